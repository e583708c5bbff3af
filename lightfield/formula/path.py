"""Straight rays from the lamp through water whose attenuation may change along the way."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightfield.arrays import Array
from lightfield.scene.lamp.frame import beyond_window, from_source
from lightfield.scene.water.ageing import ages, growth_per_m
from lightfield.scene.water.coefficients import absorption_per_m, is_grey, scattering_per_m
from lightfield.scene.water.hardening import hardening_depth
from lightfield.scene.water.layers import is_layered, layers_absorption_per_m, layers_depth, slab_m

if TYPE_CHECKING:
    from lightfield.scene import Lamp, Water


@dataclass(frozen=True)
class Ray:
    """Straight rays from the apparent source to the receivers.

    Parameters
    ----------
    dx, dy, dz : array, m
        From the apparent source point to the receiver.
    r : array, m
        Their length, the r of the inverse square.
    water_m : array, m
        Part of the ray behind the window plane.
    y_m : array, m
        Of the receiver.
    """

    dx: Array
    dy: Array
    dz: Array
    r: Array
    water_m: Array
    y_m: Array | float = 0.0

    @property
    def from_y_m(self) -> Array:
        """y where the ray crosses the window plane, m."""
        return np.asarray(self.y_m - self.dy * (self.water_m / self.r))


def rays(
    lamp: Lamp, x_m: Array, y_m: Array, z_m: Array, *, beside_m: tuple[ArrayLike, ArrayLike] = (0.0, 0.0)
) -> Ray:
    """Rays from where the light seems to come from, `source_point`, to points.

    Parameters
    ----------
    lamp : Lamp
        Pose.
    x_m, y_m, z_m : array, m
        Points.
    beside_m : two arrays, m
        Where they start, in x and y beside the source; broadcast against the points.
    """
    dx, dy, dz = from_source(lamp, x_m - np.asarray(beside_m[0]), y_m - np.asarray(beside_m[1]), z_m)
    r = np.sqrt(dx * dx + dy * dy + dz * dz)
    behind = lamp.apparent_distance_m
    water = beyond_window(r, z_m, behind) if behind else r
    return Ray(dx, dy, dz, r, water, y_m)


def optical_depth(
    water: Water,
    ray: Ray,
    z_m: Array,
    wavelength_nm: ArrayLike | None = None,
    default_nm: float = 525.0,
    time_s: ArrayLike | None = None,
) -> Array:
    """Integral of c = a + b along each ray (eq. 4-7), with gradient, layer, change in time and hardening.

    Parameters
    ----------
    water : Water
        Medium.
    ray : Ray
        From the source to the receivers.
    z_m : array, m
        Of the receivers.
    wavelength_nm : array, nm, optional
        One per receiver, or one for all; NaN means `default_nm`.
    default_nm : float, nm
        Wavelength where none is given.
    time_s : array, s, optional
        One per receiver; absent or NaN means 0.
    """
    s = ray.water_m
    tau = attenuation_per_m(water, wavelength_nm, default_nm) * s
    if is_layered(water):
        tau = tau + layers_depth(water, z_m, s, ray.y_m, ray.from_y_m)
    if time_s is not None and ages(water):
        tau = tau + growth_per_m(water, time_s, stated_nm(wavelength_nm, default_nm)) * s
    if water.hardening_per_m:
        tau = tau - hardening_depth(water, s)
    return np.asarray(tau)


def stated_nm(wavelength_nm: ArrayLike | None, default_nm: float) -> Array:
    """Wavelengths, nm, with another in place of those that are absent or NaN."""
    stated = np.asarray(default_nm if wavelength_nm is None else wavelength_nm, dtype=float)
    return np.where(np.isnan(stated), default_nm, stated)


def attenuation_per_m(water: Water, wavelength_nm: ArrayLike | None = None, default_nm: float = 525.0) -> Any:
    """Beam attenuation coefficient c = a + b at time 0; one number for grey water, else one per wavelength.

    Parameters
    ----------
    water : Water
        Medium.
    wavelength_nm : array, nm, optional
        NaN means `default_nm`.
    default_nm : float, nm
        Where none is given.
    """
    if is_grey(water):
        return water.absorption_per_m + water.scattering_per_m + water.settling_per_m
    w = stated_nm(wavelength_nm, default_nm)
    unique, back = _colours(w.tobytes())
    c = absorption_per_m(water, unique) + scattering_per_m(water, unique)
    return c[back].reshape(w.shape)


@lru_cache(maxsize=16)
def _colours(wavelengths_nm: bytes) -> tuple[Array, NDArray[np.intp]]:
    """The different wavelengths, and which of them each one is: the same for every scene of a fit."""
    return np.unique(np.frombuffer(wavelengths_nm), return_inverse=True)


def least_attenuation_per_m(
    water: Water, wavelength_nm: ArrayLike, y_m: ArrayLike, z_m: ArrayLike, time_s: ArrayLike = ()
) -> float:
    """Least attenuation that straight rays meet on their way to some places, 1/m; below zero water amplifies.

    Parameters
    ----------
    water : Water
        Medium.
    wavelength_nm : array, nm
        Those that are read.
    y_m, z_m : array, m
        Places; the rays begin at the origin.
    time_s : array, s
        When it is read; NaN and none mean time 0.
    """
    z, far = np.asarray(z_m, float), float(np.max(z_m, initial=0.0))
    bends = (*slab_m(water), *(at for at, _ in water.absorption_departure))
    # What is added is straight between these, and a slab only adds.
    along = layers_absorption_per_m(water, np.array([0.0, *(at for at in bends if 0 < at < far), far]))
    there = layers_absorption_per_m(water, z, y_m)
    least = float(np.min(attenuation_per_m(water, wavelength_nm)))
    grown = float(np.min(growth_per_m(water, time_s), initial=0.0)) if ages(water) else 0.0
    return least + grown + float(np.min(there, initial=float(along.min())))
