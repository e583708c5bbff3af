"""Variance of the quoted errors over what they say: of few readings, and of many along the scan."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import Chebyshev
from scipy import optimize

from lightfield.arrays import Array
from lightfield.decompositions import eigen
from lightfield.diagnosis.adequacy.likelihood import SCALE_SPREAD
from lightfield.diagnosis.problem.noise import Noise
from lightfield.diagnosis.problem.whitening import Whitener

#: Readings to spare that stated errors count as, where the scale of the noise is judged: an estimate from so
#: many has that spread, and tells with them as Smyth (2004, doi:10.2202/1544-6115.1027, section 3) has it.
#: Derived: ln of a mean of d squares of noise has the variance 2/d.
STATED_COUNT_AS = 2 / SCALE_SPREAD**2
#: An overstated part of the error budget must not make the readings look better than they can be. Chosen; on
#: half and nearly twice of it no answer hangs (test_cascade.py).
SMALLEST_SCALE = 0.5
#: Beside fewer spare readings than this no scale is estimated. Chosen: from four its error is 70 %.
_FEWEST_TO_SCALE = 4
#: Points at which a deviance is asked for before its minimum is sought between two of them. Chosen.
_SCALES_TRIED = 40
#: Degree of the polynomials in ln(phi) that stand for the likelihood where each value of it takes a factor of
#: its own: one over all that is credible, to find the place, and one about it. The scale is that of the dense
#: covariance to 2e-4 (test_chain.py).
_DEGREE = 8
#: Stays with a gain of their own that are taken as columns of the shared errors. Chosen: time alone.
_FEW_STAYS = 200
#: Columns that are whitened at a time. Chosen: memory alone.
_AT_ONCE = 128


def noise_scale(
    residual: Array, rich: Array, plain: Whitener, extra: Array, keep: Array, count_as: float = 0.0
) -> float:
    """Variance factor of the quoted errors beside the rest of the error budget, by restricted likelihood.

    What is left beside the rich basis has the covariance phi + extra. In the eigenvectors of `extra` that is
    a sum of independent terms, so that directions which the rest of the budget fills say little about phi
    (Patterson and Thompson 1971).

    Parameters
    ----------
    residual : array, shape (n,)
        Residual whitened by the quoted errors alone (`plain`).
    extra : array, shape (n, n)
        Covariance of the other terms of the budget.
    count_as : float
        Readings to spare that the quoted errors count as, see `likeliest_scale`.
    """
    kept = np.flatnonzero(keep > 0)
    spare = len(kept) - rich.shape[1]
    if spare < _FEWEST_TO_SCALE:
        return 1.0
    outside = np.linalg.qr(rich[kept], mode="complete")[0][:, rich.shape[1] :]
    white = plain(plain(extra).T)[np.ix_(kept, kept)]
    more, directions = eigen(outside.T @ white @ outside)
    more, square = np.maximum(more, 0.0), (directions.T @ (outside.T @ residual[kept])) ** 2

    def deviance(log_phi: float) -> float:
        variance = np.exp(log_phi) + more
        return float(np.sum(np.log(variance) + square / variance))

    return likeliest_scale(lambda low, high: deviance, float(square.sum()) / spare, count_as)


def likeliest_scale(
    within: Callable[[float, float], Callable[[float], float]], mean_square: float, count_as: float = 0.0
) -> float:
    """Scale of least deviance that is credible.

    Parameters
    ----------
    within : callable
        Takes bounds of ln(phi) and gives the deviance, a function of ln(phi), between them.
    mean_square : float
        Of the residual: the scale if there were no other errors.
    count_as : float
        Readings to spare with a mean square of one that are taken to have been seen before.
    """
    largest = max(mean_square, 2 * SMALLEST_SCALE)
    low, high = float(np.log(SMALLEST_SCALE)), float(np.log(2 * largest))

    def with_known(deviance: Callable[[float], float]) -> Callable[[float], float]:
        return lambda x: deviance(x) + count_as * float(x + np.exp(-x))

    deviance, grid = with_known(within(low, high)), np.linspace(low, high, _SCALES_TRIED)
    best = grid[int(np.argmin([deviance(x) for x in grid]))]
    width = grid[1] - grid[0]
    low, high = max(best - width, low), best + width
    nearer = with_known(within(low, high))
    return float(np.exp(optimize.minimize_scalar(nearer, bounds=(low, high), method="bounded").x))


def scale_along(
    residual: Array,
    rich: Array,
    plain: Whitener,
    noise: Noise,
    tolerance: float,
    keep: Array,
    count_as: float = 0.0,
) -> float:
    """What `noise_scale` gives, from the covariance as a chain (Patterson and Thompson 1971).

    Parameters
    ----------
    residual : array, shape (n,)
        Whitened by the quoted errors alone (`plain`).
    rich : array, shape (n, k)
        Whitened likewise, orthonormal.
    noise : Noise
        With the other terms of the budget.
    """
    kept = keep > 0
    spare = int(kept.sum()) - rich.shape[1]
    if spare < _FEWEST_TO_SCALE:
        return 1.0
    columns = np.column_stack([rich, residual])
    rest = float(np.asarray(np.linalg.qr(columns[kept], mode="r"))[-1, -1] ** 2)
    own = noise if kept.all() else noise.subset(kept)
    coloured = plain.coloured(columns)[kept]
    (stay, gain), stays = own.stays, np.unique(own.stays[0][own.stays[0] >= 0])
    if not own.of_moments and len(stays) <= _FEW_STAYS:
        shared = [*own.smooth_parts(tolerance), gain[:, None] * (stay[:, None] == stays)]
        along = _deviance(own, plain.rho, shared, coloured)
        return likeliest_scale(lambda low, high: along, rest / spare, count_as)
    smooth = own.smooth_columns(tolerance)
    raw = np.hstack([smooth, coloured])
    rough = own.without_light
    # Amplitudes of the smooth errors have unit variance, those of the rich model may be anything.
    known = np.diag(np.r_[np.ones(smooth.shape[1]), np.zeros(columns.shape[1])])

    def deviance(log_phi: float) -> float:
        whiten = Whitener(rough, plain.rho, float(np.exp(log_phi)))
        white = whiten(raw)
        root = np.linalg.cholesky(white.T @ white + known).diagonal()
        return float(whiten.log_determinant + 2 * np.log(root[:-1]).sum() + root[-1] ** 2)

    def polynomial(low: float, high: float) -> Callable[[float], float]:
        return Chebyshev.interpolate(np.vectorize(deviance, [float]), _DEGREE, domain=[low, high])

    return likeliest_scale(polynomial, rest / spare, count_as)


def _deviance(noise: Noise, rho: float, shared: list[Array], columns: Array) -> Callable[[float], float]:
    """Deviance as a function of ln(phi) where nothing but the shared errors is beside phi times the own ones:
    one factor then serves every phi.

    Parameters
    ----------
    shared : list of arrays, shape (n, r)
        Errors of unit amplitude.
    columns : array, shape (n, k + 1)
        Rich model and, last, residual.
    """
    whiten, parts = Whitener(noise.alone, rho), [*shared, columns]
    white = np.empty((len(columns), sum(part.shape[1] for part in parts)))
    at = 0
    for part in parts:
        for first in range(0, part.shape[1], _AT_ONCE):
            some = np.asarray(part[:, first : first + _AT_ONCE], float)
            white[:, at : (at := at + some.shape[1])] = whiten(some)
    gram, known = white.T @ white, at - columns.shape[1]
    # In the eigenvectors of what is shared one decomposition serves every phi.
    square, directions = eigen(gram[:known, :known])
    square, beside = np.maximum(square, 0.0), directions.T @ gram[:known, known:]

    def deviance(log_phi: float) -> float:
        part = np.exp(-log_phi)
        share = part / (1 + part * square)
        root = np.linalg.cholesky(part * (gram[known:, known:] - beside.T @ (share[:, None] * beside)))
        last = root.diagonal()
        log_determinant = len(white) * log_phi + whiten.log_determinant + np.log1p(part * square).sum()
        return float(log_determinant + 2 * np.log(last[:-1]).sum() + last[-1] ** 2)

    return deviance
