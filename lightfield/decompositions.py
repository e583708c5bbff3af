"""Singular values, eigenvalues and least squares of matrices, by drivers that converge.

LAPACK's divide and conquer is fast, and fails on some finite matrices, of nearly parallel columns and a few
others; the slower QR iteration then does it.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from lightfield.arrays import Array


def thin_svd(columns: Array) -> tuple[Array, Array, Array]:
    """Singular value decomposition u, s, v^T of columns, shape (n, k)."""
    try:
        u, s, vt = np.linalg.svd(columns, full_matrices=False)
    except np.linalg.LinAlgError:
        u, s, vt = scipy.linalg.svd(columns, full_matrices=False, lapack_driver="gesvd")
    return u, s, vt


def eigen(symmetric: Array) -> tuple[Array, Array]:
    """Eigenvalues in rising order, shape (k,), and eigenvectors as columns of a symmetric matrix."""
    try:
        values, vectors = np.linalg.eigh(symmetric)
    except np.linalg.LinAlgError:
        values, vectors = scipy.linalg.eigh(symmetric, driver="ev")
    return values, vectors


def solved(columns: Array, target: Array, least: float | None = None) -> Array:
    """Coefficients of columns, shape (n, k), that together come nearest to a target, (n,) or (n, m).

    Parameters
    ----------
    least : float, optional
        Singular values below this part of the largest count as none; rounding by default.
    """
    try:
        return np.asarray(np.linalg.lstsq(columns, target, rcond=least)[0])
    except np.linalg.LinAlgError:
        least = np.finfo(float).eps * max(columns.shape) if least is None else least
        return np.asarray(scipy.linalg.lstsq(columns, target, cond=least, lapack_driver="gelss")[0])
