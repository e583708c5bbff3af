"""Render a scene: trace until the error is small enough, then evaluate maps for any wavelength."""

from __future__ import annotations

from dataclasses import asdict, astuple, dataclass
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.formula.cells import along_a_side, cell_mean
from lightfield.formula.closed_form import direct_field
from lightfield.formula.own_formulas import factor, has_own_straight_light, lit, on_path
from lightfield.render.backend import use_backend
from lightfield.render.limits import OF_MAPS
from lightfield.render.response import response_cache
from lightfield.render.response.bookkeeping import Bookkeeping
from lightfield.render.response.grid import Grid, reference_of, scene_grid
from lightfield.render.response.of_colours import OfColours
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.render.settings import Settings
from lightfield.scene import Scene, Water
from lightfield.scene.acts import TRACED
from lightfield.scene.all_parameters import only
from lightfield.scene.bands import at_wavelengths, middles_nm, over_bands, refuse_unlit
from lightfield.scene.lamp.colour import in_colour
from lightfield.scene.listed import OWN_FIELD
from lightfield.scene.water.coefficients import absorption_per_m, coefficients_in, scattering_per_m

_TOGETHER = 25  # wavelengths evaluated at once
#: A lamp whose width has a colour is traced at so many wavelengths.
_COLOURS = 3


@dataclass(frozen=True)
class TracedMaps:
    """The light of a scene in the cells of a grid.

    Parameters
    ----------
    of_colours : OfColours, optional
        Of a lamp whose width has a colour.
    """

    scene: Scene
    response: TransportResponse
    grid: Grid
    of_colours: OfColours | None

    def maps(self, wavelengths_nm: Array | None = None, part: str = "all") -> tuple[Array, Array]:
        """Spectral maps in absolute units.

        Parameters
        ----------
        wavelengths_nm : array, shape (n,), nm, optional
            Default: one map per band of the detector, averaged over the band.
        part : "all", "direct" or "diffuse"

        Returns
        -------
        mean, stderr : arrays, shape (n, n_planes, n_y, n_x), W m^-2 nm^-1 (W m^-2 sr^-1 nm^-1 for radiance)
            NaN in cells of a plane that are not all in the tank.
        """
        scene = self.scene
        at, intensity = (
            over_bands(scene) if wavelengths_nm is None else at_wavelengths(scene.lamp, wavelengths_nm)
        )
        grey = not has_own_straight_light(scene) and (
            np.ptp(absorption_per_m(scene.water, at.ravel()))
            == np.ptp(scattering_per_m(scene.water, at.ravel()))
            == 0
        )
        if grey:
            mean, stderr = self.relative_maps(at[:1, 0], part)
            per_band = intensity.mean(axis=1)[:, None, None, None]
            return mean * per_band, stderr * per_band
        # Some wavelengths at a time: the tally is read once for all of them.
        band = np.repeat(np.arange(len(at)), at.shape[1])
        totals: list[Array] = []
        for first in range(0, at.size, _TOGETHER):
            some = slice(first, first + _TOGETHER)
            pair = self.relative_maps(at.ravel()[some], part, intensity.ravel()[some])
            totals = totals or [np.zeros((len(at), *v.shape[1:])) for v in pair]
            for total, values in zip(totals, pair, strict=True):
                np.add.at(total, band[some], values / at.shape[1])
        mean, stderr = totals
        return mean, stderr

    def relative_maps(
        self, wavelengths_nm: Array, part: str = "all", intensity: Array | None = None
    ) -> tuple[Array, Array]:
        """Maps for unit on-axis radiant intensity (or `intensity`, (n,)), shape (n, n_planes, n_y, n_x).

        NaN in cells that are not all in the tank; of cells around single positions the mean over their part
        in it.
        """
        water = self.scene.water
        a, b = coefficients_in(water, wavelengths_nm, self.response.reference.molecular_share)
        found = self._evaluated(wavelengths_nm, a, b, part)
        if part != "diffuse" and on_path(self.scene):
            straight = found if part == "direct" else self._evaluated(wavelengths_nm, a, b, "direct")
            found = with_own_path(self.scene, self.grid, wavelengths_nm, straight, found)
        mean, stderr = map(self.grid.in_water, found)
        if intensity is None:
            return mean, stderr
        power = np.asarray(intensity)[:, None, None, None]
        return mean * power, stderr * power

    def _evaluated(self, wavelengths_nm: Array, a: Array, b: Array, part: str) -> tuple[Array, Array]:
        """Maps in water of these coefficients, of shape (n,), without own effects on the path."""
        asked, hardening = (a, b, *self.scene.reflectances), self.scene.water.hardening_per_m
        if self.of_colours is None:
            return self.response.evaluate(*asked, hardening=hardening, part=part)
        return self.of_colours.evaluate(wavelengths_nm, *asked, hardening, part)


@dataclass(frozen=True)
class Rendering(TracedMaps):
    """Maps of a scene and what they rest on.

    Parameters
    ----------
    energy : Bookkeeping
        Energy balance in the reference water, sr (power for unit on-axis intensity).
    reached : float
        Relative standard error that 95 % of the lit cells have.
    """

    energy: Bookkeeping
    reached: float
    settings: Settings


def with_own_path(
    scene: Scene, grid: Grid, wavelengths_nm: Array, straight: tuple[Array, Array], maps: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Maps in which formulas of the user's own have acted on the light that comes straight.

    Parameters
    ----------
    wavelengths_nm : array, shape (n,), nm
    straight : two arrays, shape (n, n_planes, n_y, n_x)
        The light that comes straight without them, and its standard error.
    maps : two arrays, of that shape
        Mean and standard error without them.

    Raises
    ------
    SceneError
        A formula has no finite value somewhere in a cell.
    """
    (mean, stderr), (direct, error) = maps, straight
    left = np.array([_left_by_own_path(scene, grid, float(w)) for w in np.ravel(wavelengths_nm)])
    rest = np.sqrt(np.maximum(stderr**2 - error**2, 0.0))
    return mean + direct * (left - 1.0), np.where(np.isfinite(stderr), np.hypot(error * left, rest), stderr)


def _left_by_own_path(scene: Scene, grid: Grid, wavelength_nm: float) -> Array:
    """Part of the straight light of every cell that own effects leave, shape (n_planes, n_y, n_x)."""
    clear = scene.model_copy(update={"water": Water(), OWN_FIELD: ()})
    pitch, count = max(grid.pitch_x_m, grid.pitch_y_m), len(grid.x_m) * len(grid.y_m)
    found = np.ones(grid.shape)
    for plane, z in zip(found, grid.z_m.tolist(), strict=True):

        def lit_and_left(x: Array, y: Array, z: float = z) -> Array:
            light = direct_field(clear, x, y, np.full_like(x, z), np.full_like(x, wavelength_nm))
            return np.stack(
                [light, light * factor(scene, ("path",), x, y, np.full_like(x, z), wavelength_nm)]
            )

        side = along_a_side(scene, z, pitch, count)
        before, after = cell_mean(lit_and_left, grid.x_m, grid.y_m, grid.pitch_x_m, grid.pitch_y_m, side)
        np.divide(after, before, out=plane, where=before > 0)
    return found


def render_scene(
    scene: Scene,
    *,
    rel_error: float = OF_MAPS.rel_error,
    max_photons: float = OF_MAPS.max_photons,
    seed: int = 0,
    reference: Reference | None = None,
    grid: Grid | None = None,
    cache: bool = True,
    symmetry: bool = False,
    path_nodes: int | None = None,
) -> Rendering:
    """Trace a scene until 95 % of its lit cells are known to a relative error, or the photon budget is spent.

    Parameters
    ----------
    scene : Scene
    rel_error : float
        Requested relative standard error.
    max_photons : float
    seed : int
        Same seed and settings, same result.
    reference : Reference, optional
        Water to trace in; give scattering or wall albedo here to evaluate them in a scene that has none.
    grid : Grid, optional
        Cells to tally; default: those that the scene's detector asks for.
    cache : bool
        Look for, and leave, the response on disk.
    symmetry : bool
        Let cells that are mirror images of each other share their photons: up to 8 times fewer are needed.
        Such cells have one common error, which averages over a map must not take for independent.
    path_nodes : int, optional
        Steps in which the lengths of paths are tallied; default: enough for absorption, not for delays.

    Raises
    ------
    RenderError
        Impossible settings.
    SceneError
        No light in any band.
    """
    settings, scene = Settings(rel_error, max_photons, seed, symmetry), lit(scene)
    refuse_unlit(scene)
    grid = scene_grid(scene) if grid is None else grid
    chosen = reference_of(scene) if reference is None else reference
    key = {"kind": "maps", **transport_key(scene, grid, chosen), "settings": asdict(settings)}
    if path_nodes is not None:
        key["path_nodes"] = path_nodes
    stored = response_cache.recall(key) if cache else None
    if stored is not None:
        response, energy = TransportResponse.unpacked(stored, chosen), Bookkeeping(*stored["energy"].tolist())
        of_colours = in_its_colours(scene, response, grid, settings, cache, path_nodes)
        return Rendering(scene, response, grid, of_colours, energy, float(stored["reached"]), settings)
    use_backend()
    from lightfield.render.tracer.accumulate import (
        trace_until,  # Mitsuba, which a cached response does not need
    )

    response, energy, reached = trace_until(scene, grid, chosen, settings, path_nodes)
    if cache:
        found = {"energy": np.array(astuple(energy)), "reached": np.array(reached)}
        response_cache.keep(key, response.packed() | found)
    of_colours = in_its_colours(scene, response, grid, settings, cache, path_nodes)
    return Rendering(scene, response, grid, of_colours, energy, reached, settings)


def in_its_colours(
    scene: Scene,
    response: TransportResponse,
    grid: Grid,
    settings: Settings,
    cache: bool = True,
    path_nodes: int | None = None,
) -> OfColours | None:
    """Light of a lamp whose width has a colour, traced at some of its wavelengths; None: it has one width.

    Parameters
    ----------
    scene : Scene
        With the lamp's shape in its lamp, see `lit`.
    response : TransportResponse
        Of the lamp as wide as it is at 550 nm.
    """
    if not scene.lamp.width_slope:
        return None
    at, traced = np.geomspace(*_ends(middles_nm(scene)), _COLOURS).tolist(), asdict(settings)
    responses = tuple(
        render_scene(
            in_colour(scene, nm), **traced, reference=response.reference, grid=grid, cache=cache,
            path_nodes=path_nodes,
        ).response
        for nm in at
    )  # fmt: skip
    return OfColours(tuple(at), responses)


def _ends(wavelengths_nm: Array) -> tuple[float, float]:
    return float(wavelengths_nm.min()), float(wavelengths_nm.max())


def transport_key(scene: Scene, grid: Grid, reference: Reference) -> dict[str, Any]:
    """All that a tally depends on, as plain values: geometry, beam, phase function, reference, software."""
    return {
        "scene": only(scene, TRACED).digest(),
        "reflects": scene.surface_reflects,
        "grid": [grid.z_m, grid.x_m, grid.y_m, grid.pitch_x_m, grid.pitch_y_m, grid.occupied],
        "reference": _told(reference),
        "software": software(),
    }


#: What references did not say at first.
_LATER = ("molecular_share", "pane_reflectance", "by_panes")


def _told(reference: Reference) -> dict[str, float]:
    """What a reference says; of molecules and panes only if there are any, as if there were no such field."""
    found = asdict(reference)
    return {k: v for k, v in found.items() if v or k not in _LATER}


@cache
def software() -> list[str]:
    """Versions of what renders."""
    return [version("mitsuba"), version("drjit")]
