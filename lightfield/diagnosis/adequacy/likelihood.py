"""Restricted likelihood of readings beside columns that a model can move (Patterson and Thompson 1971,
doi:10.1093/biomet/58.3.545): it does not mistake for accuracy what the columns took out."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from scipy import special

from lightfield.arrays import TINY, Array

#: ln(variance scale) over which it is integrated out, from a twentieth to eight thousand. Chosen.
_LOG_SCALE = np.linspace(-3.0, 9.0, 121)
#: Spread of ln(variance of the noise over the stated one) in the prior, and degrees of freedom of its Student
#: distribution. Chosen: stated errors are good to a factor of 1.3 or so, but tails wide enough for one of 5.
SCALE_SPREAD, _SCALE_DOF = 0.5, 4
#: From so many rows on products of columns are quicker than reflections, and as good. Chosen: time alone.
_MANY_ROWS = 3000


def log_evidence(white: Array, stated: float | None) -> float:
    """Restricted likelihood of a residual beside columns, both whitened, the variance scale integrated out.

    Parameters
    ----------
    white : array, shape (n, k + 1)
        Columns and, last, residual.
    """
    prior = np.zeros_like(_LOG_SCALE)
    if stated is not None:
        # Student's t, up to a constant.
        far = (_LOG_SCALE - np.log(stated)) / SCALE_SPREAD
        prior = -0.5 * (_SCALE_DOF + 1) * np.log1p(far**2 / _SCALE_DOF)
    nu, rest, volume = _beside(white)
    log_likelihood = prior - 0.5 * (nu * _LOG_SCALE + rest * np.exp(-_LOG_SCALE))
    return float(special.logsumexp(log_likelihood) - volume)


def _beside(white: Array) -> tuple[int, float, float]:
    """Spare readings and sum of squares of a residual (last column) beside columns; ln(volume) of these."""
    r = _triangle(white)
    nu = len(white) - white.shape[1] + 1
    volume = float(np.log(np.abs(np.diag(r)[: white.shape[1] - 1])).sum())
    return nu, float(r[-1, -1] ** 2) if nu > 0 else 0.0, volume


def _triangle(columns: Array) -> Array:
    """R of a QR decomposition; of many rows, where a basis is far from collinear, from their products."""
    if len(columns) > _MANY_ROWS:
        with suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.cholesky(columns.T @ columns).T)
    return np.asarray(np.linalg.qr(columns, mode="r"))


def profile(white: Array) -> tuple[float, float]:
    """Restricted log likelihood of a residual (last column) beside the others at its best scale, and that."""
    nu, rest, volume = _beside(white)
    variance = max(rest / nu, TINY)
    return -0.5 * nu * float(np.log(variance)) - volume, variance
