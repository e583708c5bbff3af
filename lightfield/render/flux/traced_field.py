"""The light of a scene on cosine receivers of any place and orientation, in any water, fast.

    E(n) = max(-n . F_direct, 0) + max(-n . F_diffuse, 0) + E_back (1 + |n_z|) / 2

F_direct is the closed form; E_back is the diffuse light that flies back, on a plane that faces away from the
lamp. F_diffuse comes from one trace (`trace`): the tally of every history, times z^2,
becomes a cubic spline over x, y and z, and a new water only weighs the splines anew,

    F_diffuse(p) = exp(-(c - c_0) r) / z^2  sum over histories  w_h(a, b, rho, s) S_h(p),

with the weights of `response`, and E_back likewise. The formula is exact for receivers that face the lamp, or
away from it. Others read less of what flies back, as if it came alike from all sides (`seen_of_back`): up to
60 degrees all light is right to 0.2 % in open water and 1.5 % between bright walls (test_flux.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates

from lightfield.arrays import Array
from lightfield.errors import RenderError
from lightfield.formula.own_formulas import lit
from lightfield.formula.path import rays
from lightfield.formula.vector import by_place, direct_flux, flux_and_slopes, on_receivers, with_back
from lightfield.render.backend import use_backend
from lightfield.render.flux.history_splines import HistorySplines
from lightfield.render.flux.spline import BEFORE, BEHIND, Splines
from lightfield.render.limits import FIELD_PHOTONS, check_photons, refuse_too_large
from lightfield.render.maps import transport_key
from lightfield.render.response import response_cache
from lightfield.render.response.grid import Grid, reference_of
from lightfield.render.response.response import Reference, TransportResponse, Waters
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm, molecular_share
from lightfield.scene.lamp.colour import in_colour
from lightfield.scene.tank import walls_m
from lightfield.scene.water.coefficients import absorption_per_m, coefficients_in, scattering_per_m
from lightfield.scene.water.hardening import hardening_depth

#: Scattering of the water of a trace from which others are weighed, 1/m, where the scene's own scatters less:
#: below it a trace is clean (chosen; the errors of the field say how it went).
_LEAST_TRACED_PER_M = 0.1
#: Bytes that a trace and its splines take for a cell at most (measured: 1.9 to 13.9 GB at 1 to 4 m aside).
_BYTES_PER_CELL = 1.2e5
#: Part of a step, and metres, that are rounding: 0.1 m times 6 is more than 0.6 m.
_ROUNDING = 1e-9


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
        Largest distance of places across the beam at which it is tallied; along it four times that, or half
        of the way from the lamp to the first, if that is less.
    """

    half_width_m: float
    near_m: float
    far_m: float
    step_m: float = 0.1

    def longest_step_m(self, source_m: float = 0.0) -> float:
        """Between cells along the beam, see `grid`."""
        return min(4 * self.step_m, 0.5 * (self.near_m - source_m))

    def grid(self, source_m: float = 0.0) -> Grid:
        """Cells whose centres reach one step beyond the region, and one and a half before it.

        There the light changes most, and splines are off at their ends: 2 % half a step from them.

        Parameters
        ----------
        source_m : float, m
            From where the light seems to come.
        """
        across = 2 * int(np.ceil(self.half_width_m / self.step_m - _ROUNDING)) + 3
        along = int(np.ceil((self.far_m - self.near_m) / self.longest_step_m(source_m)))
        step_z = (self.far_m - self.near_m) / along
        x = self.step_m * (np.arange(across) - 0.5 * (across - 1))
        z = self.near_m + step_z * (np.arange(along + 3) - 1.5)
        return Grid(z, x, x, self.step_m, self.step_m)


def reference_for_others(scene: Scene) -> Reference:
    """Water to trace in for any other: that of the first band's middle, scattering at least a little."""
    at = middles_nm(scene)[0].mean(keepdims=True)
    (a,), (b,) = absorption_per_m(scene.water, at), scattering_per_m(scene.water, at)
    traced = max(float(b), _LEAST_TRACED_PER_M)
    molecules = molecular_share(scene) * float(b) / traced
    return Reference(float(a), traced, *scene.reflectances, molecules)


def traced_field(
    scene: Scene,
    region: Region,
    *,
    photons: float = FIELD_PHOTONS,
    seed: int = 0,
    reference: Reference | None = None,
    cache: bool = True,
) -> TracedField:
    """Trace the flux vector of a scene's light in a region.

    Parameters
    ----------
    scene : Scene
        Its detector is not asked.
    photons : float
    reference : Reference, optional
        Water to trace in, default: the scene's own; see `reference_for_others`.
    cache : bool
        Look for, and leave, the trace on disk.

    Raises
    ------
    RenderError
        A region that is not all in the water in front of the lamp, or photons that no trace can have.
    """
    check_photons(photons)
    scene = in_colour(lit(scene), float(middles_nm(scene)[0].mean()))
    grid = _grid(scene, region)
    chosen = reference_of(scene) if reference is None else reference
    key = {"kind": "flux", **transport_key(scene, grid, chosen), "photons": photons, "seed": seed}
    refuse_too_large(
        _BYTES_PER_CELL * len(grid.z_m) * len(grid.x_m) * len(grid.y_m),
        "the light of so large a region", where="region",
        remedy="ask for a smaller half width, or for distances nearer to each other",
    )  # fmt: skip
    stored = response_cache.recall(key) if cache else None
    if stored is not None:
        return TracedField(scene, grid, TransportResponse.unpacked(stored, chosen))
    use_backend()
    from lightfield.render.flux.trace import trace_flux  # Mitsuba, which a cached response does not need

    response = trace_flux(scene, grid, chosen, int(photons), seed)
    if cache:
        response_cache.keep(key, response.packed())
    return TracedField(scene, grid, response)


def _grid(scene: Scene, region: Region) -> Grid:
    """Cells of a region that is all in the water in front of the lamp."""
    inside = scene.lamp.least_distance_m < region.near_m < region.far_m and region.half_width_m > 0
    if inside:
        grid = region.grid(max(-scene.lamp.apparent_distance_m, 0.0))
        for cells, pitch, (low, high) in zip(
            (grid.x_m, grid.y_m, grid.z_m),
            (grid.pitch_x_m, grid.pitch_y_m, 0.0),
            walls_m(scene.tank),
            strict=True,
        ):
            inside = (
                inside
                and cells[0] - 0.5 * pitch >= low - _ROUNDING
                and cells[-1] + 0.5 * pitch <= high + _ROUNDING
            )
    if not inside:
        raise RenderError(
            "the light is asked for where there is no water",
            where="region",
            found=f"|x|, |y| up to {region.half_width_m:g} m, z {region.near_m:g} to {region.far_m:g} m",
            rule="in front of the lamp, and one and a half steps away from every wall",
            remedy="ask for a smaller region, or take smaller steps",
        )
    return grid


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
    known : HistorySplines, optional
        Splines of the trace, where another view of it has them.
    """

    scene: Scene
    grid: Grid
    response: TransportResponse
    known: HistorySplines | None = None

    def in_water_of(self, scene: Scene) -> TracedField:
        """The same trace in the water, walls and surface of another scene."""
        return replace(self, scene=scene, known=self.histories)

    def leave_one_out(self) -> list[TracedField]:
        """The field without one of the independent batches of the trace, each in turn: for a jackknife."""
        return [replace(self, known=some) for some in self.histories.leave_one_out()]

    @cached_property
    def histories(self) -> HistorySplines:
        return self.known or HistorySplines(self.scene, self.grid, self.response)

    def irradiance(self, place_m: Array, normal: Array) -> tuple[Array, Array]:
        """Readings and their standard errors, 1/m^2, shape (n,): of photons, and of light from walls that
        scattered more often than a trace in other water tells apart (`render/response/open_ended`).

        Parameters
        ----------
        place_m, normal : array, shape (n, 3)
            Places in the region, m, and outward unit normals of the receivers.
        """
        place, normal = np.asarray(place_m, float), np.asarray(normal, float)
        cells, factor = self.histories.cells(place), self._factor(place)
        direct, known = on_receivers(direct_flux(self.scene, place), normal), self._known_at(cells)
        diffuse = with_back(known.mean.at(known.own(cells)) * factor, normal)
        spread = self._diffuse_batches(cells, factor, normal)
        photons = np.std(spread, axis=0, ddof=1) / np.sqrt(len(spread))
        if not self._is_doubtful:
            return direct + diffuse, photons
        doubt = with_back(known.doubt.at(known.own(cells)) * factor, normal)
        return direct + diffuse, np.hypot(photons, doubt)

    def batches(self, place_m: Array, normal: Array) -> Array:
        """`reading` of every independent part of the trace, shape (n_batches, n)."""
        place, normal = np.asarray(place_m, float), np.asarray(normal, float)
        direct = on_receivers(direct_flux(self.scene, place), normal)
        return direct + self._diffuse_batches(self.histories.cells(place), self._factor(place), normal)

    def _diffuse_batches(self, cells: Array, factor: Array, normal: Array) -> Array:
        """What `batches` adds to the direct light."""
        known = self._known_at(cells)
        flux = known.batches.at(known.own(cells)).reshape(len(cells), 4, -1) * factor[:, :, None]
        return with_back(np.moveaxis(flux, -1, 0), normal)

    def reading(self, place_m: Array, normal: Array) -> Array:
        """`irradiance` without its errors."""
        place = np.asarray(place_m, float)
        direct = on_receivers(direct_flux(self.scene, place), normal)
        cells = self.histories.cells(place)
        known = self._known_at(cells)
        return direct + with_back(known.mean.at(known.own(cells)) * self._factor(place), normal)

    def fluxes(self, place_m: Array) -> list[tuple[Array, Array]]:
        """Flux vectors of direct and of diffuse light, what of it flies back, and their slopes by the place.

        Parameters
        ----------
        place_m : array, shape (n, 3), m

        Returns
        -------
        list of (flux, slopes)
            Shapes (n, k), 1/m^2, and (n, k, 3), 1/m^3: component, then direction; k is 3 of direct light, and
            4 of diffuse light with what flies back.
        """
        place = np.asarray(place_m, float)
        cells = self.histories.cells(place)
        known = self._known_at(cells)
        both = known.mean.with_slopes(known.own(cells))  # [n, value and by z y x, component]
        mirrored = self.histories.signs(place)
        signs = np.column_stack([mirrored, np.ones(len(place))])
        around = by_place(lambda at: self._along(at)[:, None], place)[:, 0]
        along = self._along(place)[:, None]
        flux = both[:, 0] * signs
        slopes = np.swapaxes(both[:, :0:-1], 1, 2) / self.histories.step_m  # by x, y and z
        slopes = slopes * signs[:, :, None] * mirrored[:, None, :]
        slopes = slopes * along[:, :, None] + flux[:, :, None] * around[:, None, :]
        return [flux_and_slopes(self.scene, place), (flux * along, slopes)]

    def diffuse_flux(self, place_m: Array) -> Array:
        """Flux vector of scattered and reflected light, and what of it flies back, 1/m^2, shape (n, 4)."""
        place = np.asarray(place_m, float)
        at = self.histories.cells(place).T
        found = [map_coordinates(one, at, order=3, prefilter=False, mode="nearest") for one in self._mean]
        return np.stack(found, axis=1) * self._factor(place)

    def _factor(self, place: Array) -> Array:
        """What the splines of the flux vector and of what flies back leave out, shape (n, 4)."""
        along = self._along(place)[:, None]
        return np.hstack([along * self.histories.signs(place), along])

    def _along(self, place: Array) -> Array:
        """Of it, what is alike for all: another water on the straight way, and 1 / z^2."""
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

    @property
    def _is_doubtful(self) -> bool:
        """Whether rows that hold every number of scatterings from some on are asked for other water."""
        return bool(self.response.varying(self._water[1]).any())

    def _known_at(self, cells: Array) -> _Layers:
        """Splines in this water about places, in cells: at first of their own layers alone.

        A single reading in a new water needs a few layers; who asks elsewhere too, gets all.
        """
        first, last = float(cells[:, 0].min()), float(cells[:, 0].max())
        for known in reversed(self._made):
            if known.hold(first, last):
                return known
        nearest, farthest = min(int(first), self.layers - 1), max(int(last), 0)
        around = slice(max(nearest - BEFORE, 0), min(farthest + BEHIND + 1, self.layers))
        self._made.append(_Layers(self, slice(0, self.layers) if self._made else around))
        return self._made[-1]

    @cached_property
    def _made(self) -> list[_Layers]:
        """Layers that were asked for so far: those of the first places, and all."""
        return []

    @property
    def layers(self) -> int:
        """Cells along the beam."""
        return len(self.grid.z_m)

    @cached_property
    def _mean(self) -> Array:
        """All coefficients of all components, shape (4, n_z, n_y, n_x)."""
        return _Layers(self, slice(0, self.layers)).weighed(self.histories.whole.tally)

    def coefficients(self) -> Waters:
        """Of this water, its walls and its surface, shape (1,) each."""
        rho, surface = (np.array([v]) for v in self.scene.reflectances)
        return Waters(*self._water, rho, surface)


@dataclass(frozen=True)
class _Layers:
    """Splines of some layers of a field, in its water, each made when it is first asked for.

    Parameters
    ----------
    field : TracedField
    z : slice
        Its layers of cells.
    """

    field: TracedField
    z: slice

    def hold(self, first: float, last: float) -> bool:
        """Are all coefficients here that places between two layers ask for?"""
        beneath, above = self.z.start, self.field.layers - self.z.stop
        return (first >= beneath + BEFORE or not beneath) and (last < self.z.stop - BEHIND or not above)

    def own(self, cells: Array) -> Array:
        """Places in these layers' own cells."""
        return cells - [self.z.start, 0, 0] if self.z.start else cells

    def weighed(self, coefficients: Array, *, uncertain: bool = False) -> Array:
        """Splines in this water, (n, n_z, n_y, n_x), of those of every history, shape (n, n_rows, n_cells).

        Coefficients are weighed as if they were values of the light: factors of open-ended rows, which change
        from cell to cell, are smooth.
        """
        response = self._response
        weigh = response.uncertain if uncertain else response.weighed
        found = weigh(coefficients, self.field.coefficients(), slice(None))
        return np.asarray(found.reshape(-1, *response.straight_m.shape))

    @property
    def _response(self) -> TransportResponse:
        return self.field.histories.layers(self.z)

    @cached_property
    def mean(self) -> Splines:
        return Splines.of(self.weighed(self._response.tally))

    @cached_property
    def doubt(self) -> Splines:
        return Splines.of(self.weighed(self._response.tally, uncertain=True))

    @cached_property
    def batches(self) -> Splines:
        flux = self.field.histories.parts_of(self.z)
        return Splines.of(self.weighed(flux.reshape(-1, *flux.shape[2:])))
