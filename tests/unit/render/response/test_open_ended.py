"""Rows of a tally that hold every number of scatterings from some on: right in far cells and near ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import gammainc, gammaln

from lightfield.arrays import Array
from lightfield.render.response.open_ended import Lengths
from lightfield.render.response.response import Reference, TransportResponse, Waters

STRAIGHT = np.array([[[1.5, 1.7, 2.5]], [[3.5, 3.6, 9.0]]])  # m
EXCESS = np.array([0.0, 0.3, 2.0])  # m
A_0, B_0, LAST = 0.1, 2.0, 3


def poisson(n: int, mean: Array) -> Array:
    """Part of the paths of a length with n scatterings, or with as many and more of the last."""
    if n == LAST:
        return np.asarray(gammainc(n, mean))
    return np.asarray(np.exp(n * np.log(mean) - mean - gammaln(n + 1)))


def response() -> TransportResponse:
    """Light whose scatterings are Poisson's, by the length of its path, as a trace tallies it."""
    length = EXCESS[:, None] + STRAIGHT.ravel()
    rows = [(n, e) for n in range(1, LAST + 1) for e in range(len(EXCESS))]
    tally = np.stack([np.exp(-A_0 * length[e]) * poisson(n, B_0 * length[e]) for n, e in rows])
    histories = np.array([[n, 0, 0] for n, _ in rows])
    excess = EXCESS[[e for _, e in rows]]
    return TransportResponse(
        np.stack([tally, tally]), histories, excess, STRAIGHT, Reference(A_0, B_0, 0.0), 1
    )


@pytest.mark.parametrize("b", [0.1, 0.8, 1.4, 2.0, 2.6])
def test_light_of_open_ended_rows_in_other_water(b: float) -> None:
    """All that was scattered is e^{-a l} (1 - e^{-b l}), summed over the paths, in every cell: here from 1.5
    to 9 m away. With one length for all cells that of the farthest was ten times too bright at b = 0.8."""
    a = 0.25
    length = EXCESS[:, None] + STRAIGHT.ravel()
    expected = (np.exp(-a * length) * -np.expm1(-b * length)).sum(axis=0)
    one = response()
    found = one.evaluate(a, b)[0]
    np.testing.assert_allclose(found.ravel(), expected, rtol=3e-3)
    along = np.exp(-(a + b - A_0 - B_0) * STRAIGHT.ravel())
    water = Waters(*(np.array([v]) for v in (a, b, 0.0, 0.0)))
    np.testing.assert_allclose(one.weighed(one.tally, water, slice(None))[0, 0] * along, expected, rtol=3e-3)


def test_several_waters_and_a_part_of_the_rows() -> None:
    """Each water has its own light, in whatever order; rows that are not asked for do not count."""
    one, rows = response(), np.array([3, 8, 7, 4])
    b = np.array([0.3, 2.0, 1.1])
    waters = Waters(np.full(3, 0.2), b, np.zeros(3), np.zeros(3))
    every = one.weighed(one.tally[:, rows], waters, rows)[0]
    for k in range(3):
        alone = one.weighed(one.tally[:, rows], Waters(*(c[k : k + 1] for c in waters[:4])), rows)[0, 0]
        np.testing.assert_allclose(every[k], alone, rtol=1e-12)
    whole = one.weighed(one.tally, waters, slice(None))[0]
    rest = np.setdiff1d(np.arange(9), rows)
    np.testing.assert_allclose(whole - every, one.weighed(one.tally[:, rest], waters, rest)[0], rtol=1e-9)


@pytest.mark.parametrize("before", [0.2, 1.24, 2.1])
@pytest.mark.parametrize("excess", [0.0, 0.3, 8.0])
def test_chances_between_the_lengths(before: float, excess: float) -> None:
    """Beside those at the very lengths, for waters of a hundredth to three times the trace's."""
    straight = np.linspace(0.5, 10.0, 300)
    b, n = before * np.array([0.01, 0.4, 0.8, 1.5, 3.0]), np.array([1, 3, 6])
    found = Lengths.of(straight).chances(n, np.full(3, excess), b, before)
    length = excess + straight
    exact = gammainc(n[:, None], b[:, None, None] * length) / gammainc(n[:, None], before * length)
    np.testing.assert_allclose(found, exact, rtol=3e-3)


@pytest.mark.parametrize("before", [0.2, 2.1])
def test_what_was_scattered_more_often_than_the_rows_hold_at_least(before: float) -> None:
    """Beside the chances at the very lengths: little on short ways in clear water, nearly all on long."""
    straight, n = np.linspace(0.5, 10.0, 300), np.array([3, 6])
    found = Lengths.of(straight).beyond(n, np.array([0.1, 1.0]), before)
    mean = before * (np.array([0.1, 1.0])[:, None] + straight)
    np.testing.assert_allclose(found, gammainc(n[:, None] + 1, mean) / gammainc(n[:, None], mean), atol=1e-3)


def test_the_error_of_open_ended_rows() -> None:
    """None in the water of the trace or without such rows; else a part of their light alone."""
    one, all_rows = response(), slice(None)
    b = np.array([B_0, 1.4, 0.7, 0.0])
    waters = Waters(np.full(4, 0.2), b, np.zeros(4), np.zeros(4))
    light, error = (f(one.tally, waters, all_rows)[0] for f in (one.weighed, one.uncertain))
    relative = error[:3] / light[:3]
    assert (relative[0] == 0).all() and (error[3] < 1e-190).all()
    top = one.weighed(one.tally[:, 6:], waters, np.arange(6, 9))[0]
    assert (relative[1:] > 0).all() and (error[1:3] < 0.4 * np.log(B_0 / b[1:3, None]) * top[1:3]).all()
    few = np.array([0, 1, 2])  # scattered once
    assert (one.uncertain(one.tally[:, few], waters, few) == 0).all()
