"""Where light is tallied: detector cells in space, nodes over the direction of emission. No Mitsuba here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from lightfield.render.response.response import Reference
from lightfield.scene import Detector, Scene
from lightfield.scene.bands import middles_nm, molecular_share
from lightfield.scene.in_tank import cells_inside, rows_of_cells
from lightfield.scene.lamp.frame import beyond_window
from lightfield.scene.receiver import half_view_rad
from lightfield.scene.tank import Tank, walls_m
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m

#: Scattered light varies over the width of the beam, or in broad beams over a tenth of the distance, and over
#: the width of the tank: from these on cells are as large as asked for.
_BROAD_M, _BROAD_DEG, _ROOMY_M = 0.25, 5.7, 1.0
#: What a receiver that looks along the axis sees varies over the radius of its view at the lamp's distance:
#: from this one on cells are as large as asked for. Of 0.2 m they are half of it, and scattered light behind
#: collimators of 1 to 15 degrees is right to 1 % (tests/physics/light/test_collimator.py); at 0.7 of it to
#: 3 %.
_SEEN_M = 0.4
#: Of a tally of the flux vector: its components, and the irradiance of a plane that faces away from the lamp.
COMPONENTS = ("x", "y", "z", "back")
#: Cells of uneven positions, which are beside their middles, as a part of those of even ones.
_UNEVEN = 0.5
_SHORTEST_STEP_M = 0.02


@dataclass(frozen=True)
class Grid:
    """The same regular cells on every detector plane.

    Parameters
    ----------
    z_m : array, shape (n_planes,), m
    x_m, y_m : array, shape (n_x,) and (n_y,), m
        Ascending cell centres.
    pitch_x_m, pitch_y_m : float, m
    occupied : array of bool, shape (n_planes, n_y, n_x), optional
        Cells to tally; all when missing.
    merged : array of int, shape (n_planes, n_y, n_x), optional
        Number of the tally cell that a cell shares with its mirror images.
    inside : array, shape (n_y, n_x), optional
        Part of every cell that is in the tank; missing: all of all.
    fineness : float
        How much smaller than in a tow tank everything is, see `fineness`.
    even : bool
        Are what it is made for places in the middle of cells?
    """

    z_m: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    pitch_x_m: float
    pitch_y_m: float
    occupied: np.ndarray | None = None
    merged: np.ndarray | None = None
    inside: np.ndarray | None = None
    fineness: float = 1.0
    even: bool = True

    @property
    def shape(self) -> tuple[int, int, int]:
        """(n_planes, n_y, n_x)."""
        return len(self.z_m), len(self.y_m), len(self.x_m)

    def centres(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x, y, z of the tallied cells: shape (n_planes, n_y, n_x), or (n_occupied,) where only some are."""
        z, y, x = np.meshgrid(self.z_m, self.y_m, self.x_m, indexing="ij")
        return (x, y, z) if self.occupied is None else (x[self.occupied], y[self.occupied], z[self.occupied])

    def padded(self, cells: int, tank: Tank | None) -> Grid:
        """With more cells, none of them occupied, on every side, but in a tank only such as are all in it.

        What was occupied and is not all in the tank is left to the cells beside it.
        """
        assert self.occupied is not None
        more = np.arange(1, cells + 1)
        x, y = (
            np.concatenate([v[0] - pitch * more[::-1], v, v[-1] + pitch * more])
            for v, pitch in ((self.x_m, self.pitch_x_m), (self.y_m, self.pitch_y_m))
        )
        wide = ((0, 0), (cells, cells), (cells, cells))
        if tank is None:
            return replace(self, x_m=x, y_m=y, occupied=np.pad(self.occupied, wide))
        walls_x, walls_y, _ = tank.box_m
        first_x, last_x = _whole(x, self.pitch_x_m, *walls_x)
        first_y, last_y = _whole(y, self.pitch_y_m, *walls_y)
        x, y = x[first_x : last_x + 1], y[first_y : last_y + 1]
        inside = np.zeros((len(self.z_m), len(y), len(x)), bool)
        plane, row, column = np.argwhere(self.occupied).T
        row, column = row + cells - first_y, column + cells - first_x
        inside[plane, np.clip(row, 0, len(y) - 1), np.clip(column, 0, len(x) - 1)] = True
        return replace(self, x_m=x, y_m=y, occupied=inside)

    def in_water(self, values: np.ndarray) -> np.ndarray:
        """Means over whole cells, of light that is in the tank alone, as means over what of them is in it.

        Planes know only cells that are all in it: the others become NaN. Cells around listed positions are
        divided by their part inside.

        Parameters
        ----------
        values : array, shape (..., n_planes, n_y, n_x), or (..., n_occupied) where only some are tallied
        """
        if self.inside is None or (self.inside == 1).all():
            return values
        if self.occupied is None:
            return np.where(self.inside == 1, values, np.nan)
        part = np.broadcast_to(self.inside, self.shape)[self.occupied]
        return np.asarray(values / np.where(part > 0, part, 1).astype(values.dtype))


#: Rings and sectors of the directions of a beam.
_RINGS, _SECTORS = 20, 8


@dataclass(frozen=True)
class AngleNodes:
    """Nodes over the direction of emission: a tally kept on them can be reweighed to another beam.

    Rings are cubic B-splines with equal knots in t = asinh(theta / scale), even about the axis; sectors are
    equal steps of phi from 0 with linear interpolation.

    Parameters
    ----------
    scale_rad : float
        Below it rings are equally spaced in theta, beyond in log(theta).
    step : float
        Knot distance in t.
    n_theta, n_phi : int
        Rings and sectors; n_phi is even, so that x -> -x maps nodes on nodes.
    """

    scale_rad: float
    step: float
    n_theta: int
    n_phi: int

    @property
    def size(self) -> int:
        """Number of nodes; node number = i_theta n_phi + i_phi."""
        return self.n_theta * self.n_phi

    def mirrored(self, in_x: bool, in_y: bool) -> np.ndarray:
        """Nodes of the directions mirrored at x = 0, at y = 0, or at both, shape (size,)."""
        ring, sector = np.divmod(np.arange(self.size), self.n_phi)
        if in_x:
            sector = self.n_phi // 2 - sector
        if in_y:
            sector = -sector
        return np.asarray(ring * self.n_phi + sector % self.n_phi)


def cell_centres(width_m: float, cells: int) -> np.ndarray:
    """Centres of equal cells that fill a width, ascending, shape (cells,), m."""
    return (np.arange(cells) + 0.5) * (width_m / cells) - 0.5 * width_m


def scene_grid(scene: Scene) -> Grid:
    """The grid that the scene's [detector] asks for, knowing which part of its cells is in the tank."""
    return in_tank(detector_grid(scene), scene)


def detector_grid(scene: Scene) -> Grid:
    """Cells of the scene's [detector]; listed positions get cells of at most 0.1 m."""
    detector = scene.detector
    if detector.positions_m is not None:
        x, y, z = np.asarray(detector.positions_m, float).T
        return positions_grid(x, y, z, detector=detector)
    width, height = scene.plane_size_m
    columns, rows = detector.pixels, rows_of_cells(detector, scene.tank)
    x, y = cell_centres(width, columns), cell_centres(height, rows)
    return Grid(np.array(detector.planes_m, float), x, y, width / columns, height / rows)


def in_tank(grid: Grid, scene: Scene) -> Grid:
    """The grid, knowing which part of its cells is in the scene's tank."""
    inside = cells_inside(scene.tank, grid.x_m, grid.y_m, grid.pitch_x_m, grid.pitch_y_m)
    return replace(grid, inside=inside)


def fineness(
    z_m: np.ndarray, hwhm_deg: float = _BROAD_DEG, tank: Tank | None = None, detector: Detector | None = None
) -> float:
    """How much smaller than in a tow tank everything is: 1 for a beam of 3.2 degrees from 4.5 m on."""
    beam = np.min(z_m) * np.radians(min(hwhm_deg, _BROAD_DEG))
    room = min(tank.width_m, tank.depth_m) if tank else _ROOMY_M
    seen = np.min(z_m) * np.tan(half_view_rad(detector)) if detector else _SEEN_M
    return float(min(1.0, beam / _BROAD_M, room / _ROOMY_M, seen / _SEEN_M))


def positions_grid(
    x_m: np.ndarray,
    y_m: np.ndarray,
    z_m: np.ndarray,
    cell_m: float = 0.1,
    hwhm_deg: float = _BROAD_DEG,
    tank: Tank | None = None,
    most_even: int | None = None,
    detector: Detector | None = None,
) -> Grid:
    """Cells around listed positions: centred on them where they are evenly spaced, else the cells of a grid.

    Parameters
    ----------
    x_m, y_m, z_m : arrays, shape (n,), m
    cell_m : float, m
        Largest cell, where nothing is small, see `fineness`.
    hwhm_deg : float
        Half width of the beam.
    most_even : int, optional
        More even positions than this that lie closer than the cells of uneven ones are taken as uneven.
    detector : Detector, optional
        The receiver, whose view may be narrow.
    """
    planes = np.unique(np.round(z_m, 4))
    fine = fineness(planes, hwhm_deg, tank, detector)
    walls = walls_m(tank)

    def cells(shortest_m: float) -> Grid:
        even = all(_is_even(v, shortest_m) for v in (x_m, y_m))
        largest = fine * cell_m * (1.0 if even else _UNEVEN)
        (x, pitch_x), (y, pitch_y) = (_axis(v, largest, shortest_m) for v in (x_m, y_m))
        x, pitch_x = _off_the_walls(x, pitch_x, x_m, walls[0])
        y, pitch_y = _off_the_walls(y, pitch_y, y_m, walls[1])
        grid = Grid(planes, x, y, pitch_x, pitch_y, fineness=fine, even=even)
        occupied = np.zeros(grid.shape, bool)
        occupied[cell_of(grid, x_m, y_m, z_m)] = True
        return replace(grid, occupied=occupied)

    grid, coarse = cells(fine * _SHORTEST_STEP_M), fine * cell_m * _UNEVEN
    if most_even is None or not grid.even or np.count_nonzero(np.asarray(grid.occupied)) <= most_even:
        return grid
    return cells(coarse) if min(grid.pitch_x_m, grid.pitch_y_m) < coarse else grid


def cell_of(
    grid: Grid, x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plane, row and column of the cell nearest to each position, arrays of int, shape (n,)."""
    plane = np.abs(np.asarray(z_m)[:, None] - grid.z_m).argmin(axis=1)
    row = np.clip(
        np.round((np.asarray(y_m) - grid.y_m[0]) / grid.pitch_y_m).astype(int), 0, len(grid.y_m) - 1
    )
    column = np.clip(
        np.round((np.asarray(x_m) - grid.x_m[0]) / grid.pitch_x_m).astype(int), 0, len(grid.x_m) - 1
    )
    return plane, row, column


def _is_even(values: np.ndarray, shortest_m: float) -> bool:
    """Are places along one axis whole steps apart? Steps shorter than the shortest are no even spacing."""
    gaps = np.diff(np.unique(np.round(values, 4)))
    if len(gaps) == 0:
        return True
    steps = gaps / gaps.min()
    return bool(gaps.min() >= shortest_m and np.allclose(steps, np.round(steps), atol=0.02))


def _axis(values: np.ndarray, cell_m: float, shortest_m: float) -> tuple[np.ndarray, float]:
    """Cell centres along one axis and their pitch."""
    places = np.unique(np.round(values, 4))
    if len(places) == 1:
        return places, cell_m
    even, gap = _is_even(values, shortest_m), np.diff(places).min()
    pitch = float(gap / ceil(gap / cell_m - 1e-6)) if even else cell_m
    count = round((places[-1] - places[0]) / pitch) + (1 if even else 2)
    return 0.5 * (places[0] + places[-1]) + (np.arange(count) - 0.5 * (count - 1)) * pitch, pitch


def _off_the_walls(
    centres: np.ndarray, pitch: float, places: np.ndarray, walls: tuple[float, float]
) -> tuple[np.ndarray, float]:
    """Rows of cells for one or two places, of which a wall would cut an outer one, moved to lie along it.

    Rows for more places stay as they are: those beside an outer one tell of the light there.

    Of a lone place near a wall, or in a corner, the light is then known from a cell that it lies in.

    Returns
    -------
    centres : array, m
    pitch : float, m
    """
    low, high = walls[0] + 0.5 * pitch, walls[1] - 0.5 * pitch
    if len(np.unique(np.round(places, 4))) > 2 or low > high:
        return centres, pitch
    if centres[0] < low and centres[-1] > high:
        width = walls[1] - walls[0]
        pitch = width / ceil(width / pitch - 1e-6)
        return np.arange(walls[0] + 0.5 * pitch, walls[1], pitch), pitch
    return centres + max(low - centres[0], 0.0) + min(high - centres[-1], 0.0), pitch


def _whole(centres: np.ndarray, pitch: float, low: float, high: float) -> tuple[int, int]:
    """First and last of the cells that are all between two walls; of all cells for places in no tank."""
    inside = np.flatnonzero((centres - 0.5 * pitch >= low - 1e-6) & (centres + 0.5 * pitch <= high + 1e-6))
    return (int(inside[0]), int(inside[-1])) if len(inside) else (0, len(centres) - 1)


def angle_nodes(hwhm_deg: float) -> AngleNodes:
    """Nodes dense over the core of a beam and sparse out to 70 degrees, for skirts and wide beams."""
    scale = np.radians(1.5 * hwhm_deg)
    step = float(np.arcsinh(np.radians(70.0) / scale) / (_RINGS - 2))
    return AngleNodes(float(scale), step, _RINGS, _SECTORS)


def reference_of(scene: Scene) -> Reference:
    """Reference to trace in: least absorption and most scattering of the scene's bands, its own walls."""
    wavelengths = middles_nm(scene).ravel()
    return Reference(
        float(np.min(absorption_per_m(scene.water, wavelengths))),
        float(np.max(scattering_per_m(scene.water, wavelengths))),
        *scene.reflectances,
        molecular_share(scene),
    )


def straight_path(scene: Scene, grid: Grid, nearest: bool = False) -> np.ndarray:
    """Path in water of the straight line from the lamp to each cell, shape of `grid.centres()`, m.

    Parameters
    ----------
    nearest : bool
        From the nearest point of the window to that of the cell, see `Planes`; else between their middles.
    """
    x, y, z = grid.centres()
    lamp = scene.lamp
    behind = lamp.apparent_distance_m
    aside_x, aside_y = np.abs(x - lamp.offset_x_m), np.abs(y - lamp.offset_y_m)
    if nearest:
        aside_x = np.maximum(aside_x - 0.5 * grid.pitch_x_m, 0)
        aside_y = np.maximum(aside_y - 0.5 * grid.pitch_y_m, 0)
    aside = np.maximum(np.hypot(aside_x, aside_y) - (lamp.radius_m if nearest else 0.0), 0)
    return np.asarray(beyond_window(np.hypot(aside, z + behind), z, behind))
