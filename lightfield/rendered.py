"""The full render at the places of a reading table: the proof of a fitted scene."""

from __future__ import annotations

from typing import Any

import numpy as np

from lightfield.analytic import direct_field
from lightfield.fit import Array
from lightfield.render.rendering import Rendering, render_scene
from lightfield.scene import Scene

#: Width of the cells in which the render counts light.
CELL_M = 0.1
PHOTONS = 6e6
REL_ERROR = 0.01
_GAUSS = 0.5 / np.sqrt(3.0)


def rendered_light(
    scene: Scene,
    readings: Any,
    *,
    seed: int = 1,
    rel_error: float = REL_ERROR,
    max_photons: float = PHOTONS,
) -> tuple[Array, Array]:
    """Light at the readings for unit on-axis intensity, from a fresh trace of the whole scene.

    The render counts light in cells. Its scattered and reflected part is interpolated between them; its direct part is
    brought from cell to point by the ratio of the formula's values, which is all that the formula is used for.

    Parameters
    ----------
    scene : Scene
    readings : Readings
    seed : int
        Other than that of the responses used in the fit.
    rel_error, max_photons : float

    Returns
    -------
    light, stderr : array, shape (n,), 1/m^2
    """
    x, y, z = (np.asarray(v, float) for v in (readings.x_m, readings.y_m, readings.z_m))
    air = np.asarray(readings.medium) == "air"
    wavelength = np.asarray(readings.wavelength_nm, float)
    light = direct_field(scene, x, y, z, wavelength, readings.medium)
    error = np.zeros(len(light))
    wet = ~air & (z > 0)
    if not wet.any():
        return light, error
    rendering = render_scene(
        _gridded(scene, x[wet], y[wet], z[wet]), rel_error=rel_error, max_photons=max_photons, seed=seed
    )
    for channel in np.unique(np.nan_to_num(wavelength, nan=-1.0)):
        mine = wet & (np.nan_to_num(wavelength, nan=-1.0) == channel)
        band = scene.detector.bands_nm[0]
        at = 0.5 * (band[0] + band[1]) if channel < 0 else float(channel)
        light[mine], error[mine] = _at(rendering, scene, at, x[mine], y[mine], z[mine])
    return light, error


def _gridded(scene: Scene, x: Array, y: Array, z: Array) -> Scene:
    """The scene with detector planes whose cells cover the readings."""

    def cells(reach: float) -> int:
        return 2 * int(np.ceil(max(reach, 0.0) / CELL_M - 0.01)) + 1

    columns, rows = cells(float(np.abs(x).max())), cells(float(np.abs(y).max()))
    return scene.with_values(
        {
            "detector.planes_m": tuple(float(v) for v in np.unique(np.round(z, 4))),
            "detector.positions_m": None,
            "detector.width_m": CELL_M * columns,
            "detector.height_m": CELL_M * rows,
            "detector.pixels": columns,
        },
        validate=False,
    )


def _bilinear(field: Array, column: Array, row: Array) -> Array:
    """Values of a map at fractional cells."""
    rows, columns = field.shape
    left = np.clip(np.floor(column).astype(int), 0, max(columns - 2, 0))
    below = np.clip(np.floor(row).astype(int), 0, max(rows - 2, 0))
    right, above = np.minimum(left + 1, columns - 1), np.minimum(below + 1, rows - 1)
    u, v = np.clip(column - left, 0, 1), np.clip(row - below, 0, 1)
    return np.asarray(
        (1 - v) * ((1 - u) * field[below, left] + u * field[below, right])
        + v * ((1 - u) * field[above, left] + u * field[above, right])
    )


def _cell_mean(scene: Scene, wavelength: float, x: Array, y: Array, z: float) -> Array:
    """Formula averaged over each cell of a plane (Gauss-Legendre, four points), shape (n_y, n_x)."""
    total = np.zeros((len(y), len(x)))
    for u in (-_GAUSS, _GAUSS):
        for v in (-_GAUSS, _GAUSS):
            gx, gy = np.meshgrid(x + u * CELL_M, y + v * CELL_M)
            at = np.full(gx.shape, wavelength)
            total += 0.25 * direct_field(scene, gx, gy, np.full(gx.shape, z), at)
    return total


def _at(
    rendering: Rendering, scene: Scene, wavelength: float, x: Array, y: Array, z: Array
) -> tuple[Array, Array]:
    grid = rendering.grid
    one = np.array([wavelength])
    diffuse, diffuse_error = (m[0] for m in rendering.relative_maps(one, "diffuse"))
    direct, direct_error = (m[0] for m in rendering.relative_maps(one, "direct"))
    light, error = np.zeros(len(x)), np.zeros(len(x))
    point = direct_field(scene, x, y, z, np.full(len(x), wavelength))
    for k, plane in enumerate(grid.z_m):
        mine = np.abs(z - plane) < 1e-3
        column = (x[mine] - grid.x_m[0]) / grid.pitch_x_m
        row = (y[mine] - grid.y_m[0]) / grid.pitch_y_m
        formula = np.maximum(_cell_mean(scene, wavelength, grid.x_m, grid.y_m, float(plane)), 1e-300)
        ratio = _bilinear(direct[k] / formula, column, row)
        ratio_error = _bilinear(direct_error[k] / formula, column, row)
        # Cells that no direct photon reached say nothing about the ratio; the light there is all diffuse.
        known = (ratio > 0) & (ratio_error < 0.3)
        light[mine] = point[mine] * np.where(known, ratio, 1.0) + _bilinear(diffuse[k], column, row)
        error[mine] = np.hypot(
            point[mine] * np.where(known, ratio_error, 0.0), _bilinear(diffuse_error[k], column, row)
        )
    return light, error
