"""What has a place and a width is found by a fit, wherever it is."""

from __future__ import annotations

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.scene import Scene
from lightfield.studies.compare.readings import FitReport, fit_readings

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
    for path, true in ((DEPTH, depth), (PLACE_M, place_m), (WIDTH_M, 0.15)):
        found = report.estimates[path]
        assert abs(found.value - true) < 4 * found.stderr, path
