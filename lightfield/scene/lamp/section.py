"""The section of the beam: how much wider it is in some directions about its axis than in others."""

from __future__ import annotations

import math

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.scene.acts import Acts
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.parameters import switched_off


def is_even(lamp: Lamp) -> bool:
    """Is the beam as wide in every direction from its axis as its profile says?"""
    return switched_off(lamp, Acts.SECTION)


def is_lopsided(lamp: Lamp) -> bool:
    """Is the beam wider on one side of its axis than on the other?"""
    return bool(lamp.asymmetry_x or lamp.asymmetry_y)


def oval(lamp: Lamp) -> tuple[float, float, float]:
    """By what an oval beam is wider than its profile: xx, xy and yy of a symmetric matrix on the angles.

    sqrt(e) exp(M / 2), where M = ((-ln e, ln d), (ln d, ln e)) of the ellipticity e and the diagonal one d.
    Where d is 1 the beam is as wide in x as its profile, and e times as wide in y; where e is 1 it is
    sqrt(d) times as wide towards +x+y, and so much narrower towards +x-y.
    """
    e, d = lamp.ellipticity, lamp.ellipticity_diagonal
    if d == 1.0:
        return 1.0, 0.0, e
    across, diagonal, mean = math.log(e), math.log(d), math.sqrt(e)
    size = math.hypot(across, diagonal)
    even, uneven = mean * math.cosh(0.5 * size), mean * math.sinh(0.5 * size) / size
    return even - uneven * across, uneven * diagonal, even + uneven * across


def widest_turn(lamp: Lamp) -> float:
    """The turn about the axis, from x towards y, at which an oval beam is widest, rad."""
    return 0.5 * math.atan2(math.log(lamp.ellipticity_diagonal), -math.log(lamp.ellipticity))


def oval_widths(lamp: Lamp) -> tuple[float, float]:
    """Widths of an oval beam where it is narrowest and widest, over that of its profile."""
    xx, xy, yy = oval(lamp)
    middle, away = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    return middle - away, middle + away


def section_widths(lamp: Lamp) -> tuple[float, float]:
    """Widths of the beam in its narrowest and its widest direction over that of its profile, or of its table.

    Bounds, where it is both oval and lopsided.
    """
    narrow, wide = oval_widths(lamp)
    lopsided = math.hypot(lamp.asymmetry_x, lamp.asymmetry_y)
    return narrow * (1.0 - lopsided), wide * (1.0 + lopsided)


def effective_angles(lamp: Lamp, theta_x_rad: Array, theta_y_rad: Array) -> tuple[Array, Array]:
    """Angles at which an even beam has the intensity that this one has at the given ones, rad.

    A beam is wider by 1 + asymmetry_x cos phi + asymmetry_y sin phi, then as its `oval` says. The tracer's
    own is in `render.tracer.emission.Emission`.

    Parameters
    ----------
    lamp : Lamp
        Ellipticities and asymmetry.
    theta_x_rad, theta_y_rad : array, rad
        Beam-frame angles, broadcast against each other.
    """
    x, y = theta_x_rad, theta_y_rad
    if is_lopsided(lamp):
        wider = width_towards(lamp, x, y)
        x, y = x / wider, y / wider
    if lamp.ellipticity_diagonal == 1.0:
        return x, y / lamp.ellipticity
    xx, xy, yy = narrowing(lamp)
    return xx * x + xy * y, xy * x + yy * y


def narrowing(lamp: Lamp) -> tuple[float, float, float]:
    """xx, xy and yy of the matrix that makes an oval beam round: the inverse of `oval`."""
    xx, xy, yy = oval(lamp)
    area = xx * yy - xy * xy
    return yy / area, -xy / area, xx / area


def width_towards(lamp: Lamp, theta_x_rad: Array, theta_y_rad: Array) -> Array:
    """How much wider a lopsided beam is in these directions from its axis than on average."""
    away = np.maximum(np.hypot(theta_x_rad, theta_y_rad), TINY)
    return np.asarray(
        1.0 + (lamp.asymmetry_x * theta_x_rad + lamp.asymmetry_y * theta_y_rad) / away, dtype=float
    )
