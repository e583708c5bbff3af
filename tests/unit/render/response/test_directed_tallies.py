"""Sparse tallies tell what dense ones do, and are stored in as many numbers as are not nought."""

from __future__ import annotations

import numpy as np
import pytest
from directed import directed
from numpy.testing import assert_allclose, assert_array_equal

from lightfield.render.response.directed_tallies import DirectedTallies, Entries

NODES, CELLS = 12, 7
#: Three classes of light, of two rows, of one, and of three.
HISTORIES = np.array([(1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0), (3, 2, 0)])
SCATTERED, FROM_WALLS, FROM_WALLS_TOO = 0, 1, 2
EVERY = slice(0, CELLS)


@pytest.fixture
def dense() -> list[np.ndarray]:
    """Of two traces, shape (NODES, 6, CELLS), nine in ten nought."""
    rng = np.random.default_rng(3)
    shape = NODES, len(HISTORIES), CELLS
    return [(rng.random(shape) * (rng.random(shape) < 0.1)).astype(np.float32) for _ in range(2)]


@pytest.mark.parametrize(("kind", "rows"), [(SCATTERED, slice(0, 2)), (FROM_WALLS_TOO, slice(3, 6))])
@pytest.mark.parametrize("cells", [slice(0, CELLS), slice(2, 5)])
def test_light_is_the_sum_over_directions(
    dense: list[np.ndarray], kind: int, rows: slice, cells: slice
) -> None:
    """Of each trace, of the rows of one class, in the cells asked for; by rings, too."""
    tallies, beams = directed(dense, HISTORIES), np.random.default_rng(4).normal(size=(3, NODES))
    assert list(tallies.rows_of) == [SCATTERED, FROM_WALLS, FROM_WALLS_TOO]
    of_rings, several = beams[:, ::4], np.array(dense)[:, :, rows, cells]
    found = tallies.light(kind, cells, beams)
    assert_allclose(found, np.einsum("bn,tnrc->ctrb", beams, several), rtol=1e-5, atol=1e-6)
    found = tallies.added(4).light(kind, cells, of_rings)
    expected = np.einsum("bn,tnrc->ctrb", np.repeat(of_rings, 4, axis=1), several)
    assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


def test_light_that_was_never_scattered_is_told_by_all_traces(dense: list[np.ndarray]) -> None:
    """By their photons."""
    every = [Entries.of(tally, np.arange(len(HISTORIES))) for tally in dense]
    found = DirectedTallies.of(every, np.array([0.25, 0.75]), HISTORIES, CELLS, NODES)
    expected = 0.25 * dense[0][:, 2] + 0.75 * dense[1][:, 2]
    assert_allclose(found.light(FROM_WALLS, EVERY, np.eye(NODES))[:, 0, 0].T, expected, rtol=1e-6)


def test_what_is_stored_is_what_is_not_nought(dense: list[np.ndarray]) -> None:
    """And is the same tally again, a trace that reached nothing too."""
    dense.append(np.zeros_like(dense[0]))
    tallies = directed(dense, HISTORIES)
    stored, scattered = tallies.packed(), np.array(dense)[:, :, HISTORIES[:, 0] > 0]
    lit = np.array(dense)[:, :, HISTORIES[:, 0] == 0].any(axis=0)
    assert len(stored["values"]) == len(stored["nodes"]) == np.count_nonzero(scattered) + lit.sum()
    again = DirectedTallies.unpacked(stored, HISTORIES)
    for kind in tallies.rows_of:
        found, expected = (t.light(kind, EVERY, np.eye(NODES)) for t in (again, tallies))
        assert_array_equal(found, expected)


def test_a_trace_that_reached_nothing_is_stored_too() -> None:
    """A collimator may see none of few photons."""
    nothing = directed([np.zeros((NODES, 0, CELLS), np.float32)], np.zeros((0, 3), int))
    again = DirectedTallies.unpacked(nothing.packed(), nothing.histories)
    assert not again.lines and not again.rows_of
    assert (again.cells, again.nodes) == (CELLS, NODES)
