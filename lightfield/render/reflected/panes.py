"""Light that panes of bare glass mirrored, and the water surface with them, any number of times: exact.

A box with plane mirrors shows images of its lamp, one for every number of reflections to each side (Allen and
Berkley 1979, J. Acoust. Soc. Am. 65, 943, doi:10.1121/1.382599):

    E = sum over images  I(d) R(d_x)^|i| R(d_y)^.. R(d_z)^..  e^{-c r} / r^2

A pane reflects as its two faces do in a row, without interference: water to glass, glass to air. Beyond the
critical angle of water, 48 degrees, it reflects everything, however thick it is: a tank of glass leads light
along. How far a ray is set off inside the glass, some millimetres, is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import TINY, Array
from lightfield.render.reflected.from_lamp import before_lamp, fresnel, in_water_m
from lightfield.scene import Lamp, Tank
from lightfield.scene.lamp.frame import beam_angles, from_source, source_point
from lightfield.scene.lamp.profile import relative_intensity
from lightfield.scene.tank import PANE_INDEX, WATER_INDEX

#: Images so far to a side at most. Derived: what no pane reflects totally is gone after ten reflections, and
#: in a tank 60 times as long as wide a ray at the critical angle meets its sides so often.
_FARTHEST = 60
#: Images that add less than this part of what all nearer ones send to any place, twice in a row, end the sum.
_LEAST = 1e-5
#: Ways that would send less than this part of a lamp on the axis, all else alike, are left out.
_FAINT = 1e-6
#: Part of diffuse light that a bare pane mirrors: its mean over a hemisphere, weighed by the cosine. Derived;
#: `tests/physics/light/test_panes.py` integrates it.
_OF_DIFFUSE = 0.496
#: Numbers of images along the tank: none, off the near end, and off the far end and then the near end.
_ALONG = (0, -1, -2)


class SeenImages(NamedTuple):
    """Ways by mirrors to some of the places, for unit reflectance multipliers; arrays of shape (k,).

    Parameters
    ----------
    place : array of int
    leaving, arriving : array, shape (3, k)
        Directions at the lamp and at the place.
    facing : array, m^-2
        What the mirrors reflect, over the square of the way.
    in_water : array, m
    panes, surfaces : array of int
        How often the way meets either.
    """

    place: Array
    leaving: Array
    arriving: Array
    facing: Array
    in_water: Array
    panes: Array
    surfaces: Array

    def lit(self, lamp: Lamp) -> Array:
        """Normal irradiance by each way without attenuation, for unit on-axis intensity, m^-2."""
        return np.asarray(relative_intensity(lamp, *beam_angles(lamp, *self.leaving)) * self.facing)


def reflectance(cos_incidence: Array) -> Array:
    """Of a pane between water and air, unpolarised; 1 beyond the critical angle.

    Two faces that send light to and fro without interference (Born and Wolf, Principles of Optics, section
    1.5 for each): R = (R1 + R2 - 2 R1 R2) / (1 - R1 R2) for either polarisation.
    """
    c = np.clip(cos_incidence, 0, 1)
    sine2 = WATER_INDEX**2 * (1 - c * c)
    found, some = np.ones_like(c), sine2 < 1
    c, sine2 = c[some], sine2[some]
    inside, outside = np.sqrt(1 - sine2 / PANE_INDEX**2), np.sqrt(1 - sine2)
    total = np.zeros_like(c)
    for power in (1, -1):  # s, p: indices multiply the cosines, or divide them
        water, pane = WATER_INDEX**power * c, PANE_INDEX**power * inside
        first = ((water - pane) / (water + pane)) ** 2
        second = ((pane - outside) / (pane + outside)) ** 2
        total += 0.5 * (first + second - 2 * first * second) / (1 - first * second)
    found[some] = total
    return found


def diffuse_part(tank: Tank) -> float:
    """The part of what is diffuse in a tank that its panes, bare, mirror where it meets a face."""
    w, d, z = tank.width_m, tank.depth_m, tank.length_m
    sides, whole = 2 * d * z, 2 * (w * d + w * z + d * z)
    of_glass = {"none": 0.0, "sides": sides, "all": whole - w * z}[tank.panes]
    return _OF_DIFFUSE * of_glass / whole


def shells(lamp: Lamp, tank: Tank, places: Array, surface: bool) -> Iterator[SeenImages]:
    """Ways from the place of a lamp by mirrors to places: those of the nearest images, the next ones, ...

    Parameters
    ----------
    tank : Tank
        With panes; how much they reflect does not count.
    places : array, shape (n, 3), m
    surface : bool
        The top is a water surface, flat.
    """
    for q in range(_FARTHEST + 1):
        numbers = _shell(q, tank.panes == "all", surface, lamp.profile == "isotropic")
        seen = _seen(lamp, tank, places, numbers)
        if q > 1 and not len(seen.place):
            return
        yield seen


@cache
def _shell(q: int, everywhere: bool, surface: bool, backwards: bool) -> NDArray[np.int_]:
    """Numbers of the images that are q reflections away to a side, shape (n_images, 3).

    Parameters
    ----------
    everywhere : bool
        Floor and ends are panes too.
    backwards : bool
        The lamp sends light to the near end.
    """
    across = range(-q, q + 1)
    levels = across if everywhere else range(min(q, 1) + 1 if surface else 1)
    images = [
        (i, j, along)
        for i in across
        for j in (levels if abs(i) == q else {-q, q}.intersection(levels))
        for along in (_ALONG if everywhere else _ALONG[:1])
        if (i, j, along) != (0, 0, 0) and (surface or j in (0, -1)) and (backwards or along % 2 == 0)
    ]
    return np.array(images).reshape(-1, 3)


def _seen(lamp: Lamp, tank: Tank, places: Array, numbers: NDArray[np.int_]) -> SeenImages:
    """Ways by some images, numbers of shape (n_images, 3), to the places that they light."""
    source = np.array(source_point(lamp))
    low, high = np.array(tank.box_m).T
    odd = numbers % 2 == 1
    at = np.where(odd, low + high - source, source) + numbers * (high - low)
    which, place = (g.ravel() for g in np.indices((len(numbers), len(places))))
    way = places[place] - at[which]
    leaves = np.where(odd[which, 2], -way[:, 2], way[:, 2])
    ahead = np.flatnonzero(before_lamp(lamp, leaves + source[2]))
    which, place, way = which[ahead], place[ahead], way[ahead]
    r = np.sqrt(np.einsum("ki,ki->k", way, way))
    facing = 1 / r**2
    by_high = (np.abs(numbers) + (numbers > 0)) // 2
    surfaces = by_high[:, 1]
    panes = np.abs(numbers) - np.array([[0, 1, 0]]) * surfaces[:, None]
    for axis in range(3):
        meets = np.flatnonzero(panes[which, axis])
        facing[meets] *= reflectance(np.abs(way[meets, axis]) / r[meets]) ** panes[which[meets], axis]
    meets = np.flatnonzero(surfaces[which])
    facing[meets] *= fresnel(np.abs(way[meets, 1]) / r[meets]) ** surfaces[which[meets]]
    bright = np.flatnonzero(facing > _FAINT / (places[place, 2] - source[2]) ** 2)
    which, place, r, facing = which[bright], place[bright], r[bright], facing[bright]
    arriving = way[bright] / r[:, None]
    leaving = np.where(odd[which], -arriving, arriving)
    z = r * leaving[:, 2] + source[2]
    met = np.ones(len(which), bool)
    if lamp.apparent_distance_m != 0:
        # A ray that seems to start behind the window meets the first mirror only beyond it.
        level = np.where(leaving == 0, TINY, leaving)
        to_walls = (np.where(leaving > 0, high, low) - source) / level
        first = np.where(numbers[which] == 0, np.inf, to_walls).min(axis=1)
        met = before_lamp(lamp, source[2] + first * leaving[:, 2])
    in_water = np.asarray(in_water_m(lamp, r, z))
    columns: tuple[NDArray[Any], ...] = (place, leaving.T, arriving.T, facing, in_water)
    columns += (panes.sum(axis=1)[which], surfaces[which])
    return SeenImages(*(column[..., met] for column in columns))


class Mirrored(NamedTuple):
    """Light of a lamp by mirrors, without attenuation and for unit reflectance multipliers.

    Parameters
    ----------
    places : int
        How many.
    place, panes, surfaces : array of int, shape (k,)
        To which of them each way leads, and how often it meets a pane or the surface.
    light : array, shape (k,), m^-2
        What a detector reads by each.
    in_water : array, shape (k,), m
    """

    places: int
    place: Array
    panes: Array
    surfaces: Array
    light: Array
    in_water: Array

    def through(self, attenuation_per_m: Array, panes: float, surface: float) -> Array:
        """What comes through water, shape (n_waters, n_places).

        Parameters
        ----------
        panes, surface : float
            Factors on the Fresnel reflectance of either.
        """
        light = self.light * panes**self.panes * surface**self.surfaces
        through = (light * np.exp(-c * self.in_water) for c in attenuation_per_m)
        return np.array([np.bincount(self.place, each, self.places) for each in through])

    def without_surface_alone(self) -> Mirrored:
        """Without what the surface mirrored and no pane."""
        kept = self.panes > 0
        return Mirrored(self.places, *(column[kept] for column in self[1:]))


class Images:
    """The images that places see, worked out as far as the lamps that stand there light them.

    Parameters
    ----------
    lamp : Lamp
        Where they stand, see `from_lamp.alike_in_place`.
    tank, places, surface
        See `shells`.
    read : callable
        What a detector reads of unit normal irradiance along directions, shape (3, k).
    """

    def __init__(
        self, lamp: Lamp, tank: Tank, places: Array, surface: bool, read: Callable[[Array], Array]
    ) -> None:
        self.places = places
        self.known: list[tuple[SeenImages, Array]] = []
        self.rest = ((seen, read(seen.arriving)) for seen in shells(lamp, tank, places, surface))

    def of(self, lamp: Lamp) -> Mirrored:
        """Light of a lamp there."""
        way = np.stack(from_source(lamp, *self.places.T))
        r2 = (way**2).sum(axis=0)
        ahead = before_lamp(lamp, self.places[:, 2])
        direct = np.where(ahead, relative_intensity(lamp, *beam_angles(lamp, *way)), 0) / r2
        total, empty, columns, number = direct, 0, [], 0
        while empty < 2:
            if number == len(self.known):
                following = next(self.rest, None)
                if following is None:
                    break
                self.known.append(following)
            seen, read = self.known[number]
            light, number = seen.lit(lamp), number + 1
            more = np.bincount(seen.place, light, len(total))
            total = total + more
            empty = empty + 1 if (more <= _LEAST * total).all() else 0
            kept = light * (len(read) / len(total)) > _FAINT * total[seen.place]
            parts = seen.place, seen.panes, seen.surfaces, light * read, seen.in_water
            columns.append([part[kept] for part in parts])
        return Mirrored(len(self.places), *map(np.concatenate, zip(*columns, strict=True)))
