"""Response of a receiver to the direction of light."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lightfield.arrays import Array
from lightfield.scene.acts import Acts
from lightfield.scene.detector import Detector
from lightfield.scene.lamp.profile import LN2
from lightfield.scene.parameters import fields_on, switched_off

#: Half angle from which on a view is wide: more is not told apart.
_WIDE_DEG = 60.0
#: Fields of a detector that make its response.
RECEIVER = fields_on(Detector, Acts.RECEIVER)


def looks_aside(detector: Detector) -> bool:
    """Is the receiver's axis another than that of the tank?"""
    return detector.aim == "lamp" or detector.tilt_x_deg != 0


def is_cosine(detector: Detector) -> bool:
    """Is the response the plain cosine to the axis of the tank?"""
    towards_end = detector.quantity == "irradiance" and detector.aim == "axis"
    return towards_end and switched_off(detector, Acts.RECEIVER)


def half_view_rad(detector: Detector) -> float:
    """Half angle of what a receiver sees that keeps parallel to itself wherever it is, at most 60 degrees.

    That of a collimator, or the half width of an acceptance. A receiver that is aimed at the lamp sees the
    same part of the beam from everywhere: its view counts as wide.
    """
    if detector.quantity == "radiance":
        half = 90.0 if detector.aim == "lamp" else 0.5 * detector.full_angle_deg
    else:
        half = detector.acceptance_hwhm_deg or 90.0
    return math.radians(min(half, _WIDE_DEG))


def tilted_axis(detector: Detector) -> tuple[float, float, float]:
    """Axis of a receiver that is not aimed at the lamp: -z, turned towards +x."""
    tilt = math.radians(detector.tilt_x_deg)
    return math.sin(tilt), 0.0, -math.cos(tilt)


def cone_sr(detector: Detector) -> float:
    """Solid angle that a receiver of radiance sees; 1 of one of irradiance, which sees all."""
    if detector.quantity != "radiance":
        return 1.0
    return 4.0 * math.pi * math.sin(0.25 * math.radians(detector.full_angle_deg)) ** 2


def response(
    detector: Detector, direction: Sequence[Array], axis: Sequence[Array | float] | None = None
) -> Array:
    """Reading of a point receiver in light of unit normal irradiance.

    Cosine for irradiance, times 1 + 2 e (1 - cosine) of a collector with an error e at 60 degrees (2 to 10 %
    beyond 60 degrees: Mueller et al. 2003, Ocean optics protocols, rev. 4, vol. II), times a Gaussian
    acceptance; 1 for scalar irradiance; 1 / solid angle inside the
    collimator's cone for radiance. The tracer's own, on the processor or the graphics card, is
    `render.tracer.planes.Planes.point_response`.

    Parameters
    ----------
    direction : x, y and z components of unit vectors, arrays
        Along which the light flies.
    axis : x, y and z components of a unit vector, optional
        Towards the light that the receiver faces; default: `tilted_axis`.

    Returns
    -------
    array, 1 (1/sr for radiance)
    """
    if detector.quantity == "scalar_irradiance":
        return np.ones_like(direction[2])
    towards = tilted_axis(detector) if axis is None else axis
    if detector.quantity == "radiance":
        inside = _angle_between(direction, towards) < 0.5 * math.radians(detector.full_angle_deg)
        return np.where(inside, 1.0 / cone_sr(detector), 0.0)
    plain = axis is None and detector.tilt_x_deg == 0
    facing = direction[2] if plain else -sum(u * a for u, a in zip(direction, towards, strict=True))
    cosine = np.asarray(np.maximum(facing, 0.0))
    if detector.cosine_error:
        cosine = cosine * (1.0 + 2.0 * detector.cosine_error * (1.0 - cosine))
    if not detector.acceptance_hwhm_deg:
        return cosine
    ratio = _angle_between(direction, towards) / math.radians(detector.acceptance_hwhm_deg)
    return np.asarray(cosine * np.exp(-LN2 * ratio**2))


def _angle_between(direction: Sequence[Array], axis: Sequence[Array | float]) -> Array:
    """Angle of incidence, rad, from the chord: 1 - cos has no digits left at small angles."""
    chord = np.sqrt(sum((u + a) ** 2 for u, a in zip(direction, axis, strict=True)))
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))
