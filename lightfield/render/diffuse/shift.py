"""From cells to readings: the mean of a cell is not its middle, and the lamp may stand a little aside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from lightfield.arrays import TINY
from lightfield.render.diffuse.bending import TalliedCells, quadratic
from lightfield.render.diffuse.on_planes import on_planes
from lightfield.render.response.grid import Grid, cell_of
from lightfield.scene.tank import Tank

#: Light from walls varies over the distance to them, not over the width of the beam.
SMOOTH_WALLS = 11, 21, 0.25
#: The light at one g over that at another varies over more than the width of a beam, which is an angle.
SMOOTH_RATIOS = 7, 21, 0.095
#: The mean over a cell parts from its middle by no more than this; what says more is noise.
_MOST_BENT = 0.5
#: Cells of a larger relative error have no logarithm to rely on: its mean is half a per cent too small there,
#: and 4 % at three times as much.
_NOISY = 0.1


class ShiftParts(NamedTuple):
    """What `Shift.apply` works with, as plain arrays.

    Parameters
    ----------
    cell : array of int, shape (n_places,)
        Cell of each place.
    dx_m, dy_m : arrays, shape (n_places,), m
        Place from the middle of its cell.
    variance_x, variance_y : float, m^2
        Of a place within its cell.
    terms : sparse array, shape (6 * n_places, n_cells)
        Value, d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2 of the logarithm, one after the other.
    which : array of int, shape (k, n)
        Place of each reading; of a track two, before and behind it.
    weight : array, shape (k, n)
        Of the logarithm of light there, see `OnPlanes`.
    scale : array, shape (n,)
    """

    cell: NDArray[np.int_]
    dx_m: np.ndarray
    dy_m: np.ndarray
    variance_x: float
    variance_y: float
    terms: sparse.csr_array
    which: NDArray[np.int_]
    weight: np.ndarray
    scale: np.ndarray

    def at_readings(self, light: np.ndarray) -> np.ndarray:
        """From light at the places that of the readings, (..., n_places) to (..., n)."""
        return self.between(light) if len(self.which) == 1 else self.between(light) * self.scale

    def between(self, values: np.ndarray) -> np.ndarray:
        """The same of what does not fall with the distance."""
        if len(self.which) == 1:
            return np.asarray(values[..., self.which[0]])
        log = np.log(np.maximum(values, TINY))[..., self.which]
        return np.asarray(np.exp((log * self.weight).sum(axis=-2)))

    def quadratic(self, offset_x_m: float = 0.0, offset_y_m: float = 0.0) -> sparse.csr_array:
        """Weights of the cells in a field that is a quadratic about each place, shape (n_places, n_cells)."""
        dx, dy, one = self.dx_m - offset_x_m, self.dy_m - offset_y_m, np.ones_like(self.dx_m)
        curved = 0.5 * (dx * dx - self.variance_x), dx * dy, 0.5 * (dy * dy - self.variance_y)
        together = sparse.hstack([sparse.diags_array(f) for f in (one, dx, dy, *curved)], format="csr")
        return sparse.csr_array(together @ self.terms)

    def shares(self, offset_x_m: float, offset_y_m: float) -> sparse.csr_array:
        """See `Shift`; of light whose source stands at the offset."""
        at_places = self.quadratic(offset_x_m, offset_y_m)
        of_each = zip(self.weight, self.which, strict=True)
        return sum(sparse.diags_array(weight) @ at_places[which] for weight, which in of_each)

    def some(self, rows: np.ndarray) -> ShiftParts:
        """Of those places alone that some of the readings are at."""
        mine = self.which[:, rows]
        used, which = np.unique(mine, return_inverse=True)
        terms = self.terms[(np.arange(6)[:, None] * len(self.cell) + used).ravel()]
        return self._replace(
            cell=self.cell[used], dx_m=self.dx_m[used], dy_m=self.dy_m[used], terms=terms,
            which=which.reshape(mine.shape), weight=self.weight[:, rows], scale=self.scale[rows],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Shift:
    """Local quadratic expansion of the logarithm of a field over its cells (exact for a Gaussian beam).

    Neighbouring cells share their photons, the mean over a cell becomes the value in its middle, and the
    field is moved.

    Parameters
    ----------
    cell_y_m, cell_z_m : arrays, shape (n_cells,), m
    asked : int
        Number of readings, of which these may be `some`.
    parts : ShiftParts
        What it works with; readings of several colours at one place are moved alike.
    shares : sparse array, shape (n, n_cells)
        Relative errors of the readings from those of the cells.
    """

    cell_y_m: np.ndarray
    cell_z_m: np.ndarray
    asked: int
    parts: ShiftParts
    shares: sparse.csr_array

    @classmethod
    def on(
        cls,
        grid: Grid,
        x_m: np.ndarray,
        y_m: np.ndarray,
        z_m: np.ndarray,
        lamp_m: tuple[float, float] = (0.0, 0.0),
        tank: Tank | None = None,
    ) -> Shift:
        """From the cells of a grid, `surrounded` by those that tell how the light bends, to readings.

        Parameters
        ----------
        lamp_m : pair of float, m
            x and y of the lamp that lit the cells.
        tank : Tank, optional
            Around the readings of a track, see `on_planes`.
        """
        cells = TalliedCells(grid)
        number = np.full(grid.shape, -1)
        number[np.ones(grid.shape, bool) if grid.occupied is None else grid.occupied] = np.arange(cells.size)
        told = on_planes(grid.z_m, x_m, y_m, z_m, lamp_m, tank)
        places, which = np.unique(np.stack(told.places, axis=1), axis=0, return_inverse=True)
        x, y, z = places.T
        at = number[cell_of(grid, x, y, z)]
        # From the few cells around each place.
        of_cell = {i: cells.quadratic(i) for i in np.unique(at).tolist()}
        quadratics = [of_cell[i] for i in at.tolist()]
        near = np.concatenate([q.near for q in quadratics])
        row = np.repeat(np.arange(len(quadratics)), [len(q.near) for q in quadratics])
        weights = np.concatenate([q.weights for q in quadratics], axis=1)
        shape = len(quadratics), cells.size
        terms = sparse.vstack([sparse.csr_array((w, (row, near)), shape) for w in weights], format="csr")
        parts = ShiftParts(
            at, x - cells.x[at] + lamp_m[0], y - cells.y[at] + lamp_m[1],
            grid.pitch_x_m**2 / 12, grid.pitch_y_m**2 / 12, terms, which.reshape(told.weight.shape),
            told.weight, told.scale,
        )  # fmt: skip
        return cls(cells.y, cells.z, len(z_m), parts, parts.shares(0.0, 0.0))

    @property
    def cell(self) -> NDArray[np.int_]:
        """Cell of each reading; of a track the one before it, shape (n,)."""
        return np.asarray(self.parts.cell[self.parts.which[0]])

    def seen_from(self, offset_x_m: float, offset_y_m: float) -> Shift:
        """The same with `shares` of light whose source stands at the offset: slopes have more noise."""
        if not (offset_x_m or offset_y_m):
            return self
        return replace(self, shares=self.parts.shares(offset_x_m, offset_y_m))

    def apply(self, field: np.ndarray, offset_x_m: float = 0.0, offset_y_m: float = 0.0) -> np.ndarray:
        """Fields at the readings when their source stands at the offset, (..., n_cells) to (..., n).

        The mean over cells of a Gaussian is nearly a Gaussian, wider by the variance v of a place in a cell.
        Of slope g and bending k of its log those of the field itself are g / (1 + v k) and k / (1 + v k), and
        the middle is 1 / sqrt(1 + v k) exp(-v g^2 / (2 (1 + v k))) of the mean, along x and along y.
        """
        return self.parts.at_readings(self._at_places(field, offset_x_m, offset_y_m))

    def of_traced(self, mean: np.ndarray, stderr: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A field with the noise of photons at the readings, and its error, (n_cells,) to (n,) each.

        The mean of logarithms is less than the logarithm of the mean, by half the variance, and by no end
        where a cell was never hit: where cells are not known well the field itself is taken for a quadratic.
        """
        known = np.isfinite(stderr) & (mean > 0)
        error = np.where(known, stderr, 0.0)
        relative = np.divide(error, mean, out=np.zeros_like(mean), where=known)
        weights = self._unmoved
        unsure = np.asarray(abs(weights) @ (~known | (relative > _NOISY)).astype(float)) > 0
        squares = weights.power(2)
        plain = np.maximum(weights @ mean, 0.0), np.sqrt(squares @ error**2)
        bent = self._at_places(mean)
        value = np.where(unsure, plain[0], bent)
        error = np.where(unsure, plain[1], bent * np.sqrt(squares @ relative**2))
        if len(self.parts.which) == 1:
            return self.parts.at_readings(value), self.parts.between(error)
        light = self.parts.at_readings(value)
        relative = np.divide(error, value, out=np.zeros_like(value), where=value > 0)
        of_each = self.parts.weight * relative[self.parts.which]
        return light, light * np.sqrt((of_each**2).sum(axis=0))

    @cached_property
    def _unmoved(self) -> sparse.csr_array:
        """`ShiftParts.quadratic` of light whose source is where it was traced."""
        return self.parts.quadratic()

    def _at_places(self, field: np.ndarray, offset_x_m: float = 0.0, offset_y_m: float = 0.0) -> np.ndarray:
        """Fields at the places, (..., n_cells) to (..., n_places), see `apply`."""
        top = field.max(axis=-1, keepdims=True, initial=TINY)  # a colour may be dark
        log = np.log(np.maximum(field, 1e-6 * top))
        at, dx, dy, vx, vy, of_cells, *_ = self.parts
        terms = (of_cells @ log.reshape(-1, log.shape[-1]).T).T
        value, gx, gy, gxx, gxy, gyy = np.moveaxis(terms.reshape(*log.shape[:-1], 6, -1), -2, 0)
        ux, uy = (np.maximum(1 + v * k, 1 - _MOST_BENT) for v, k in ((vx, gxx), (vy, gyy)))
        middle = -0.5 * (np.log(ux * uy) + vx * gx * gx / ux + vy * gy * gy / uy)
        dx, dy = dx - offset_x_m, dy - offset_y_m
        change = (gx * dx + 0.5 * gxx * dx * dx) / ux + (gy * dy + 0.5 * gyy * dy * dy) / uy
        change += gxy * dx * dy / (ux * uy)
        here = field[..., at]
        lit = np.where(here > 1e-6 * top, np.exp(value), here)
        bent = np.exp(np.clip(middle, -_MOST_BENT, _MOST_BENT) + np.clip(change, -3, 3))
        return np.asarray(lit * bent)

    def some(self, rows: np.ndarray) -> Shift:
        """To some of the readings."""
        return replace(self, shares=self.shares[rows], parts=self.parts.some(rows))

    def pick(self, field: np.ndarray) -> np.ndarray:
        """Field of the cells of each reading, unshifted; shape (n,)."""
        return self.parts.between(field[self.parts.cell])


def smoother(grid: Grid, most_1d: int, most_2d: int, reach_rad: float = np.inf) -> sparse.csr_array:
    """Weights that replace every cell by a local quadratic through its neighbours on the plane, (n, n).

    Parameters
    ----------
    most_1d, most_2d : int
        So many neighbours, itself included, on planes that are read along a line or all over.
    reach_rad : float
        And none farther away, as seen from the lamp.
    """
    cx, cy, cz = (v.ravel() for v in grid.centres())
    on_plane = {z: np.flatnonzero(cz == z) for z in np.unique(cz).tolist()}
    near, weights = [], []
    for i, z in enumerate(cz.tolist()):
        cells, weight = _smoothed(cx, cy, on_plane[z], i, most_1d, most_2d, reach_rad * z)
        near.append(cells)
        weights.append(weight)
    ends = np.cumsum([0, *map(len, near)])
    out = sparse.csr_array((np.concatenate(weights), np.concatenate(near), ends), (len(cx), len(cx)))
    out.sort_indices()
    return out


def _smoothed(
    x: np.ndarray, y: np.ndarray, same: np.ndarray, i: int, most_1d: int, most_2d: int, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours of cell i, and their weights in the least-squares quadratic at it; with too few it stays."""
    most = most_1d if np.ptp(x[same]) == 0 or np.ptp(y[same]) == 0 else most_2d
    away = np.hypot(x[same] - x[i], y[same] - y[i])
    near = same[np.argsort(away, kind="stable")[: min(most, int((away <= reach).sum()))]]
    usable, weights = quadratic(tuple(np.round(x[near] - x[i], 9)), tuple(np.round(y[near] - y[i], 9)))
    if len(near) < len(usable):
        return np.array([i]), np.ones(1)
    return near, weights[0]
