"""How to whiten by the noise: by a factor of its covariance, of few readings as one, of many as a chain."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky
from scipy.linalg.blas import dtrmm, dtrsm, dtrsv

from lightfield.arrays import Array
from lightfield.diagnosis.problem.chain import ChainBlock, ChainFactor, RowNumbers
from lightfield.diagnosis.problem.layout import Labels
from lightfield.diagnosis.problem.noise import WHITENED_WHOLE, Noise
from lightfield.memory import Latest

#: Choices of readings whose covariance is kept: a plane left out, one after the other. Chosen: memory alone.
_KEPT = 64

#: Of many readings, so many are whitened at a time. Chosen: time alone.
_BLOCK = 128


class Whitener:
    """Multiplies columns by the inverse Cholesky factor of the covariance.

    Few readings, or such as share nearly as many errors as there are, are one block, in the table's order.
    Many are taken in that of the scan, in which stays and serial correlation are short.

    Parameters
    ----------
    rho : float
        Serial correlation of neighbours in the scan.
    phi : float
        Variance over the quoted one.
    tolerance : float
        Relative error of the light that readings share smoothly.
    block : int, optional
        Most readings in one block.
    """

    def __init__(
        self,
        noise: Noise,
        rho: float = 0.0,
        phi: float = 1.0,
        tolerance: float = 0.0,
        block: int | None = None,
    ) -> None:
        self.noise, self.rho, self.phi, self.tolerance = noise, rho, phi, tolerance
        self._sigma: Array | None = None
        self._order: Labels | None = None
        self._of: Latest[bytes, Whitener] = Latest(_KEPT)
        if rho == 0 and noise.independent(tolerance):
            variance = noise.variance(phi, tolerance)
            self._sigma = np.sqrt(variance)
            #: Logarithm of the determinant of the covariance.
            self.log_determinant = float(np.log(variance).sum())
            return
        self._block = block
        self.log_determinant = self._factor.log_determinant

    @cached_property
    def _factor(self) -> DenseFactor | ChainFactor:
        noise, tolerance, block = self.noise, self.tolerance, self._block
        n, size = noise.layout.size, block or _BLOCK
        factor: DenseFactor | ChainFactor
        if n <= (block or WHITENED_WHOLE) or (block is None and self._is_one(size)):
            factor = DenseFactor(noise.covariance(self.rho, self.phi, tolerance))
        else:
            self._order = np.argsort(noise.layout.position, kind="stable")
            links = _links_of(noise, self.rho, self.phi, tolerance, self._order, size)
            factor = ChainFactor(links, single=noise.has_many)
        # Noise of another serial correlation shares what it was made of.
        noise.forget(columns=self.rho == 0)
        return factor

    def forget(self) -> None:
        """Free the memory of the factor: who asks for it again has it made again."""
        self.__dict__.pop("_factor", None)
        self._of.clear()
        self.noise.forget(columns=True)

    def _is_one(self, size: int) -> bool:
        """Do readings share so many errors that one block of them is as quick as many?"""
        noise, n = self.noise, self.noise.layout.size
        if noise.is_kept_whole and noise.has_modes:
            return True
        return 2 * noise.smooth_columns(self.tolerance).shape[1] + size > n

    def __call__(self, columns: Array) -> Array:
        if self._sigma is not None:
            return columns / (self._sigma if columns.ndim == 1 else self._sigma[:, None])
        return self._applied(self._factor.white, columns)

    def coloured(self, columns: Array) -> Array:
        """Columns times the Cholesky factor: the inverse of whitening."""
        if self._sigma is not None:
            return columns * (self._sigma if columns.ndim == 1 else self._sigma[:, None])
        return self._applied(self._factor.coloured, columns)

    def _applied(self, factor: Callable[[Array], Array], columns: Array) -> Array:
        two = columns[:, None] if columns.ndim == 1 else columns
        if self._order is None:
            return np.asarray(factor(two).reshape(columns.shape))
        out = np.empty(two.shape)
        out[self._order] = factor(two[self._order])
        return out.reshape(columns.shape)

    def of(self, rows: NDArray[np.bool_]) -> Whitener:
        """The same of some of the readings."""
        key = rows.tobytes()
        if key not in self._of:
            self._of[key] = Whitener(self.noise.subset(rows), self.rho, self.phi, self.tolerance)
        return self._of[key]

    def replicates(self, rng: np.random.Generator, count: int) -> Array:
        """Whitened noise, shape (n, count), as precise as tables that are kept."""
        return np.asarray(rng.standard_normal((self.noise.layout.size, count), self.kept_as))

    @property
    def kept_as(self) -> type[np.float32] | type[np.float64]:
        """Precision of whitened tables that are kept: of many readings single."""
        return np.float32 if self.noise.has_many else np.float64


class DenseFactor:
    """Multiplies columns by the Cholesky factor of a covariance, one triangle, and by its inverse.

    Parameters
    ----------
    covariance : array, shape (n, n)
        Overwritten.

    Raises
    ------
    numpy.linalg.LinAlgError
        The covariance is not positive definite.
    """

    def __init__(self, covariance: Array) -> None:
        # The transpose is the same covariance in the order of LAPACK, which then needs no copy.
        self._root: Array = cholesky(covariance.T, lower=True, overwrite_a=True, check_finite=False)
        #: Logarithm of the determinant of the covariance.
        self.log_determinant = 2 * float(np.log(np.diag(self._root)).sum())

    def white(self, columns: Array) -> Array:
        """L^-1 times columns of shape (n, k)."""
        if columns.shape[1] == 1:  # what a fit asks for most
            return np.asarray(dtrsv(self._root, columns[:, 0], lower=1)[:, None])
        return np.asarray(dtrsm(1.0, self._root, columns.T, side=1, lower=1, trans_a=1).T)

    def coloured(self, columns: Array) -> Array:
        """L times columns of shape (n, k)."""
        return np.asarray(dtrmm(1.0, self._root, columns.T, side=1, lower=1, trans_a=1).T)


def _links_of(
    noise: Noise, rho: float, phi: float, tolerance: float, order: RowNumbers, size: int
) -> Iterator[ChainBlock]:
    """The covariance of many readings as a chain: blocks of readings that follow each other in the scan.

    The state between them holds smooth errors, of which nothing is forgotten; the own noise of the last
    reading of each channel, of which rho is left with every step; and what readings of stays and of moments
    share that are not over.

    Parameters
    ----------
    order : array of int, shape (n,)
        Readings by `layout.position`.
    size : int
        Readings per block.
    """
    lay, n = noise.layout, noise.layout.size
    smooth, own = noise.smooth_columns(tolerance), np.sqrt(phi) * noise.sigma
    channels = np.arange(int(lay.channel.max()) + 1 if rho > 0 else 0)
    lasting = smooth.shape[1] + len(channels)
    block = np.empty(n, int)
    block[order] = np.arange(n) // size
    # Each kind of shared error has labels that no other has.
    at_once = [
        (np.where(amount > 0, label + k * n, -1), amount)
        for k, (label, amount) in enumerate((noise.stays, *noise.of_moments))
    ]
    first, last = np.full(len(at_once) * n, n), np.full(len(at_once) * n, -1)
    for label, _ in at_once:
        np.minimum.at(first, label[label >= 0], block[label >= 0])
        np.maximum.at(last, label[label >= 0], block[label >= 0])

    def columns(rows: RowNumbers, lag: Array, still: RowNumbers) -> Array:
        remembered = np.where(lay.channel[rows][:, None] == channels, rho ** lag[:, None], 0.0)
        shared = np.zeros((len(rows), len(still)))
        for label, amount in at_once:
            shared += amount[rows][:, None] * (label[rows][:, None] == still)
        return np.hstack([smooth[rows], own[rows][:, None] * remembered, shared])

    before, begin = np.zeros(0, int), lay.position[order[0]]
    for i, at in enumerate(range(0, n, size)):
        rows, place = order[at : at + size], lay.position[order[at : at + size]]
        end = lay.position[order[min(at + size, n - 1)]]
        after = np.flatnonzero((first <= i) & (last > i))
        known = {label: lasting + k for k, label in enumerate(before.tolist())}
        source = [*range(lasting), *(known.get(label, -1) for label in after.tolist())]
        decay = np.ones(len(source))
        decay[smooth.shape[1] : lasting] = rho ** (end - begin)
        out = columns(rows, place - begin, before)
        into = columns(rows, end - place, after)
        if i == 0:
            out, source = out[:, :0], [-1] * len(source)
        yield ChainBlock(noise.covariance(rho, phi, tolerance, rows), out, into, np.array(source, int), decay)
        before, begin = after, end


def unwhitened(columns: Array) -> Array:
    """Columns as they are: for fits to what has no noise."""
    return columns
