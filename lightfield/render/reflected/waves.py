"""The lamp's image in a water surface with waves: their mean over time, as light of many small mirrors.

Facets of the surface have slopes of a normal distribution, the same in all directions (Cox and Munk 1954,
J. Opt. Soc. Am. 44, 838, doi:10.1364/JOSA.44.000838). Light along d meets those that it sees, those turned
towards it more often:

    E = int dA  I(d) F(d.n)  P(s) d_y / (4 N(d) n_y^4)  e^{-c (r1 + r2)} / (r1^2 r2^2)
    N = mean over P of max(0, d_y - d_x s_x - d_z s_z)

over the level of the surface; s is the slope, and n the normal, that sends light from the lamp to the place.
In still water this is the mirror image. Facets all lie at the level of the surface: no crest stands before
another, and light that a facet sends up again meets the next one where it is. That is a sum over directions
from the lamp and slopes of the first facet, drawn once and for all (`twice`); what the second sends up again,
to a third, is left out (the tracer follows it).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from math import pi, radians, sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import erf, ndtr, ndtri
from scipy.stats import qmc

from lightfield.arrays import Array
from lightfield.render.reflected.from_lamp import before_lamp, fresnel, in_water_m
from lightfield.scene import Lamp, Tank
from lightfield.scene.lamp.frame import beam_angles, beam_axes, source_point
from lightfield.scene.lamp.profile import relative_intensity
from lightfield.scene.lamp.width import core_width_deg

#: Slopes up to so many standard deviations (beyond: 1e-5 of the facets), and up to where a facet sends light
#: straight back: the ways to it are no longer one to a slope there.
_FAR, _STEEP = 4.5, 0.95
#: Of second facets all up to so many. Derived: beyond, 1e-8 of them.
_FARTHEST = 6.0
#: Steps between slopes, as parts of the standard deviation and of the half width of the beam, which is turned
#: by twice the slope; at most so many to a side. A sum of even steps over a Gaussian of 0.75 of its standard
#: deviation errs by 1e-15; beside a beam the sum is held to 1 % by `tests/physics/light/test_waves.py`.
_STEP, _STEP_OF_BEAM, _MOST = 0.75, 0.35, 24
#: A number of steps that is this near to a whole one is that.
_ROUNDING = 1e-6
#: Ways that are worked out at a time.
_AT_ONCE = 200_000
#: Directions and first facets of light that meets two, as a power of two. Chosen: what arrives is right to
#: some per cent of itself, which is some per cent of all light of the waves.
_DRAWN = 11
#: Sine of the least angle to the surface, and a probability that is none.
_LEVEL, _NONE = 1e-6, 1e-30
#: Angles to the beam's axis between which directions are drawn.
_ANGLES = 1024


class Glitter(NamedTuple):
    """Light by way of k facets, for unit reflectance multiplier and without attenuation.

    Parameters
    ----------
    place : array of int, shape (k,)
        To which place it comes.
    arriving : array, shape (3, k)
        Directions of arrival.
    light : array, shape (k,), m^-2
        Normal irradiance by each.
    in_water : array, shape (k,), m
        Way in water.
    """

    place: np.ndarray
    arriving: np.ndarray
    light: np.ndarray
    in_water: np.ndarray

    def from_place(self, first: int) -> Glitter:
        """The same where the first of the places is that of many."""
        return self._replace(place=first + self.place)


def glitter(lamp: Lamp, tank: Tank, places: np.ndarray) -> Iterator[Glitter]:
    """Light of a lamp by way of the waves of a tank, to some of the places after the others.

    Parameters
    ----------
    tank : Tank
        With a slope of its surface.
    places : array, shape (n, 3), m
    """
    width = radians(core_width_deg(lamp))
    step = min(_STEP * tank.slope, _STEP_OF_BEAM * width)
    count = min(int(np.ceil(min(_FAR * tank.slope, _STEEP) / step - _ROUNDING)), _MOST)
    step = min(_FAR * tank.slope, _STEEP) / count
    slopes = step * np.arange(-count, count + 1)
    at_once = max(_AT_ONCE // len(slopes) ** 2, 1)
    for first in range(0, len(places), at_once):
        yield _glitter(lamp, tank, places[first : first + at_once], slopes, step).from_place(first)


def _glitter(lamp: Lamp, tank: Tank, places: np.ndarray, slopes: np.ndarray, step: float) -> Glitter:
    source = np.array(source_point(lamp))
    top = tank.lamp_depth_m
    above_lamp, above = top - source[1], np.maximum(top - places[:, 1], 1e-9)[:, None]
    level = places[:, [0, 2]] - source[[0, 2]]
    far = np.linalg.norm(level, axis=1)
    ahead = np.where(far[:, None] > 0, level / np.maximum(far, 1e-12)[:, None], [0.0, 1.0])  # (n, 2): x, z
    # Where a facet in the plane of lamp and place, of that slope along it, sends light from one to the other.
    turn = 2 * np.arctan(slopes)
    sine, cosine, far = np.sin(turn), np.cos(turn), far[:, None]
    b = cosine * (above_lamp + above) + sine * far
    c = above_lamp * (cosine * far - sine * above)
    along = 2 * c / (b + np.sqrt(b * b - 4 * sine * c))  # (n, k), from the lamp
    r1, r2 = np.hypot(along, above_lamp), np.hypot(far - along, above)
    rate_along = 0.5 * (1 + slopes**2) * (above_lamp / r1**2 + above / r2**2)
    rate_aside = (1 / r1 + 1 / r2) / (above_lamp / r1 + above / r2)
    aside = slopes / rate_aside[..., None]  # (n, k, k)
    area = step**2 / (rate_along * rate_aside)

    met_x = source[0] + along[..., None] * ahead[:, :1, None] - aside * ahead[:, 1:, None]
    met_z = source[2] + along[..., None] * ahead[:, 1:, None] + aside * ahead[:, :1, None]
    met_x, met_z = (v.reshape(len(places), -1) for v in (met_x, met_z))
    x, y, z = (np.broadcast_to(v[:, None], met_x.shape) for v in places.T)
    (left, right), _, (back, end) = tank.box_m
    inside = (met_x > left) & (met_x < right) & (met_z > back) & (met_z < end)
    inside &= before_lamp(lamp, met_z) & before_lamp(lamp, z)
    place, facet = np.nonzero(inside)
    met_x, met_z, x, y, z = (v[inside] for v in (met_x, met_z, x, y, z))
    to, r1 = _way(met_x - source[0], np.full_like(met_x, above_lamp), met_z - source[2])
    on, r2 = _way(x - met_x, y - top, z - met_z)
    light = to[1] * _turned(to, on, tank.slope) / (r1 * r2) ** 2 * area[place, facet // len(slopes)]
    light *= relative_intensity(lamp, *beam_angles(lamp, *to))
    return Glitter(place, on, light, in_water_m(lamp, r1, met_z) + r2)


def _way(x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """Unit vectors of ways, shape (3, ...), and their lengths."""
    length = np.sqrt(x * x + y * y + z * z)
    return np.stack([x / length, y / length, z / length]), length


def _turned(to: Array, on: Array, sigma: float) -> Array:
    """Part of the light along `to`, per solid angle, that facets send along `on`, over its cosine.

    Parameters
    ----------
    to, on : array, shape (3, ...)
        Unit vectors; `to` upwards.
    """
    x, y, z = to - on
    flat = x * x + z * z
    steep, chord = flat / (y * y), np.sqrt(flat + y * y)  # of incidence: half the chord between both ways
    facets = np.exp(-0.5 * steep / sigma**2) / (2 * pi * sigma**2) * (1 + steep) ** 2
    return np.asarray(fresnel(0.5 * chord) * facets / (4 * seen(to, sigma)))


def twice(lamp: Lamp, tank: Tank, places: np.ndarray) -> Iterator[Glitter]:
    """Light that two facets in a row send to the places, as `glitter`."""
    first = _sent_up_again(lamp, tank)
    at_once = max(_AT_ONCE // max(len(first.power), 1), 1)
    for start in range(0, len(places), at_once):
        yield _by_second(first, lamp, tank.slope, places[start : start + at_once]).from_place(start)


class _First(NamedTuple):
    """Light that a first facet sends up again, k of them.

    Parameters
    ----------
    point : array, shape (k, 3), m
        Where it is met.
    ahead : array, shape (k, 3)
        Along what the light flies on.
    power : array, shape (k,), sr
    in_water : array, shape (k,), m
        Way in water.
    """

    point: Array
    ahead: Array
    power: Array
    in_water: Array


def _by_second(first: _First, lamp: Lamp, sigma: float, places: np.ndarray) -> Glitter:
    """What a second facet at the same place sends on."""
    on, r2 = _way(*(of[:, None] - met for of, met in zip(places.T, first.point.T, strict=True)))
    x, y, z = first.ahead.T[:, None] - on
    some = (
        (on[1] < 0) & (x * x + z * z < (_FARTHEST * sigma * y) ** 2) & before_lamp(lamp, places[:, None, 2])
    )
    place, facet = np.nonzero(some)
    on, r2, ahead = on[:, some], r2[some], first.ahead.T[:, facet]
    light = first.power[facet] * _turned(ahead, on, sigma) / r2**2
    return Glitter(place, on, light, first.in_water[facet] + r2)


def _sent_up_again(lamp: Lamp, tank: Tank) -> _First:
    """Light of a lamp that meets facets which send it up.

    Of the facets those alone are drawn, each with its part of all that the light sees: what is drawn changes
    smoothly with the slope of the waves.
    """
    drawn, to, point, power = _at_surface(lamp, tank)
    sigma, aside, rise = tank.slope, tank.slope * ndtri(drawn[:, 1]), to[:, 1]
    level = np.maximum(np.hypot(to[:, 0], to[:, 2]), _LEVEL)
    # Steeper than this along the way of the light, of such a slope aside, facets send it up.
    flat = rise * (1 - aside**2)
    least = flat / (level + np.sqrt(np.maximum(level**2 + rise * flat, 0.0)))
    part = ndtr(-least / sigma)
    some = part > _NONE
    drawn, to, point, power, aside, level, part = (
        v[some] for v in (drawn, to, point, power, aside, level, part)
    )
    along = -sigma * ndtri(part * drawn[:, 0])
    ahead_x, ahead_z = to[:, 0] / level, to[:, 2] / level
    slope_x, slope_z = -along * ahead_x + aside * ahead_z, -along * ahead_z - aside * ahead_x
    normal = np.stack([slope_x, np.ones(len(to)), slope_z], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    cosine = np.maximum((to * normal).sum(axis=1), 0.0)
    power = power * part * fresnel(np.maximum(cosine, _LEVEL)) * cosine / (normal[:, 1] * seen(to.T, sigma))
    length = np.linalg.norm(point - source_point(lamp), axis=1)
    return _First(point, to - 2 * cosine[:, None] * normal, power, in_water_m(lamp, length, point[:, 2]))


def _at_surface(lamp: Lamp, tank: Tank) -> tuple[Array, Array, Array, Array]:
    """Light of a lamp that meets the surface: two numbers for its facet, along what it flies, where it is, m,
    and its power, sr."""
    drawn = _drawn()
    theta, nearer = _angles(lamp)
    chosen, turn = np.interp(drawn[:, 0], nearer, theta), 2 * pi * drawn[:, 1]
    right, up, forward = (np.array(axis) for axis in beam_axes(lamp))
    beside = np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up
    to = np.cos(chosen)[:, None] * forward + np.sin(chosen)[:, None] * beside
    # Between two of the angles each angle is as probable.
    k = np.clip(np.searchsorted(theta, chosen) - 1, 0, _ANGLES - 1)
    solid = 2 * pi * np.sin(chosen) * (np.diff(theta) / np.diff(nearer))[k]
    power = relative_intensity(lamp, *beam_angles(lamp, *to.T)) * solid / len(drawn)
    source = np.array(source_point(lamp))
    rise = np.maximum(to[:, 1], _LEVEL)
    point = source + ((tank.lamp_depth_m - source[1]) / rise)[:, None] * to
    (left, right_wall), _, (back, end) = tank.box_m
    met = (to[:, 1] > _LEVEL) & before_lamp(lamp, point[:, 2])
    met &= (point[:, 0] > left) & (point[:, 0] < right_wall) & (point[:, 2] > back) & (point[:, 2] < end)
    return drawn[met, 2:], to[met], point[met], power[met]


@cache
def _drawn() -> Array:
    """Numbers between 0 and 1 that fill four dimensions evenly, shape (n, 4)."""
    drawn = qmc.Sobol(4, scramble=True, seed=0).random_base2(_DRAWN)
    return np.clip(drawn, 1e-9, 1 - 1e-9)


def _angles(lamp: Lamp) -> tuple[Array, Array]:
    """Angles to the beam's axis, rad, and which part of its light is nearer, both shape (n,).

    Half of it as if it shone alike everywhere: no direction is left out.
    """
    theta = np.linspace(0.0, 0.5 * pi, _ANGLES + 1)
    middle = 0.5 * (theta[1:] + theta[:-1])
    none = np.zeros(_ANGLES)
    sides = ((middle, none), (-middle, none), (none, middle), (none, -middle))
    light = np.sin(middle) * np.mean([relative_intensity(lamp, *side) for side in sides], axis=0)
    even = np.sin(middle)
    part = 0.5 * light / light.sum() + 0.5 * even / even.sum()
    return theta, np.concatenate([[0.0], np.cumsum(part)])


def seen(to: np.ndarray, sigma: float) -> np.ndarray:
    """What light upwards along `to` sees of the facets over their level: the mean of their cosines over n_y.

    Smith 1967 (IEEE Trans. Antennas Propag. 15, 668, doi:10.1109/TAP.1967.1138991), of normal slopes.

    Parameters
    ----------
    to : array, shape (3, ...)
        Unit vectors, y upwards.
    sigma : float
        Standard deviation of the slope in one direction.
    """
    x, y, z = to
    spread = sigma * np.sqrt(x * x + z * z)
    at = y / np.maximum(spread, 1e-12)
    density = np.exp(-0.5 * at * at) / sqrt(2 * pi)
    below = 0.5 * (1 + erf(at / sqrt(2)))
    return np.asarray(y * below + spread * density)
