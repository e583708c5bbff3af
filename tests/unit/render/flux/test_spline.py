"""Splines gathered all at once are those of SciPy, one after the other; their slopes are differences."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

from lightfield.render.flux.spline import Splines

RNG = np.random.default_rng(5)
COEFFICIENTS = RNG.standard_normal((3, 5, 6, 7))
#: Inside, on a cell, and at both edges.
CELLS = np.vstack([RNG.uniform(0, 1, (40, 3)) * np.array([4, 5, 6]), [[2, 3, 4], [0, 0, 0], [4, 5, 6]]])


def test_values_are_those_of_map_coordinates() -> None:
    expected = [map_coordinates(c, CELLS.T, order=3, prefilter=False, mode="nearest") for c in COEFFICIENTS]
    splines = Splines.of(COEFFICIENTS)
    np.testing.assert_allclose(splines.at(CELLS), np.array(expected).T, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(splines.with_slopes(CELLS)[:, 0], splines.at(CELLS), rtol=1e-12, atol=1e-12)


def test_beyond_the_edge_is_what_is_at_the_edge() -> None:
    splines = Splines.of(COEFFICIENTS)
    beyond, edge = np.array([[-1.0, 2, 2], [2, 9, 2]]), np.array([[0.0, 2, 2], [2, 5, 2]])
    np.testing.assert_allclose(splines.at(beyond), splines.at(edge), rtol=1e-12)


def test_slopes_are_differences() -> None:
    splines, inside, step = Splines.of(COEFFICIENTS), CELLS[:40], 1e-5
    for axis in range(3):
        move = step * np.eye(3)[axis]
        expected = (splines.at(inside + move) - splines.at(inside - move)) / (2 * step)
        np.testing.assert_allclose(splines.with_slopes(inside)[:, axis + 1], expected, atol=1e-7)
