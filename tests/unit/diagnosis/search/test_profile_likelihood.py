"""Errors of shapes: what a second minimum, or a bent one, adds to the curvature at the best fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search.profile_likelihood import profiled, restarted
from lightfield.fitting.parameter import FitParameter

SIGMA = 0.05
OMEGA = 1.0


class Wave:
    """A sin^2 of unknown frequency and depth: read at whole numbers, w and pi - w are the same."""

    def __init__(self, x: np.ndarray) -> None:
        self.x, self.size = x, len(x)

    def predict(self, values: dict[str, float]) -> np.ndarray:
        return values["base"] + values["depth"] * np.sin(values["omega"] * self.x) ** 2


def problem(x: np.ndarray, seed: int = 0) -> tuple[Problem, Any]:
    forward = Wave(x)
    noise = SIGMA * np.random.default_rng(seed).standard_normal(len(x))
    value = forward.predict({"base": 1.0, "depth": 0.5, "omega": OMEGA}) + noise
    depth = FitParameter("depth", 0.0, 2.0, 0.0, 1e-4)
    omega = FitParameter("omega", 0.5, np.pi - 0.5, 2.0, 1e-4)
    wave = SimpleNamespace(
        amplitudes=(depth,), shapes=(omega,), parameters=(depth, omega), grid=((0.8,), (1.3,), (2.0,)),
        effect=SimpleNamespace(instead_of=()),
    )  # fmt: skip
    base = (FitParameter("base", 0.0, 3.0, 1.0, 1e-4),)
    return Problem(cast(Any, forward), cast(Any, None), value, np.ones(len(x)), base, (wave,)), wave


def whiten(columns: np.ndarray) -> np.ndarray:
    return columns / SIGMA


def test_the_error_reaches_to_an_equal_minimum() -> None:
    made, wave = problem(np.repeat(np.arange(4.0), 10))
    fit = made.fit((wave,), whiten, [np.array([1.0, 0.4, OMEGA])])
    found, errors = profiled(made, (wave,), fit, whiten, 1.0)
    apart = np.pi - 2 * OMEGA
    assert fit.stderr()["omega"] < 0.05
    assert errors["omega"] == pytest.approx(apart, rel=0.05)
    assert found.chi2 <= fit.chi2


def test_one_sharp_minimum_keeps_its_error() -> None:
    """Where the model is nearly linear over its errors, the profile says what the curvature says."""
    made, wave = problem(np.linspace(0, 3, 40))
    fit = made.fit((wave,), whiten, [np.array([1.0, 0.4, OMEGA])])
    _, errors = profiled(made, (wave,), fit, whiten, 1.0)
    for path in ("omega", "depth"):
        assert errors[path] < 1.15 * fit.stderr()[path]
    assert errors["omega"] > 0.85 * fit.stderr()["omega"]


def test_a_worse_minimum_is_left() -> None:
    """From a frequency in another valley the fit gets stuck; begun again at the grid it does not."""
    made, wave = problem(np.linspace(0, 20, 60))
    stuck = made.fit((wave,), whiten, [np.array([1.0, 0.4, 2.0])])
    assert stuck.values["omega"] == pytest.approx(2.0, abs=0.4)
    assert restarted(made, (wave,), stuck, whiten).values["omega"] != pytest.approx(2.0, abs=0.4)
    found, _ = profiled(made, (wave,), stuck, whiten, 1.0)
    assert found.values["omega"] == pytest.approx(OMEGA, abs=0.02)
