"""Ambient light in time: it drifts, is switched, comes for a while, or goes its own way.

Readings come from a closed form written here.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.fitting.fitted_curves import fitted_curves
from lightfield.formula.closed_form import predict
from lightfield.readings import Readings
from lightfield.scene import Scene

HWHM, PER_M, ASIDE_M, EVERY_S = 4.6, 0.095, 0.04, 25.0
BELIEVED = {"lamp": {"hwhm_deg": 5.2}, "water": {"absorption_per_m": 0.08}}


def campaign(ambient: Callable[[np.ndarray], np.ndarray], seed: int) -> Readings:
    """Four planes one after the other, a lamp that stands aside, and other light, over the brightest."""
    z, x = (v.ravel() for v in np.meshgrid([2.5, 4.0, 6.0, 8.0], np.linspace(-0.9, 0.9, 31), indexing="ij"))
    time = EVERY_S * np.arange(z.size)
    away = np.hypot(x - ASIDE_M, z)
    beam = np.exp(-np.log(2) * (np.degrees(np.arctan2(x - ASIDE_M, z)) / HWHM) ** 2)
    lit = beam * np.exp(-PER_M * away) / away**2 * z / away
    shown = lit / lit.max() + ambient(time)
    stderr = np.hypot(0.005 * shown, 6e-4)
    value = shown + stderr * np.random.default_rng(seed).standard_normal(z.size)
    return Readings.from_arrays(x_m=x, z_m=z, value=value, stderr=stderr, time_s=time)


def found(ambient: Callable[[np.ndarray], np.ndarray], seed: int) -> Diagnosis:
    table = campaign(ambient, seed)
    diagnosis = diagnose(table, Scene.from_dict(BELIEVED), diffuse=None, advise=False)
    one = diagnosis.verdict.ladder[-1].parameters["water.absorption_per_m"]
    assert one.stderr and abs(one.value - PER_M) < 3 * one.stderr < PER_M
    return diagnosis


def read(ambient: dict[str, float], time_s: list[float]) -> np.ndarray:
    """On the axis, 4 m from the lamp, over its light there."""
    at = SimpleNamespace(x_m=np.zeros(len(time_s)), y_m=0.0, z_m=4.0, time_s=np.array(time_s))
    return predict(Scene.from_dict({"detector": ambient}), at) - 1 / 16


def test_ambient_light_that_drifts_is_added_by_the_hour() -> None:
    """0.01 that doubles in an hour: at 0, 30 min and an unknown time."""
    drifting = {"background": 0.01, "background_drift_per_hour": 1.0}
    assert read(drifting, [0.0, 1800.0, np.nan]) == pytest.approx([0.01, 0.015, 0.01], rel=1e-12)


def test_ambient_light_is_switched_on_and_off_again() -> None:
    """0.01, and 0.002 more from 1000 s on: of it half at that moment, tanh(1) of the rest 10 s later."""
    switched = {"background": 0.01, "background_step": 0.002, "background_step_s": 1000.0}
    late = 0.5 * (1 + np.tanh(1.0))
    seen = read(switched, [0.0, 1000.0, 1010.0, 9000.0])
    assert seen == pytest.approx([0.01, 0.011, 0.01 + 0.002 * late, 0.012], rel=1e-9)
    seen = read({**switched, "background_step_for_s": 600.0}, [0.0, 1300.0, 1600.0, 9000.0])
    assert seen == pytest.approx([0.01, 0.012, 0.011, 0.01], rel=1e-9)
    slow = read({**switched, "background_step_over_s": 100.0}, [1100.0])
    assert slow == pytest.approx([0.01 + 0.002 * late], rel=1e-9)


def test_ambient_light_has_a_course_of_its_own() -> None:
    course = {"background": 0.01, "background_course": [[0.0, 0.0], [1000.0, 0.002], [2000.0, -0.004]]}
    seen = read(course, [0.0, 500.0, 1000.0, 1500.0, 4000.0])
    assert seen == pytest.approx([0.01, 0.011, 0.012, 0.009, 0.006], rel=1e-9)


def test_ambient_light_that_drifts_is_a_form_of_the_background() -> None:
    drifting = {"detector.background": 0.004, "detector.background_drift_per_hour": 3.0}
    for hidden in (drifting, {"detector.background": 0.006}):
        table, scene = readings(hidden, seed=2)
        verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
        assert (verdict.verdict, verdict.effects) == ("identified", ["background"])
        parameters = verdict.explanations[0].parameters
        assert parameters.keys() & drifting.keys() == hidden.keys()
        for path, value in hidden.items():
            assert abs(parameters[path].value - value) < 4 * parameters[path].stderr


@pytest.mark.parametrize(("step", "begins_s", "lasts_s"), [(-0.015, 1700.0, 0.0), (0.012, 1010.0, 900.0)])
def test_a_light_that_is_switched_is_told_with_its_moment(
    step: float, begins_s: float, lasts_s: float
) -> None:
    """It was anywhere between two readings."""
    ends_s = begins_s + (lasts_s or np.inf)

    def ambient(time_s: np.ndarray) -> np.ndarray:
        return 0.01 + step * ((time_s > begins_s) & (time_s < ends_s))

    verdict = found(ambient, 1).verdict
    assert verdict.verdict == "identified" and verdict.certain == ["beam_offset", "background"]
    fitted = verdict.ladder[-1].parameters
    true = {"": step, "_s": begins_s} | ({"_for_s": lasts_s} if lasts_s else {})
    for end, value in true.items():
        one = fitted[f"detector.background_step{end}"]
        assert one.stderr and abs(one.value - value) < 3 * one.stderr, end
    assert fitted["detector.background_step"].stderr < 0.1 * abs(step)
    moment = fitted["detector.background_step_s"].stderr
    assert EVERY_S / np.sqrt(12) < moment < 2 * EVERY_S
    sudden = fitted["detector.background_step_over_s"]
    assert sudden.stderr is None and sudden.reason == "as sudden as these readings tell"


def test_a_light_that_takes_minutes_to_come_is_as_slow_as_that() -> None:
    """A logistic of 90 s, which is a tanh of 180 s."""
    fitted = found(lambda t: 0.015 / (1 + np.exp(-(t - 1700) / 90)), 2).verdict.ladder[-1].parameters
    over = fitted["detector.background_step_over_s"]
    assert over.stderr and abs(over.value - 180.0) < 3 * over.stderr < 100.0


def test_light_that_comes_and_goes_is_a_curve_in_time() -> None:
    """The sun between clouds, faster than three or six functions follow."""

    def ambient(time_s: np.ndarray) -> np.ndarray:
        return 0.01 * (1.5 + np.sin(time_s / 500.0) + 0.5 * np.sin(time_s / 160.0 + 1.0))

    diagnosis = found(ambient, 3)
    verdict = diagnosis.verdict
    assert {*verdict.best_set} == {"beam_offset", "background_curve"} == {*verdict.certain}
    last, scale = diagnosis.steps[-1].fit, diagnosis.finding.level.phi
    (curve,) = fitted_curves(diagnosis.forward, last, scale, diagnosis.widest)
    true = ambient(curve.at)
    inside = slice(10, -10)
    assert np.sqrt(np.mean(((curve.value - true) / curve.stderr)[inside] ** 2)) < 1.6
    assert np.mean(curve.stderr[inside]) < 0.1 * np.ptp(true)
    assert curve.without.shape == curve.at.shape
