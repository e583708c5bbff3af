"""Absorption that changes with the place: gradients along z and upwards, layers across and at the bottom, any
curve of z."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.acts import Acts
from lightfield.scene.curve import integral_to, value_at
from lightfield.scene.parameters import switched_off
from lightfield.scene.water.water import Water

#: Paths that climb by less see the bottom layer as their middle does. Chosen: float precision alone.
_LEVEL_M = 1e-6


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


def bottom_m(water: Water) -> tuple[float, float]:
    """Heights below which all of the bottom layer is, and above which none is."""
    half = 0.5 * water.bottom_layer_blend_m
    return water.bottom_layer_top_m - half, water.bottom_layer_top_m + half


def part_in_bottom_layer(water: Water, from_y_m: ArrayLike, to_y_m: ArrayLike) -> Array:
    """Mean of the bottom layer's part of the water along straight paths between two heights, 0 to 1."""
    low, high = bottom_m(water)
    ends = np.stack(np.broadcast_arrays(np.asarray(from_y_m, float), np.asarray(to_y_m, float)))
    climb = np.abs(ends[1] - ends[0])
    level = climb < _LEVEL_M
    inside = high - np.clip(ends, low, high)
    below = inside**2 / (2 * (high - low)) + low - np.minimum(ends, low)  # integral from there upwards
    part = np.abs(below[1] - below[0]) / np.where(level, 1.0, climb)
    middle = (high - np.clip(0.5 * (ends[0] + ends[1]), low, high)) / (high - low)
    return np.asarray(np.where(level, middle, part))


def layers_depth(
    water: Water, z_m: Array, path_m: Array, y_m: ArrayLike = 0.0, from_y_m: ArrayLike = 0.0
) -> Array | float:
    """Optical depth that gradients, layers and curve add along straight paths from the window plane to z.

    The tracer's own, for flights from anywhere to anywhere, is `render.tracer.absorption.Absorption.depth`.

    Parameters
    ----------
    z_m, path_m : arrays, m
        Where the paths end, z > 0, and their lengths.
    y_m, from_y_m : arrays, m
        Where they end, and where they begin.
    """
    depth: Array | float = 0.0
    begin, end = np.asarray(from_y_m, float), np.asarray(y_m, float)
    if water.gradient_per_m2:
        depth = depth + water.gradient_per_m2 * path_up_gradient_m2(water, z_m, path_m)
    if water.height_gradient_per_m2:
        depth = depth + water.height_gradient_per_m2 * 0.5 * (begin + end) * path_m
    if water.bottom_layer_absorption_per_m:
        part = part_in_bottom_layer(water, begin, end)
        depth = depth + water.bottom_layer_absorption_per_m * part * path_m
    if water.layer_absorption_per_m:
        depth = depth + water.layer_absorption_per_m * path_in_slab_m(water, z_m, path_m)
    if water.absorption_departure:
        depth = depth + integral_to(water.absorption_departure, z_m) * (path_m / z_m)
    return depth


def mean_to_per_m(water: Water, z_m: float, heights_m: tuple[float, float] = (0.0, 0.0)) -> float:
    """Absorption that gradients, layers and curve add on average from the window to z, between two heights;
    1/m."""
    far = np.full(1, z_m)
    return float(np.ravel(layers_depth(water, far, far, heights_m[1], heights_m[0]))[0]) / z_m


def layers_absorption_per_m(water: Water, z_m: Array, y_m: ArrayLike = 0.0) -> Array:
    """Absorption that gradients, layers and curve add at places, 1/m.

    Parameters
    ----------
    z_m, y_m : array, m
    """
    low, high = slab_m(water)
    extra = water.gradient_per_m2 * (z_m - water.gradient_centre_m)
    extra = extra + water.layer_absorption_per_m * ((z_m > low) & (z_m < high))
    if water.bottom_layer_absorption_per_m:
        extra = extra + water.bottom_layer_absorption_per_m * part_in_bottom_layer(water, y_m, y_m)
    if water.absorption_departure:
        extra = extra + value_at(water.absorption_departure, z_m)
    return np.asarray(extra + water.height_gradient_per_m2 * np.asarray(y_m))
