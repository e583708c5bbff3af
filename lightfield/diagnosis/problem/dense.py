"""Cholesky factor of a covariance of few readings, or of such as share nearly all errors: one triangle."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky
from scipy.linalg.blas import dtrmm, dtrsm, dtrsv

from lightfield.arrays import Array


class DenseFactor:
    """Multiplies columns by the Cholesky factor of a covariance, and by its inverse.

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
