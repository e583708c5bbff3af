"""Beside a lamp whose width may be without end no effect of directions is certain."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from toy_problem import Linear

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.search.pool.evidence import width_reaches_its_end
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet
from lightfield.fitting.least_squares import least_squares
from lightfield.fitting.parameter import FitParameter, Model
from lightfield.readings import Readings
from lightfield.scene import Scene

TILT_DEG, HWHM_DEG = 9.0, 22.0


def read() -> Readings:
    """By formulas of their own: a lamp of 22 degrees, tilted by 9, that grows by a fifth in an hour."""
    rng = np.random.default_rng(5)
    places = []
    for z in (1.0, 1.6, 2.4, 3.5, 5.0):
        places += [(z * np.tan(np.radians(7.0 * k)), 0.0, z) for k in range(-5, 6)]
        places += [(0.0, z * np.tan(np.radians(7.0 * k)), z) for k in (-4, -2, 2, 4)]
    x, y, z = np.array(places)[rng.permutation(len(places))].T
    hour = np.arange(len(x)) / 120
    r = np.sqrt(x**2 + y**2 + z**2)
    tilt = np.radians(TILT_DEG)
    angle = np.degrees(np.arccos((x * np.sin(tilt) + z * np.cos(tilt)) / r))
    value = np.exp(-np.log(2) * (angle / HWHM_DEG) ** 2) * z / r**3 * np.exp(-0.09 * r) * (1 + 0.2 * hour)
    value /= value.max()
    sigma = np.hypot(0.005 * value, 5e-4)
    value = value + sigma * rng.standard_normal(len(value))
    return Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=value, stderr=sigma, time_s=3600 * hour,
        plane_gain_percent=0.0, position_mm=0.0,
    )  # fmt: skip


@pytest.mark.parametrize(("sigma", "reaches"), [(10.0, True), (1.0, False)])
def test_whether_a_width_may_be_without_end(sigma: float, reaches: bool) -> None:
    """75 degrees of 80 at most, read directly with such an error."""
    forward = Linear({"lamp.hwhm_deg": np.ones(4)})
    width = FitParameter("lamp.hwhm_deg", 1.0, 80.0, 60.0, 1e-3)
    readings = np.full(4, 75.0)
    fit = least_squares(Model(forward, (width,)), readings, lambda r: r / (2 * sigma), [60.0], np.ones(4))
    pool = SimpleNamespace(ground=SimpleNamespace(phi=1.0))
    assert width_reaches_its_end(pool, FittedSet((), fit)) == reaches


def test_beside_a_curve_that_makes_up_for_it_a_width_is_as_known_as_with_the_curve_as_it_is() -> None:
    """Two columns that are alike to 1 %: an error of 1 degree with the other held, of 100 without."""
    along = np.array([1.0, 1.0, 1.0, 1.0])
    forward = Linear({"lamp.hwhm_deg": along, "curve": along + 0.01 * np.array([1.0, -1.0, 1.0, -1.0])})
    width = FitParameter("lamp.hwhm_deg", 1.0, 80.0, 60.0, 1e-3)
    curve = FitParameter("curve", -200.0, 200.0, 1.0, 1e-3)
    readings = 75.0 * along
    fit = least_squares(Model(forward, (width, curve)), readings, lambda r: r / 2, [74.0, 1.0], np.ones(4))
    errors = [np.sqrt(fit.covariance(held=held)[0, 0]) for held in ((), ("curve",))]
    np.testing.assert_allclose(errors, [100.0, 1.0], rtol=0.01)
    pool, node = SimpleNamespace(ground=SimpleNamespace(phi=1.0)), FittedSet((), fit)
    assert width_reaches_its_end(pool, node) and not width_reaches_its_end(pool, node, {"curve"})


@pytest.mark.parametrize(("name", "unknown"), [("beam_profile", False), ("background", True)])
def test_a_curve_is_determined_where_any_of_its_amplitudes_is(name: str, unknown: bool) -> None:
    """The width makes up for the first of two."""
    along, across = np.array([1.0, 1.0, 1.0, 1.0]), np.array([1.0, 1.0, -1.0, -1.0])
    alike = along + 0.01 * np.array([1.0, -1.0, 1.0, -1.0])
    forward = Linear({"lamp.hwhm_deg": along, "first": alike, "second": across})
    width = FitParameter("lamp.hwhm_deg", 1.0, 800.0, 60.0, 1e-3)
    both = tuple(FitParameter(path, -20.0, 20.0, 1.0, 1e-3) for path in ("first", "second"))
    model = Model(forward, (width, *both))
    fit = least_squares(model, 75.0 * along, lambda r: r / 2, [74.0, 1.0, 0.0], np.ones(4))
    candidate = SimpleNamespace(name=name, amplitudes=both, parameters=both)
    assert ScoredSet((candidate,), fit, 0.0).undetermined == unknown  # type: ignore[arg-type]  # stands in


def test_a_tilt_of_nine_degrees_is_found() -> None:
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 26.0}, "water": {"absorption_per_m": 0.11}})
    verdict = diagnose(read(), scene, diffuse=None, advise=False).verdict
    assert sorted(verdict.best_set) == ["beam_tilt", "lamp_drift"] and verdict.verdict == "identified"
    tilt = verdict.ladder[-1].parameters["lamp.tilt_x_deg"]
    assert abs(tilt.value - TILT_DEG) < 3 * tilt.stderr
