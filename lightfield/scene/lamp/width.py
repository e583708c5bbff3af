"""How wide a beam is, however its shape is stated."""

from __future__ import annotations

import math

import numpy as np

from lightfield.arrays import Array
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.profile import HALF_PI, radial_intensity
from lightfield.storage.tables import kept_by_tables

#: Angles at which a beam is asked for its widths.
_ANGLES = 20001


def intensity(lamp: Lamp, theta_squared: Array) -> Array:
    """Radiant intensity over that on the axis, at squared angles from it, rad^2, the same all around."""
    return radial_intensity(lamp, theta_squared) * (theta_squared <= HALF_PI * HALF_PI)


@kept_by_tables(4)
def at_all_angles(lamp: Lamp) -> tuple[Array, Array]:
    """Angles to half a turn, rad, and the intensity at each."""
    theta = np.linspace(0.0, HALF_PI, _ANGLES)
    return theta, intensity(lamp, theta * theta)


@kept_by_tables(256)
def half_width_rad(lamp: Lamp, level: float = 0.5) -> float:
    """Largest angle at which the beam is as bright as this part of its brightest, rad."""
    theta, light = at_all_angles(lamp)
    level *= float(light.max())
    i = int(np.flatnonzero(light >= level)[-1])
    return _falls_to(level, theta, light, i)


def _falls_to(level: float, theta: Array, light: Array, i: int) -> float:
    """Where light is this bright after an angle at which it is as bright at least, rad."""
    if i + 1 == len(theta):
        return HALF_PI
    high, low = light[i : i + 2]
    part = (high - level) / (high - low) if high > low else 0.0
    return float(theta[i] + part * (theta[1] - theta[0]))


def widened(lamp: Lamp, factor: float) -> Lamp:
    """The lamp whose beam has all its angles from the axis so many times as large."""
    angles = {name: factor * getattr(lamp, name) for name in ("hwhm_deg", "skirt_hwhm_deg", "table_width")}
    departure = tuple((factor * angle, log) for angle, log in lamp.profile_departure)
    return lamp.model_copy(update={**angles, "profile_departure": departure})


def stated_width_deg(lamp: Lamp) -> float:
    """Half width of the beam where it is half as bright as where it is brightest, degrees.

    That of its table, or of Gaussian, skirt and departure together, where it is more than the Gaussian alone.
    """
    more = lamp.profile == "table" or lamp.skirt_fraction or lamp.profile_departure
    return math.degrees(half_width_rad(lamp)) if more else lamp.hwhm_deg


def lobe_width_deg(lamp: Lamp, read_rad: Array) -> float:
    """The same of the lobe that holds the brightest of some angles, where others may be as bright.

    Between readings, and far out, hardly anything holds a fitted departure.

    Parameters
    ----------
    read_rad : array, rad
        Angles at which the beam was read.
    """
    if not lamp.profile_departure:
        return stated_width_deg(lamp)
    theta, light = at_all_angles(lamp)
    read = np.minimum(np.searchsorted(theta, read_rad), len(theta) - 1)
    brightest = int(read[np.argmax(light[read])])
    level = 0.5 * float(light[brightest])
    lit = int(np.argmin([*(light[brightest:] >= level), False])) - 1
    return math.degrees(_falls_to(level, theta, light, brightest + lit))


def core_width_deg(lamp: Lamp) -> float:
    """Half width of what steps over a beam have to resolve: a skirt makes no beam smooth, degrees."""
    stated = stated_width_deg(lamp)
    return stated if lamp.profile == "table" else min(stated, lamp.hwhm_deg)
