"""Readings that share the gain of their stay, as stated, scatter as stated, whatever is asked for."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.readings import Readings
from lightfield.scene import Scene

GAIN, OWN = 0.01, 0.002


def read(seed: int) -> Readings:
    """By formulas of their own: five planes of 13 readings, each plane with a gain of its own of 1 %."""
    rng = np.random.default_rng(seed)
    x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(-0.12, 0.12, 13), np.linspace(2, 6, 5)))
    r = np.hypot(x, z)
    value = np.exp(-np.log(2) * (np.degrees(np.arctan2(x, z)) / 7) ** 2) * z / r**3 * np.exp(-0.12 * r)
    value = value / value.max() * np.repeat(1 + GAIN * rng.standard_normal(5), 13)
    sigma = OWN * value
    value = value + sigma * rng.standard_normal(len(value))
    return Readings.from_arrays(
        x_m=x, y_m=np.zeros(65), z_m=z, value=value, stderr=sigma, time_s=30.0 * np.arange(65),
        plane_gain_percent=100 * GAIN, position_mm=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_gains_of_stays_are_no_scatter_of_readings(seed: int) -> None:
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 8.0}, "water": {"absorption_per_m": 0.13}})
    verdict = diagnose(
        read(seed), scene, diffuse=None, only=["beam_tilt", "background", "beam_offset"], advise=False
    ).verdict
    assert verdict.verdict == "none"
    warned = {caution.warns for caution in verdict.cautions}
    assert warned.isdisjoint({Warns.SCATTER_MORE, Warns.ERRORS_DOUBTED})
