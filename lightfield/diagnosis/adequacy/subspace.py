"""Small linear algebra: orthonormal bases, and what is left of columns beside a basis."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array


def orthonormal(columns: Array, tolerance: float = 1e-3) -> Array:
    """Orthonormal basis of the span; directions weaker than `tolerance` of the strongest are dropped.

    Parameters
    ----------
    columns : array, shape (n, k)
        Scaled to unit length first, so that the tolerance means collinearity and not size.
    """
    norm = np.linalg.norm(columns, axis=0)
    usable = columns[:, norm > 1e-300] / norm[norm > 1e-300]
    if usable.shape[1] == 0:
        return np.zeros((len(columns), 0))
    u, s, _ = np.linalg.svd(usable, full_matrices=False)
    return np.asarray(u[:, s > tolerance * s[0]])


def beside(basis: Array, columns: Array) -> Array:
    """Columns minus their projection on an orthonormal basis (twice, against rounding)."""
    rest = columns - basis @ (basis.T @ columns)
    return np.asarray(rest - basis @ (basis.T @ rest))
