"""Gains of planes may have a slope over the distance, which the absorption takes: its error knows it."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.scene import Scene

PLANES_M, GAINS, TRUE_PER_M, ERROR = np.arange(2.0, 6.5), 0.03, 0.12, 0.005
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 8.8}, "water": {"absorption_per_m": 0.1},
        "detector": {"planes_m": PLANES_M.tolist()},
    }
)  # fmt: skip


def absorption(seed: int, unit: float = 1.0, background: float | None = None) -> tuple[float, float] | None:
    """Found and its error, of a lamp of 8 degrees whose planes were each read by a gain of their own; None
    where the gains happen to be a line and no more.

    Parameters
    ----------
    unit : float
        Factor on all readings.
    background : float, optional
        Over the brightest reading; it is asked about as well, and an error of the dark is stated.
    """
    rng = np.random.default_rng(seed)
    plane, x = (a.ravel() for a in np.meshgrid(np.arange(5), np.linspace(-0.6, 0.6, 13), indexing="ij"))
    z = PLANES_M[plane]
    r = np.hypot(x, z)
    beam = np.exp2(-((np.degrees(np.arctan2(np.abs(x), z)) / 8) ** 2))
    value = beam * z / r**3 * np.exp(-TRUE_PER_M * r) * np.exp(GAINS * rng.standard_normal(5))[plane]
    stderr = ERROR * value
    if background is not None:
        value = value + background * value.max()
        stderr = np.hypot(ERROR * value, 3e-4 * value.max())
    value = value + stderr * rng.standard_normal(len(x))
    table = Readings.from_arrays(x_m=x, y_m=0 * x, z_m=z, value=unit * value, stderr=unit * stderr)
    asked = ["plane_gain", *([] if background is None else ["background"])]
    verdict = diagnose(table, SCENE, diffuse=None, only=asked, advise=False).verdict
    if "plane_gain" not in verdict.best_set:
        return None
    found = verdict.ladder[-1].parameters["water.absorption_per_m"]
    return found.value, found.stderr


def test_a_slope_of_the_gains_is_in_the_error_of_the_absorption() -> None:
    """Gains of 3 % on five planes a metre apart move it by 0.03 / sqrt(10) per m: the readings alone, which
    follow every other gain, would tell it to 0.0005."""
    found, error = np.array([one for one in map(absorption, range(10)) if one]).T
    assert len(found) >= 7
    by_slope = GAINS / np.sqrt(((PLANES_M - PLANES_M.mean()) ** 2).sum())
    assert 0.5 * by_slope < np.median(error) < 2.5 * by_slope
    assert np.abs(found - TRUE_PER_M).max() > by_slope
    assert (np.abs(found - TRUE_PER_M) < 3 * error).all()


def test_it_is_there_in_any_unit() -> None:
    """Of readings in W, beside a background in W, the error of the absorption per metre is what it was."""
    found, error = absorption(1, background=0.02) or (0.0, 0.0)
    for unit in (1e-6, 1e-12):
        assert absorption(1, unit, 0.02) == pytest.approx((found, error), rel=1e-3)
    assert error > 0.5 * GAINS / np.sqrt(((PLANES_M - PLANES_M.mean()) ** 2).sum())


def test_gains_that_rest_on_single_readings_are_not_certain() -> None:
    """An axis read once at every distance, and crosses at three: a bubble before one reading on the axis, in
    water of a gradient, made gains of planes of 42 sigma, certain."""
    rng = np.random.default_rng(5)
    axis = [(0.0, z) for z in np.arange(1.0, 6.75, 0.5)]
    rows = [(x, z) for z in (1.0, 3.0, 5.0) for x in np.linspace(-0.6, 0.6, 17) if x]
    x, z = np.array(axis + rows).T
    r = np.hypot(x, z)
    beam = np.exp2(-((np.degrees(np.arctan2(np.abs(x), z)) / 5) ** 2))
    value = beam * z / r**3 * np.exp(-(TRUE_PER_M + 0.01 * (z / 2 - 3.5)) * r)
    stderr = np.hypot(ERROR * value, 3e-4 * value.max())
    value = value * np.where((x == 0) & (z == 1.5), 0.7, 1.0) + stderr * rng.standard_normal(len(x))
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value, stderr=stderr, time_s=15.0 * np.arange(len(x)),
        plane_gain_percent=0.3, position_mm=0.0,
    )  # fmt: skip
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 5.5}, "water": {"absorption_per_m": 0.1}})
    verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
    assert "plane_gain" in verdict.best_set
    assert "plane_gain" not in [*verdict.certain, *verdict.simplest]
