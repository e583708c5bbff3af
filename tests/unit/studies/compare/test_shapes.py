"""What has a place and a width is found by a fit, wherever it is."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.ledger import entries
from lightfield.report.compare.readings_page import readings_page
from lightfield.scene import Scene
from lightfield.studies.compare.readings import FitReport, fit_readings
from lightfield.studies.compare.text import as_text

DEPTH, PLACE_M, WIDTH_M = "effect.rope.depth", "effect.rope.x0", "effect.rope.width"


def rope(least: float) -> dict:
    """An effect whose depth may be as little as this."""
    return {
        "name": "rope",
        "family": "obstruction",
        "stage": "path",
        "formula": "1 - depth*exp(-((x - x0)/width)**2)",
        "parameters": {
            "depth": {"range": [least, 0.9], "neutral": 0.0, "typical": 0.05},
            "x0": {"unit": "m", "range": [-0.5, 0.5]},
            "width": {"unit": "m", "range": [0.02, 0.3]},
        },
    }


@cache
def fitted(depth: float, place_m: float, least: float, *names: str) -> FitReport:
    table, believed = readings(
        seed=7, layout="fine", factor=lambda t: 1 - depth * np.exp(-(((t.x_m - place_m) / 0.15) ** 2))
    )
    scene = Scene.from_dict({**believed.to_dict(), "effect": [rope(least)]})
    return fit_readings(table, scene, names, diffuse=None)


@pytest.mark.parametrize(
    ("depth", "place_m", "least"), [(0.2, 0.15, -0.9), (-0.2, 0.15, -0.9), (0.09, -0.3, 0.0), (0.1, 0.4, 0.0)]
)
@pytest.mark.parametrize("names", [("rope",), ("rope", "background")], ids="+".join)
def test_it_is_found_at_any_place_and_of_either_sign(
    depth: float, place_m: float, least: float, names: tuple[str, ...]
) -> None:
    report = fitted(depth, place_m, least, *names)
    assert report.statistics.chi2_per_dof < 1.3
    assert f"(base by the same noise: {report.statistics.base_chi2_per_dof:.4g})" in as_text(report)
    told = re.findall(r"= -?\d+\.(\d+)(?: \S+)? ± \d+\.(\d+) ", as_text(report))
    assert len(told) >= 3 and all(len(value) == len(error) for value, error in told)
    for path, true in ((DEPTH, depth), (PLACE_M, place_m), (WIDTH_M, 0.15)):
        found = report.estimates[path]
        assert abs(found.value - true) < 4 * found.stderr, path


@pytest.mark.usefixtures("undrawn")
def test_a_rung_is_held_against_the_base_model_by_the_same_noise(tmp_path: Path) -> None:
    """Each fit judges the noise anew, so that the base model alone may have the lower chi-square."""
    base, better = (fitted(0.2, 0.15, -0.9, *names) for names in ((), ("rope",)))
    for one in (base, better):
        one.save(tmp_path)
    first, second = entries(tmp_path)
    assert first["base_chi2_per_dof"] == pytest.approx(first["chi2_per_dof"])
    assert second["base_chi2_per_dof"] > 5 * second["chi2_per_dof"]
    below = replace(better.statistics, error_percent=1.0, noise_floor_percent=1.1)
    told = [{**first, "error_percent": 0.9}, {**second, "error_percent": 1.0}]
    page = readings_page(replace(better, statistics=below), told, "ladder")
    assert "of the base model by the same noise" in page and "The lowest error so far" not in page
    above = replace(below, noise_floor_percent=0.5)
    assert "The lowest error so far" in readings_page(replace(better, statistics=above), told, "ladder")
