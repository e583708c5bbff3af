"""Beside water that would absorb nothing, though its scene's does, no effect is certain."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.scene import Scene

ASIDE_M, HWHM_DEG = 0.03, 6.0


def read(per_m: float) -> Readings:
    """By formulas of their own: a lamp 3 cm aside, in water of such an attenuation."""
    rng = np.random.default_rng(3)
    places = [(x, 0.0, z) for z in (2.0, 3.0, 4.0, 5.0, 6.0) for x in np.linspace(-0.8, 0.8, 17)]
    x, y, z = np.array(places)[rng.permutation(len(places))].T
    across, far = np.abs(x - ASIDE_M), np.hypot(x - ASIDE_M, z)
    beam = np.exp(-np.log(2) * (np.degrees(np.arctan2(across, z)) / HWHM_DEG) ** 2)
    value = beam * z / far**3 * np.exp(-per_m * far)
    value /= value.max()
    sigma = np.hypot(0.004 * value, 2e-4)
    return Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=value + sigma * rng.standard_normal(len(x)), stderr=sigma,
        time_s=20.0 * np.arange(len(x)), plane_gain_percent=0.0, position_mm=0.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("per_m", "stated_per_m", "certain"),
    [
        pytest.param(0.08, 0.1, ["beam_offset"], id="water"),
        pytest.param(0.0, 0.1, [], id="none, where the scene has some"),
        pytest.param(0.0, 0.001, ["beam_offset"], id="as clear as the readings can tell"),
    ],
)  # fmt: skip
def test_beside_no_water_nothing_is_certain(per_m: float, stated_per_m: float, certain: list[str]) -> None:
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 7.0}, "water": {"absorption_per_m": stated_per_m}})
    verdict = diagnose(read(per_m), scene, diffuse=None, advise=False).verdict
    assert verdict.best_set == ["beam_offset"] and sorted(verdict.certain) == certain
