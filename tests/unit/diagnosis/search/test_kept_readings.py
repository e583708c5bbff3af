"""Readings that are set aside, where planes change from one reading to the next."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.scene import Scene

SCENE = {"lamp": {"hwhm_deg": 10.0}, "water": {"absorption_per_m": 0.12}}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_slip_in_a_stay_of_two_readings_is_seen(seed: int) -> None:
    """One in five readings shares its stay with the one before it, and a gain of 0.2 % is stated: no stay's
    gain may stand for a slip of 16 errors."""
    rng = np.random.default_rng(seed)
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-1, 1, 23), [2.0, 3.0, 4.5, 6.0, 7.5]))
    order = rng.permutation(len(x))
    x, z = x[order], z[order]
    far, across = np.hypot(x, z), np.degrees(np.arctan2(np.abs(x), z)) / 10
    value = np.exp(-np.log(2) * across**2 - 0.12 * far) * z / far**3
    value = value / value.max()
    sigma = np.hypot(0.006 * value, 3e-4)
    read = value + sigma * rng.standard_normal(len(x))
    pairs = np.flatnonzero((np.diff(z) == 0) & (value[1:] > 0.1)) + 1
    slip = int(rng.choice(pairs))
    read[slip] -= 16 * sigma[slip]
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=read, stderr=sigma, time_s=20.0 * np.arange(len(x)), scale="relative",
        plane_gain_percent=0.2, position_mm=0.0,
    )  # fmt: skip
    verdict = diagnose(table, Scene.from_dict(SCENE), diffuse=None, advise=False).verdict
    assert verdict.outliers == [slip]
    assert verdict.verdict == "none"
