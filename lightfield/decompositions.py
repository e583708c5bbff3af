"""Singular values and eigenvalues of matrices, by drivers that converge.

LAPACK's divide and conquer is fast, and fails on some finite matrices of nearly parallel columns; the slower
QR iteration then does it.
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
