"""Rows of a tally that hold every number of scatterings from some on, in water that scatters more or less.

Given the length of a path, the number of scatterings is close to a Poisson number. Averaged over n >= N the
factor (b / b_0)^n is

    e^{(b - b_0) l} P(n >= N; b l) / P(n >= N; b_0 l),    l = r + e

with the straight line r to the cell and the path in excess of it e. To a far cell it is another than to a
near one: light that was reflected is told apart by a few scatterings only, and most of it is in these rows.
How many scatterings lead to a cell is not Poisson's alone, which is an error of what is told of other water.
"""

from __future__ import annotations

from math import ceil, log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc

from lightfield.arrays import Array

#: Factor from one length to the next at which the chances are worked out; between them the logarithm of their
#: quotient is taken to be straight, right to 0.3 % at worst (tests/unit/render/response/test_open_ended.py).
STEP = 1.05
#: Lines shorter than this, m, or than this part of the longest are taken to be as long: on them nothing is
#: scattered often.
_SHORTEST_M, _FARTHEST = 1e-2, 50.0
#: A smaller chance has no logarithm to go by.
_NEVER = 1e-200
#: Scatterings from which light that was reflected is held together, in maps and in fits.
HELD_FROM, HELD_FROM_IN_FITS = 5, 3
#: Relative error of what was scattered more often than such rows hold at least, per |ln(b / b_0)|. Chosen:
#: in far planes of three tanks, b from 2.1 to 1.05 and to 1.4 per m, fresh traces differ by 0.1 to 0.6 of it;
#: off the axis of near planes by up to 1.2, of little light.
OPEN_ENDED_ERROR = 0.4


class Lengths(NamedTuple):
    """Straight lines to cells, between a few lengths.

    Parameters
    ----------
    nodes : array, shape (n_nodes,), m
    below : array of int, shape (n_cells,)
        The node below each.
    part : array, shape (n_cells,)
        How far it lies towards the next one.
    """

    nodes: Array
    below: NDArray[np.integer[Any]]
    part: Array

    @classmethod
    def of(cls, straight_m: Array) -> Lengths:
        """Of straight lines, shape (n_cells,)."""
        high = max(float(straight_m.max()), _SHORTEST_M)
        low = max(float(straight_m.min()), high / _FARTHEST, _SHORTEST_M)
        count = 2 + ceil(log(high / low) / log(STEP))
        nodes = low * STEP ** np.arange(count)
        length = np.maximum(straight_m, low)
        below = np.clip(np.searchsorted(nodes, length, side="right") - 1, 0, count - 2)
        return cls(nodes, below, (length - nodes[below]) / (nodes[below + 1] - nodes[below]))

    def chances(self, n: NDArray[np.integer[Any]], excess_m: Array, b: Array, before: float) -> Array:
        """P(n >= N; b l) / P(n >= N; b_0 l), shape (n_waters, n_rows, n_cells).

        Parameters
        ----------
        n : array of int, shape (n_rows,)
        excess_m : array, shape (n_rows,), m
        b : array, shape (n_waters,), m^-1
        before : float, m^-1
            Of the trace, above zero.
        """
        length = excess_m[:, None] + self.nodes
        now = gammainc(n[:, None], b[:, None, None] * length)
        then = gammainc(n[:, None], before * length)
        quotient = np.log(np.maximum(now, _NEVER) / np.maximum(then, _NEVER))
        here, there = quotient[..., self.below], quotient[..., self.below + 1]
        return np.asarray(np.exp(here + self.part * (there - here)))

    def beyond(self, n: NDArray[np.integer[Any]], excess_m: Array, before: float) -> Array:
        """Part of what open-ended rows hold that was scattered more often than they hold at least.

        Parameters
        ----------
        n, excess_m : arrays, shape (n_rows,)
        before : float, m^-1
            Scattering of the trace, above zero.

        Returns
        -------
        array, shape (n_rows, n_cells)
        """
        mean = before * (excess_m[:, None] + self.nodes)
        part = gammainc(n[:, None] + 1, mean) / np.maximum(gammainc(n[:, None], mean), _NEVER)
        here, there = part[:, self.below], part[:, self.below + 1]
        return np.asarray(here + self.part * (there - here))
