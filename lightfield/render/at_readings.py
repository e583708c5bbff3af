"""The full render at single places: those that a scene lists, or those of readings.

There it is the proof of a fitted scene, and the maker of hidden effects.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.formula.own_formulas import lit
from lightfield.readings import Readings
from lightfield.readings.motion import motion_of
from lightfield.render.diffuse.bending import surrounded
from lightfield.render.diffuse.on_planes import on_planes, planes_for
from lightfield.render.diffuse.shift import Shift
from lightfield.render.direct import direct_at
from lightfield.render.limits import AT_READINGS
from lightfield.render.maps import Rendering, render_scene, software
from lightfield.render.response import response_cache
from lightfield.render.response.grid import positions_grid
from lightfield.render.settings import SharedTracing
from lightfield.scene import Scene
from lightfield.scene.bands import at_wavelengths, over_bands, read_nm
from lightfield.scene.lamp.width import core_width_deg
from lightfield.scene.water.ageing import ages, at_time, moments
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m

if TYPE_CHECKING:
    from typing_extensions import Unpack

#: Largest cell around a reading.
CELL_M = 0.1
#: Moments at which changing water is evaluated; between them nothing of the light is lost.
_MOMENTS = 8


def rendered_light(
    scene: Scene,
    readings: Readings,
    *,
    seed: int = 1,
    rel_error: float = AT_READINGS.rel_error,
    max_photons: float = AT_READINGS.max_photons,
    symmetry: bool = False,
) -> tuple[Array, Array]:
    """Light at the readings for unit on-axis intensity, from a fresh render of the whole scene.

    The direct part comes from rays between the lamp's window and each receiver, the scattered and reflected
    part from a new trace of this very scene, counted in cells around the readings. Neither the closed-form
    model nor a response used in a fit takes part.

    Parameters
    ----------
    seed : int
        Other than that of the responses used in the fit.
    rel_error, max_photons : float
    symmetry : bool
        Let places that are mirror images of each other share their photons, and so their errors.

    Returns
    -------
    light, stderr : array, shape (n,), 1/m^2
        From the cache, if this very render was made before.
    """
    x, y, z = (np.asarray(v, float) for v in (readings.x_m, readings.y_m, readings.z_m))
    if scene.detector.lag_m and (motion := motion_of(x, y, z, readings.time_s)) is not None:
        x, y, z = motion.behind(scene.detector.lag_m, x, y, z)
    dry = np.asarray(readings.medium) == "air"
    wavelength = np.asarray(readings.wavelength_nm, float)
    middle = float(np.mean(scene.detector.bands_nm[0]))
    channels = np.where(np.isnan(wavelength), middle, wavelength)
    settings: SharedTracing = {
        "rel_error": rel_error, "max_photons": max_photons, "seed": seed, "symmetry": symmetry,
    }  # fmt: skip
    places = {"x": x, "y": y, "z": z, "dry": dry, "wavelength": channels}
    time = np.nan_to_num(np.asarray(readings.time_s, float))
    if ages(scene.water):
        places["time"] = time
    key = {"kind": "light at readings", "scene": scene.digest(), "software": software(), **places, **settings}
    stored = response_cache.recall(key)
    if stored is None:
        light, error = _render(scene, x, y, z, dry, channels, time, **settings)
        stored = {"light": light, "error": error}
        response_cache.keep(key, stored)
    return stored["light"], stored["error"]


def _render(
    scene: Scene,
    x: Array,
    y: Array,
    z: Array,
    dry: Mask,
    channels: Array,
    time: Array,
    **settings: Unpack[SharedTracing],
) -> tuple[Array, Array]:
    """Light at places in air (`dry`) or water, and its error, shape (n,)."""
    light, error = np.zeros(len(x)), np.zeros(len(x))
    for channel in np.unique(channels[dry]).tolist():
        mine = dry & (channels == channel)
        nm = float(read_nm(scene, [channel])[0])
        light[mine] = direct_at(scene, x[mine], y[mine], z[mine], 0.0, in_air=True, wavelength_nm=nm)
    wet = ~dry & (z > 0)
    if not wet.any():
        return light, error
    rendering = _traced(scene, x[wet], y[wet], z[wet], **settings)
    for channel in np.unique(channels[wet]).tolist():
        mine = wet & (channels == channel)
        straight = np.sqrt(x[mine] ** 2 + y[mine] ** 2 + z[mine] ** 2)
        for moment, share in _moments(rendering, time[mine], straight):
            read = AtPlaces(moment, x[mine], y[mine], z[mine]).relative(read_nm(scene, [channel]))
            light[mine] += share * read[0][0]
            error[mine] += share * read[1][0]  # of the same photons in all moments
    return light, np.abs(error)


def _moments(rendering: Rendering, time: Array, straight_m: Array) -> list[tuple[Rendering, Array | float]]:
    """The rendering in the water of a few moments, and how much of the light at each time each one is."""
    scene = rendering.scene
    if not ages(scene.water):
        return [(rendering, 1.0)]
    at, shares = moments(scene.water, time, straight_m, _MOMENTS)
    waters = [at_time(scene.water, float(t)) for t in at]
    now = [replace(rendering, scene=scene.model_copy(update={"water": water})) for water in waters]
    return list(zip(now, shares, strict=True))


def render_positions(scene: Scene, **settings: Unpack[SharedTracing]) -> AtPlaces:
    """Render the light at the single positions that a scene's detector lists.

    Parameters
    ----------
    scene : Scene
        With `detector.positions_m`.
    **settings
        Of `render_scene`.
    """
    x, y, z = np.asarray(scene.detector.positions_m, float).T
    return AtPlaces(_traced(scene, x, y, z, **settings), x, y, z)


@dataclass(frozen=True)
class AtPlaces:
    """A rendering read at single places in the water, in the order in which they are given.

    The direct light of each place itself; scattered and reflected light from the cells around it, with the
    bending between their middles and the place.

    Parameters
    ----------
    rendering : Rendering
        Of cells around the places.
    x_m, y_m, z_m : arrays, shape (n_places,), m
    """

    rendering: Rendering
    x_m: Array
    y_m: Array
    z_m: Array

    @property
    def scene(self) -> Scene:
        """The scene that was rendered."""
        return self.rendering.scene

    def maps(self, wavelengths_nm: Array | None = None, part: str = "all") -> tuple[Array, Array]:
        """Spectral light in absolute units, as `Rendering.maps` gives it.

        Returns
        -------
        mean, stderr : arrays, shape (n, n_places), W m^-2 nm^-1 (W m^-2 sr^-1 nm^-1 for radiance)
        """
        scene = self.scene
        at, intensity = (
            over_bands(scene) if wavelengths_nm is None else at_wavelengths(scene.lamp, wavelengths_nm)
        )
        relative = (v.reshape(*at.shape, -1) for v in self.relative(at.ravel(), part))
        # Wavelengths of a band share their photons: errors add up, they do not average out.
        mean, stderr = ((v * intensity[..., None]).mean(axis=1) for v in relative)
        return mean, stderr

    def relative(self, wavelengths_nm: Array, part: str = "all") -> tuple[Array, Array]:
        """Light for unit on-axis intensity and its error, shape (n, n_places), 1/m^2."""
        scene, at = self.scene, np.asarray(wavelengths_nm, float)
        light, error = np.zeros((2, len(at), len(self.x_m)))
        if part != "diffuse":
            attenuation = absorption_per_m(scene.water, at) + scattering_per_m(scene.water, at)
            light += [
                direct_at(scene, self.x_m, self.y_m, self.z_m, float(c), wavelength_nm=float(w))
                for c, w in zip(attenuation, at, strict=True)
            ]
        if part != "direct":
            found = self.rendering.relative_maps(at, "diffuse")
            shift = Shift.on(self.rendering.grid, self.x_m, self.y_m, self.z_m, tank=scene.tank)
            for n, (mean, stderr) in enumerate(zip(*(v.reshape(len(at), -1) for v in found), strict=True)):
                moved, error[n] = shift.of_traced(mean, stderr)
                light[n] += moved
        return light, error


def _traced(scene: Scene, x: Array, y: Array, z: Array, **settings: Unpack[SharedTracing]) -> Rendering:
    """A rendering of cells around places in the water."""
    width = core_width_deg(lit(scene).lamp)
    told = on_planes(planes_for(z, scene.tank), x, y, z, tank=scene.tank)
    grid = positions_grid(*told.places, CELL_M, width, scene.tank, detector=scene.detector)
    return render_scene(scene, grid=surrounded(grid, scene.tank), **settings)
