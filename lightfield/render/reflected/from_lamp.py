"""Straight light from a lamp, and from its mirror image in the water surface, to places in a tank."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lightfield.arrays import TINY
from lightfield.render.reflected.patches import Patches
from lightfield.scene import Lamp
from lightfield.scene.lamp.frame import beam_angles, beyond_window, is_mirrored, is_round, source_point
from lightfield.scene.lamp.profile import relative_intensity
from lightfield.scene.tank import WATER_INDEX


class Ways(NamedTuple):
    """Ways from the place of a lamp to patches, straight or by the water surface; arrays of shape (k,).

    Parameters
    ----------
    ahead : array of bool
        Patches that a lamp there can light.
    direction : array, shape (3, k)
        Unit vectors along which light leaves for those, in the frame of the tank.
    theta : array, rad
        Their angles to the axis of the tank.
    facing : array, m^-2
        Cosine of incidence over the square of the way, times what the surface reflects, of those.
    in_water : array, m
    """

    ahead: np.ndarray
    direction: np.ndarray
    theta: np.ndarray
    facing: np.ndarray
    in_water: np.ndarray

    @classmethod
    def of(cls, lamp: Lamp, patches: Patches) -> Ways:
        ahead = before_lamp(lamp, patches.centre[:, 2])
        way = patches.centre[ahead] - source_point(lamp)
        r = np.sqrt(np.einsum("ki,ki->k", way, way))
        direction = way / r[:, None]
        facing = np.maximum(-np.einsum("ki,ki->k", direction, patches.normal[ahead]), 0) / r**2
        in_water = np.zeros(len(ahead))
        in_water[ahead] = in_water_m(lamp, r, patches.centre[ahead, 2])
        return cls(ahead, direction.T, _to_axis(direction), facing, in_water.astype(np.float32))

    @classmethod
    def by_surface(cls, lamp: Lamp, patches: Patches, top_m: float) -> Ways:
        """By way of the surface y = top."""
        ahead, arriving, facing, in_water = _by_surface(lamp, top_m, patches.centre)
        facing *= np.maximum(-np.einsum("ki,ki->k", arriving, patches.normal), 0)[ahead]
        leaving = arriving[ahead] * np.array([1.0, -1.0, 1.0])
        return cls(ahead, leaving.T, _to_axis(leaving), facing, in_water.astype(np.float32))

    def lit(self, lamp: Lamp) -> np.ndarray:
        """Irradiance by a lamp there, without attenuation."""
        light = np.zeros(len(self.ahead), np.float32)
        # A round beam needs no azimuths, which cost more than all the rest.
        angles = (self.theta, np.zeros(1)) if is_round(lamp) else beam_angles(lamp, *self.direction)
        light[self.ahead] = relative_intensity(lamp, *angles) * self.facing
        return light

    def through(self, attenuation_per_m: float) -> np.ndarray:
        """What water lets through."""
        return np.asarray(np.exp(np.float32(-attenuation_per_m) * self.in_water))


def _to_axis(direction: np.ndarray) -> np.ndarray:
    """Angle of unit vectors, shape (k, 3), to the axis of the tank."""
    return np.arccos(np.clip(direction[:, 2], -1, 1))


def alike_in_place(lamp: Lamp) -> Lamp:
    """A lamp from whose place light goes the same ways."""
    profile = "isotropic" if lamp.profile == "isotropic" else "gaussian"
    x, y, behind = lamp.offset_x_m, lamp.offset_y_m, lamp.apparent_distance_m
    return Lamp(profile=profile, offset_x_m=x, offset_y_m=y, apparent_distance_m=behind)


def alike_on_both_sides(lamp: Lamp) -> bool:
    """Is the light of a lamp the same at x and at -x?"""
    return lamp.offset_x_m == 0 and lamp.tilt_x_deg == 0 and is_mirrored(lamp)[0]


def image_of_lamp(lamp: Lamp, top_m: float, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light by way of the surface y = top, without attenuation.

    Returns
    -------
    arriving : array, shape (n, 3)
        Direction of arrival.
    light : array, shape (n,), m^-2
        Normal irradiance.
    in_water : array, shape (n,), m
        Way in water; 0 where no light comes.
    """
    ahead, arriving, facing, in_water = _by_surface(lamp, top_m, places)
    leaving = arriving[ahead] * np.array([1.0, -1.0, 1.0])
    light = np.zeros(len(places))
    light[ahead] = relative_intensity(lamp, *beam_angles(lamp, *leaving.T)) * facing
    return arriving, light, in_water


def _by_surface(
    lamp: Lamp, top_m: float, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Ways by the surface y = top: to which places there is one, the direction of arrival at each, what the
    surface reflects over the square of the way to those, and the way in water to each, 0 without one."""
    x, y, z = source_point(lamp)
    image = np.array([x, 2 * top_m - y, z])
    way = places - image
    r = np.linalg.norm(way, axis=1)
    arriving = way / r[:, None]
    # A ray that seems to start behind the window meets the surface only beyond it.
    met = image[2] + way[:, 2] * (top_m - image[1]) / np.where(way[:, 1] < 0, way[:, 1], -1e-9)
    ahead = before_lamp(lamp, places[:, 2]) & before_lamp(lamp, met)
    in_water = np.zeros(len(places))
    in_water[ahead] = in_water_m(lamp, r[ahead], places[ahead, 2])
    return ahead, arriving, fresnel(np.abs(arriving[ahead, 1])) / r[ahead] ** 2, in_water


def before_lamp(lamp: Lamp, z_m: np.ndarray) -> np.ndarray:
    """Where its light can be: nothing comes out behind the window, but an isotropic lamp has none; nor does
    light that comes from a point in front of it reach what lies before that."""
    everywhere = lamp.profile == "isotropic" and lamp.apparent_distance_m == 0
    return np.asarray((z_m > max(0.0, -lamp.apparent_distance_m)) | everywhere)


def in_water_m(lamp: Lamp, r_m: np.ndarray, z_m: np.ndarray) -> np.ndarray:
    """The part of a path of length r from the apparent source that lies beyond the window."""
    behind = lamp.apparent_distance_m
    return r_m if behind == 0 else np.asarray(beyond_window(r_m, z_m, behind))


def fresnel(cos_incidence: np.ndarray, n: float = WATER_INDEX) -> np.ndarray:
    """Reflectance of a water surface from below, unpolarised; 1 beyond the critical angle (Fresnel)."""
    c = np.clip(cos_incidence, 0, 1)
    sine = n * np.sqrt(1 - c * c)
    t = np.sqrt(np.maximum(1 - sine * sine, 0))
    s_part, p_part = (n * c - t) / (n * c + t), (c - n * t) / (c + n * t + TINY)
    return np.where(sine >= 1, 1.0, 0.5 * (s_part**2 + p_part**2))
