"""Errors of shapes: what a second minimum, or a bent one, adds to the curvature at the best fit."""

from __future__ import annotations

import numpy as np
import pytest
from wave_problem import OMEGA, SIGMA, wave_problem

from lightfield.diagnosis.search.profile_likelihood import profiled, restarted


def whiten(columns: np.ndarray) -> np.ndarray:
    return columns / SIGMA


def test_the_error_reaches_to_an_equal_minimum() -> None:
    made, wave = wave_problem(np.repeat(np.arange(4.0), 10))
    fit = made.fit((wave,), whiten, [np.array([1.0, 0.4, OMEGA])])
    found, errors = profiled(made, (wave,), fit, whiten, 1.0)
    apart = np.pi - 2 * OMEGA
    assert fit.stderr()["omega"] < 0.05
    assert errors["omega"] == pytest.approx(apart, rel=0.05)
    assert found.chi2 <= fit.chi2


def test_one_sharp_minimum_keeps_its_error() -> None:
    """Where the model is nearly linear over its errors, the profile says what the curvature says."""
    made, wave = wave_problem(np.linspace(0, 3, 40))
    fit = made.fit((wave,), whiten, [np.array([1.0, 0.4, OMEGA])])
    _, errors = profiled(made, (wave,), fit, whiten, 1.0)
    for path in ("omega", "depth"):
        assert errors[path] < 1.15 * fit.stderr()[path]
    assert errors["omega"] > 0.85 * fit.stderr()["omega"]


def test_a_worse_minimum_is_left() -> None:
    """From a frequency in another valley the fit gets stuck; begun again at the grid it does not."""
    made, wave = wave_problem(np.linspace(0, 20, 60))
    stuck = made.fit((wave,), whiten, [np.array([1.0, 0.4, 2.0])])
    assert stuck.values["omega"] == pytest.approx(2.0, abs=0.4)
    assert restarted(made, (wave,), stuck, whiten).values["omega"] != pytest.approx(2.0, abs=0.4)
    found, _ = profiled(made, (wave,), stuck, whiten, 1.0)
    assert found.values["omega"] == pytest.approx(OMEGA, abs=0.02)
