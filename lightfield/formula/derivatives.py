"""Derivatives of the direct light by scene parameters: closed form where cheap, central differences else."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.formula.field import air_mask, direct_field, rays
from lightfield.formula.path import Ray
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import acts_on
from lightfield.scene.lamp.frame import beam_angles
from lightfield.scene.lamp.profile import LN2
from lightfield.scene.water.constituents import (
    cdom_absorption_per_m,
    sediment_absorption_per_m,
    sediment_scattering_per_m,
)
from lightfield.scene.water.layers import path_in_slab_m, path_up_gradient_m2

if TYPE_CHECKING:
    from lightfield.scene import Scene

GAUSSIAN_FAMILY = ("gaussian", "super-gaussian", "two-component")
DEPTH: dict[str, Callable[[Scene, Ray, Array, Array], Array]] = {
    "water.absorption_per_m": lambda scene, ray, z, w: ray.water_m,
    "water.scattering_per_m": lambda scene, ray, z, w: ray.water_m,
    "water.gradient_per_m2": lambda scene, ray, z, w: path_up_gradient_m2(scene.water, z, ray.water_m),
    "water.layer_absorption_per_m": lambda scene, ray, z, w: path_in_slab_m(scene.water, z, ray.water_m),
    "water.hardening_per_m": lambda scene, ray, z, w: -scene.water.hardening_per_m * ray.water_m**2,
    "water.cdom_440_per_m": lambda scene, ray, z, w: (
        cdom_absorption_per_m(1.0, scene.water.cdom_slope_per_nm, w) * ray.water_m
    ),
    "water.sediment_g_per_m3": lambda scene, ray, z, w: (
        (sediment_absorption_per_m(1.0, w) + sediment_scattering_per_m(1.0, w)) * ray.water_m
    ),
}


def direct_jacobian(
    scene: Scene,
    x_m: ArrayLike,
    y_m: ArrayLike,
    z_m: ArrayLike,
    paths: Sequence[str],
    wavelength_nm: ArrayLike | None = None,
    medium: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Direct light and its derivatives.

    Parameters
    ----------
    scene : Scene
        Point of expansion.
    x_m, y_m, z_m : array, m, shape (n,)
        Receivers in front of the window.
    paths : sequence of str
        Scene parameters, in any order.
    wavelength_nm : array, nm, optional
        As for `direct_field`.
    medium : array, optional
        As for `direct_field`.

    Returns
    -------
    field : array, shape (n,)
        As `direct_field`.
    jacobian : array, shape (n, len(paths))
        d field / d parameter, in the parameter's own unit.
    """
    x, y, z = (np.asarray(v, dtype=float) for v in (x_m, y_m, z_m))
    field = direct_field(scene, x, y, z, wavelength_nm, medium)
    columns = np.empty((len(field), len(paths)))
    point = scene.lamp.radius_m == 0.0
    ray, in_air = rays(scene.lamp, x, y, z), air_mask(medium)
    low, high = scene.detector.bands_nm[0]
    w = np.full(len(z), np.nan) if wavelength_nm is None else np.asarray(wavelength_nm, dtype=float)
    w = np.where(np.isnan(w), 0.5 * (low + high), w)
    beam: dict[str, Array] = {}
    if point and scene.lamp.profile in GAUSSIAN_FAMILY and any(acts_on(path) & Acts.BEAM for path in paths):
        beam = _beam_slopes(scene, ray, in_air)
    for column, path in enumerate(paths):
        if point and path in DEPTH:
            slope = -DEPTH[path](scene, ray, z, w)
            columns[:, column] = field * (slope if in_air is None else np.where(in_air, 0.0, slope))
        elif path in beam:
            columns[:, column] = field * beam[path]
        else:
            columns[:, column] = _difference(scene, path, (x, y, z), wavelength_nm, medium)
    return field, columns


def _beam_slopes(scene: Scene, ray: Ray, in_air: Array | None) -> dict[str, Array]:
    """d ln I / d parameter of the Gaussian family, per degree for the widths."""
    lamp = scene.lamp
    theta_x, theta_y = beam_angles(lamp, ray.dx, ray.dy, ray.dz)
    n = 1.0 if in_air is None else np.where(in_air, lamp.window_index, 1.0)
    xx, yy = (theta_x / n) ** 2, (theta_y / n) ** 2 / lamp.ellipticity**2
    squared = np.maximum(xx + yy, 1e-300)
    core_width, skirt_width = math.radians(lamp.hwhm_deg), math.radians(lamp.skirt_hwhm_deg)
    m, f = lamp.shape_exponent, lamp.skirt_fraction
    q, p = (squared / core_width**2) ** (0.5 * m), squared / skirt_width**2
    core, skirt = np.exp(-LN2 * q), f * np.exp(-LN2 * p)
    total = core + skirt
    return {
        "lamp.hwhm_deg": core * LN2 * m * q / lamp.hwhm_deg / total,
        "lamp.shape_exponent": -core * LN2 * q * 0.5 * np.log(squared / core_width**2) / total,
        "lamp.skirt_fraction": np.exp(-LN2 * p) / total - 1.0 / (1.0 + f),
        "lamp.skirt_hwhm_deg": skirt * 2.0 * LN2 * p / lamp.skirt_hwhm_deg / total,
        "lamp.ellipticity": LN2
        * (core * m * q + 2.0 * skirt * p)
        * (yy / squared)
        / lamp.ellipticity
        / total,
    }


def _difference(
    scene: Scene,
    path: str,
    places: tuple[Array, Array, Array],
    wavelength_nm: ArrayLike | None,
    medium: ArrayLike | None,
) -> Array:
    """Central difference, one-sided at the end of the parameter's range."""
    value, parameter = float(scene.get(path)), scene.parameters()[path]
    step = 1e-5 * max(abs(value), 0.1)
    up, down = min(value + step, parameter.high), max(value - step, parameter.low)
    high, low = (
        direct_field(scene.with_values({path: v}, validate=False), *places, wavelength_nm, medium)
        for v in (up, down)
    )
    return (high - low) / (up - down)
