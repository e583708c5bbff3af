"""From cells to readings: the mean of a cell is not its middle, and the lamp may stand a little aside."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import sparse

from lightfield.render.response.grid import Grid, cell_of, nearness

NEIGHBOURS_1D, NEIGHBOURS_2D = 5, 9
#: Light from walls varies over the distance to them, not over the width of the beam.
SMOOTH_WALLS = 11, 21
#: The light at one g over that at another varies over more than the width of a beam, which is an angle.
SMOOTH_RATIOS = 7, 21, 0.095
#: Cells this near to each other are smoothed together, far from the lamp.
SMOOTHED_M = 0.11


class Shift:
    """Local quadratic expansion of the logarithm of a field over its cells (exact for a Gaussian beam).

    Neighbouring cells share their photons, the mean over a cell becomes the value in its middle, and the
    field is moved.

    Parameters
    ----------
    grid : Grid
        With occupied cells.
    x_m, y_m, z_m : arrays, shape (n,), m
        Positions of the readings, each near an occupied cell.
    """

    def __init__(self, grid: Grid, x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray) -> None:
        cx, cy, cz = (v.ravel() for v in grid.centres())
        number = np.full(grid.shape, -1)
        number[np.ones(grid.shape, bool) if grid.occupied is None else grid.occupied] = np.arange(len(cx))
        self.cell = number[cell_of(grid, x_m, y_m, z_m)]
        self.cell_z_m = cz
        # Readings of several colours at one place are moved alike.
        places = np.stack([x_m, y_m, z_m], axis=1)
        _, one_each, which = np.unique(places, axis=0, return_index=True, return_inverse=True)
        self._which = which.ravel()
        self._cell = self.cell[one_each]
        self.dx, self.dy = x_m[one_each] - cx[self._cell], y_m[one_each] - cy[self._cell]
        self.pitch_m = grid.pitch_x_m, grid.pitch_y_m
        n = len(cx)
        # Of d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2 of the log field at each cell: weights of all cells.
        derivatives = np.zeros((5, n, n))
        self.smooth = np.eye(n)
        smoothed = SMOOTHED_M * nearness(grid.z_m)
        for i in range(n):
            near, terms, weights = _expansion(cx, cy, cz, i, NEIGHBOURS_1D, NEIGHBOURS_2D)
            for row, term in zip(weights[1:], terms[1:] - 1, strict=True):
                derivatives[term, i, near] = row
            apart = np.maximum(np.abs(cx[near] - cx[i]), np.abs(cy[near] - cy[i]))
            beside = np.count_nonzero(apart <= smoothed)
            if beside > 2 and apart.max() <= 2 * smoothed:
                self.smooth[i] = 0.0
                self.smooth[i, near] = weights[0]
        # Straight to the readings, from the few cells around each.
        self._expansion = sparse.csr_array(np.vstack([d[self._cell] for d in (*derivatives, self.smooth)]))
        # Readings along one line through the axis do not show the curvature across it: that of a round field.
        self.across: int | None = None
        if np.ptp(cy) == 0 and np.abs(cy).max() < 1e-6:
            self.across = 1
        elif np.ptp(cx) == 0 and np.abs(cx).max() < 1e-6:
            self.across = 0
        self.radius_m = (cx if self.across == 1 else cy)[self._cell]

    def apply(self, field: np.ndarray, offset_x_m: float = 0.0, offset_y_m: float = 0.0) -> np.ndarray:
        """Fields at the readings when their source stands at the offset, (..., n_cells) to (..., n)."""
        top = field.max(axis=-1, keepdims=True, initial=1e-300)  # a colour may be dark
        log = np.log(np.maximum(field, 1e-6 * top))
        expanded = (self._expansion @ log.reshape(-1, log.shape[-1]).T).T
        *slopes, smooth = np.moveaxis(expanded.reshape(*log.shape[:-1], 6, -1), -2, 0)
        here = field[..., self._cell]
        middle = np.where(here > 1e-6 * top, np.exp(smooth), here) / self._mean_over_middle(slopes)
        gx, gy, gxx, gxy, gyy = slopes
        dx, dy = self.dx - offset_x_m, self.dy - offset_y_m
        change = gx * dx + gy * dy + 0.5 * gxx * dx * dx + gxy * dx * dy + 0.5 * gyy * dy * dy
        return np.asarray((middle * np.exp(np.clip(change, -3, 3)))[..., self._which])

    def _mean_over_middle(self, slopes: list[np.ndarray]) -> np.ndarray:
        """Mean of the field over each reading's cell, relative to its middle: 1 + h^2/24 f''/f along both
        edges."""
        gx, gy, gxx, _, gyy = slopes
        if self.across is not None:
            along, second = (gx, gxx) if self.across == 1 else (gy, gyy)
            off = np.abs(self.radius_m) > 0.6 * min(self.pitch_m)
            curvature = np.where(off, along / np.where(off, self.radius_m, 1.0), second)
            gxx, gyy = (gxx, curvature) if self.across == 1 else (curvature, gyy)
        hx, hy = self.pitch_m
        mean = 1 + (hx * hx * (gxx + gx * gx) + hy * hy * (gyy + gy * gy)) / 24
        return np.asarray(np.clip(mean, 0.8, 1.25))

    def spread(self, relative: np.ndarray, which: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Relative errors of the readings, or of some, from those of the cells, (n_cells, k) to (n, k)."""
        return np.asarray((self.smooth @ relative)[self.cell[which]])

    def pick(self, field: np.ndarray) -> np.ndarray:
        """Field of the cell of each reading, unshifted; shape (n,)."""
        return np.asarray(field[self.cell])


def smoother(grid: Grid, most_1d: int, most_2d: int, reach_rad: float = np.inf) -> np.ndarray:
    """Weights that replace every cell by a local quadratic through its neighbours on the plane, (n, n).

    Parameters
    ----------
    most_1d, most_2d : int
        So many neighbours, itself included, on planes that are read along a line or all over.
    reach_rad : float
        And none farther away, as seen from the lamp.
    """
    cx, cy, cz = (v.ravel() for v in grid.centres())
    weights = np.zeros((len(cx), len(cx)))
    for i in range(len(cx)):
        near, _, rows = _expansion(cx, cy, cz, i, most_1d, most_2d, reach_rad * cz[i])
        weights[i, near] = rows[0]
    return weights


def _expansion(
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    i: int,
    most_1d: int,
    most_2d: int,
    reach: float = np.inf,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least-squares quadratic about cell i: neighbours, terms (of 1, x, y, xx/2, xy, yy/2), weights.

    A cell with too few neighbours is expanded to a constant.
    """
    same = np.flatnonzero(z == z[i])
    most = most_1d if np.ptp(x[same]) == 0 or np.ptp(y[same]) == 0 else most_2d
    away = np.hypot(x[same] - x[i], y[same] - y[i])
    near = same[np.argsort(away, kind="stable")[: min(most, int((away <= reach).sum()))]]
    usable, weights = _quadratic(tuple(np.round(x[near] - x[i], 9)), tuple(np.round(y[near] - y[i], 9)))
    if len(near) < len(usable):
        return np.array([i]), usable[:1], np.ones((1, 1))
    return near, usable, weights


@lru_cache(maxsize=1024)
def _quadratic(dx: tuple[float, ...], dy: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Terms that neighbours at these places tell, and their weights; cells lie alike over most of a plane."""
    x, y = np.array(dx), np.array(dy)
    terms = np.stack([np.ones_like(x), x, y, 0.5 * x * x, x * y, 0.5 * y * y], axis=1)
    usable = np.flatnonzero(np.linalg.norm(terms, axis=0) > 1e-12)
    return usable, np.linalg.pinv(terms[:, usable])
