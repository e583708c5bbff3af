"""The closed-form model, stage by stage: source, path, receiver, readout.

    I(theta)  = I0 exp(-B theta^2)                       source      (paper eq. 1)
    E         = I(theta) / r^2                           inverse square (eq. 2-3)
    T         = exp(-integral of c along the ray)        path        (eq. 4-7)
    reading   = readout(gain (E T x response + diffuse) x lamp power(t) / immersion + background)

All fields are for unit radiant intensity on the beam axis (1 W/sr), in 1/m^2, or 1/m^2/sr for radiance.
"""

from __future__ import annotations

import math
from functools import cache, partial
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.errors import SceneError
from lightfield.formula import own_formulas
from lightfield.formula.path import Ray, optical_depth, rays, stated_nm
from lightfield.formula.readout import Taken, halves, readout, spectra, time_factor
from lightfield.formula.scattered.quadrature import finest_rad
from lightfield.scene.acts import Acts
from lightfield.scene.bands import read_nm
from lightfield.scene.detector import Detector
from lightfield.scene.lamp.colour import REFERENCE_NM, wider_in_colour
from lightfield.scene.lamp.frame import beam_angles, is_ahead, through_window
from lightfield.scene.lamp.profile import LN2, relative_intensity
from lightfield.scene.lamp.section import effective_angles
from lightfield.scene.parameters import switched_off
from lightfield.scene.receiver import half_view_rad, response

if TYPE_CHECKING:
    from lightfield.scene import Lamp, Scene

#: The distance that the paper relates its readings to, r0, m.
_PAPER_FROM_M = 4.5
# Disc quadrature of degree 5 (Stroud 1971, S2: 5-1): a finite window as seven points.
_TURN = np.arange(6) * (math.pi / 3)
_DISC = [
    (0.0, 0.0, 0.25),
    *((math.sqrt(2 / 3) * math.cos(t), math.sqrt(2 / 3) * math.sin(t), 0.125) for t in _TURN),
]
#: A window this many half widths of its beam wide, where it is nearest, is seven points to 1e-3 of the axis;
#: wider ones are rings, of so many for each half width and at most so many, to 1e-4 (test_window.py).
_SEVEN, _RINGS, _MOST_RINGS = 0.75, 1.5, 12
#: A collimator sees all of a window that is smaller than this part of what it sees from the axis; where its
#: edge may cut it there are so many points: right to 2 % (test_window.py).
_WHOLLY, _CUT = 0.1, 200
#: So many rays from points of a window to receivers are worked out at once. Chosen: memory alone.
_AT_ONCE = 20_000
#: No beam counts as wider, rad.
_STEEPEST = 1.4


def refuse_pencil(lamp: Lamp) -> None:
    """Raise `SceneError` for a beam without a width, whose intensity is infinite."""
    if lamp.profile == "pencil":
        raise SceneError(
            "a pencil beam has no irradiance at a point", where="lamp.profile", rule="finite intensity",
            remedy="render it, or give the beam a width",
        )  # fmt: skip


def source(
    lamp: Lamp, ray: Ray, in_air: Array | None = None, wavelength_nm: ArrayLike = REFERENCE_NM
) -> Array:
    """Relative radiant intensity towards each receiver (eq. 1).

    Parameters
    ----------
    lamp : Lamp
        Profile.
    ray : Ray
        Where to.
    in_air : array of bool, optional
        Readings in air see I(theta / n) / n^2 of the beam in water, n = lamp.window_index.
    wavelength_nm : array, nm, optional
        Of each, where the beam's width has a colour.
    """
    refuse_pencil(lamp)
    theta_x, theta_y = beam_angles(lamp, ray.dx, ray.dy, ray.dz)
    if lamp.width_slope:
        wider = wider_in_colour(lamp, wavelength_nm)
        theta_x, theta_y = theta_x / wider, theta_y / wider
    if in_air is None or lamp.window_index == 1.0:
        return relative_intensity(lamp, theta_x, theta_y)
    n = np.where(in_air, lamp.window_index, 1.0)
    return np.asarray(through_window(partial(relative_intensity, lamp), theta_x, theta_y, n))


def table_angle(lamp: Lamp, x_m: Array, y_m: Array, z_m: Array, medium: ArrayLike | None = None) -> Array:
    """Angles from the beam's axis, rad, at which a lamp's table is read for receivers, all alike in shape."""
    ray = rays(lamp, x_m, y_m, z_m)
    theta_x, theta_y = beam_angles(lamp, ray.dx, ray.dy, ray.dz)
    in_air = air_mask(medium)
    n = 1.0 if in_air is None else np.where(in_air, lamp.window_index, 1.0)
    return np.asarray(np.hypot(*effective_angles(lamp, theta_x, theta_y)) / n)


def receiver(scene: Scene, ray: Ray, x_m: Array, y_m: Array, z_m: Array) -> Array:
    """Response to light of unit normal irradiance from each ray, see `scene.receiver.response`.

    The receiver looks along -z turned towards +x by its tilt, or at the lamp's window.

    Parameters
    ----------
    scene : Scene
        Detector, and the lamp's place.
    ray : Ray
        Incoming light.
    x_m, y_m, z_m : array, m
        Receivers.
    """
    direction, axis = (ray.dx / ray.r, ray.dy / ray.r, ray.dz / ray.r), None
    if scene.detector.aim == "lamp":
        dx, dy = scene.lamp.offset_x_m - x_m, scene.lamp.offset_y_m - y_m
        length = np.sqrt(dx * dx + dy * dy + z_m * z_m)
        axis = (dx / length, dy / length, -z_m / length)
    return response(scene.detector, direction, axis)


def direct_field(
    scene: Scene,
    x_m: ArrayLike,
    y_m: ArrayLike,
    z_m: ArrayLike,
    wavelength_nm: ArrayLike | None = None,
    medium: ArrayLike | None = None,
    time_s: ArrayLike | None = None,
) -> Array:
    """Light that comes straight from the lamp, for unit radiant intensity on the axis.

    Parameters
    ----------
    scene : Scene
        Lamp, water, detector.
    x_m, y_m, z_m : array, m
        Receivers, broadcast against each other.
    wavelength_nm : array, nm, optional
        One per receiver; absent or NaN means the centre of the first band.
    medium : array of str or bool, optional
        "air" or True: no attenuation, and the window index acts.
    time_s : array, s, optional
        One per receiver, for water that changes; absent or NaN means 0.

    Returns
    -------
    array, 1/m^2 (1/m^2/sr for radiance)
        Zero at and behind the window plane, and no farther than a source in front of it.

    Raises
    ------
    SceneError
        A pencil beam, or a wavelength outside the water's table.
    """
    x, y, z = (np.asarray(v, dtype=float) for v in (x_m, y_m, z_m))
    if not x.shape == y.shape == z.shape:
        x, y, z = np.broadcast_arrays(x, y, z)
    in_air, scene = air_mask(medium), own_formulas.lit(scene)
    lamp, on_path = scene.lamp, own_formulas.factor(scene, ("path",), x, y, z, wavelength_nm)
    if lamp.radius_m == 0.0:
        return light_of_point(scene, (0.0, 0.0), x, y, z, wavelength_nm, in_air, time_s) * on_path
    total = np.zeros(x.shape)
    points = np.array(points_of_window(lamp, z, scene.detector)).T
    for some in np.array_split(points, math.ceil(points.shape[1] * x.size / _AT_ONCE) or 1, axis=1):
        u, v, share = some.reshape(3, -1, *[1] * x.ndim)
        light = light_of_point(scene, (u, v), x, y, z, wavelength_nm, in_air, time_s)
        total += (share * light).sum(axis=0)
    return total * on_path


def points_of_window(
    lamp: Lamp, z_m: ArrayLike = math.inf, detector: Detector | None = None
) -> list[tuple[float, float, float]]:
    """The points that stand for the lamp's window: places in x and y beside its middle, m, and shares.

    Parameters
    ----------
    z_m : array, m
        Where their light is wanted: the nearer, the more points there are; default: far away.
    detector : Detector, optional
        One that sees a part of the window only asks for many.
    """
    if lamp.radius_m == 0.0:
        return [(0.0, 0.0, 1.0)]
    return [(lamp.radius_m * u, lamp.radius_m * v, share) for u, v, share in _points(lamp, z_m, detector)]


def _points(lamp: Lamp, z_m: ArrayLike, detector: Detector | None) -> list[tuple[float, float, float]]:
    """Places in a window of radius one, and the share of each."""
    window = float(np.min(z_m, where=np.asarray(z_m) > 0, initial=math.inf))
    half_width = math.sqrt(2 * LN2) * finest_rad(lamp) if lamp.profile != "isotropic" else math.inf
    wide = lamp.radius_m / ((window + lamp.apparent_distance_m) * math.tan(min(half_width, _STEEPEST)))
    if detector is not None:
        seen = lamp.radius_m / window
        if detector.quantity != "radiance":
            wide = max(wide, seen / math.tan(half_view_rad(detector)))
        elif seen > _WHOLLY * math.tan(math.radians(0.5 * detector.full_angle_deg)):
            # The edge of what it sees may cut the window anywhere.
            return _spread_evenly(_CUT)
    return _DISC if wide <= _SEVEN else _rings(min(math.ceil(_RINGS * wide) + 1, _MOST_RINGS))


@cache
def _spread_evenly(count: int) -> list[tuple[float, float, float]]:
    """Points of equal share along a spiral by the golden angle (Vogel 1979, Math. Biosci. 44, 179): whatever
    is cut off a disc, as great a part of them is."""
    k = np.arange(count)
    radius, turn = np.sqrt((k + 0.5) / count), k * (math.pi * (3 - math.sqrt(5)))
    columns = (radius * np.cos(turn), radius * np.sin(turn), np.full(count, 1.0 / count))
    return list(zip(*(column.tolist() for column in columns), strict=True))


@cache
def _rings(count: int) -> list[tuple[float, float, float]]:
    """Rings by Gauss and Legendre over the area, every other one turned by half a step."""
    node, weight = np.polynomial.legendre.leggauss(count)
    around = 2 * count + 3
    turn = (np.arange(around) + 0.5 * (np.arange(count) % 2)[:, None]) * (2 * math.pi / around)
    radius = np.sqrt(0.5 * (node + 1))[:, None]
    share = np.broadcast_to(0.5 * weight[:, None] / around, turn.shape)
    columns = (radius * np.cos(turn), radius * np.sin(turn), share)
    return list(zip(*(column.ravel().tolist() for column in columns), strict=True))


def light_of_point(
    scene: Scene,
    beside_m: tuple[ArrayLike, ArrayLike],
    x: Array,
    y: Array,
    z: Array,
    wavelength_nm: ArrayLike | None = None,
    in_air: Array | None = None,
    time_s: ArrayLike | None = None,
) -> Array:
    """`direct_field` of one point of the window, or of each of several, without effects of your own.

    Parameters
    ----------
    beside_m : two arrays, m
        The points' places in x and y beside the middle, which receivers that are aimed look at; broadcast
        against the receivers.
    x, y, z : array, m
        Receivers, all of one shape.
    """
    lamp, ahead = scene.lamp, is_ahead(scene.lamp, z)
    if not ahead.all():
        z = np.where(ahead, z, 1.0 + abs(lamp.apparent_distance_m))
    ray = rays(lamp, x, y, z, beside_m=beside_m)
    low, high = scene.detector.bands_nm[0]
    tau = optical_depth(scene.water, ray, z, wavelength_nm, 0.5 * (low + high), time_s)
    if in_air is not None:
        tau = np.where(in_air, 0.0, tau)
    colour = stated_nm(wavelength_nm, 0.5 * (low + high)) if lamp.width_slope else REFERENCE_NM
    sent = source(lamp, ray, in_air, colour)
    light = sent * np.exp(-tau) / (ray.r * ray.r) * receiver(scene, ray, x, y, z)
    return light if ahead.all() else np.where(ahead, light, 0.0)


def air_mask(medium: ArrayLike | None) -> Array | None:
    """True where a reading was taken in air; None when none was.

    Parameters
    ----------
    medium : array of str or bool, optional
        "air" or "water".
    """
    if medium is None:
        return None
    given = np.asarray(medium)
    mask = given if given.dtype == bool else given == "air"
    return mask if mask.any() else None


class ReadAt(Protocol):
    """Places of readings, m; `wavelength_nm`, `medium` and `time_s` are asked for where it has them."""

    @property
    def x_m(self) -> Array: ...
    @property
    def y_m(self) -> Array: ...
    @property
    def z_m(self) -> Array: ...


def predict(
    scene: Scene, readings: ReadAt, diffuse: ArrayLike = 0.0, gain: ArrayLike = 1.0, full: float | None = None
) -> Array:
    """Readings of a table: readout(gain (direct + diffuse) x lamp power).

    Parameters
    ----------
    scene : Scene
        Everything that is known.
    readings : Readings or similar
        Where, and with what.
    diffuse : array, 1/m^2
        Scattered and reflected light for unit on-axis intensity.
    gain : array
        Reading per unit of light; one, or one per reading.
    full : float, optional
        Largest reading, for saturation.
    """
    wavelength, medium, time = (getattr(readings, k, None) for k in ("wavelength_nm", "medium", "time_s"))
    places = readings.x_m, readings.y_m, readings.z_m
    stated = wavelength
    if scene.detector.wavelength_shift_nm:
        middle = float(np.mean(scene.detector.bands_nm[0]))
        known = np.full(np.shape(places[2]), np.nan) if wavelength is None else np.asarray(wavelength, float)
        wavelength = read_nm(scene, np.where(np.isnan(known), middle, known))
    direct = direct_field(scene, *places, wavelength, medium, time)
    light = (np.asarray(diffuse, dtype=float) + direct) * np.asarray(gain, dtype=float)
    if time is not None and not switched_off(scene.lamp, Acts.TIME):
        light = light * time_factor(scene, time)
    in_air = air_mask(medium)
    spectrum = None
    if (scene.detector.stray_light or scene.detector.second_order) and wavelength is not None:
        rest = (np.zeros(light.shape) if v is None else v for v in (in_air, time))
        spectrum = spectra(*places, *rest)
    taken = Taken(in_air, spectrum, time, halves(spectrum, stated), places[2], stated)
    if not scene.effect:
        return readout(scene, light, full, taken)
    where = (*places, stated, time)
    found = readout(scene, light * own_formulas.factor(scene, ("source", "receiver"), *where), full, taken)
    return own_formulas.shown(scene, found, float(np.abs(found).max()) if full is None else full, *where)


def paper_model(
    r_m: ArrayLike, theta_rad: ArrayLike, hwhm_deg: float = 3.81, attenuation_per_m: float = 0.1
) -> Array:
    """The paper's combined form, I(r, theta) / I(r0, 0) = (r0/r)^2 exp(-K (r - r0)) exp(-B theta^2).

    Parameters
    ----------
    r_m : array, m
        Distance from the lamp.
    theta_rad : array, rad
        Angle from the beam axis.
    hwhm_deg : float, deg
        Half width of the beam at half maximum, B = ln2 / hwhm^2.
    attenuation_per_m : float, 1/m
        K.
    """
    r, theta = np.asarray(r_m, dtype=float), np.asarray(theta_rad, dtype=float)
    beam = np.exp(-LN2 * (theta / math.radians(hwhm_deg)) ** 2)
    return np.asarray((_PAPER_FROM_M / r) ** 2 * np.exp(-attenuation_per_m * (r - _PAPER_FROM_M)) * beam)
