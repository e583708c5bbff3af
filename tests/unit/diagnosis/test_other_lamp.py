"""A lamp's table that is not the lamp's: readings of a Gaussian beam, whose scene states steeper flanks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene

WIDTH_DEG, ABSORPTION, OFFSET_M = 5.2, 0.1, 0.02
ONLY = ["background", "beam_profile", "water_gradient", "beam_offset", "spectral_hardening", "acceptance"]
TRUE = {"lamp": {"hwhm_deg": WIDTH_DEG, "offset_x_m": OFFSET_M}, "water": {"absorption_per_m": ABSORPTION}}


def found(exponent: float, folder: Path, seed: int) -> Diagnosis:
    """Beside a table of exp(-ln2 (theta / 5 deg)^exponent)."""
    theta = np.arange(0.0, 20.1, 0.25)
    rows = "\n".join(
        f"{t:.2f},{v:.6g}" for t, v in zip(theta, 0.5 ** ((theta / 5.0) ** exponent), strict=True)
    )
    (folder / "lamp.csv").write_text(f"angle_deg,intensity\n{rows}\n", encoding="utf-8")
    lamp = {"profile": "table", "intensity_table": str(folder / "lamp.csv")}
    believed = Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 0.12}})
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.9, 0.9, 21), [3.0, 4.0, 5.0, 6.0, 7.0]))
    light = direct_field(Scene.from_dict(TRUE), x, 0 * x, z)
    error, rng = np.hypot(0.004 * light, 3e-4 * light.max()), np.random.default_rng(seed)
    table = Readings.from_arrays(
        x_m=x, z_m=z, value=light + error * rng.standard_normal(x.size), stderr=error,
        time_s=20.0 * rng.permutation(x.size), plane_gain_percent=0.0, position_mm=0.0, quantity="irradiance",
    )  # fmt: skip
    return diagnose(table, believed, diffuse=None, only=ONLY, advise=False)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_plain_beam_in_its_place_leaves_what_is_there(seed: int, tmp_path: Path) -> None:
    """Beside a curve in the table's place, gradients and backgrounds stood in for what no curve follows."""
    one = found(6.0, tmp_path, seed)
    assert one.verdict.best_set == one.verdict.certain == ["beam_offset"]
    told = one.verdict.explanations[0].parameters
    for path, true in (
        ("lamp.hwhm_deg", WIDTH_DEG),
        ("lamp.offset_x_m", OFFSET_M),
        ("water.absorption_per_m", ABSORPTION),
    ):
        assert told[path].value == pytest.approx(true, abs=4 * (told[path].stderr or 0.0)), path
    assert one.verdict.headline.startswith("The beam of your scene's table is not in the readings")
    assert "lamp's table" in one.verdict.check_first[0]


@pytest.mark.parametrize("exponent", [2.2, 4.0])
def test_where_the_curve_alone_makes_the_difference_it_is_the_answer(exponent: float, tmp_path: Path) -> None:
    one = found(exponent, tmp_path, 0)
    assert sorted(one.verdict.best_set) == ["beam_offset", "beam_profile"]
    assert "scene's table" not in one.verdict.headline
