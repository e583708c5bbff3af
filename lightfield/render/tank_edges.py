"""Where the edges of a tank are in a camera's view: black walls in the dark show nothing of it."""

from __future__ import annotations

from itertools import product
from math import radians, tan

import numpy as np

from lightfield.arrays import Array
from lightfield.scene.tank import Tank

#: Half width of a line, pixels, and the least depth before the eye that is drawn, m (chosen).
_HALF_LINE, _NEAREST_M = 0.6, 0.02


def edges_in_view(tank: Tank, eye: Array, target: Array, view_deg: float, size: tuple[int, int]) -> Array:
    """How much of every pixel is a line along an edge of the water, 0 to 1, shape (height, width).

    Parameters
    ----------
    eye, target : array, shape (3,), m
        From where, and to where one looks, +y up.
    view_deg : float
        Horizontal angle of view, full.
    size : (int, int)
        Width and height, pixels.
    """
    width, height = size
    ahead = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    left = np.cross([0.0, 1.0, 0.0], ahead)
    left /= np.linalg.norm(left)
    axes = np.array([left, np.cross(ahead, left), ahead])
    row, column = np.mgrid[:height, :width] + 0.5
    found = np.zeros((height, width))
    for ends in _edges(tank):
        seen = (ends - eye) @ axes.T
        if seen[:, 2].max() <= _NEAREST_M:
            continue
        near, far = seen[np.argsort(seen[:, 2])]
        if near[2] < _NEAREST_M:
            near = near + (_NEAREST_M - near[2]) / (far[2] - near[2]) * (far - near)
        scale = 0.5 * width / tan(radians(0.5 * view_deg))
        (x, y), (to_x, to_y) = ((0.5 * width - scale * p[0] / p[2], 0.5 * height - scale * p[1] / p[2])
                                for p in (near, far))  # fmt: skip
        along = np.array([to_x - x, to_y - y])
        part = ((column - x) * along[0] + (row - y) * along[1]) / max(float(along @ along), 1e-12)
        part = np.clip(part, 0.0, 1.0)
        away = np.hypot(column - x - part * along[0], row - y - part * along[1])
        found = np.maximum(found, np.clip(_HALF_LINE + 0.5 - away, 0.0, 1.0))
    return found


def _edges(tank: Tank) -> list[Array]:
    """Both ends of the twelve edges of a box, shape (2, 3) each, m."""
    corners = np.array(list(product(*tank.box_m)))
    pairs = ((a, b) for k, a in enumerate(corners) for b in corners[k + 1 :])
    return [np.array([a, b]) for a, b in pairs if (a != b).sum() == 1]
