"""Absorption that changes with the place: gradients along z and upwards, a slab across, any curve of z."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.acts import Acts
from lightfield.scene.curve import integral_to, value_at
from lightfield.scene.parameters import switched_off
from lightfield.scene.water.water import Water


def is_layered(water: Water) -> bool:
    """Does the absorption change with the place?"""
    return not switched_off(water, Acts.LAYERS)


def slab_m(water: Water) -> tuple[float, float]:
    """First and last z of the slab."""
    half = 0.5 * water.layer_width_m
    return water.layer_centre_m - half, water.layer_centre_m + half


def path_in_slab_m(water: Water, z_m: Array, path_m: Array) -> Array:
    """Part of straight paths from the window plane to z that is inside the slab.

    Parameters
    ----------
    z_m, path_m : arrays, m
        Where the paths end, z > 0, and their lengths.
    """
    low, high = slab_m(water)
    start = max(low, 0.0)
    return np.asarray(np.clip(z_m - start, 0.0, high - start) * (path_m / z_m))


def path_up_gradient_m2(water: Water, z_m: Array, path_m: Array) -> Array:
    """Integral of z - gradient_centre_m along straight paths from the window plane; as `path_in_slab_m`."""
    return np.asarray((0.5 * z_m - water.gradient_centre_m) * path_m)


def layers_depth(water: Water, z_m: Array, path_m: Array, height_m: Array | float = 0.0) -> Array | float:
    """Optical depth that gradients, slab and curve add along straight paths from the window plane to z.

    The tracer's own, for flights from anywhere to anywhere, is `render.tracer.absorption.Absorption.depth`.

    Parameters
    ----------
    z_m, path_m : arrays, m
        Where the paths end, z > 0, and their lengths.
    height_m : array, m
        Mean y of the paths.
    """
    depth: Array | float = 0.0
    if water.gradient_per_m2:
        depth = depth + water.gradient_per_m2 * path_up_gradient_m2(water, z_m, path_m)
    if water.height_gradient_per_m2:
        depth = depth + water.height_gradient_per_m2 * height_m * path_m
    if water.layer_absorption_per_m:
        depth = depth + water.layer_absorption_per_m * path_in_slab_m(water, z_m, path_m)
    if water.absorption_departure:
        depth = depth + integral_to(water.absorption_departure, z_m) * (path_m / z_m)
    return depth


def mean_to_per_m(water: Water, z_m: float, height_m: float = 0.0) -> float:
    """Absorption that gradients, slab and curve add on average from the window to z, at some height; 1/m."""
    far = np.full(1, z_m)
    return float(np.ravel(layers_depth(water, far, far, height_m))[0]) / z_m


def layers_absorption_per_m(water: Water, z_m: Array, y_m: ArrayLike = 0.0) -> Array:
    """Absorption that gradients, slab and curve add at places, 1/m.

    Parameters
    ----------
    z_m, y_m : array, m
    """
    low, high = slab_m(water)
    extra = water.gradient_per_m2 * (z_m - water.gradient_centre_m)
    extra = extra + water.layer_absorption_per_m * ((z_m > low) & (z_m < high))
    if water.absorption_departure:
        extra = extra + value_at(water.absorption_departure, z_m)
    return np.asarray(extra + water.height_gradient_per_m2 * np.asarray(y_m))
