"""Cells of a plane: what a model shows in one, their size, and those on the axis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.formula.scattered.quadrature import in_cell


def cell_mean(
    field: Callable[[Array, Array], Array], x_m: Array, y_m: Array, pitch_x_m: float, pitch_y_m: float
) -> Array:
    """A field averaged over every cell of a plane by 3 x 3 Gauss-Legendre points.

    Parameters
    ----------
    field : callable
        Of x and y, m, arrays of shape (n_y, n_x); gives an array of shape (..., n_y, n_x).
    x_m, y_m : arrays, shape (n_x,) and (n_y,), m
        Centres of the cells.
    pitch_x_m, pitch_y_m : float, m
        Their size.

    Returns
    -------
    array, shape (..., n_y, n_x), unit of the field
    """
    total: Array = np.zeros(1)
    for (u, v), weight in zip(*in_cell(3), strict=True):
        total = total + weight * field(*np.meshgrid(x_m + u * pitch_x_m, y_m + v * pitch_y_m))
    return total


def pitch_m(centres_m: Array) -> float:
    """Size of evenly spaced cells, m; 0 for one alone."""
    return float(np.median(np.diff(centres_m))) if centres_m.size > 1 else 0.0


def axis_cells(x_m: Array, y_m: Array) -> NDArray[np.bool_]:
    """The cell, or the equally near cells, at x = y = 0; shape (n_y, n_x)."""
    radius = np.hypot(*np.meshgrid(x_m, y_m))
    return np.asarray(radius <= radius.min() * (1 + 1e-6) + 1e-12)
