"""A step between two readings is as well known as they are close, whatever slopes say."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lightfield.arrays import Array
from lightfield.diagnosis.verdict.estimates import estimates
from lightfield.diagnosis.verdict.parts import Estimate, Reason
from lightfield.diagnosis.verdict.rest.located import located
from lightfield.fitting.least_squares import Fit, least_squares
from lightfield.fitting.parameter import FitParameter, Model

TIME = np.array([0.0, 10, 20, 30, 40, 60, 70, 80, 90, 100])
SIGMA = 0.01


class Step:
    """Light that falls at once, in nothing but a tenth of a second."""

    def predict(self, values: Mapping[str, float]) -> Array:
        fallen = (1 + np.tanh((TIME - values["time0"]) / 0.1)) / 2
        return values["gain"] * (1 + values["size"] * fallen)


def fitted(value: Array, **start: float) -> Fit:
    parameters = (
        FitParameter("gain", 0.1, 10.0, 1.0, 1e-4),
        FitParameter("size", -0.9, 0.9, start["size"], 1e-4),
        FitParameter("time0", 0.0, 100.0, start["time0"], 1e-4),
    )
    model = Model(Step(), parameters)
    return least_squares(model, value, lambda a: a / SIGMA, model.start)


def of_time(value: Array, fit: Fit, scale: float = 1.0) -> tuple[Estimate, Estimate]:
    """When, as the slopes tell it, and as it is told then."""
    told = estimates(fit, scale, {})["time0"]
    problem = SimpleNamespace(value=value, keep=np.ones(len(value)))
    return told, located(problem, fit, lambda a: a / SIGMA, scale, "time0", told)


@pytest.mark.parametrize("begin", [41.0, 47.0, 59.0])
def test_a_sudden_step_is_between_the_readings_that_differ(begin: float) -> None:
    """By the clock of the readings: after 40 and before 60 s, wherever in between a fit ends."""
    value = Step().predict({"gain": 1.0, "size": -0.2, "time0": 44.0})
    before, after = of_time(value, fitted(value, size=-0.2, time0=begin))
    assert before.reason is not None and before.stderr is None
    assert after.reason is None and after.stderr is not None
    assert after.value == pytest.approx(50.0, abs=0.5)
    assert after.stderr == pytest.approx(10.0, abs=0.5)


def test_a_step_of_no_size_may_be_anywhere() -> None:
    value = np.ones(len(TIME))
    before, after = of_time(value, fitted(value, size=0.0, time0=47.0))
    assert before.reason is not None and after == before


def test_a_small_step_is_less_well_known() -> None:
    """One that a reading of errors as large does not tell from none: the next ones are within it."""
    value = Step().predict({"gain": 1.0, "size": -0.008, "time0": 44.0})
    _, after = of_time(value, fitted(value, size=-0.008, time0=47.0))
    assert after.stderr is None or after.stderr > 15.0


def test_two_errors_hold_when_a_step_was() -> None:
    """Steps at once, in noise, for a fit of which the duration is free: where it ends at some seconds, slopes
    know the time by the one reading in the middle, and two of their errors held 74 % of 112 such steps."""
    rng, time, by_slopes = np.random.default_rng(5), 20.0 * np.arange(30), 0
    pulls, wider = [], []

    class Slow:
        def predict(self, values: Mapping[str, float]) -> Array:
            fallen = (1 + np.tanh((time - values["time0"]) / values["duration"])) / 2
            return values["gain"] * (1 + values["size"] * fallen)

    for _ in range(60):
        sigma, true = rng.choice([0.006, 0.012, 0.02], time.size), rng.uniform(100, 500)
        value = np.where(time > true, 0.9, 1.0) * (1 + sigma * rng.standard_normal(time.size))

        def whiten(a: Array, sigma: Array = sigma) -> Array:
            return a / (sigma if a.ndim == 1 else sigma[:, None])

        parameters = (
            FitParameter("gain", 0.1, 10.0, 1.0, 1e-4),
            FitParameter("size", -0.9, 0.9, -0.1, 1e-4),
            FitParameter("time0", 0.0, 580.0, true + rng.uniform(-15, 15), 1e-2),
            FitParameter("duration", 0.4, 145.0, 5.0, 1e-2),
        )
        model = Model(Slow(), parameters)
        fit = least_squares(model, value, whiten, model.start)
        told = estimates(fit, 1.0, {})["time0"]
        by_slopes += told.stderr is not None
        problem = SimpleNamespace(value=value, keep=np.ones(len(value)))
        known = located(problem, fit, whiten, 1.0, "time0", told)
        assert known.stderr is not None
        pulls.append(abs(known.value - true) / known.stderr)
        wider.append((told.stderr or 0.0) / known.stderr)
    assert by_slopes > 15
    # Where no reading lies in the middle slopes know nothing: 1144 ± 1378 s, of 1144 ± 8 s.
    assert max(wider) > 3
    assert np.mean(np.array(pulls) < 1) > 0.6
    assert np.mean(np.array(pulls) < 2) > 0.93


def test_no_place_is_asked_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where one and where two errors end is sought along the same way, a fit a place."""
    asked = list[float]()

    def counted(model: Model, *given: Any) -> Fit:
        asked.append(model.parameters[2].low)
        return least_squares(model, *given)

    value = Step().predict({"gain": 1.0, "size": -0.2, "time0": 44.0})
    fit = fitted(value, size=-0.2, time0=47.0)
    monkeypatch.setattr("lightfield.diagnosis.verdict.rest.located.least_squares", counted)
    of_time(value, fit)
    assert len(asked) == len(set(asked)) > 20


def test_what_lies_at_a_bound_stays_there() -> None:
    at_bound = Estimate(value=3.0, reason=Reason.AT_BOUNDARY)
    value = Step().predict({"gain": 1.0, "size": -0.2, "time0": 44.0})
    fit = fitted(value, size=-0.2, time0=47.0)
    problem = SimpleNamespace(value=value, keep=np.ones(len(value)))
    assert located(problem, fit, lambda a: a / SIGMA, 1.0, "time0", at_bound) is at_bound
