"""The frame of the beam: its axes in the tank, and angles about its axis."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lightfield.arrays import TINY, Array, Mask
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.photometry import beam_table
from lightfield.scene.lamp.section import is_even

Direction = tuple[float, float, float]
#: x, y and z of a place in the tank, m.
Point = tuple[float, float, float]


def is_tilted(lamp: Lamp) -> bool:
    """Does the beam's axis differ from that of the tank?"""
    return bool(lamp.tilt_x_deg or lamp.tilt_y_deg)


def is_round(lamp: Lamp) -> bool:
    """Is the beam the same all round the axis of the tank?"""
    return not is_tilted(lamp) and has_round_section(lamp)


def has_round_section(lamp: Lamp) -> bool:
    """Is the beam the same all round its own axis?"""
    return is_even(lamp) and (lamp.profile != "table" or beam_table(str(lamp.intensity_table)).is_round)


def is_mirrored(lamp: Lamp) -> tuple[bool, bool]:
    """Is the section of the beam the same at -x, and at -y?"""
    in_x, in_y = beam_table(str(lamp.intensity_table)).mirrored if lamp.profile == "table" else (True, True)
    straight = lamp.ellipticity_diagonal == 1.0
    return in_x and straight and not lamp.asymmetry_x, in_y and straight and not lamp.asymmetry_y


def source_point(lamp: Lamp) -> Point:
    """Where the light seems to come from, m: the middle of the window, or so far behind it along the tank.

    The tracer's own is `render.tracer.emission.Emission.on_window`.
    """
    return lamp.offset_x_m, lamp.offset_y_m, -lamp.apparent_distance_m


def from_source(lamp: Lamp, x_m: Array, y_m: Array, z_m: Array) -> tuple[Array, Array, Array]:
    """The way from there to points, along the axes of the tank, m."""
    x, y, z = source_point(lamp)
    return x_m - x, y_m - y, z_m - z


def angle_from_axis(x_m: Array, y_m: Array, z_m: Array) -> Array:
    """Angle of points from the axis of the tank, as the middle of the window sees them, rad."""
    return np.asarray(np.arctan2(np.hypot(x_m, y_m), z_m))


def is_ahead(lamp: Lamp, z_m: Array) -> Mask:
    """Does straight light get there: beyond the window, and beyond a source in front of it?"""
    return np.asarray(z_m > max(-lamp.apparent_distance_m, 0.0))


def beyond_window(length_m: Any, z_m: Any, apparent_distance_m: Any) -> Any:
    """The part of a path from the apparent source to a point that lies beyond the window, where water is, m.

    Parameters
    ----------
    length_m : array of NumPy or Dr.Jit, m
        From the source, `apparent_distance_m` behind the window, to the point.
    z_m : the same, m
        Of the point, not zero where the source is in the window.
    apparent_distance_m : float, or Dr.Jit's, m
    """
    return length_m * (z_m / (z_m + apparent_distance_m))


def through_window(
    intensity: Callable[[Any, Any], Any], theta_x_rad: Any, theta_y_rad: Any, index: Any
) -> Any:
    """Intensity of a beam beyond a flat window that refracts it: I(theta / n) / n^2, at small angles.

    Parameters
    ----------
    intensity : callable
        Of the beam in water, at two angles about its axis.
    theta_x_rad, theta_y_rad : arrays of NumPy or Dr.Jit, rad
        Behind the window.
    index : float or array
        n, `lamp.window_index` towards air; 1 towards water.
    """
    return intensity(theta_x_rad / index, theta_y_rad / index) / (index * index)


def beam_axes(lamp: Lamp) -> tuple[Direction, Direction, Direction]:
    """Unit vectors right, up and forward of the beam in the frame of the tank.

    Forward is along (tan tilt_x, tan tilt_y, 1), right is level, and an untilted beam has the tank's axes.
    """
    ax, ay = math.tan(math.radians(lamp.tilt_x_deg)), math.tan(math.radians(lamp.tilt_y_deg))
    flat, full = math.hypot(1.0, ax), math.sqrt(1.0 + ax * ax + ay * ay)
    right = (1.0 / flat, 0.0, -ax / flat)
    up = (-ax * ay / (flat * full), flat / full, -ay / (flat * full))
    return right, up, (ax / full, ay / full, 1.0 / full)


def axis_at(lamp: Lamp, z_m: Array) -> tuple[Array, Array]:
    """Where the beam's axis meets planes, x and y, m, each of the shape of `z_m`.

    It begins where the light seems to come from, see `formula.path.rays`.
    """
    ux, uy, uz = beam_axes(lamp)[2]
    x, y, z = source_point(lamp)
    return x + ux / uz * (z_m - z), y + uy / uz * (z_m - z)


def beam_angles(lamp: Lamp, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """Angles about the beam's axis, see `angles_about_axis`, of directions given in the frame of the tank.

    The tracer's own, on the processor or the graphics card, is `render.tracer.emission.Emission.angles`.

    Parameters
    ----------
    lamp : Lamp
        Tilt.
    x, y, z : arrays
        Components, of vectors of any length.
    """
    if is_tilted(lamp):
        x, y, z = (u * x + v * y + w * z for u, v, w in beam_axes(lamp))
    return angles_about_axis(x, y, z)


def angles_about_axis(x: Array, y: Array, z: Array | float) -> tuple[Array, Array]:
    """theta (cos phi, sin phi), rad, of vectors with these components in the frame of the beam."""
    across = np.sqrt(x * x + y * y)
    scale = np.arctan2(across, z) / np.maximum(across, TINY)
    return x * scale, y * scale
