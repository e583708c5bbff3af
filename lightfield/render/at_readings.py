"""The full render at the places of readings: the proof of a fitted scene, the maker of hidden effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.render.diffuse.bending import surrounded
from lightfield.render.diffuse.shift import Shift
from lightfield.render.direct import direct_at
from lightfield.render.maps import Rendering, render_scene, software
from lightfield.render.response import store
from lightfield.render.response.grid import positions_grid
from lightfield.scene import Scene
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m

PHOTONS = 3e6
REL_ERROR = 0.01
#: Largest cell around a reading.
CELL_M = 0.1


def rendered_light(
    scene: Scene,
    readings: Any,
    *,
    seed: int = 1,
    rel_error: float = REL_ERROR,
    max_photons: float = PHOTONS,
    symmetry: bool = False,
) -> tuple[Array, Array]:
    """Light at the readings for unit on-axis intensity, from a fresh render of the whole scene.

    The direct part comes from rays between the lamp's window and each receiver, the scattered and reflected
    part from a new trace of this very scene, counted in cells around the readings. Neither the closed-form
    model nor a response used in a fit takes part.

    Parameters
    ----------
    scene : Scene
    readings : Readings
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
    dry = np.asarray(readings.medium) == "air"
    wavelength = np.asarray(readings.wavelength_nm, float)
    middle = float(np.mean(scene.detector.bands_nm[0]))
    channels = np.where(np.isnan(wavelength), middle, wavelength)
    settings = {"rel_error": rel_error, "max_photons": max_photons, "seed": seed, "symmetry": symmetry}
    places = {"x": x, "y": y, "z": z, "dry": dry, "wavelength": channels}
    key = {"kind": "light at readings", "scene": scene.digest(), "software": software(), **places, **settings}
    stored = store.load(key)
    if stored is None:
        light, error = _render(scene, x, y, z, dry, channels, **settings)
        stored = {"light": light, "error": error}
        store.save(key, stored)
    return stored["light"], stored["error"]


def _render(
    scene: Scene, x: Array, y: Array, z: Array, dry: NDArray[np.bool_], channels: Array, **settings: Any
) -> tuple[Array, Array]:
    """Light at places in air (`dry`) or water, and its error, shape (n,)."""
    light, error = np.zeros(len(x)), np.zeros(len(x))
    if dry.any():
        light[dry] = direct_at(scene, x[dry], y[dry], z[dry], 0.0, in_air=True)
    wet = ~dry & (z > 0)
    if not wet.any():
        return light, error
    grid = positions_grid(x[wet], y[wet], z[wet], CELL_M, scene.lamp.hwhm_deg, scene.tank)
    rendering = render_scene(scene, grid=surrounded(grid, scene.tank), **settings)
    for channel in np.unique(channels[wet]):
        mine = wet & (channels == channel)
        light[mine], error[mine] = _wet_light(rendering, float(channel), x[mine], y[mine], z[mine])
    return light, error


def _wet_light(rendering: Rendering, wavelength: float, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    scene, one = rendering.scene, np.array([wavelength])
    attenuation = float(absorption_per_m(scene.water, one)[0] + scattering_per_m(scene.water, one)[0])
    direct = direct_at(scene, x, y, z, attenuation)
    diffuse, error = (field[0].ravel() for field in rendering.relative_maps(one, "diffuse"))
    shift = Shift(rendering.grid, x, y, z)
    relative = np.divide(error, diffuse, out=np.zeros_like(error), where=np.isfinite(error) & (diffuse > 0))
    moved = shift.apply(diffuse)
    return direct + moved, moved * np.sqrt(shift.shares.power(2) @ relative**2)
