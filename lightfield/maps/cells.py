"""Cells of a plane: what a model shows in one, their size, and those on the axis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.formula.scattered.quadrature import in_cell
from lightfield.scene import Detector

#: A view from which on more is not told apart, degrees.
_WIDE_DEG = 60.0


#: Points along a side of a cell where a field is smooth (Gauss-Legendre); most of them, and so many to the
#: radius of what a collimator sees of the lamp, whose edge is sharp (even ones): right to 2 %. Chosen.
SMOOTH, _MOST, _TO_AN_EDGE = 3, 80, 16


def nodes_for(detector: Detector, z_m: float, pitch_m: float) -> int:
    """Points along a side of a cell for the direct light on a plane.

    A collimator along the axis sees the lamp from a disc about it alone, which may be smaller than a cell.
    """
    if detector.quantity != "radiance" or detector.aim == "lamp":
        return SMOOTH
    seen = z_m * np.tan(np.radians(min(0.5 * detector.full_angle_deg, _WIDE_DEG)))
    return int(np.clip(np.ceil(_TO_AN_EDGE * pitch_m / seen), SMOOTH, _MOST))


def cell_mean(
    field: Callable[[Array, Array], Array],
    x_m: Array,
    y_m: Array,
    pitch_x_m: float,
    pitch_y_m: float,
    nodes: int = SMOOTH,
) -> Array:
    """A field averaged over every cell of a plane.

    Parameters
    ----------
    field : callable
        Of x and y, m, arrays of shape (n_y, n_x); gives an array of shape (..., n_y, n_x).
    x_m, y_m : arrays, shape (n_x,) and (n_y,), m
        Centres of the cells.
    pitch_x_m, pitch_y_m : float, m
        Their size.
    nodes : int
        Along each side, see `nodes_for`.

    Returns
    -------
    array, shape (..., n_y, n_x), unit of the field
    """
    total: Array = np.zeros(1)
    for (u, v), weight in zip(*(in_cell(nodes) if nodes == SMOOTH else _evenly(nodes)), strict=True):
        total = total + weight * field(*np.meshgrid(x_m + u * pitch_x_m, y_m + v * pitch_y_m))
    return total


def _evenly(n: int) -> tuple[Array, Array]:
    """Middles of n x n equal parts of a square of side one about zero, shape (n^2, 2), and their shares."""
    at = (np.arange(n) + 0.5) / n - 0.5
    return np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2), np.full(n * n, n**-2.0)


def pitch_m(centres_m: Array) -> float:
    """Size of evenly spaced cells, m; 0 for one alone."""
    return float(np.median(np.diff(centres_m))) if centres_m.size > 1 else 0.0


def axis_cells(x_m: Array, y_m: Array) -> NDArray[np.bool_]:
    """The cell, or the equally near cells, at x = y = 0; shape (n_y, n_x)."""
    radius = np.hypot(*np.meshgrid(x_m, y_m))
    return np.asarray(radius <= radius.min() * (1 + 1e-6) + 1e-12)
