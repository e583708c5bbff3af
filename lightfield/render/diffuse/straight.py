"""Changes of the attenuation along the straight path, which diffuse light nearly follows."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array
from lightfield.scene.lamp.frame import beyond_window


def from_behind(apparent_distance_m: float, attenuation_per_m: Array, z_m: Array, straight_m: Array) -> Array:
    """Less attenuation for light from behind the window, which crosses the water less obliquely.

    Parameters
    ----------
    attenuation_per_m : array, shape (n_waters,)
    z_m, straight_m : array, shape (n,)
        Distance of each cell along the axis, and straight from the window.

    Returns
    -------
    factor : array, shape (n_waters, n)
    """
    if apparent_distance_m == 0:
        return np.ones((len(attenuation_per_m), len(z_m)))
    behind = z_m + apparent_distance_m
    radius = np.sqrt(np.maximum(straight_m**2 - z_m**2, 0))
    in_water = beyond_window(np.hypot(radius, behind), z_m, apparent_distance_m)
    return np.asarray(np.exp(-attenuation_per_m[:, None] * (in_water - straight_m)))
