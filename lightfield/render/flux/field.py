"""The light of a scene on cosine receivers of any place and orientation, in any water, fast.

    E(n) = max(-n . F_direct, 0) + max(-n . F_diffuse, 0)

F_direct is the closed form. F_diffuse comes from one trace (`trace`): the tally of every history, times z^2,
becomes a cubic spline over x, y and z, and a new water only weighs the splines anew,

    F_diffuse(p) = exp(-(c - c_0) r) / z^2  sum over histories  w_h(a, b, rho, s) S_h(p),

with the weights of `response`. The formula is exact while no light comes from behind a receiver's plane; the
backward part of the light, kept beside, tells how much that can be.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter1d

from lightfield.arrays import Array
from lightfield.errors import RenderError
from lightfield.formula.path import rays
from lightfield.formula.vector import by_place, direct_flux, flux_and_slopes, on_receivers
from lightfield.render.backend import use_backend
from lightfield.render.flux.spline import Splines
from lightfield.render.limits import check_photons
from lightfield.render.maps import transport_key
from lightfield.render.response import store
from lightfield.render.response.grid import COMPONENTS, Grid, reference_of
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.render.response.symmetry import symmetric
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm
from lightfield.scene.lamp.frame import is_round
from lightfield.scene.water.coefficients import coefficients_in
from lightfield.scene.water.hardening import hardening_depth

#: How the components change under x -> -x and y -> -y, and which they become when x and y are exchanged.
_MIRROR_X, _MIRROR_Y, _EXCHANGED = (-1, 1, 1, 1), (1, -1, 1, 1), (1, 0, 2, 3)


@dataclass(frozen=True)
class Region:
    """Part of the water in which a field is known.

    Parameters
    ----------
    half_width_m : float, m
        |x| and |y| at most.
    near_m, far_m : float, m
        First and last distance.
    step_m : float, m
        Largest distance of places across the beam at which it is tallied; along it four times that.
    """

    half_width_m: float
    near_m: float
    far_m: float
    step_m: float = 0.1

    def grid(self) -> Grid:
        """Cells whose centres reach one step beyond the region."""
        across = 2 * int(np.ceil(self.half_width_m / self.step_m)) + 3
        along = int(np.ceil((self.far_m - self.near_m) / (4 * self.step_m))) + 2
        step_z = (self.far_m - self.near_m) / (along - 2)
        first = max(self.near_m - 0.5 * step_z, 0.5 * self.near_m)
        x = self.step_m * (np.arange(across) - 0.5 * (across - 1))
        return Grid(np.linspace(first, self.far_m + 0.5 * step_z, along), x, x, self.step_m, self.step_m)


def traced_field(
    scene: Scene,
    region: Region,
    *,
    photons: float = 1e7,
    seed: int = 0,
    reference: Reference | None = None,
    cache: bool = True,
) -> TracedField:
    """Trace the flux vector of a scene's light in a region.

    Parameters
    ----------
    scene : Scene
        Its detector is not asked.
    region : Region
    photons : float
    seed : int
    reference : Reference, optional
        Water to trace in: give scattering here to evaluate waters that scatter from a scene that does not.
    cache : bool
        Look for, and leave, the trace on disk.

    Raises
    ------
    RenderError
        A region that is not all in the water in front of the lamp, or photons that no trace can have.
    """
    check_photons(photons)
    grid = region.grid()
    _check(scene, region)
    chosen = reference_of(scene) if reference is None else reference
    key = {"kind": "flux", **transport_key(scene, grid, chosen), "photons": photons, "seed": seed}
    stored = store.load(key) if cache else None
    if stored is not None:
        return TracedField(scene, grid, TransportResponse.unpacked(stored, chosen))
    use_backend()
    from lightfield.render.flux.trace import trace_flux  # Mitsuba, which a cached response does not need

    response = trace_flux(scene, grid, chosen, int(photons), seed)
    if cache:
        store.save(key, response.packed())
    return TracedField(scene, grid, response)


def _check(scene: Scene, region: Region) -> None:
    box = scene.tank.box_m if scene.tank else ((-np.inf, np.inf),) * 3
    grid = region.grid()
    inside = region.near_m > 0 and region.far_m > region.near_m and region.half_width_m > 0
    for cells, pitch, (low, high) in zip(
        (grid.x_m, grid.y_m, grid.z_m), (grid.pitch_x_m, grid.pitch_y_m, 0.0), box, strict=True
    ):
        inside = inside and cells[0] - 0.5 * pitch >= low and cells[-1] + 0.5 * pitch <= high
    if not inside:
        raise RenderError(
            "the light is asked for where there is no water",
            where="region",
            found=f"|x|, |y| up to {region.half_width_m:g} m, z {region.near_m:g} to {region.far_m:g} m",
            rule="in front of the lamp, and one and a half steps away from every wall",
            remedy="ask for a smaller region, or take smaller steps",
        )


@dataclass(frozen=True)
class TracedField:
    """Direct light in closed form and diffuse light of a trace, see `traced_field`.

    Parameters
    ----------
    scene : Scene
        Its lamp, tank and phase function are those of the trace; its water is free.
    grid : Grid
        Cells of the trace.
    response : TransportResponse
        Flux vector, cell by cell.
    """

    scene: Scene
    grid: Grid
    response: TransportResponse

    def in_water_of(self, scene: Scene) -> TracedField:
        """The same trace in the water, walls and surface of another scene."""
        other = TracedField(scene, self.grid, self.response)
        other.__dict__["_whole"], other.__dict__["_tally"] = self._whole, self._tally
        if "_parts" in self.__dict__:
            other.__dict__["_parts"] = self._parts
        return other

    def leave_one_out(self) -> list[TracedField]:
        """The field without one of the independent batches of the trace, each in turn: for a jackknife."""
        mean, batches = self._whole, self._parts
        found = []
        for one, tally in zip(batches, self.response.tally, strict=True):
            other = TracedField(self.scene, self.grid, self.response)
            other.__dict__["_whole"] = (len(batches) * mean - one) / (len(batches) - 1)
            other.__dict__["_tally"] = (len(batches) * self._tally - tally) / (len(batches) - 1)
            other.__dict__["_parts"] = batches
            found.append(other)
        return found

    def irradiance(self, place_m: Array, normal: Array) -> tuple[Array, Array]:
        """Readings and their standard errors, 1/m^2, shape (n,): of photons, and of light from walls that
        scattered more often than a trace in other water tells apart (`render/response/open_ended`).

        Parameters
        ----------
        place_m, normal : array, shape (n, 3)
            Places in the region, m, and outward unit normals of the receivers.
        """
        place, normal = np.asarray(place_m, float), np.asarray(normal, float)
        cells, factor = self._cells(place), self._factor(place)[:, None]
        direct = on_receivers(direct_flux(self.scene, place), normal)
        diffuse = on_receivers(self._quick.at(cells) * factor, normal)
        spread = self._diffuse_batches(cells, factor, normal)
        photons = np.std(spread, axis=0, ddof=1) / np.sqrt(len(spread))
        if not len(self._open_ended):
            return direct + diffuse, photons
        doubt = on_receivers(self._doubt.at(cells) * factor, normal)
        return direct + diffuse, np.hypot(photons, doubt)

    def batches(self, place_m: Array, normal: Array) -> Array:
        """`reading` of every independent part of the trace, shape (n_batches, n)."""
        place, normal = np.asarray(place_m, float), np.asarray(normal, float)
        direct = on_receivers(direct_flux(self.scene, place), normal)
        return direct + self._diffuse_batches(self._cells(place), self._factor(place)[:, None], normal)

    def _diffuse_batches(self, cells: Array, factor: Array, normal: Array) -> Array:
        """What `batches` adds to the direct light."""
        flux = (self._quick_batches.at(cells) * factor).reshape(len(cells), -1, 3)
        return on_receivers(flux.swapaxes(0, 1), normal)

    def reading(self, place_m: Array, normal: Array) -> Array:
        """`irradiance` without its errors."""
        place = np.asarray(place_m, float)
        direct = on_receivers(direct_flux(self.scene, place), normal)
        diffuse = self._quick.at(self._cells(place)) * self._factor(place)[:, None]
        return direct + on_receivers(diffuse, normal)

    def fluxes(self, place_m: Array) -> list[tuple[Array, Array]]:
        """Flux vectors of direct and of diffuse light, and their slopes by the place.

        Parameters
        ----------
        place_m : array, shape (n, 3), m

        Returns
        -------
        list of (flux, slopes)
            Shapes (n, 3), 1/m^2, and (n, 3, 3), 1/m^3: component, then direction.
        """
        place = np.asarray(place_m, float)
        both = self._quick.with_slopes(self._cells(place))  # [n, value and by z y x, component]
        axes = (self.grid.x_m, self.grid.y_m, self.grid.z_m)
        step = np.array([axis[1] - axis[0] for axis in axes])
        around = by_place(lambda at: self._factor(at)[:, None], place)[:, 0]
        factor = self._factor(place)[:, None]
        flux = both[:, 0]
        slopes = np.swapaxes(both[:, :0:-1], 1, 2) / step  # by x, y and z
        slopes = slopes * factor[:, :, None] + flux[:, :, None] * around[:, None, :]
        return [flux_and_slopes(self.scene, place), (flux * factor, slopes)]

    def diffuse_flux(self, place_m: Array) -> Array:
        """Flux vector of scattered and reflected light, and what of it flies back, 1/m^2, shape (n, 4)."""
        return self._at(self._mean, place_m)

    def _at(self, splines: Array, place_m: Array) -> Array:
        place = np.asarray(place_m, float)
        at = self._cells(place).T
        found = [map_coordinates(one, at, order=3, prefilter=False, mode="nearest") for one in splines]
        return np.stack(found, axis=1) * self._factor(place)[:, None]

    def _cells(self, place: Array) -> Array:
        """Places in cells along (z, y, x), shape (n, 3)."""
        axes = (self.grid.z_m, self.grid.y_m, self.grid.x_m)
        first = np.array([axis[0] for axis in axes])
        return np.asarray((place[:, ::-1] - first) / np.array([axis[1] - axis[0] for axis in axes]))

    def _factor(self, place: Array) -> Array:
        """What the splines, which are smooth, leave out: another water on the straight way, and 1 / z^2."""
        x, y, z = place.T
        straight = rays(self.scene.lamp, x, y, z).water_m
        depth = self._change * straight - hardening_depth(self.scene.water, straight)
        return np.asarray(np.exp(-depth) / z**2)

    @cached_property
    def _water(self) -> tuple[Array, Array]:
        """Absorption and scattering coefficient in the middle of the first band, 1/m, shape (1,) each."""
        at = middles_nm(self.scene)[0].mean(keepdims=True)
        return coefficients_in(self.scene.water, at, self.response.reference.molecular_share)

    @cached_property
    def _change(self) -> float:
        (a,), (b,) = self._water
        before = self.response.reference
        return float(a + b - before.absorption_per_m - before.scattering_per_m)

    @cached_property
    def _weights(self) -> Array:
        a, b = self._water
        rho, surface = (np.array([v]) for v in self.scene.reflectances)
        weights = self.response.row_weights(a, b, rho, surface)[0]
        weights[self._open_ended] = 0
        return np.asarray(weights, np.float32)

    @cached_property
    def _open_ended(self) -> NDArray[np.integer[Any]]:
        """Rows that have another factor in every cell."""
        return np.flatnonzero(self.response.varying(self._water[1]))

    def _often(self, tallies: Array, uncertain: bool = False) -> Array | float:
        """What open-ended rows add, or the error of it: weighed cell by cell, then splines like `_mean`."""
        some = self._open_ended
        if not len(some):
            return 0.0
        (a, b), (rho, surface) = self._water, (np.array([v]) for v in self.scene.reflectances)
        weigh = self.response.uncertain if uncertain else self.response.weighed
        light = weigh(tallies[:, some], a, b, rho, surface, some)
        return self._coefficients(np.asarray(light, np.float32))[:, 0]

    @cached_property
    def _tally(self) -> Array:
        return np.asarray(self.response.tally.mean(axis=0))

    @cached_property
    def _mean(self) -> Array:
        found = np.tensordot(self._weights, self._whole, axes=1)[None] + self._often(self._tally[None])
        return np.asarray(found[0])

    @cached_property
    def _quick(self) -> Splines:
        return Splines.of(self._mean[:3])

    @cached_property
    def _doubt(self) -> Splines:
        return Splines.of(np.asarray(self._often(self._tally[None], uncertain=True))[0, :3])

    @cached_property
    def _quick_batches(self) -> Splines:
        each = self._batches[:, :3]
        return Splines.of(each.reshape(-1, *each.shape[2:]))

    @cached_property
    def _batches(self) -> Array:
        # Batch by batch, without a copy of all their rows.
        parts = self._parts
        every = (self._weights @ parts.reshape(*parts.shape[:2], -1)).reshape(len(parts), *parts.shape[2:])
        return np.asarray(every + self._often(self.response.tally))

    @cached_property
    def _whole(self) -> Array:
        """Coefficients of the splines of every history, shape (n_rows, 4, n_z, n_y, n_x)."""
        return self._coefficients(self.response.tally.mean(axis=0)[None])[0]

    @cached_property
    def _parts(self) -> Array:
        """The same batch by batch, which takes as many times as long, shape (n_batches, n_rows, ...)."""
        return self._coefficients(self.response.tally)

    def _coefficients(self, tally: Array) -> Array:
        shape = (len(COMPONENTS), *self.grid.shape)
        tally = tally.reshape(*tally.shape[:2], *shape)
        tally = _averaged_over_images(tally, self.scene) * (self.grid.z_m**2)[:, None, None]
        tally = _at_middles(_at_middles(tally).swapaxes(-1, -2)).swapaxes(-1, -2)
        # The straight line of the response is not in the tally, but in its factor exp(-change r).
        for axis in (-3, -2, -1):
            tally = spline_filter1d(tally, order=3, axis=axis, mode="nearest", output=np.float32)
        return tally


def _at_middles(means: Array) -> Array:
    """Values in the middle of cells from their means, along the last axis: f = mean - (step^2 / 24) f''."""
    values = means.copy()
    values[..., 1:-1] -= (means[..., 2:] - 2 * means[..., 1:-1] + means[..., :-2]) / 24
    return values


def _averaged_over_images(tally: Array, scene: Scene) -> Array:
    """Mean over the mirror images that the light has, components turned with them, shape as given."""
    plain = scene.model_copy(update={"detector": scene.detector.model_copy(update={"tilt_x_deg": 0.0})})
    in_x, in_y = symmetric(plain)
    signs_x, signs_y = (np.array(s, np.float32)[:, None, None, None] for s in (_MIRROR_X, _MIRROR_Y))
    if in_x:
        tally = 0.5 * (tally + signs_x * tally[..., ::-1])
    if in_y:
        tally = 0.5 * (tally + signs_y * tally[..., ::-1, :])
    if in_x and in_y and scene.tank is None and is_round(scene.lamp):
        tally = 0.5 * (tally + tally[:, :, _EXCHANGED].swapaxes(-1, -2))
    return tally
