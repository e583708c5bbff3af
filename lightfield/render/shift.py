"""From cells to readings: the field of a lamp that stands a little aside, a reading beside its cell."""

from __future__ import annotations

import numpy as np

from lightfield.render.grid import Grid, cell_of

NEIGHBOURS_1D, NEIGHBOURS_2D = 5, 9
WIDE_1D, WIDE_2D = 11, 21


class Shift:
    """Local quadratic expansion of the logarithm of a field over its cells (exact for a Gaussian beam).

    Parameters
    ----------
    grid : Grid
        With occupied cells.
    x_m, y_m, z_m : arrays, shape (n,), m
        Positions of the readings, each near an occupied cell.
    """

    def __init__(self, grid: Grid, x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray) -> None:
        cx, cy, cz = grid.centres()
        cx, cy, cz = cx.ravel(), cy.ravel(), cz.ravel()
        number = np.full(grid.shape, -1)
        number[np.ones(grid.shape, bool) if grid.occupied is None else grid.occupied] = np.arange(len(cx))
        self.cell = number[cell_of(grid, x_m, y_m, z_m)]
        self.cell_z_m = cz
        self.dx, self.dy = x_m - cx[self.cell], y_m - cy[self.cell]
        n = len(cx)
        # Rows: d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2 of the log field at each cell, as weights of all cells.
        self.derivatives = np.zeros((5, n, n))
        for i in range(n):
            near, terms, weights = _expansion(cx, cy, cz, i, NEIGHBOURS_1D, NEIGHBOURS_2D)
            for row, term in zip(weights[1:], terms[1:] - 1, strict=True):
                self.derivatives[term, i, near] = row

    def apply(self, field: np.ndarray, offset_x_m: float = 0.0, offset_y_m: float = 0.0) -> np.ndarray:
        """Field at the readings, when its source stands at (offset_x, offset_y); shape (n,)."""
        dx, dy = self.dx - offset_x_m, self.dy - offset_y_m
        if not dx.any() and not dy.any():
            return np.asarray(field[self.cell])
        floor = 1e-6 * np.abs(field).max() + 1e-300
        log = np.log(np.maximum(field, floor))
        gx, gy, gxx, gxy, gyy = (d[self.cell] @ log for d in self.derivatives)
        change = gx * dx + gy * dy + 0.5 * gxx * dx * dx + gxy * dx * dy + 0.5 * gyy * dy * dy
        return np.asarray(field[self.cell] * np.exp(np.clip(change, -3, 3)))

    def pick(self, field: np.ndarray) -> np.ndarray:
        """Field of the cell of each reading, unshifted; shape (n,)."""
        return np.asarray(field[self.cell])


def smoother(grid: Grid) -> np.ndarray:
    """Weights that replace every cell by a local quadratic through its neighbours on the plane, (n, n).

    For light that varies over the distance to the walls, not over the width of the beam.
    """
    cx, cy, cz = (v.ravel() for v in grid.centres())
    weights = np.zeros((len(cx), len(cx)))
    for i in range(len(cx)):
        near, _, rows = _expansion(cx, cy, cz, i, WIDE_1D, WIDE_2D)
        weights[i, near] = rows[0]
    return weights


def _expansion(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, i: int, most_1d: int, most_2d: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least-squares quadratic about cell i: neighbours, terms (of 1, x, y, xx/2, xy, yy/2), weights.

    A cell with too few neighbours is expanded to a constant.
    """
    same = np.flatnonzero(z == z[i])
    most = most_1d if np.ptp(x[same]) == 0 or np.ptp(y[same]) == 0 else most_2d
    near = same[np.argsort(np.hypot(x[same] - x[i], y[same] - y[i]), kind="stable")[:most]]
    dx, dy = x[near] - x[i], y[near] - y[i]
    terms = np.stack([np.ones_like(dx), dx, dy, 0.5 * dx * dx, dx * dy, 0.5 * dy * dy], axis=1)
    usable = np.flatnonzero(np.linalg.norm(terms, axis=0) > 1e-12)
    if len(near) < len(usable):
        return np.array([i]), usable[:1], np.ones((1, 1))
    return near, usable, np.linalg.pinv(terms[:, usable])
