"""Render a scene: trace until the error is small enough, then evaluate maps for any wavelength."""

from __future__ import annotations

from dataclasses import asdict, astuple, dataclass
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.formula.own_formulas import factor, lit, on_path
from lightfield.render.backend import use_backend
from lightfield.render.limits import OF_MAPS
from lightfield.render.response import response_cache
from lightfield.render.response.grid import Grid, reference_of, scene_grid
from lightfield.render.response.response import Bookkeeping, Reference, TransportResponse
from lightfield.render.settings import Settings
from lightfield.scene import Scene
from lightfield.scene.acts import TRACED
from lightfield.scene.all_parameters import only
from lightfield.scene.bands import at_wavelengths, over_bands, refuse_unlit
from lightfield.scene.water.coefficients import absorption_per_m, coefficients_in, scattering_per_m

TOGETHER = 25  # wavelengths evaluated at once


@dataclass(frozen=True)
class Rendering:
    """Maps of a scene and what they rest on.

    Parameters
    ----------
    energy : Bookkeeping
        Energy balance in the reference water, sr (power for unit on-axis intensity).
    reached : float
        Relative standard error that 95 % of the lit cells have.
    """

    scene: Scene
    response: TransportResponse
    grid: Grid
    energy: Bookkeeping
    reached: float
    settings: Settings

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
        grey = not on_path(scene) and (
            np.ptp(absorption_per_m(scene.water, at.ravel()))
            == np.ptp(scattering_per_m(scene.water, at.ravel()))
            == 0
        )
        if grey:
            mean, stderr = self.relative_maps(at[:1, 0], part)
            per_band = intensity.mean(axis=1)[:, None, None, None]
            return mean * per_band, stderr * per_band
        # Some bands at a time: the tally is read once for all of them.
        step = max(1, TOGETHER // at.shape[1])
        parts = []
        for first in range(0, len(at), step):
            some = slice(first, first + step)
            pair = self.relative_maps(at[some].ravel(), part, intensity[some].ravel())
            parts.append([v.reshape(*at[some].shape, *v.shape[1:]).mean(axis=1) for v in pair])
        mean, stderr = (np.concatenate(v) for v in zip(*parts, strict=True))
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
        found = self.response.evaluate(
            a, b, *self.scene.reflectances, hardening=water.hardening_per_m, part=part
        )
        if part != "diffuse" and on_path(self.scene):
            found = with_own_path(self.scene, self.response, self.grid, wavelengths_nm, (a, b), found)
        mean, stderr = map(self.grid.in_water, found)
        if intensity is None:
            return mean, stderr
        factor = np.asarray(intensity)[:, None, None, None]
        return mean * factor, stderr * factor


def with_own_path(
    scene: Scene,
    response: TransportResponse,
    grid: Grid,
    wavelengths_nm: Array,
    coefficients: tuple[Array, Array],
    maps: tuple[Array, Array],
) -> tuple[Array, Array]:
    """Maps in which formulas of the user's own have acted on the light that comes straight.

    Parameters
    ----------
    wavelengths_nm : array, shape (n,), nm
    coefficients : two arrays, shape (n,), m^-1
        Absorption and scattering, as the response was evaluated.
    maps : two arrays, shape (n, n_planes, n_y, n_x)
        Mean and standard error without them.

    Raises
    ------
    SceneError
        A formula has no finite value in the middle of every cell.
    """
    mean, stderr = maps
    straight, _ = response.evaluate(
        *coefficients, *scene.reflectances, hardening=scene.water.hardening_per_m, part="direct"
    )
    places = grid.centres()
    left = np.array([factor(scene, ("path",), *places, w) - 1.0 for w in np.ravel(wavelengths_nm)])
    change = straight * left.reshape(straight.shape)
    seen = np.divide(mean + change, mean, out=np.ones_like(mean), where=mean > 0)
    return mean + change, stderr * seen


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
        return Rendering(scene, response, grid, energy, float(stored["reached"]), settings)
    use_backend()
    from lightfield.render.tracer.accumulate import (
        trace_until,  # Mitsuba, which a cached response does not need
    )

    response, energy, reached = trace_until(scene, grid, chosen, settings, path_nodes)
    if cache:
        found = {"energy": np.array(astuple(energy)), "reached": np.array(reached)}
        response_cache.keep(key, response.packed() | found)
    return Rendering(scene, response, grid, energy, reached, settings)


def transport_key(scene: Scene, grid: Grid, reference: Reference) -> dict[str, Any]:
    """All that a tally depends on, as plain values: geometry, beam, phase function, reference, software."""
    return {
        "scene": only(scene, TRACED).digest(),
        "reflects": scene.surface_reflects,
        "grid": [grid.z_m, grid.x_m, grid.y_m, grid.pitch_x_m, grid.pitch_y_m, grid.occupied],
        "reference": _told(reference),
        "software": software(),
    }


def _told(reference: Reference) -> dict[str, float]:
    """What a reference says; of molecules only if there are any, as if there were no such field."""
    found = asdict(reference)
    return found if reference.molecular_share else {k: v for k, v in found.items() if k != "molecular_share"}


@cache
def software() -> list[str]:
    """Versions of what renders."""
    return [version("mitsuba"), version("drjit")]
