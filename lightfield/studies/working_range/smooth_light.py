"""The light of a trace about the axis, without its grain.

Derivatives of a trace's noise look like information, and far from the lamp there is nothing else. So
scattered light is a smooth factor on the direct light here, a few polynomials in distance and in the squared
tangent of the angle to the axis,

    F_z = D_z e^P(z, t^2),        F_rho / F_z = S(z, t^2) rho / z    of what was scattered or reflected,

fitted to the traced flux vector F about the axis; D is the direct light in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from lightfield.arrays import Array, jackknife_stderr
from lightfield.errors import RenderError
from lightfield.formula.scattered.quadrature import in_cell
from lightfield.formula.vector import by_place, direct_flux, on_receivers
from lightfield.render.flux.traced_field import Region, reference_for_others, traced_field
from lightfield.render.response.grid import COMPONENTS, Grid
from lightfield.render.response.response import TransportResponse, Waters
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm
from lightfield.scene.lamp.frame import axis_at
from lightfield.scene.lamp.width import stated_width_deg
from lightfield.scene.water.coefficients import coefficients_in
from lightfield.scene.water.hardening import hardening_depth

#: Terms in distance and in squared tangent, of the excess and of the direction.
_TERMS, _TURNING = (5, 3), (3, 2)
#: Cells of the trace across the beam, m; along it they are four times as long. Where the array comes near a
#: wall they are smaller, so small at least.
_STEP_M, _FINEST_M = 0.16, 0.02
#: So many cells lie between the light that is asked for and a wall, and at least beside the array.
_FROM_WALLS, _FROM_WALLS_AT_LEAST = 2.5, 1.6
#: Light is followed to so many half widths of the beam at least, and beyond the array; but to this tangent: a
#: wider beam is smooth about its axis, and at 60 degrees would fill millions of cells.
_HALF_WIDTHS, _WIDE = 1.2, 0.25
#: Room for the array beside its own reach, m: derivatives ask next to it.
_ROOM_M = 0.05
#: Part of a cell that is rounding.
_ROUNDING = 1e-9
#: Light and its ratios are at least this, and squared distances, m2: logarithms and quotients stay finite.
_DARK, _NEAR_M2 = 1e-12, 1e-12
#: Sets of places whose light is remembered: a pose asks for about ten, in five waters.
_REMEMBERED = 128


class FitRange(NamedTuple):
    """Where the polynomials are fitted: distances, m, the largest tangent, and the largest radius, m."""

    near_m: float
    far_m: float
    tangent: float
    radius_m: float


class FittedCells(NamedTuple):
    """Cells of a trace that are fitted to, and their solutions for the polynomials' coefficients.

    Parameters
    ----------
    place_m : array, shape (n, 3)
    pitch_m : float
    response : TransportResponse
        Flux vector in these cells alone, one plane per component.
    excess, turning : array, shape (n_terms, n)
    """

    place_m: Array
    pitch_m: float
    response: TransportResponse
    excess: Array
    turning: Array


class InCells(NamedTuple):
    """Light in every cell, in some water.

    Parameters
    ----------
    diffuse : array, shape (n_batches, 3, n)
        Flux vector of scattered and reflected light.
    doubt : array, shape (3, n)
        Its error by what the trace does not tell apart, see `render/response/open_ended`.
    direct : array, shape (n,)
        Mean of the direct light along the beam.
    """

    diffuse: Array
    doubt: Array
    direct: Array


class _Shared:
    """What all views of one trace have in common: without one of its batches, or in other water, all are
    asked for light at the same places.

    Parameters
    ----------
    scene : Scene
        Lamp and tank of the trace.
    """

    def __init__(self, scene: Scene, frame: FitRange) -> None:
        self._scene, self._frame = scene, frame
        self._waters: list[Scene] = []
        self.in_cells: dict[int, InCells] = {}
        self.direct = lru_cache(_REMEMBERED)(self._direct)
        self.polynomials = lru_cache(_REMEMBERED)(self._polynomials)

    @property
    def widest(self) -> float:
        """Largest tangent of the angle to the axis."""
        return self._frame.tangent

    def number(self, scene: Scene) -> int:
        """The same for the same water."""
        if scene not in self._waters:
            self._waters.append(scene)
        return self._waters.index(scene)

    def _direct(self, water: int, places: bytes) -> Array:
        return direct_flux(self._waters[water], np.frombuffer(places).reshape(-1, 3))

    def _polynomials(self, places: bytes) -> tuple[Array, Array]:
        place = np.frombuffer(places).reshape(-1, 3)
        excess, turning = (terms(self._scene, self._frame, place, count) for count in (_TERMS, _TURNING))
        return excess, turning


@dataclass(frozen=True, eq=False)
class SmoothLight:
    """Light about the axis without the grain of its trace; a `Light` of the follower.

    Parameters
    ----------
    scene : Scene
        Lamp and tank are those of the trace; the water is free.
    left_out : int, optional
        A batch of the trace that does not count.
    """

    scene: Scene
    cells: FittedCells
    shared: _Shared
    left_out: int | None = None

    def reading(self, place_m: Array, normal: Array) -> Array:
        """Readings of cosine receivers, 1/m^2, shape (n,), at places and outward normals of shape (n, 3)."""
        return on_receivers(self._flux(np.asarray(place_m, float)), np.asarray(normal, float))

    def fluxes(self, place_m: Array) -> list[tuple[Array, Array]]:
        """Flux vector of all light, 1/m^2, (n, 3), and its slopes by the place, (n, 3, 3)."""
        place = np.asarray(place_m, float)
        return [(self._flux(place), by_place(self._flux, place))]

    def irradiance(self, place_m: Array, normal: Array) -> tuple[Array, Array]:
        """`reading` and its standard errors: by a jackknife over the batches of the trace, and of light that
        scattered more often than the trace tells apart."""
        read, parts = self.reading(place_m, normal), self._left_out(place_m, normal)
        photons = jackknife_stderr(parts)
        more = self._flux(np.asarray(place_m, float), self._doubted)
        return read, np.hypot(photons, on_receivers(more, np.asarray(normal, float)) - read)

    def batches(self, place_m: Array, normal: Array) -> Array:
        """Readings by independent parts of the trace, as the jackknife makes them of it."""
        parts = self._left_out(place_m, normal)
        return len(parts) * self.reading(place_m, normal) - (len(parts) - 1) * parts

    def leave_one_out(self) -> list[SmoothLight]:
        """Without one of the batches of the trace, each in turn."""
        return [replace(self, left_out=k) for k in range(len(self.cells.response.tally))]

    def in_water_of(self, scene: Scene) -> SmoothLight:
        """The same trace in the water of another scene."""
        return replace(self, scene=scene)

    def _left_out(self, place_m: Array, normal: Array) -> Array:
        place, normal = np.asarray(place_m, float), np.asarray(normal, float)
        return np.stack([on_receivers(self._flux(place, fit), normal) for fit in self._fits[1:]])

    @cached_property
    def _water(self) -> int:
        return self.shared.number(self.scene)

    def _in_water(self) -> InCells:
        if self._water not in self.shared.in_cells:
            self.shared.in_cells[self._water] = self._in_cells()
        return self.shared.in_cells[self._water]

    def _in_cells(self) -> InCells:
        place, scene, response = self.cells.place_m, self.scene, self.cells.response
        before, straight = response.reference, response.straight_m[:, 0]
        at = middles_nm(scene)[0].mean(keepdims=True)
        a, b = coefficients_in(scene.water, at, before.molecular_share)
        rho, surface = scene.reflectances
        harder = np.exp(hardening_depth(scene.water, straight))
        diffuse = response.batches(float(a[0]), float(b[0]), rho, surface)[:, :, 0] * harder
        walls, top = np.array([rho]), np.array([surface])
        doubt = response.uncertain(response.tally.mean(axis=0)[None], Waters(a, b, walls, top), slice(None))
        change = a + b - before.absorption_per_m - before.scattering_per_m
        doubt = doubt.reshape(straight.shape) * np.exp(-change * straight) * harder
        steps = np.pad(self.cells.pitch_m * in_cell(2).at, ((0, 0), (0, 1)))  # all nodes count the same
        direct = np.mean([direct_flux(scene, place + step)[:, 2] for step in steps], axis=0)
        return InCells(diffuse, doubt, np.maximum(direct, _DARK))

    @cached_property
    def _used(self) -> Array:
        """Batches that count, shape (n, 3, n_cells)."""
        every = self._in_water().diffuse
        return every if self.left_out is None else np.delete(every, self.left_out, axis=0)

    @cached_property
    def _fits(self) -> list[tuple[Array, Array]]:
        """Of all batches that count, and without one of them, each in turn."""
        n, whole = len(self._used), self._used.mean(axis=0)
        return [self._fit(flux) for flux in [whole, *((n * whole - one) / (n - 1) for one in self._used)]]

    @cached_property
    def _doubted(self) -> tuple[Array, Array]:
        """Of all batches that count, brighter by the light's error."""
        return self._fit(self._used.mean(axis=0) + self._in_water().doubt)

    def _fit(self, flux: Array) -> tuple[Array, Array]:
        """Coefficients of P and of S to a flux in the cells, shape (3, n)."""
        lamp, (x, y, z) = self.scene.lamp, self.cells.place_m.T
        dx, dy = x - lamp.offset_x_m, y - lamp.offset_y_m
        excess = np.log1p(np.maximum(flux[2] / self._in_water().direct, _DARK))
        away = (flux[0] * dx + flux[1] * dy) * z / np.maximum(dx * dx + dy * dy, _NEAR_M2)
        return self.cells.excess @ excess, self._turned(flux[2], away)

    def _turned(self, along: Array, away: Array) -> Array:
        """S where F_rho = S F_z rho / z: the two are fitted apart, for photons are few in a single cell."""
        return np.stack([self.cells.turning @ away, self.cells.turning @ along])

    def _flux(self, place: Array, fit: tuple[Array, Array] | None = None) -> Array:
        P, (away, along) = self._fits[0] if fit is None else fit
        lamp, places = self.scene.lamp, place.tobytes()
        direct, (excess, turning) = self.shared.direct(self._water, places), self.shared.polynomials(places)
        diffuse = direct[:, 2] * np.expm1(excess @ P)
        turned = _ratio(turning @ away, turning @ along, self.shared.widest)
        slope = (turned / place[:, 2])[:, None]
        aside = slope * (place[:, :2] - [lamp.offset_x_m, lamp.offset_y_m])
        return np.asarray(direct + diffuse[:, None] * np.column_stack([aside, np.ones(len(place))]))


def _ratio(away: Array, along: Array, tangent: float) -> Array:
    """S = away / along, but no light that flies aside more than along: |S| tangent is less than one.

    Where hardly anything is scattered or reflected, both are noise, and their ratio would be anything. To 2 %
    the ratio itself up to |S| tangent = 0.38; smooth, and nothing where `along` changes its sign.
    """
    square, bound = along * along, (tangent * away) ** 2
    both = square * square + bound * bound
    return np.divide(away * along * square, both, out=np.zeros_like(away), where=both > 0)


def terms(scene: Scene, frame: FitRange, place_m: Array, count: tuple[int, int]) -> Array:
    """Chebyshev polynomials at places, shape (n, n_terms)."""
    x, y, z = place_m.T
    x0, y0 = axis_at(scene.lamp, z)
    near, far, tangent, _ = frame
    along = 2 * (z - near) / (far - near) - 1
    aside = 2 * ((x - x0) ** 2 + (y - y0) ** 2) / (tangent * z) ** 2 - 1
    return np.asarray(chebyshev.chebvander2d(along, aside, [n - 1 for n in count]))


def smooth_light(scene: Scene, near_m: float, far_m: float, reach_m: float, photons: float) -> SmoothLight:
    """Trace the flux vector about the axis between two distances, and smooth it.

    Parameters
    ----------
    reach_m : float
        Of the array.
    photons : float

    Raises
    ------
    RenderError
        The array reaches into a wall.
    """
    near, end, step = near_m - 0.5 * reach_m, far_m + reach_m, _STEP_M
    beam = _HALF_WIDTHS * np.tan(np.radians(stated_width_deg(scene.lamp)))
    tangent = max((reach_m + _ROOM_M) / near_m, min(beam, _WIDE))
    wide, aside = tangent * end, _aside(scene, end)
    if scene.tank is not None:
        free = min(scene.tank.room_m) - aside
        step = min(step, (free - reach_m - _ROOM_M) / _FROM_WALLS_AT_LEAST)
        if step < _FINEST_M:
            needed = reach_m + _ROOM_M + _FROM_WALLS_AT_LEAST * _FINEST_M
            raise RenderError(
                "the array reaches into a wall", where="tank",
                found=f"{free:.3g} m between the beam's axis and the nearest wall or surface",
                rule=f"{needed:.3g} m, for the array reaches {reach_m:.3g} m",
                remedy="a smaller array (array.size_m), or a wider tank",
            )  # fmt: skip
        end = min(end, scene.tank.box_m[2][1] - 4 * step)
        wide = min(wide, free - _FROM_WALLS * step)
    wide = max(wide, reach_m + _ROOM_M)
    region = Region(step * np.floor((wide + aside) / step + _ROUNDING), near, end, step)
    field = traced_field(scene, region, photons=photons, reference=reference_for_others(scene))
    frame = FitRange(near, end, tangent, region.half_width_m - aside)
    cells = _cells(scene, field.grid, field.response, frame)
    return SmoothLight(scene, cells, _Shared(scene, frame))


def _cells(scene: Scene, grid: Grid, response: TransportResponse, frame: FitRange) -> FittedCells:
    """The cells within the frame, and the least squares of the polynomials over them."""
    x, y, z = (v.ravel() for v in grid.centres())
    x0, y0 = axis_at(scene.lamp, z)
    radius = np.hypot(x - x0, y - y0)
    inside = radius <= np.minimum(frame.tangent * z, frame.radius_m)
    place, lamp = np.stack([x, y, z], axis=1)[inside], scene.lamp
    every = response.tally.reshape(*response.tally.shape[:2], len(COMPONENTS), -1)[..., inside]
    # Receivers face the lamp, more or less: they read what flies back as they do what flies along z.
    tally = every[:, :, :3] + every[:, :, 3:] * np.array([0.0, 0.0, 1.0], every.dtype)[:, None]
    straight = response.straight_m.reshape(len(COMPONENTS), 1, -1)[:3, :, inside]
    here = replace(response, tally=tally.reshape(*tally.shape[:2], -1), straight_m=straight)
    # Noise of a cell's light over its light, roughly: few photons are far away, and aside.
    weight = 1 / place[:, 2]
    excess = np.linalg.pinv(weight[:, None] * terms(scene, frame, place, _TERMS)) * weight
    squared = (place[:, 0] - lamp.offset_x_m) ** 2 + (place[:, 1] - lamp.offset_y_m) ** 2
    weight = np.sqrt(squared) * place[:, 2]
    turning = np.linalg.pinv(weight[:, None] * terms(scene, frame, place, _TURNING)) * weight
    return FittedCells(place, grid.pitch_x_m, here, excess, turning)


def _aside(scene: Scene, z_m: float) -> float:
    """How far the beam's axis is from the tank's, m, as far as there."""
    return float(np.abs(axis_at(scene.lamp, np.array([0.0, z_m]))).max())
