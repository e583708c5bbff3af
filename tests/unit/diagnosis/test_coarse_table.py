"""A lamp's table in coarse steps: a smooth beam between them is no missing effect."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings

HWHM_DEG, NOISE = 6.0, 0.004


def read(offset_m: float, drift_per_hour: float, seed: int = 3) -> Readings:
    """By formulas of their own: a Gaussian of 6 degrees in water of 0.1 per m, five planes, at random."""
    rng = np.random.default_rng(seed)
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.8, 0.8, 21), np.linspace(2.5, 7.5, 5)))
    order = rng.permutation(len(x))
    x, z = x[order], z[order]
    time_s = 20.0 * np.arange(len(x))
    far = np.hypot(x - offset_m, z)
    away = np.degrees(np.arccos(z / far)) / HWHM_DEG
    light = 2.0 ** -(away**2) * np.exp(-0.1 * far) * z / far**3 * (1 + drift_per_hour * time_s / 3600)
    sigma = np.hypot(NOISE * light, 3e-4 * light.max())
    value = light + sigma * rng.standard_normal(len(x))
    return Readings.from_arrays(x_m=x, y_m=0 * x, z_m=z, value=value, stderr=sigma, time_s=time_s)


@pytest.mark.parametrize("step_deg", [0.25, 1.5, 2.5])
@pytest.mark.parametrize(
    ("hidden", "sizes"), [([], (0.0, 0.0)), (["beam_offset", "lamp_drift"], (0.03, -0.1))]
)
def test_only_what_is_missing_is_found(
    tmp_path: Path, step_deg: float, hidden: list[str], sizes: tuple[float, float]
) -> None:
    angle = np.arange(0.0, 45.1, step_deg)
    rows = (f"{a:g},{2.0 ** -((a / HWHM_DEG) ** 2):.8g}" for a in angle)
    (tmp_path / "lamp.csv").write_text("\n".join(["angle_deg,intensity", *rows]), encoding="utf-8")
    lamp = {"profile": "table", "intensity_table": str(tmp_path / "lamp.csv")}
    scene = Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 0.12}})
    verdict = diagnose(read(*sizes), scene, diffuse=None, advise=False).verdict
    assert sorted(verdict.best_set) == hidden
    assert verdict.verdict == ("identified" if hidden else "none")
    assert not [c for c in verdict.cautions if c.warns is Warns.COARSE_TABLE]


def test_a_steep_edge_between_two_angles_is_told(tmp_path: Path) -> None:
    """The table does not say where it is: a beam that falls within a degree, in steps of two. Of one plane:
    the note asks where readings lie, and in more planes many effects are tried against what is amiss."""
    angle = np.arange(0.0, 45.1, 2.0)
    rows = (f"{a:g},{1 / (1 + math.exp((a - 7.4) / 0.3)):.8g}" for a in angle)
    (tmp_path / "lamp.csv").write_text("\n".join(["angle_deg,intensity", *rows]), encoding="utf-8")
    lamp = {"profile": "table", "intensity_table": str(tmp_path / "lamp.csv")}
    scene = Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 0.12}})
    table = read(0.0, 0.0)
    (told,) = (n for n in fit_readings(table.subset(table.z_m == 5.0), scene).notes if "table has steps" in n)
    assert "steps of 2 degrees" in told
