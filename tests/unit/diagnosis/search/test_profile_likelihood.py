"""Errors of shapes: what a second minimum, or a bent one, adds to the curvature at the best fit."""

from __future__ import annotations

import numpy as np
import pytest
from wave_problem import OMEGA, SIGMA, wave_problem

from lightfield.diagnosis.search.profile_likelihood import profiled, restarted
from lightfield.fitting.least_squares import least_squares
from lightfield.fitting.parameter import Model


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


@pytest.mark.parametrize("far", [1.0, 1.2])
def test_where_two_make_up_for_each_other_the_error_is_that_of_a_fine_profile(far: float) -> None:
    """Of a wave that is read over a part of its first rise depth and frequency are hardly told apart, and
    chi-square is no parabola. Of four points along it the error of the depth was 0.65 and 0.72 of this."""
    made, wave = wave_problem(np.linspace(0, far, 40))
    found, errors = profiled(
        made, (wave,), made.fit((wave,), whiten, [np.array([1.0, 0.4, OMEGA])]), whiten, 1.0
    )
    i = found.paths.index("omega")
    reach = dict.fromkeys(("omega", "depth"), 0.0)
    for value in np.linspace(0.5, np.pi - 0.5, 300):
        held = found.model.parameters[i].held(float(value))
        parameters = (*found.model.parameters[:i], held, *found.model.parameters[i + 1 :])
        there = least_squares(Model(made.forward, parameters), made.value, whiten, found.u, made.keep)
        worse = there.chi2 - found.chi2
        for path in reach if worse <= 4.0 else ():
            aside = abs(there.values[path] - found.values[path]) / (1.0 if worse <= 1.0 else 2.0)
            reach[path] = max(reach[path], aside)
    assert [errors[path] for path in reach] == pytest.approx(list(reach.values()), rel=0.1)


def test_a_worse_minimum_is_left() -> None:
    """From a frequency in another valley the fit gets stuck; begun again at the grid it does not."""
    made, wave = wave_problem(np.linspace(0, 20, 60))
    stuck = made.fit((wave,), whiten, [np.array([1.0, 0.4, 2.0])])
    assert stuck.values["omega"] == pytest.approx(2.0, abs=0.4)
    assert restarted(made, (wave,), stuck, whiten).values["omega"] != pytest.approx(2.0, abs=0.4)
    found, _ = profiled(made, (wave,), stuck, whiten, 1.0)
    assert found.values["omega"] == pytest.approx(OMEGA, abs=0.02)
