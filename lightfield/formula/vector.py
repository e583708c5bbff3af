"""Direct light as a flux vector: what a cosine receiver reads that stands and faces anywhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lightfield.arrays import Array
from lightfield.formula import own_formulas
from lightfield.formula.closed_form import points_of_window, source
from lightfield.formula.path import optical_depth, rays
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm
from lightfield.scene.lamp.frame import is_ahead

#: Step of numerical derivatives, m: light changes over decimetres, so the relative error is about
#: (step / length)^2 = 1e-6.
_STEP_M = 1e-4


def direct_flux(scene: Scene, place_m: Array) -> Array:
    """Flux vector of the light that comes straight from the lamp, for unit radiant intensity on the axis.

    At the middle of the first band as it is read. T is what own effects on the way leave of it.

        F = sum over the window  I(theta) exp(-tau) / r^2  u  T

    Parameters
    ----------
    place_m : array, shape (n, 3), m
        In front of the window plane, and of a source before it; else there is none.

    Returns
    -------
    array, shape (n, 3), 1/m^2
        A receiver of outward normal n reads max(-n . F, 0).
    """
    place = np.asarray(place_m, float)
    ahead = is_ahead(scene.lamp, place[:, 2])
    beyond = 1.0 + abs(scene.lamp.apparent_distance_m)
    x, y, z = place[:, 0], place[:, 1], np.where(ahead, place[:, 2], beyond)
    scene, middle = own_formulas.lit(scene), float(middles_nm(scene)[0].mean())
    total = np.zeros_like(place)
    for u, v, share in points_of_window(scene.lamp, z):
        ray = rays(scene.lamp, x, y, z, beside_m=(u, v))
        light = source(scene.lamp, ray, wavelength_nm=middle) * np.exp(
            -optical_depth(scene.water, ray, z, middle)
        )
        total += (share * light / ray.r**3)[:, None] * np.stack([ray.dx, ray.dy, ray.dz], axis=1)
    left = own_formulas.factor(scene, ("path",), x, y, z, middle)
    return np.where(ahead[:, None], total * np.reshape(left, (-1, 1)), 0.0)


def on_receivers(flux: Array, normal: Array) -> Array:
    """What cosine receivers read in light that comes from in front of them, max(-n . F, 0), shape (..., n).

    Parameters
    ----------
    flux, normal : arrays, shape (..., n, 3) and (n, 3)
        Flux vector of the light; outward unit normals.
    """
    return np.maximum(-(flux * normal).sum(axis=-1), 0.0)


def seen_of_back(normal: Array) -> Array:
    """Part of the light that flies back which cosine receivers read beside their side of the flux vector.

    Of light that is alike from all of a hemisphere a tilted plane sees (1 + cos) / 2 (Liu and Jordan 1963,
    Solar Energy 7, 53): all where it faces the lamp or away from it, half where it stands along the beam.

    Parameters
    ----------
    normal : array, shape (..., 3)
        Outward unit normals.
    """
    return np.asarray(0.5 * (1.0 + np.abs(normal[..., 2])))


def with_back(light: Array, normal: Array) -> Array:
    """`on_receivers` of a flux vector, and what they read of the light that flies back, the last component.

    Parameters
    ----------
    light, normal : arrays, shape (..., n, 4) and (n, 3)
    """
    return on_receivers(light[..., :3], normal) + seen_of_back(normal) * light[..., 3]


def flux_and_slopes(scene: Scene, place_m: Array) -> tuple[Array, Array]:
    """`direct_flux`, shape (n, 3), and its slopes by the place, shape (n, 3, 3): component, direction."""
    around = _around(place_m)
    found = direct_flux(scene, np.concatenate([place_m, around]))  # at once, for speed
    return found[: len(place_m)], _between(found[len(place_m) :], len(place_m))


def by_place(values: Callable[[Array], Array], place_m: Array) -> Array:
    """Slopes by x, y and z of values of shape (n, k) at places of shape (n, 3), shape (n, k, 3)."""
    return _between(values(_around(place_m)), len(place_m))


def _around(place_m: Array) -> Array:
    """Places a step to either side along x, y and z, shape (6 n, 3)."""
    step = _STEP_M * np.eye(3)[:, None]
    return np.concatenate([place_m + step, place_m - step]).reshape(-1, 3)


def _between(around: Array, count: int) -> Array:
    """Slopes of `count` values from those around them, as `_around` has them."""
    found = around.reshape(2, 3, count, -1)
    return np.asarray(((found[0] - found[1]) / (2 * _STEP_M)).transpose(1, 2, 0))
