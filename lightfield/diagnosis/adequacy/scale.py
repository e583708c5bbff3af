"""Variance of the quoted errors over what they say, for many readings; see `robust.noise_scale` for few."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.polynomial import Chebyshev

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.robust import FEWEST_TO_SCALE, likeliest_scale
from lightfield.diagnosis.problem.noise import Noise, Whitener

#: Degree of the polynomials in ln(phi) that stand for the likelihood: one over all that is credible, to find
#: the place, and one about it. The scale is that of the dense covariance to 2e-4 (test_chain.py).
_DEGREE = 8


def scale_along(
    residual: Array, rich: Array, plain: Whitener, noise: Noise, tolerance: float, keep: Array
) -> float:
    """What `robust.noise_scale` gives, from the covariance as a chain (Patterson and Thompson 1971).

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
    if spare < FEWEST_TO_SCALE:
        return 1.0
    columns = np.column_stack([rich, residual])
    rest = float(np.asarray(np.linalg.qr(columns[kept], mode="r"))[-1, -1] ** 2)
    own = noise.subset(kept)
    smooth = own.smooth_columns(tolerance)
    raw = np.hstack([smooth, plain.coloured(columns)[kept]])
    rough = replace(own, photon_modes=None, response_error=None)
    # Amplitudes of the smooth errors have unit variance, those of the rich model may be anything.
    known = np.diag(np.r_[np.ones(smooth.shape[1]), np.zeros(columns.shape[1])])

    def deviance(log_phi: float) -> float:
        whiten = Whitener(rough, plain.rho, float(np.exp(log_phi)))
        white = whiten(raw)
        root = np.linalg.cholesky(white.T @ white + known).diagonal()
        return float(whiten.log_determinant + 2 * np.log(root[:-1]).sum() + root[-1] ** 2)

    def polynomial(low: float, high: float) -> Callable[[float], float]:
        return Chebyshev.interpolate(np.vectorize(deviance), _DEGREE, domain=[low, high])

    return likeliest_scale(polynomial, rest / spare)
