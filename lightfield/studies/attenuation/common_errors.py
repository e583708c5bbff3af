"""Generalised least squares over all colours at once, with errors of stays that all colours share.

    y[j, l] = X[j, l, :] theta[l, :] + beta[stay j] + eps[j, l]

beta has a prior of zero mean and known width. Eliminating theta colour by colour leaves equations for the few
beta, so thousands of colours cost no more than their number. The covariance of theta is

    cov(theta_l, theta_m) = own_l [l = m] + G_l B G_m^T        B = cov(beta), a few by a few
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array

#: Of a colour's largest singular value, below which a combination of its parameters is not told.
_TOLD = 1e-9


@dataclass(frozen=True, eq=False)
class Estimate:
    """What the readings say of the parameters of every colour.

    Parameters
    ----------
    theta : array, shape (n_colours, n_parameters)
    own : array, shape (n_colours, n_parameters, n_parameters)
        Covariance by the readings' own errors.
    modes : array, shape (n_colours, n_parameters, n_stays)
        Errors that all colours share: covariance between colours = modes @ modes^T.
    beta, beta_stderr : array, shape (n_stays,)
    residual : array, shape (n_rows, n_colours)
        y - X theta - beta; NaN where nothing was read.
    chi2 : float
    dof : int
    """

    theta: Array
    own: Array
    modes: Array
    beta: Array
    beta_stderr: Array
    residual: Array
    chi2: float
    dof: int

    @property
    def stderr(self) -> Array:
        """Standard error of every parameter, shape (n_colours, n_parameters)."""
        own = np.einsum("lpp->lp", self.own)
        return np.asarray(np.sqrt(own + (self.modes**2).sum(axis=2)))

    def covariance(self, parameter: int) -> Array:
        """Covariance of a parameter between colours, shape (n_colours, n_colours)."""
        modes = self.modes[:, parameter]
        return np.asarray(modes @ modes.T + np.diag(self.own[:, parameter, parameter]))


def least_squares(y: Array, sigma: Array, X: Array, stay: NDArray[np.int_], stay_stderr: Array) -> Estimate:
    """Estimate the parameters of every colour and the errors of the stays together.

    Parameters
    ----------
    y, sigma : array, shape (n_rows, n_colours)
        NaN where nothing was read.
    X : array, shape (n_rows, n_colours, n_parameters)
    stay : array of int, shape (n_rows,)
    stay_stderr : array, shape (n_stays,)

    Source
    ------
    Aitken (1935), Proc. R. Soc. Edinburgh 55, 42; the elimination is Schur's complement.
    """
    known = np.isfinite(y)
    w = np.where(known, 1.0 / np.where(known, sigma, 1.0) ** 2, 0.0)  # [rows, colours]
    value, X = np.where(known, y, 0.0), np.where(known[..., None], X, 0.0)
    H = (stay[:, None] == np.arange(len(stay_stderr))).astype(float)  # [rows, stays]
    WX = w[..., None] * X
    own = np.linalg.pinv(np.einsum("jlp,jlq->lpq", X, WX), rcond=_TOLD, hermitian=True)
    onto = own @ np.einsum("jlp,jk->lpk", WX, H)  # [colours, parameters, stays]: theta follows beta so
    alone = np.einsum("lpq,jlq,jl->lp", own, WX, value)  # theta without beta
    HWX = np.einsum("jk,jlp->lkp", H, WX)
    some = stay_stderr > 0
    precision = np.where(some, 1.0 / np.where(some, stay_stderr, 1.0) ** 2, 0.0)
    N = np.diag(precision + (w.sum(axis=1) @ H)) - np.einsum("lkp,lpm->km", HWX, onto)
    right = (w * value).sum(axis=1) @ H - np.einsum("lkp,lp->k", HWX, alone)
    beta, spread = np.zeros(len(some)), np.zeros((len(some), len(some)))
    if some.any():
        inverse = np.linalg.pinv(N[np.ix_(some, some)], hermitian=True)
        beta[some] = inverse @ right[some]
        spread[np.ix_(some, some)] = inverse
    theta = alone - onto @ beta
    size, direction = np.linalg.eigh(spread)
    root = direction * np.sqrt(np.clip(size, 0, None))
    residual = np.where(known, y - np.einsum("jlp,lp->jl", X, theta) - (H @ beta)[:, None], np.nan)
    chi2 = float((w * np.where(known, residual, 0.0) ** 2).sum() + (precision * beta**2).sum())
    told = np.linalg.matrix_rank(np.einsum("jlp,jlq->lpq", X, WX), hermitian=True).sum()
    return Estimate(
        theta, own, onto @ root, beta, np.sqrt(np.diag(spread)), residual, chi2, int(known.sum() - told)
    )
