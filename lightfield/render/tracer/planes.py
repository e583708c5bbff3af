"""Detector planes inside the photon walk: where a flight crosses one, in which cell, with which response.

A receiver that does not face along the tank weighs a crossing by 1 / |cos|, whose variance has no bound:
light that grazes the plane is rare and heavy. For such receivers a plane is a thin slab, and a flight counts
by its length in it, at a point of that length chosen at random (track-length estimator; Spanier and Gelbard
1969, Monte Carlo Principles and Neutron Transport Problems, ch. 2): the same mean, a variance that exists.
"""

from __future__ import annotations

from math import inf, log, pi, radians
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.render.response.grid import COMPONENTS, Grid
from lightfield.scene import Detector
from lightfield.scene.lamp.frame import beyond_window
from lightfield.scene.receiver import looks_aside, tilted_axis

OPEN_WATER_REACH = 12.0  # light is not followed beyond this many times the farthest cell's distance
#: Thickness of the slab, as a part of the distance: the mean of the inverse square over it is 1e-4 too large.
_SLAB = 0.02
#: The same of a plane at an end wall, before which the slab lies.
_THINNEST = 2e-4
#: A plane may lie at the end wall: light on its way there is not lost to the rounding of its way.
_AT_THE_WALL = 1 + 1e-5


class Crossing(NamedTuple):
    """A flight meets a plane: how far on, in which cell, and in which cell its mirror image at -x does.

    `per_depth` is the path per unit of depth, which makes power through the plane the sum over directions.
    """

    distance: mi.Float
    x: mi.Float
    y: mi.Float
    z: mi.Float
    hits: mi.Bool
    cell: mi.UInt32
    mirror_hits: mi.Bool
    mirror_cell: mi.UInt32
    per_depth: mi.Float


class Planes:
    """Parallel detector planes facing the lamp, all divided into the same grid of cells.

    Parameters
    ----------
    receiver : Detector
        Its response to directions; where it is, the grid says.
    lamp_position_m : tuple of 3 floats, m
        Where the straight line to a cell starts (window centre).
    apparent_distance_m : float, m
        How far behind the window the light seems to come from.
    ends_m : tuple of 2 floats, m
        Where the water begins and ends in z: no slab reaches beyond.
    whole_cells : bool
        Straight lines lead from the nearest point of the window to that of a cell, which makes its mean right
        in any other water; else between the very points, for cells that are asked for light at their middle.
    window_m : float, m
        Radius of the window, for those of whole cells.
    """

    def __init__(
        self,
        grid: Grid,
        receiver: Detector,
        lamp_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        apparent_distance_m: float = 0.0,
        ends_m: tuple[float, float] = (-inf, inf),
        whole_cells: bool = False,
        window_m: float = 0.0,
    ) -> None:
        self.receiver, self.whole_cells = receiver, whole_cells
        every = np.ones(grid.shape, bool) if grid.occupied is None else grid.occupied
        self.cells = int(every.sum())
        number = np.where(every, np.cumsum(every).reshape(every.shape) - 1, self.cells)
        self.images: np.ndarray | None = None  # how many cells of the grid each cell of the tally stands for
        if grid.merged is not None:
            number, self.images = grid.merged, np.bincount(grid.merged.ravel())
            self.cells = len(self.images)
        self.row_length = self.component_length = dr.opaque(mi.UInt32, self.cells)
        self.lookup = mi.UInt32(number.ravel())
        self.listed = mi.UInt32(np.flatnonzero(number.ravel() < self.cells))  # cells of the grid that count
        # In variables, not literals: another layout needs no new kernel.
        self.count, self._n_y, self._n_x, self._n_cells = (
            dr.opaque(mi.UInt32, n) for n in (*grid.shape, self.cells)
        )
        self.z, self.nearest_m = mi.Float(grid.z_m), float(grid.z_m.min())
        self.first_x = _opaque(grid.x_m[0] - 0.5 * grid.pitch_x_m)
        self.first_y = _opaque(grid.y_m[0] - 0.5 * grid.pitch_y_m)
        self.per_x, self.per_y = _opaque(1 / grid.pitch_x_m), _opaque(1 / grid.pitch_y_m)
        self.pitch_m, self.cell_m2 = max(grid.pitch_x_m, grid.pitch_y_m), grid.pitch_x_m * grid.pitch_y_m
        self.per_area = _opaque(1 / (grid.pitch_x_m * grid.pitch_y_m))
        room = 2 * np.minimum(grid.z_m - ends_m[0], ends_m[1] - grid.z_m)
        thickness = np.clip(_SLAB * grid.z_m, 0, np.maximum(room, _THINNEST * grid.z_m))
        self.thickness = mi.Float(thickness)
        self.slab_z = mi.Float(np.clip(grid.z_m, ends_m[0] + 0.5 * thickness, ends_m[1] - 0.5 * thickness))
        self.last = _opaque((grid.z_m + 0.5 * thickness).max())
        self.reach = _opaque(open_water_m(grid))
        self.lamp = [_opaque(v) for v in lamp_position_m]
        self.apparent, self.window = _opaque(apparent_distance_m), _opaque(window_m)
        self.acceptance_hwhm = _opaque(radians(receiver.acceptance_hwhm_deg))
        self.cosine_error = _opaque(receiver.cosine_error)
        x, _, z = tilted_axis(receiver)
        self.axis = mi.Vector3f(_opaque(x), 0.0, _opaque(z))
        # A receiver that is turned away from the axis sees some of the light that flies back to the lamp.
        self.is_slab = receiver.quantity == "scalar_irradiance" or looks_aside(receiver)

    def crossing(
        self,
        plane: mi.UInt32,
        position: mi.Point3f,
        direction: mi.Vector3f,
        reach: mi.Float,
        mirror: bool,
        u: mi.Float,
    ) -> Crossing:
        """Where a flight from `position` along `direction`, at most `reach` long, meets a plane.

        `u` is a uniform number, which a slab asks for.
        """
        z, reach = dr.gather(mi.Float, self.slab_z if self.is_slab else self.z, plane), reach * _AT_THE_WALL
        if self.is_slab:
            distance, per_depth = self._in_slab(plane, z, position, direction, reach, u)
            meets = per_depth > 0
            z = dr.fma(direction.z, distance, position.z)
        else:
            distance, per_depth = (z - position.z) / direction.z, dr.rcp(dr.maximum(direction.z, 1e-3))
            meets = (distance > 0) & (distance < reach) & (direction.z > 0)
        x, y = dr.fma(direction.x, distance, position.x), dr.fma(direction.y, distance, position.y)
        hits, cell = self._cell(plane, x, y, meets)
        mirror_hits, mirror_cell = self._cell(plane, -x, y, meets) if mirror else (mi.Bool(False), cell)
        return Crossing(distance, x, y, z, hits, cell, mirror_hits, mirror_cell, per_depth)

    def _in_slab(
        self,
        plane: mi.UInt32,
        z: mi.Float,
        position: mi.Point3f,
        direction: mi.Vector3f,
        reach: mi.Float,
        u: mi.Float,
    ) -> tuple[mi.Float, mi.Float]:
        """A point of a flight's part in a slab, and the length of that part per thickness."""
        thickness = dr.gather(mi.Float, self.thickness, plane)
        steep = dr.select(dr.abs(direction.z) > 1e-6, direction.z, 1e-6)
        middle, half = (z - position.z) / steep, 0.5 * thickness / dr.abs(steep)
        enters, leaves = dr.maximum(middle - half, 0), dr.minimum(middle + half, reach)
        inside = dr.maximum(leaves - enters, 0)
        return dr.fma(u, inside, enters), inside / thickness

    def place(self, number: mi.UInt32, u: mi.Float, v: mi.Float) -> tuple[mi.Point3f, mi.UInt32]:
        """A place in a cell of the grid, by its number and two uniform numbers; and the cell of the tally."""
        row, column = number // self._n_x, number % self._n_x
        x = self.first_x + (mi.Float(column) + u) / self.per_x
        y = self.first_y + (mi.Float(row % self._n_y) + v) / self.per_y
        z = dr.gather(mi.Float, self.z, row // self._n_y)
        return mi.Point3f(x, y, z), dr.gather(mi.UInt32, self.lookup, number)

    def first_crossing(
        self, plane: mi.UInt32, start: mi.Point3f, direction: mi.Vector3f, reach: mi.Float, mirror: bool
    ) -> Crossing:
        """Where light from the window meets a plane, which is no slab for it; see `crossing`."""
        z = dr.gather(mi.Float, self.z, plane)
        distance = z / direction.z
        place = mi.Point3f(dr.fma(direction.x, distance, start.x), dr.fma(direction.y, distance, start.y), z)
        met = self.straight_to(place, mi.UInt32(0), direction, reach)
        hits, cell = self._cell(plane, place.x, place.y, met.hits)
        mirror_hits, mirror_cell = (
            self._cell(plane, -place.x, place.y, met.hits) if mirror else (mi.Bool(False), cell)
        )
        return met._replace(hits=hits, cell=cell, mirror_hits=mirror_hits, mirror_cell=mirror_cell)

    def straight_to(
        self, place: mi.Point3f, cell: mi.UInt32, direction: mi.Vector3f, reach: mi.Float
    ) -> Crossing:
        """The crossing at a place of a flight from the window that leads there, where `reach` is so far."""
        distance, per_depth = place.z / direction.z, dr.rcp(dr.maximum(direction.z, 1e-3))
        hits = (distance < reach * _AT_THE_WALL) & (direction.z > 0)
        return Crossing(distance, place.x, place.y, place.z, hits, cell, mi.Bool(False), cell, per_depth)

    def reading(self, crossing: Crossing, direction: mi.Vector3f) -> tuple[tuple[mi.Float, ...], mi.Float]:
        """Receiver's responses to unit power, 1/m^2 (1/m^2/sr), and the straight path from the lamp, m.

        There is one response; a receiver of several components has its tally once for each.
        """
        z = crossing.z
        to_lamp = mi.Vector3f(self.lamp[0] - crossing.x, self.lamp[1] - crossing.y, self.lamp[2] - z)
        response = self._response(direction, to_lamp, crossing.per_depth)
        aside = mi.Vector2f(to_lamp.x, to_lamp.y)
        if self.whole_cells:
            aside.x = self._to_cell(crossing.x, self.lamp[0], self.first_x, self.per_x)
            aside.y = self._to_cell(crossing.y, self.lamp[1], self.first_y, self.per_y)
            aside = mi.Vector2f(dr.maximum(dr.norm(aside) - self.window, 0), 0)
        full = dr.norm(mi.Vector3f(aside.x, aside.y, to_lamp.z - self.apparent))
        return (response * self.per_area,), beyond_window(full, z, self.apparent)

    @staticmethod
    def _to_cell(at: mi.Float, lamp: mi.Float, first: mi.Float, per: mi.Float) -> mi.Float:
        """From the lamp to the nearest point of the cell around a place, along one axis."""
        low = dr.fma(dr.floor((at - first) * per), dr.rcp(per), first)
        return dr.maximum(dr.maximum(low - lamp, lamp - low - dr.rcp(per)), 0)

    def _cell(self, plane: mi.UInt32, x: mi.Float, y: mi.Float, meets: mi.Bool) -> tuple[mi.Bool, mi.UInt32]:
        ny, nx = mi.Float(self._n_y), mi.Float(self._n_x)
        column, row = dr.floor((x - self.first_x) * self.per_x), dr.floor((y - self.first_y) * self.per_y)
        on_grid = meets & (row >= 0) & (row < ny) & (column >= 0) & (column < nx)
        in_row, in_column = mi.UInt32(dr.clip(row, 0, ny - 1)), mi.UInt32(dr.clip(column, 0, nx - 1))
        at = (plane * self._n_y + in_row) * self._n_x + in_column
        cell = dr.gather(mi.UInt32, self.lookup, at, on_grid)
        return on_grid & (cell < self._n_cells), cell

    def _response(self, direction: mi.Vector3f, to_lamp: mi.Vector3f, across: mi.Float) -> mi.Float:
        """Weight of a crossing: what the receiver makes of power through the plane; `across` is 1 / |cos|."""
        receiver = self.receiver
        axis = dr.normalize(to_lamp) if receiver.aim == "lamp" else self.axis
        facing = -dr.dot(direction, axis)
        if receiver.quantity == "scalar_irradiance":
            return across
        if receiver.quantity == "radiance":
            half = 0.5 * radians(receiver.full_angle_deg)
            solid_angle = 2 * pi * 2 * np.sin(0.5 * half) ** 2
            # |d + axis|^2 = 2 (1 - cos psi), exact at small angles where 1 - cos rounds away.
            inside = dr.squared_norm(direction + axis) < 4 * np.sin(0.5 * half) ** 2
            return dr.select(inside, across / solid_angle, 0)
        response = across * dr.maximum(facing, 0) if looks_aside(receiver) else mi.Float(1)
        if receiver.cosine_error != 0:
            response *= 1 + 2 * self.cosine_error * (1 - dr.maximum(facing, 0))
        if receiver.acceptance_hwhm_deg > 0:
            psi = 2 * dr.asin(dr.minimum(0.5 * dr.norm(direction + axis), 1))
            ratio = psi / self.acceptance_hwhm
            response *= dr.exp(-log(2) * ratio * ratio)
        return response

    def point_response(self, direction: mi.Vector3f, to_lamp: mi.Vector3f) -> mi.Float:
        """Reading of a point receiver in light of unit normal irradiance from `direction`."""
        cosine = dr.maximum(dr.abs(direction.z), 1e-3)
        return self._response(direction, to_lamp, dr.rcp(cosine)) * cosine

    def way_out(self, position: mi.Point3f, direction: mi.Vector3f) -> mi.Float:
        """Distance after which a flight in open water is so far out that it is not followed any more, m."""
        along = dr.dot(mi.Vector3f(position), direction)
        left = self.reach * self.reach - dr.squared_norm(mi.Vector3f(position))
        return dr.sqrt(dr.maximum(along * along + left, 0)) - along

    def ahead(self, position: mi.Point3f, direction: mi.Vector3f) -> mi.Float:
        """Distance along a flight to the last plane, negative when it is not ahead, m."""
        return (self.last - position.z) / direction.z

    def behind(self, position: mi.Point3f, direction: mi.Vector3f) -> mi.Bool:
        """Past the last plane and leaving it: such light comes back only by turning round, and is little."""
        return (position.z > self.last) & (direction.z > 0)


def open_water_m(grid: Grid) -> float:
    """Radius of the part of open water that light is followed in, m."""
    return float(OPEN_WATER_REACH * max(grid.z_m.max(), np.abs(grid.x_m).max(), np.abs(grid.y_m).max()))


def _opaque(value: float) -> mi.Float:
    """A variable, not a literal: a new value needs no new kernel."""
    return dr.opaque(mi.Float, float(value))


class FluxPlanes(Planes):
    """Planes that tally the flux vector of the light, for receivers that may face anywhere.

    The flux vector F = integral of radiance times direction, over all directions, says what a cosine receiver
    of outward normal n reads, max(-n . F, 0), as long as no light comes from behind its plane (Gershun 1939,
    J. Math. Phys. 18, 51). What flies back to the lamp is kept apart, which tells how far that holds. Every
    cell is there once per component, see `COMPONENTS`.

    Parameters
    ----------
    grid : Grid
    *where
        Lamp and ends of the water, as `Planes` takes them.
    """

    def __init__(self, grid: Grid, *where: Any) -> None:
        super().__init__(grid, Detector(quantity="scalar_irradiance"), *where)
        self.cells *= len(COMPONENTS)
        self.row_length = dr.opaque(mi.UInt32, self.cells)

    def reading(self, crossing: Crossing, direction: mi.Vector3f) -> tuple[tuple[mi.Float, ...], mi.Float]:
        (scalar,), straight = super().reading(crossing, direction)
        parts = direction.x, direction.y, direction.z, dr.maximum(-direction.z, 0)
        return tuple(scalar * part for part in parts), straight
