"""The walls of a tank as patches: light that is reflected by them, any number of times.

Radiosity (Goral, Torrance, Greenberg and Battaile 1984), worked out at a few attenuations and reflectances of
the surface between which it is interpolated.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cached_property, lru_cache
from math import prod, sqrt

import numpy as np

from lightfield.memory import Latest
from lightfield.render.reflected.from_lamp import Ways, alike_in_place, alike_on_both_sides, fresnel
from lightfield.render.reflected.orders import (
    FEWER,
    REFLECTIONS,
    AtOnce,
    Operators,
    Orders,
    reflections_of,
    terms_of_light,
)
from lightfield.render.reflected.patches import AngularResponse, Patches, Transfer, closed, transfer, walls
from lightfield.scene import Lamp, Scene, Tank, receiver

_MOST_PAIRS = 1_500_000  # of fine patch and reading
_FEWEST_PATCHES, _MOST_PATCHES, _MOST_PARTS = 400, 900, 4
#: Step of attenuation, m^-1, between which orders of light are interpolated, and after how many of them it is
#: twice as long. In the tanks of `benchmarks/constants`, in the middle of steps: to 0.2 % in the clearest
#: water of one of 37 m, to 0.02 % in the others, and to 0.06 % where steps are long; in a closed white tow
#: tank, for a beam of 4 degrees, to 0.1 %.
C_STEP, _SHORT_STEPS = 0.025, 6
#: Reflectances of the surface, as far as a scene may say. At 0.1 light is right to 0.25 %, from 0.25 on to
#: 0.1 % (walls of 0.3 and 0.9, beams of 4 to 30 degrees). Between four of them, orders added up before, it
#: was 2 % off between walls of 0.9.
SURFACE_NODES = (0.0, 0.2, 0.5, 1.0, 1.5)
#: The normal of the floor has a y above this, that of walls none, and that of a lid looks down; the far end's
#: has a z below the negative.
_FACING = 0.5
#: Of walls, floor and far end: albedo over that of the brightest of the three.
Shares = tuple[float, float, float]
#: Attenuation, m^-1, surface reflectance, shares of the faces, reflections that are followed.
_Exchange = tuple[float, float, Shares, int]
#: Of these numbers of reflections.
_NUMBERS = (*FEWER, REFLECTIONS)
#: Light that is the same on both sides of x = 0, and light that is opposite there: that of the other side
#: over that of the one.
_EVEN, _ODD = 1.0, -1.0
#: Lamps whose light is remembered: at most so many, and in so many bytes, but some; operators alike.
KEPT_LAMPS, _KEPT_BYTES, _FEWEST = 60, 50e6, 8
_KEPT_OPERATORS, _OPERATOR_BYTES = 60, 100e6
#: What waters let through on the way from the place of a lamp: of at most so many, and in so many bytes.
_KEPT_WATERS, _THROUGH_BYTES = 400, 20e6
#: Where it is at most so many times the exchange of the patches, what takes light to the readings at once is
#: worked out for a water that was asked for so often, and kept in so many bytes: it costs as much as to
#: follow ten lamps, five where what patches exchange has to be made anew, and of few reflections one or two.
_LARGER, OFTEN, _AT_ONCE_BYTES = 2, 5, 100e6
#: Waters of which it is remembered how often they were asked for, in two megabytes.
_COUNTED = 10_000


class Room:
    """The walls of a tank as patches: the light that they send to each other and to the readings.

    A tank is its own mirror image at x = 0, and so is the exchange: light is taken as the sum of what is the
    same on both sides and what is opposite there, each of which needs the patches of one side only. A lamp
    whose beam is alike on both sides has none of the second.
    """

    def __init__(self, scene: Scene, places: np.ndarray, lid: bool) -> None:
        assert scene.tank is not None
        self.scene = scene
        self._which, self._side, self.places = np.arange(len(places)), np.ones(len(places)), places
        if not receiver.looks_aside(scene.detector):
            self._side = np.where(places[:, 0] < 0, -1.0, 1.0)
            folded = places * np.stack([self._side, *np.ones((2, len(places)))], axis=1)
            self.places, which = np.unique(folded, axis=0, return_inverse=True)
            self._which = which.ravel()
        self.top = scene.tank.lamp_depth_m
        # Many readings: rather fewer patches in three by three parts than more in two by two.
        count = float(np.clip(_MOST_PAIRS / (9 * len(places)), _FEWEST_PATCHES, _MOST_PATCHES))
        self.half, self._openings = walls(scene, float(places[:, 2].max()), lid, count)
        self.patches = self.half.on_both_sides()
        # A receiver that faces straight back to the lamp sees only walls before it.
        before = self.half.centre[:, 2] - self.half.half_along < places[:, 2].max()
        before |= receiver.looks_aside(scene.detector)
        self.before = np.flatnonzero(before)
        parts = int(sqrt(_MOST_PAIRS / (len(places) * 2 * len(self.before))))
        self.parts = int(np.clip(parts, 1, _MOST_PARTS))
        self.fine = self.half.divided(self.parts).on_both_sides()
        self._terms = terms_of_light(self.parts)
        size = 4 * (
            len(self.places) * (self._terms.shape[1] + 1) * len(self.before) + len(self.half.centre) ** 2
        )
        self._operator = lru_cache(int(np.clip(_OPERATOR_BYTES / size, _FEWEST, _KEPT_OPERATORS)))(
            self._operator_in
        )
        self._through = lru_cache(2)(self._through_water)
        self._at_once: dict[tuple[_Exchange, float], AtOnce] = {}
        self._asked = Latest[tuple[_Exchange, float], int](_COUNTED)
        self._ways = lru_cache(KEPT_LAMPS)(self._ways_of)
        waters = int(np.clip(_THROUGH_BYTES / (4 * len(self.fine.centre)), _FEWEST, _KEPT_WATERS))
        self._dimmed = lru_cache(waters)(lambda at, mirrored, c: self._ways(at, mirrored).through(c))
        self._is_floor = self.half.normal[:, 1] > _FACING
        self._is_end = self.half.normal[:, 2] < -_FACING
        #: Light at the readings, of lamps by their number.
        kept = int(np.clip(_KEPT_BYTES / (8 * REFLECTIONS * len(places)), 4 * _FEWEST, 4 * KEPT_LAMPS))
        self._known = Latest[tuple[int, _Exchange], Orders](kept)
        numbers = itertools.count()
        self._number = lru_cache(KEPT_LAMPS)(lambda lamp: next(numbers))

    def light(self, lamp: Lamp, attenuation_per_m: np.ndarray, tank: Tank) -> np.ndarray:
        """Light at the readings that was reflected by a wall at least once, shape (n_waters, n).

        Worked out at a few attenuations and reflectances, and interpolated: the logarithm of every order is
        nearly linear in the first (cubic between four nodes, which leaves no jump) and smooth in the second.
        A fit that moves the water, all walls or the surface then costs nothing new.

        Parameters
        ----------
        attenuation_per_m : array, shape (n_waters,), m^-1
        tank : Tank
            Albedos and surface reflectance.
        """
        surface = tank.surface_reflectance
        albedo, shares, reflections = _faces(tank)
        mirrors = (surface,) if surface in SURFACE_NODES else SURFACE_NODES
        nodes, along_c = between_attenuations(attenuation_per_m)
        asked, mine = [(c, m, shares, reflections) for c in nodes for m in mirrors], self._number(lamp)
        reached = {of: self._known[mine, of] for of in asked if (mine, of) in self._known}
        missing = [of for of in asked if of not in reached]
        for of, found in zip(missing, self._reached(lamp, missing), strict=True):
            reached[of] = self._known[mine, of] = found
        weights = np.kron(along_c, lagrange(mirrors, surface))
        return Orders.between([reached[of] for of in asked], weights).for_albedo(albedo)

    def _reached(self, lamp: Lamp, asked: Sequence[_Exchange]) -> list[Orders]:
        """Light at the readings in several waters, under several surfaces, between walls of some albedos."""
        if not asked:
            return []
        waters = {c: k for k, c in enumerate(dict.fromkeys(of[0] for of in asked))}
        straight = self.lit(lamp, False, list(waters))
        by_surface = self.lit(lamp, True, list(waters)) if any(of[1] for of in asked) else None
        light = np.zeros((len(asked), asked[0][3], len(self._which)))
        for side in (_EVEN,) if alike_on_both_sides(lamp) else (_EVEN, _ODD):
            direct = self._in_terms(straight, side)
            mirrored = direct if by_surface is None else self._in_terms(by_surface, side)
            for k, of in enumerate(asked):
                water = waters[of[0]]
                terms = direct[water] + np.float32(of[1]) * mirrored[water] if of[1] else direct[water]
                found = self._passed(of, side, terms)
                light[k] += found[:, self._which] * (1.0 if side == _EVEN else self._side)
        every = Orders.of(light)
        return [every.at(k) for k in range(len(asked))]

    def _in_terms(self, lit: np.ndarray, side: float) -> np.ndarray:
        """The part of light on the fine patches that is the same on both sides, or opposite, by terms.

        Of the patches of one side, (n_waters, n_patches / 2, n_terms).
        """
        here, there = np.split(lit, 2, axis=1)
        part = np.float32(0.5) * (here + np.float32(side) * there)
        return np.asarray(part.reshape(len(lit), -1, self.parts**2) @ self._terms)

    def lit(self, lamp: Lamp, mirrored: bool, attenuation_per_m: Sequence[float]) -> np.ndarray:
        """Irradiance of the fine patches by the lamp, for unit on-axis intensity, m^-2, in each of m waters,
        shape (m, k): straight, or by way of the water surface for unit reflectance multiplier."""
        at = alike_in_place(lamp)
        light, out = self._ways(at, mirrored).lit(lamp), []
        for c in attenuation_per_m:
            out.append(light * self._dimmed(at, mirrored, c))
        return np.stack(out)

    def _ways_of(self, lamp: Lamp, mirrored: bool) -> Ways:
        return Ways.by_surface(lamp, self.fine, self.top) if mirrored else Ways.of(lamp, self.fine)

    def _passed(self, of: _Exchange, side: float, terms: np.ndarray) -> np.ndarray:
        """What reaches the readings by number of reflections, (reflections, n); of few readings, when it was
        often asked for, at once."""
        before, whole = terms[self.before], terms[:, 0] / self.parts  # the first term is the same all over
        if (known := self._known_at_once(of, side)) is not None:
            return known.apply(before, whole, of[3])
        return self._operator(*of[:2], side).apply(before, whole, self._albedo(of[2]), of[3])

    def _known_at_once(self, of: _Exchange, side: float) -> AtOnce | None:
        """What is known at once; for the next time, if it is asked for often and there is room."""
        each = of, side
        self._asked[each] = asked = self._asked.get(each, 0) + 1
        for reflections in _NUMBERS:  # fewer are part of more
            if reflections >= of[3] and (known := self._at_once.get(((*of[:3], reflections), side))):
                return known
        rows, columns = of[3] * len(self.places), len(self.half.centre)
        is_worth_it = asked * REFLECTIONS > OFTEN * of[3] and rows <= _LARGER * columns
        if is_worth_it and self._room_for(4 * rows * columns, asked):
            operator = self._operator(of[0], of[1], side)
            self._at_once[each] = operator.at_once(self._albedo(of[2]), of[3])
        return None

    def _room_for(self, size: int, asked: int) -> bool:
        """Is there room for so many bytes, when what was asked for half as often for its size makes it?"""
        sizes = {of: known.later.nbytes for of, known in self._at_once.items()}
        often = {of: self._asked.get(of, 0) / bytes_ for of, bytes_ in sizes.items()}
        seldom, kept = sorted(often, key=often.__getitem__), sum(sizes.values())
        while kept + size > _AT_ONCE_BYTES:
            if not seldom or 2 * often[seldom[0]] >= asked / size:
                return False
            kept -= self._at_once.pop(seldom.pop(0)).later.nbytes
        return True

    def _operator_in(self, attenuation_per_m: float, surface: float, side: float) -> Operators:
        """What walls and readings exchange in one water, under one surface, on one side."""
        among, reading = self._through(attenuation_per_m, False)
        if surface:
            image = self._through(attenuation_per_m, True)
            among, reading = (
                t + np.float32(surface) * i for t, i in zip((among, reading), image, strict=True)
            )
        halves = (np.split(t, 2, axis=1) for t in (among, reading))
        among, reading = (here + np.float32(side) * there for here, there in halves)
        return Operators.of(among, reading, self._terms, self.before)

    def _albedo(self, shares: Shares) -> np.ndarray:
        """Of the patches of one side, over that of the brightest."""
        walls, floor, end = (np.float32(share) for share in shares)
        return np.where(self._is_floor, floor, np.where(self._is_end, end, walls))

    def _through_water(self, attenuation_per_m: float, mirrored: bool) -> tuple[np.ndarray, np.ndarray]:
        """From all patches to those of one side and to the readings, straight or by the water surface."""
        both = (self.among_image, self.reading_image) if mirrored else (self.among, self.reading)
        among, reading = (t.through(attenuation_per_m) for t in both)
        return among, reading

    @cached_property
    def among(self) -> Transfer:
        centre = self.half.centre
        found = transfer(centre, self._facing, self.patches)
        return closed(found, self._whole(found, centre, self._facing))

    @cached_property
    def among_image(self) -> Transfer:
        return self._in_surface(self.half.centre, self._facing, self.patches)

    @cached_property
    def reading(self) -> Transfer:
        found = transfer(self.places, self._read, self._seen)
        plain = receiver.is_cosine(self.scene.detector)
        facing_back = found if plain else transfer(self.places, _facing_back, self._seen)
        return closed(found, self._whole(facing_back, self.places, _facing_back))

    def _whole(self, found: Transfer, places: np.ndarray, response: AngularResponse) -> np.ndarray:
        """What places see of walls and openings together, of unit radiosity each, shape (n,)."""
        openings = transfer(places, response, self._openings)
        return np.asarray(found.factor.sum(axis=1) + openings.factor.sum(axis=1))

    @cached_property
    def reading_image(self) -> Transfer:
        return self._in_surface(self.places, self._read, self._seen)

    @cached_property
    def _seen(self) -> Patches:
        return self.half.some(self.before).divided(self.parts).on_both_sides()

    def _in_surface(self, places: np.ndarray, response: AngularResponse, patches: Patches) -> Transfer:
        def mirrored(direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
            return np.asarray(response(direction, which) * fresnel(np.abs(direction[1])))

        return transfer(places, mirrored, patches.mirrored(self.top))

    def _facing(self, direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        """Response of the patches themselves to light along `direction`."""
        normal = self.half.normal[which]
        return np.maximum(-sum(d * normal[..., i] for i, d in enumerate(direction)), 0)

    def _read(self, direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        return receiver.response(self.scene.detector, direction)


def _facing_back(direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
    """Response of a cosine receiver that faces the lamp's end of the tank."""
    return np.maximum(direction[2], 0.0)


def between_attenuations(attenuation_per_m: np.ndarray) -> tuple[list[float], np.ndarray]:
    """Cubic interpolation at several attenuations between the four nodes that are next to each.

    Returns
    -------
    nodes : list of float, m^-1
        The k that are needed, ascending, none below zero.
    weights : array, shape (n, k)
    """
    at, steps = np.asarray(attenuation_per_m, float), np.asarray(attenuation_per_m, float) / C_STEP
    steps = np.where(steps > _SHORT_STEPS, 0.5 * (steps + _SHORT_STEPS), steps)
    four = np.maximum(np.floor(steps) - 1, 0).astype(int)[:, None] + np.arange(4)
    needed, column = np.unique(four, return_inverse=True)
    nodes = np.round(C_STEP * np.where(needed > _SHORT_STEPS, 2 * needed - _SHORT_STEPS, needed), 6)
    column = column.reshape(-1, 4)
    weights, rows = np.zeros((len(at), len(needed))), np.arange(len(at))
    for k in range(4):
        others = nodes[np.delete(column, k, axis=1)]
        apart = (at[:, None] - others) / (nodes[column[:, k]][:, None] - others)
        weights[rows, column[:, k]] = apart.prod(axis=1)
    return nodes.tolist(), weights


def lagrange(nodes: Sequence[float], at: float) -> np.ndarray:
    """Weights of polynomial interpolation at one place."""
    return np.array([prod((at - y) / (x - y) for y in nodes if y != x) for x in nodes])


def _faces(tank: Tank) -> tuple[float, Shares, int]:
    """Albedo of the brightest of walls, floor and far end; the shares of the three; and how many reflections
    are followed: light goes from the floor, or from the end, to another face, never to the same."""
    walls, floor, end = tank.wall_albedo * np.array([1.0, tank.floor_share, tank.end_share])
    most = max(walls, floor, end)
    one_by_one = max(walls, sqrt(floor * max(walls, end)), sqrt(end * max(walls, floor)))
    return most, (walls / most, floor / most, end / most), reflections_of(one_by_one)
