"""Cholesky factor of a covariance along a chain: dense within blocks of readings, of low rank between them.

Readings far apart share few errors: the gain of a stay, a smooth error of the model, the noise that is left
of the last reading. What the blocks up to one have in common with all that follow is a state of s numbers,
so that the factor takes n (b + 2 s) numbers for blocks of b readings, and n (b + s)^2 steps, in place of n^2
and n^3 (the blocked form of Foreman-Mackey, Agol, Ambikasaran and Angus 2017, Astron. J. 154, 220). It is the
Cholesky factor itself, not another root of the covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_lapack_funcs, solve_triangular
from scipy.linalg.lapack import dtrtri

from lightfield.arrays import Array
from lightfield.decompositions import eigen

RowNumbers = NDArray[np.int_]

#: Rows among which the next columns of a factor of low rank are chosen: it has no more of them than among
#: 1500, in half the time.
_CHOSEN_AMONG = 400


@dataclass(frozen=True)
class ChainBlock:
    """One block of readings; C_ij = out_i carry_i-1 ... carry_j+1 into_j^T is its covariance with another.

    Parameters
    ----------
    own : array, shape (b, b)
        C_ii.
    out : array, shape (b, s)
        What the readings take from the state before them.
    into : array, shape (b, s')
        What they add to the state after them.
    source : array of int, shape (s',)
        Where the numbers of the new state come from in the old one; -1: from nowhere.
    decay : array, shape (s',)
        Factor on each.
    """

    own: Array
    out: Array
    into: Array
    source: RowNumbers
    decay: Array

    @cached_property
    def _kept(self) -> RowNumbers | None:
        """What decays of a state whose numbers stay in place."""
        same = len(self.source) == self.out.shape[1] and (self.source == np.arange(len(self.source))).all()
        return np.flatnonzero(self.decay != 1) if same else None

    @cached_property
    def _taken(self) -> tuple[RowNumbers, Array]:
        there = self.source >= 0
        return np.where(there, self.source, 0), np.where(there, self.decay, 0.0)[:, None]

    def carry(self, state: Array) -> Array:
        """The old state, shape (s, k), as part of the new one, shape (s', k)."""
        if self._kept is not None:
            if len(self._kept):
                state = state.copy()
                state[self._kept] *= self.decay[self._kept, None]
            return state
        source, factor = self._taken
        return factor * state[source] if len(state) else np.zeros((len(source), state.shape[1]))


class ChainFactor:
    """Multiplies columns by the Cholesky factor of a covariance, and by its inverse.

    Parameters
    ----------
    links : iterable of ChainBlock
        In order.
    single : bool
        What blocks have in common in single precision: half the memory, half the time of a column, which is
        that of reading it, and two thirds of that of the factor. Of 10,125 readings with 563 shared columns
        chi-square is the same to 3e-9.

    Raises
    ------
    numpy.linalg.LinAlgError
        The covariance is not positive definite.
    """

    def __init__(self, links: Iterable[ChainBlock], single: bool = False) -> None:
        self._kind = np.float32 if single else np.float64
        self._links: list[tuple[ChainBlock, Array, Array]] = []
        #: Logarithm of the determinant of the covariance.
        self.log_determinant = 0.0
        kind = self._kind
        known = np.zeros(
            (0, 0), kind
        )  # covariance of the state before a block, as the readings so far tell it
        for link in links:
            own, out, gain = link.own, link.out.astype(kind, copy=False), link.into.T.astype(kind)
            if len(known):
                taken = out @ known
                own, gain = own - taken @ out.T, gain - link.carry(taken.T)
            root: Array = np.linalg.cholesky(own)
            inverse: Array = dtrtri(root, lower=1)[0]
            self.log_determinant += 2 * float(np.log(np.diag(root)).sum())
            gain = (gain @ inverse.T).astype(kind, copy=False)
            known = (link.carry(link.carry(known).T) + gain @ gain.T).astype(kind, copy=False)
            # What the factor holds is not kept twice.
            nothing = np.zeros((0, 0))
            self._links.append((replace(link, own=nothing, into=nothing, out=out), inverse, gain))

    def white(self, columns: Array) -> Array:
        """L^-1 times columns of shape (n, k)."""
        state: Array = np.zeros((0, columns.shape[1]), self._kind)
        out, at = np.empty_like(columns), 0
        for link, inverse, gain in self._links:
            rows = slice(at, at := at + len(inverse))
            rest = columns[rows] - link.out @ state if len(state) else columns[rows]
            out[rows] = inverse @ rest
            state = self._carried(link, state) + gain @ out[rows].astype(self._kind, copy=False)
        return out

    def _carried(self, link: ChainBlock, state: Array) -> Array:
        return link.carry(state).astype(self._kind, copy=False)

    def coloured(self, columns: Array) -> Array:
        """L times columns of shape (n, k)."""
        state: Array = np.zeros((0, columns.shape[1]), self._kind)
        out, at = np.empty_like(columns), 0
        for link, inverse, gain in self._links:
            rows = slice(at, at := at + len(inverse))
            out[rows] = solve_triangular(inverse, columns[rows], lower=True, check_finite=False)
            if len(state):
                out[rows] += link.out @ state
            state = self._carried(link, state) + gain @ columns[rows].astype(self._kind, copy=False)
        return out


def low_rank(between: Callable[[RowNumbers, RowNumbers], Array], variance: Array, tolerance: float) -> Array:
    """Columns U with U U^T near a covariance: no variance differs by more than a tolerance, shape (n, rank).

    Cholesky decomposition with pivots, which are looked for among some rows at a time, the more likely the
    more is left of their variance (Chen, Epperly, Tropp and Webber 2025, Comm. Pure Appl. Math. 78, 995).

    Parameters
    ----------
    between : callable
        Covariance of two sets of rows, shape (len(a), len(b)), in the precision that is worked with.
    variance : array, shape (n,)
        Its diagonal.
    tolerance : float
    """
    n, left, rng = len(variance), variance.copy(), np.random.default_rng(0)
    every = np.arange(n)
    columns = between(every, every[:0])
    while left.max(initial=0.0) > tolerance:
        likely = np.flatnonzero(left > tolerance)
        if len(likely) > _CHOSEN_AMONG:
            part = left[likely] / left[likely].sum()
            # A sum of independent exponentials' races: draws without replacement.
            likely = likely[np.argsort(rng.exponential(size=len(likely)) / part)[:_CHOSEN_AMONG]]
        rest = between(likely, likely) - columns[likely] @ columns[likely].T
        # Further than asked for, so that rounding cannot leave a row that is asked for again.
        (pstrf,) = get_lapack_funcs(("pstrf",), (rest,))
        root, order, rank, _ = pstrf(rest, tol=0.5 * tolerance, lower=1)
        pivots = likely[order[:rank] - 1]
        new = between(every, pivots) - columns @ columns[pivots].T
        new = solve_triangular(root[:rank, :rank], new.T, lower=True).T
        columns = np.hstack([columns, new])
        left = np.maximum(left - (new**2).sum(1), 0.0)
    return columns


def fewer_columns(parts: Sequence[Array], own: Array, left_out: float) -> Array:
    """As few columns as tell the same covariance, but for its least directions, shape (n, fewer).

    In single precision: what is left out is far above its rounding.

    Parameters
    ----------
    parts : sequence of arrays, shape (n, some)
        Side by side they are U of a covariance U U^T.
    own : array, shape (n,)
        Standard errors that it is beside.
    left_out : float
        What goes of the variances, in units of the own ones, in the mean over rows.
    """
    relative = np.empty((len(own), sum(part.shape[1] for part in parts)), np.float32)
    at = 0
    for part in parts:
        some = relative[:, at : (at := at + part.shape[1])]
        np.divide(part, own[:, None], out=some, casting="same_kind")
    square, directions = eigen(relative.T @ relative)
    lost = np.cumsum(np.maximum(square, 0.0)) <= left_out * len(own)
    if lost.any():
        relative = relative @ directions[:, ~lost]
    return np.multiply(relative, own[:, None], out=relative, casting="same_kind")
