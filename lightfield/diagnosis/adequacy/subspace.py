"""Small linear algebra: orthonormal bases, what is left of columns beside a basis, and what others make of
them."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.decompositions import eigen, solved, thin_svd

#: Derivatives with respect to parameters are collinear when less than this part of the strongest direction is
#: left. Chosen: far above the rounding of doubles (1e-16), far below what readings tell apart.
INDEPENDENT = 1e-9
#: The same of effects and unknowns, told apart by readings good to a per cent. Chosen: a tenth of that.
DISTINCT = 1e-3


def orthonormal(columns: Array, tolerance: float = DISTINCT) -> Array:
    """Orthonormal basis of the span; directions weaker than `tolerance` of the strongest are dropped.

    Parameters
    ----------
    columns : array, shape (n, k)
        Scaled to unit length first, so that the tolerance means collinearity and not size.
    """
    norm = np.linalg.norm(columns, axis=0)
    usable = columns[:, norm > TINY] / norm[norm > TINY]
    if usable.shape[1] == 0:
        return np.zeros((len(columns), 0))
    u, s, _ = thin_svd(usable)
    return np.asarray(u[:, s > tolerance * s[0]])


def combined(gram: Array) -> Array:
    """`orthonormal` of columns that are known by their products: the basis as combinations of them.

    Parameters
    ----------
    gram : array, shape (k, k)
        Products of the columns with each other.

    Returns
    -------
    array, shape (k, rank)
    """
    norm = np.sqrt(np.maximum(gram.diagonal(), 0.0))
    usable = np.flatnonzero(norm > np.sqrt(TINY))
    out = np.zeros((len(gram), 0))
    if len(usable) == 0:
        return out
    square, directions = eigen(gram[np.ix_(usable, usable)] / np.outer(norm[usable], norm[usable]))
    strong = square > DISTINCT**2 * square[-1]
    out = np.zeros((len(gram), int(strong.sum())))
    out[usable] = directions[:, strong] / np.sqrt(square[strong]) / norm[usable, None]
    return out


def beside(basis: Array, columns: Array) -> Array:
    """Columns minus their projection on an orthonormal basis (twice, against rounding)."""
    rest = columns - basis @ (basis.T @ columns)
    return np.asarray(rest - basis @ (basis.T @ rest))


def by_others(others: Array, columns: Array, tolerance: float | None = None) -> Array:
    """Amplitudes of other columns, (k, m), that come nearest to some, whatever units either are in.

    Parameters
    ----------
    others : array, shape (n, k)
        Scaled to unit length first: a background in a small unit is a long column, beside which the rest
        would pass for nothing.
    columns : array, shape (n, m)
    tolerance : float, optional
        Combinations weaker than this part of the strongest are left out; default: those that rounding makes.
    """
    norm = np.linalg.norm(others, axis=0) + TINY
    return np.asarray(solved(others / norm, columns, tolerance) / norm[:, None])
