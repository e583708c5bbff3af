"""Light that walls and surface reflected, any number of times, and nothing scattered: free of noise.

The mirror image of the lamp in the water surface, and radiosity between patches of the walls (Goral,
Torrance, Greenberg and Battaile 1984; here with attenuation on the way, and with mirror images of the patches
in the surface):

    E_i = E0_i + sum over j of  rho E_j F_ij e^{-c d_ij}

Waves smear the image of the lamp (`waves`); between walls, and on its way from lamp to walls, light meets a
surface that is flat.

The transport response holds the same light with the noise of its trace; readings lie in few small cells, so
there it is noisier than a fit can bear. Used for irradiance; what was scattered as well stays with the
response.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from copy import copy
from functools import cache, cached_property, lru_cache
from math import prod, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lightfield.render.reflected.from_lamp import Ways, alike_in_place, fresnel, image_of_lamp
from lightfield.render.reflected.orders import (
    REFLECTIONS,
    AtOnce,
    Operators,
    Orders,
    reflections_of,
    terms_of_light,
)
from lightfield.render.reflected.patches import Patches, Response, Transfer, closed, transfer, walls
from lightfield.render.reflected.waves import glitter
from lightfield.scene import Lamp, Scene, Tank, receiver

MOST_PAIRS = 1_500_000  # of fine patch and reading
FEWEST_PATCHES, MOST_PATCHES, MOST_PARTS = 400, 900, 4
#: Step of attenuation, m^-1, between which orders of light are interpolated: in a closed white tow tank to
#: 0.1 % for a beam of 4 degrees (twice the step: 0.7 %), in other tanks to 0.03 % (beside a quarter of it).
C_STEP, SURFACE_NODES = 0.025, (0.0, 0.5, 1.0)
#: Part of the light of waves that met two facets in a row: 0 to 7 % of it for slopes of 2 to 12 degrees, a
#: lamp 0.25 to 1.2 m below the surface, 3 to 6.5 m away (`tests/physics/test_waves.py`); the middle of that.
TWO_FACETS = 0.035
#: Albedo of the darker of walls and floor over that of the other: light of one reflection is linear in it.
FLOOR_NODES = (0.0, 0.3, 0.7, 1.0)
#: The normal of the floor has a y above this, that of walls none, and that of a lid looks down.
_UPWARDS = 0.5
#: Of walls and floor: albedo over that of the brighter of the two.
Shares = tuple[float, float]
#: Attenuation, m^-1, surface reflectance, shares of walls and floor, reflections that are followed.
_Exchange = tuple[float, float, Shares, int]
#: Lamps whose light is remembered: at most so many, and in so many bytes, but some; operators alike.
KEPT_LAMPS, KEPT_BYTES, FEWEST = 60, 50e6, 8
KEPT_OPERATORS, OPERATOR_BYTES = 60, 50e6
#: What waters let through on the way from the place of a lamp: of at most so many, and in so many bytes.
KEPT_WATERS, THROUGH_BYTES = 400, 20e6
#: Where it is at most so many times the exchange of the patches, what takes light to the readings at once is
#: worked out for a water that was asked for so often, and kept in so many bytes: it costs as much as to
#: follow ten lamps, five where what patches exchange has to be made anew, and of few reflections one or two.
LARGER, OFTEN, AT_ONCE_BYTES = 2, 5, 100e6


class ReflectedLight:
    """Reflected, unscattered light at n readings in the tank of a scene.

    Parameters
    ----------
    scene : Scene
        With a tank, and an irradiance detector.
    x_m, y_m, z_m : arrays, shape (n,), m
    """

    def __init__(self, scene: Scene, x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray) -> None:
        self.scene = scene
        # Readings of several colours at one place share their light's way.
        every = np.stack([x_m, y_m, z_m], axis=1).astype(float)
        self.places, which = np.unique(every, axis=0, return_inverse=True)
        self._which = which.ravel()
        #: The walls, with a lid or with an open top.
        self.room = cache(lambda lid: Room(scene, self.places, lid))
        self._smeared = lru_cache(1)(self._smeared_of)
        self._mirrored = lru_cache(KEPT_LAMPS)(self._mirrored_of)

    def some(self, rows: np.ndarray) -> ReflectedLight:
        """At some of the readings, from what is worked out for all of them."""
        out = copy(self)
        out._which = self._which[rows]
        return out

    def evaluate(self, scene: Scene, attenuation_per_m: ArrayLike) -> np.ndarray:
        """Light for unit on-axis intensity, m^-2, shape (n,), or (n_waters, n) in several waters at once.

        Parameters
        ----------
        scene : Scene
            Its lamp, albedos and surface reflectance count; the tank is that of the constructor.
        attenuation_per_m : float or array, shape (n_waters,), m^-1
        """
        tank, rates = scene.tank, np.atleast_1d(np.asarray(attenuation_per_m, float))
        assert tank is not None
        light = np.zeros((len(rates), len(self.places)))
        if tank.surface_reflectance > 0:
            light += tank.surface_reflectance * self._image(scene.lamp, rates, tank)
        if tank.wall_albedo > 0:
            room = self.room(tank.surface_reflectance == 0)
            light += room.light(scene.lamp, rates, tank)
        return np.asarray(light[:, self._which].reshape(*np.shape(attenuation_per_m), -1))

    def uncertain(self, scene: Scene, attenuation_per_m: np.ndarray) -> np.ndarray:
        """Error of the light of waves, which knows nothing that met two facets in a row; (n_waters, n)."""
        tank = scene.tank
        if tank is None or tank.slope == 0:
            return np.zeros((len(attenuation_per_m), len(self._which)))
        image = self._image(scene.lamp, attenuation_per_m, tank)
        return np.asarray(TWO_FACETS * tank.surface_reflectance * image[:, self._which])

    def by_floor(self, scene: Scene, attenuation_per_m: np.ndarray) -> np.ndarray:
        """Light from walls and floor over that of a floor like the walls, shape (n_waters, n)."""
        tank = scene.tank
        if tank is None or tank.floor_share == 1 or not tank.wall_albedo:
            return np.ones((len(attenuation_per_m), len(self._which)))
        room = self.room(tank.surface_reflectance == 0)
        like_walls = tank.model_copy(update={"floor_over_walls": 1.0})
        light, plain = (room.light(scene.lamp, attenuation_per_m, t) for t in (tank, like_walls))
        ratio = np.divide(light, plain, out=np.ones_like(light), where=plain > 0)
        return np.asarray(ratio[:, self._which])

    def _image(self, lamp: Lamp, attenuation_per_m: np.ndarray, tank: Tank) -> np.ndarray:
        """Light mirrored by the water surface alone, for unit reflectance multiplier; (n_waters, n)."""
        if tank.slope > 0:
            light, in_water = self._smeared(lamp, tank.surface_slope_deg)
            # One water at a time: there are thousands of facets for each place.
            return np.stack([(light * np.exp(-c * in_water)).sum(axis=1) for c in attenuation_per_m])
        light, in_water = self._mirrored(lamp, tank.lamp_depth_m)
        return np.asarray(light * np.exp(-attenuation_per_m[:, None] * in_water))

    def _mirrored_of(self, lamp: Lamp, top_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Light by way of a flat surface without attenuation, and its way in water; (n,)."""
        arriving, light, in_water = image_of_lamp(lamp, top_m, self.places)
        return light * receiver.response(self.scene.detector, list(arriving.T)), in_water

    def _smeared_of(self, lamp: Lamp, slope_deg: float) -> tuple[np.ndarray, np.ndarray]:
        """Light by way of each facet of the waves without attenuation, and its way in water; (n, k)."""
        assert self.scene.tank is not None
        tank = self.scene.tank.model_copy(update={"surface_slope_deg": slope_deg, "surface_reflectance": 1.0})
        detector, found = self.scene.detector, []
        for some in glitter(lamp, tank, self.places):
            response = receiver.response(detector, list(np.moveaxis(some.arriving, -1, 0)))
            found.append((some.light * response, some.in_water))
        light, in_water = (np.concatenate(column) for column in zip(*found, strict=True))
        return light, in_water


class Room:
    """The walls of a tank as patches: the light that they send to each other and to the readings."""

    def __init__(self, scene: Scene, places: np.ndarray, lid: bool) -> None:
        assert scene.tank is not None
        self.scene, self.places = scene, places
        self.top = scene.tank.lamp_depth_m
        # Many readings: rather fewer patches in three by three parts than more in two by two.
        count = float(np.clip(MOST_PAIRS / (9 * len(places)), FEWEST_PATCHES, MOST_PATCHES))
        self.patches, self._openings = walls(scene, float(places[:, 2].max()), lid, count)
        # A receiver that faces straight back to the lamp sees only walls before it.
        before = self.patches.centre[:, 2] - self.patches.half_along < places[:, 2].max()
        before |= receiver.looks_aside(scene.detector)
        self.before = np.flatnonzero(before)
        parts = int(sqrt(MOST_PAIRS / (len(places) * len(self.before))))
        self.parts = int(np.clip(parts, 1, MOST_PARTS))
        self.fine = self.patches.divided(self.parts)
        self._terms = terms_of_light(self.parts)
        size = 4 * (
            len(places) * (self._terms.shape[1] + 1) * len(self.before) + len(self.patches.centre) ** 2
        )
        self._operator = lru_cache(int(np.clip(OPERATOR_BYTES / size, FEWEST, KEPT_OPERATORS)))(
            self._operator_in
        )
        self._through = lru_cache(2)(self._through_water)
        self._at_once: dict[_Exchange, AtOnce] = {}
        self._asked = Counter[_Exchange]()
        self._ways = lru_cache(KEPT_LAMPS)(self._ways_of)
        waters = int(np.clip(THROUGH_BYTES / (4 * len(self.fine.centre)), FEWEST, KEPT_WATERS))
        self._dimmed = lru_cache(waters)(lambda at, mirrored, c: self._ways(at, mirrored).through(c))
        self._is_floor = self.patches.normal[:, 1] > _UPWARDS
        #: Light of a lamp at the readings.
        self._known: Callable[[Lamp], dict[_Exchange, Orders]]
        lamps = KEPT_BYTES / (4 * 8 * REFLECTIONS * len(places))
        self._known = lru_cache(int(np.clip(lamps, FEWEST, KEPT_LAMPS)))(lambda lamp: {})

    def light(self, lamp: Lamp, attenuation_per_m: np.ndarray, tank: Tank) -> np.ndarray:
        """Light at the readings that was reflected by a wall at least once, shape (n_waters, n).

        Worked out at a few attenuations and reflectances, and interpolated: the logarithm of every order is
        nearly linear in the first (cubic between four nodes, which leaves no jump), light itself a low
        polynomial in the second, and in the albedo of the darker of walls and floor over that of the other.
        A fit that moves the water, the walls, the floor or the surface then costs nothing new.

        Parameters
        ----------
        attenuation_per_m : array, shape (n_waters,), m^-1
        tank : Tank
            Albedos and surface reflectance.
        """
        surface, share = tank.surface_reflectance, tank.floor_share
        albedo, darker = tank.wall_albedo * max(share, 1.0), min(share, 1.0 / share if share else 0.0)
        dim = FLOOR_NODES if share != 1 else (1.0,)
        shares = [(1.0, d) if share <= 1 else (d, 1.0) for d in dim]
        mirrors = (surface,) if surface in SURFACE_NODES else SURFACE_NODES
        nodes, along_c = cubic(attenuation_per_m, C_STEP)
        under = [(m, w, reflections_of(albedo)) for w in shares for m in mirrors]
        known, every = self._known(lamp), []
        asked = [[(c, *each) for c in nodes] for each in under]
        missing = sorted(of for one in asked for of in one if of not in known)  # water by water
        known.update(zip(missing, self._reached(lamp, missing), strict=True))
        for one in asked:
            every.append(Orders.between([known[of] for of in one], along_c).for_albedo(albedo))
        weights = np.outer(lagrange(dim, darker if len(dim) > 1 else 1.0), lagrange(mirrors, surface))
        return np.asarray(np.tensordot(weights.ravel(), np.array(every), axes=1))

    def _reached(self, lamp: Lamp, asked: Sequence[_Exchange]) -> list[Orders]:
        """Light at the readings in several waters, under several surfaces, over several floors."""
        if not asked:
            return []
        waters = {c: k for k, c in enumerate(dict.fromkeys(of[0] for of in asked))}
        direct = self._in_terms(self._lit(lamp, False, list(waters)))
        by_surface = direct
        if any(of[1] for of in asked):
            by_surface = self._in_terms(self._lit(lamp, True, list(waters)))
        light = []
        for of in asked:
            water, surface = waters[of[0]], of[1]
            terms = direct[water] + np.float32(surface) * by_surface[water] if surface else direct[water]
            whole = terms[:, 0] / self.parts  # the first term is the same all over a patch
            light.append(self._exchange(of).apply(terms[self.before], whole, of[3]))
        every = Orders.of(np.stack(light))
        return [every.at(k) for k in range(len(asked))]

    def _in_terms(self, lit: np.ndarray) -> np.ndarray:
        """Light on the fine patches of each patch by terms, (n_waters, n_patches, n_terms)."""
        return np.asarray(lit.reshape(len(lit), -1, self.parts**2) @ self._terms)

    def lit(self, lamp: Lamp, attenuation_per_m: Sequence[float], surface: float) -> np.ndarray:
        """Irradiance of the fine patches by the lamp and its image, for unit on-axis intensity, m^-2.

        In each of m waters, shape (m, k).
        """
        lit = self._lit(lamp, False, attenuation_per_m)
        return lit + np.float32(surface) * self._lit(lamp, True, attenuation_per_m) if surface else lit

    def _lit(self, lamp: Lamp, mirrored: bool, attenuation_per_m: Sequence[float]) -> np.ndarray:
        """The same straight, or by way of the water surface for unit reflectance multiplier."""
        at = alike_in_place(lamp)
        light, out = self._ways(at, mirrored).lit(lamp), []
        for c in attenuation_per_m:
            out.append(light * self._dimmed(at, mirrored, c))
        return np.stack(out)

    def _ways_of(self, lamp: Lamp, mirrored: bool) -> Ways:
        return Ways.by_surface(lamp, self.fine, self.top) if mirrored else Ways.of(lamp, self.fine)

    def _exchange(self, of: _Exchange) -> Operators | AtOnce:
        """What walls and readings exchange: of few readings, when it was often asked for, at once."""
        self._asked[of] += 1
        if of not in self._at_once and self._asked[of] * REFLECTIONS > OFTEN * of[3]:
            rows, columns = of[3] * len(self.places), len(self.patches.centre)
            size = 4 * rows * columns
            if rows <= LARGER * columns and self._room_for(size, self._asked[of]):
                self._at_once[of] = self._operator(*of[:3]).at_once(of[3])
        return self._at_once.get(of) or self._operator(*of[:3])

    def _room_for(self, size: int, asked: int) -> bool:
        """Is there room for so many bytes, when what was asked for half as often at most makes it?"""
        kept = sum(known.later.nbytes for known in self._at_once.values())
        seldom = sorted(self._at_once, key=lambda of: self._asked[of])
        while kept + size > AT_ONCE_BYTES:
            if not seldom or 2 * self._asked[seldom[0]] >= asked:
                return False
            kept -= self._at_once.pop(seldom.pop(0)).later.nbytes
        return True

    def _operator_in(self, attenuation_per_m: float, surface: float, shares: Shares) -> Operators:
        """What walls and readings exchange in one water, under one surface, over a floor."""
        among, reading = self._through(attenuation_per_m, False)
        if surface:
            image = self._through(attenuation_per_m, True)
            among, reading = (
                t + np.float32(surface) * i for t, i in zip((among, reading), image, strict=True)
            )
        albedo = np.where(self._is_floor, np.float32(shares[1]), np.float32(shares[0]))
        return Operators.of(among, reading, self._terms, self.before, albedo)

    def _through_water(self, attenuation_per_m: float, mirrored: bool) -> tuple[np.ndarray, np.ndarray]:
        """Among patches and to the readings, straight or by way of the water surface."""
        both = (self.among_image, self.reading_image) if mirrored else (self.among, self.reading)
        among, reading = (t.through(attenuation_per_m) for t in both)
        return among, reading

    @cached_property
    def among(self) -> Transfer:
        centre = self.patches.centre
        found = transfer(centre, self._facing, self.patches)
        return closed(found, self._whole(found, centre, self._facing))

    @cached_property
    def among_image(self) -> Transfer:
        return self._in_surface(self.patches.centre, self._facing, self.patches)

    @cached_property
    def reading(self) -> Transfer:
        found = transfer(self.places, self._read, self._seen)
        plain = receiver.is_cosine(self.scene.detector)
        facing_back = found if plain else transfer(self.places, _facing_back, self._seen)
        return closed(found, self._whole(facing_back, self.places, _facing_back))

    def _whole(self, found: Transfer, places: np.ndarray, response: Response) -> np.ndarray:
        """What places see of walls and openings together, of unit radiosity each, shape (n,)."""
        openings = transfer(places, response, self._openings)
        return np.asarray(found.factor.sum(axis=1) + openings.factor.sum(axis=1))

    @cached_property
    def reading_image(self) -> Transfer:
        return self._in_surface(self.places, self._read, self._seen)

    @cached_property
    def _seen(self) -> Patches:
        return self.fine.some((self.before[:, None] * self.parts**2 + np.arange(self.parts**2)).ravel())

    def _in_surface(self, places: np.ndarray, response: Any, patches: Patches) -> Transfer:
        def mirrored(direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
            return np.asarray(response(direction, which) * fresnel(np.abs(direction[1])))

        return transfer(places, mirrored, patches.mirrored(self.top))

    def _facing(self, direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        """Response of the patches themselves to light along `direction`."""
        normal = self.patches.normal[which]
        return np.maximum(-sum(d * normal[..., i] for i, d in enumerate(direction)), 0)

    def _read(self, direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        return receiver.response(self.scene.detector, direction)


def _facing_back(direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
    """Response of a cosine receiver that faces the lamp's end of the tank."""
    return np.maximum(direction[2], 0.0)


def applies(scene: Scene) -> bool:
    """Is the reflected, unscattered light of this scene known without a trace?"""
    detector = scene.detector
    return scene.tank is not None and detector.quantity == "irradiance" and detector.aim == "axis"


def cubic(at: np.ndarray, step: float) -> tuple[list[float], np.ndarray]:
    """Cubic interpolation at several places between those of the multiples of a step that are next to each.

    Returns
    -------
    nodes : list of float
        The k multiples that are needed, ascending, none below zero.
    weights : array, shape (n, k)
    """
    first = np.maximum(np.floor(at / step) - 1, 0).astype(int)
    needed, column = np.unique(first[:, None] + np.arange(4), return_inverse=True)
    t = at / step - first
    own = [(t - 1) * (t - 2) * (t - 3) / -6, t * (t - 2) * (t - 3) / 2, t * (t - 1) * (t - 3) / -2]
    weights = np.zeros((len(at), len(needed)))
    rows = np.arange(len(at))[:, None]
    weights[rows, column.reshape(-1, 4)] = np.stack([*own, t * (t - 1) * (t - 2) / 6], axis=1)
    return [round(step * k, 6) for k in needed.tolist()], weights


def lagrange(nodes: Sequence[float], at: float) -> np.ndarray:
    """Weights of polynomial interpolation at one place."""
    return np.array([prod((at - y) / (x - y) for y in nodes if y != x) for x in nodes])
