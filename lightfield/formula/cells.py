"""Cells of a plane: what a model shows in one, their size, and those on the axis."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.formula.own_formulas import on_path
from lightfield.formula.scattered.quadrature import Quadrature, finest_rad, interval
from lightfield.scene import Detector, Lamp, Scene
from lightfield.scene.lamp.section import section_widths
from lightfield.scene.receiver import half_view_rad

#: Points along a side of a cell where a field is smooth (Gauss-Legendre); where its edge is sharp (even ones)
#: at most so many, and so many to the radius of what a collimator sees of the lamp: right to 2 %. Chosen.
_SMOOTH, _MOST, _TO_AN_EDGE = 3, 80, 16
#: A Gaussian takes so many points for each of its standard deviations along a side, and two more, to 2e-4
#: (test_cells.py); inverse square and cosine are as smooth as one of this part of the distance.
_PER_WIDTH, _OF_DISTANCE = 1.15, 0.5
#: Along a side at least where a formula of the user's own acts, whose scale nobody knows: a dip a quarter of
#: a cell wide is right to 1 %.
_OF_FORMULAS = 12
#: Points of all cells of a plane, where that is more than `_MOST` along each side of each.
_MOST_POINTS = 4_000_000


def _gauss(n: int) -> Quadrature:
    """Gauss-Legendre nodes from -1/2 to 1/2 and their shares."""
    at, share = interval(n)
    return Quadrature(at - 0.5, share)


SMOOTH = _gauss(_SMOOTH)


def along_a_side(scene: Scene, z_m: float, pitch_m: float, cells: int) -> Quadrature:
    """Places along a side of a cell, from -1/2 to 1/2, that tell the mean of direct light on a plane.

    Parameters
    ----------
    scene : Scene
        Lamp and detector: a cell may be larger than the spot, or than the disc about the axis from which a
        collimator sees the lamp.
    z_m, pitch_m : float, m
        Distance of the plane, and the longer side of its cells.
    cells : int
        How many there are.
    """
    spot = pitch_m / _finest_m(scene.lamp, z_m)
    most = max(_MOST, math.isqrt(_MOST_POINTS // cells))
    least = _OF_FORMULAS if on_path(scene) else _SMOOTH
    smooth = int(np.clip(math.ceil(_PER_WIDTH * spot) + 2, least, max(most, least)))
    if (seen := _seen_m(scene.detector, z_m)) is None:
        return _gauss(smooth)
    edge = math.ceil(_TO_AN_EDGE * pitch_m / seen)
    if edge <= _SMOOTH:
        return _gauss(smooth)
    n = max(min(edge, _MOST), smooth)
    return Quadrature((np.arange(n) + 0.5) / n - 0.5, np.full(n, 1.0 / n))


def _finest_m(lamp: Lamp, z_m: float) -> float:
    """Standard deviation of the Gaussian that is as sharp as the light on a plane is, m."""
    away = z_m + lamp.apparent_distance_m
    if lamp.profile == "isotropic":
        return _OF_DISTANCE * away
    return away * min(math.tan(section_widths(lamp)[0] * finest_rad(lamp)), _OF_DISTANCE)


def _seen_m(detector: Detector, z_m: float) -> float | None:
    """Radius of the disc from which a collimator along the axis sees the lamp, m; None of other receivers."""
    if detector.quantity != "radiance" or detector.aim == "lamp":
        return None
    return z_m * math.tan(half_view_rad(detector))


def cell_mean(
    field: Callable[[Array, Array], Array],
    x_m: Array,
    y_m: Array,
    pitch_x_m: float,
    pitch_y_m: float,
    side: Quadrature = SMOOTH,
) -> Array:
    """A field averaged over every cell of a plane.

    Parameters
    ----------
    field : callable
        Of x and y, m, arrays of one shape (n, m); gives an array of shape (..., n, m).
    x_m, y_m : arrays, shape (n_x,) and (n_y,), m
        Centres of the cells.
    pitch_x_m, pitch_y_m : float, m
        Their size.
    side : Quadrature
        Places along each side, see `along_a_side`.

    Returns
    -------
    array, shape (..., n_y, n_x), unit of the field
    """
    across = np.add.outer(x_m, side.at * pitch_x_m).ravel()
    total: Array = np.zeros(1)
    for v, share in zip(*side, strict=True):
        light = field(*np.meshgrid(across, y_m + v * pitch_y_m))  # [..., n_y, n_x * n]
        total = total + share * (light.reshape(*light.shape[:-1], len(x_m), -1) @ side.weight)
    return total


def pitch_m(centres_m: Array) -> float:
    """Size of evenly spaced cells, m; 0 for one alone."""
    return float(np.median(np.diff(centres_m))) if centres_m.size > 1 else 0.0


def axis_cells(x_m: Array, y_m: Array) -> Mask:
    """The cell, or the equally near cells, at x = y = 0; shape (n_y, n_x)."""
    radius = np.hypot(*np.meshgrid(x_m, y_m))
    return np.asarray(radius <= radius.min() * (1 + 1e-6) + 1e-12)
