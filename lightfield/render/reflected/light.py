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
from itertools import product
from math import floor, prod, sqrt
from typing import Any

import numpy as np

from lightfield.render.reflected.from_lamp import Ways, alike_in_place, fresnel, image_of_lamp
from lightfield.render.reflected.orders import REFLECTIONS, AtOnce, Operators, Orders, terms_of_light
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
#: Operators, and lamps whose light is remembered: at most so many, and in so many bytes, but some.
KEPT, KEPT_LAMPS, KEPT_BYTES, FEWEST = 60, 60, 50e6, 8
#: Where it is at most so many times the exchange of the patches, what takes light to the readings at once is
#: worked out for a water that was asked for so often, and kept in so many bytes: it costs as much as to
#: follow ten lamps.
LARGER, OFTEN, AT_ONCE_BYTES = 2, 10, 100e6


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
        self._mirrored = lru_cache(KEPT)(self._mirrored_of)

    def some(self, rows: np.ndarray) -> ReflectedLight:
        """At some of the readings, from what is worked out for all of them."""
        out = copy(self)
        out._which = self._which[rows]
        return out

    def evaluate(self, scene: Scene, attenuation_per_m: float) -> np.ndarray:
        """Light for unit on-axis intensity, shape (n,), m^-2.

        Parameters
        ----------
        scene : Scene
            Its lamp, albedos and surface reflectance count; the tank is that of the constructor.
        attenuation_per_m : float, m^-1
        """
        tank = scene.tank
        assert tank is not None
        light = np.zeros(len(self.places))
        if tank.surface_reflectance > 0:
            light += tank.surface_reflectance * self._image(scene.lamp, attenuation_per_m, tank)
        if tank.wall_albedo > 0:
            room = self.room(tank.surface_reflectance == 0)
            light += room.light(scene.lamp, attenuation_per_m, tank)
        return np.asarray(light[self._which])

    def uncertain(self, scene: Scene, attenuation_per_m: float) -> np.ndarray:
        """Error of the light of waves, which knows nothing that met two facets in a row; shape (n,)."""
        tank = scene.tank
        if tank is None or tank.slope == 0:
            return np.zeros(len(self._which))
        image = self._image(scene.lamp, attenuation_per_m, tank)
        return np.asarray(TWO_FACETS * tank.surface_reflectance * image[self._which])

    def by_floor(self, scene: Scene, attenuation_per_m: float) -> np.ndarray:
        """Light from walls and floor over that of a floor like the walls, shape (n,)."""
        tank = scene.tank
        if tank is None or tank.floor_share == 1 or not tank.wall_albedo:
            return np.ones(len(self._which))
        room = self.room(tank.surface_reflectance == 0)
        like_walls = tank.model_copy(update={"floor_over_walls": 1.0})
        light, plain = (room.light(scene.lamp, attenuation_per_m, t) for t in (tank, like_walls))
        ratio = np.divide(light, plain, out=np.ones_like(light), where=plain > 0)
        return np.asarray(ratio[self._which])

    def _image(self, lamp: Lamp, attenuation_per_m: float, tank: Tank) -> np.ndarray:
        """Light mirrored by the water surface alone, for unit reflectance multiplier."""
        if tank.slope > 0:
            light, in_water = self._smeared(lamp, tank.surface_slope_deg)
            return np.asarray((light * np.exp(-attenuation_per_m * in_water)).sum(axis=1))
        light, in_water = self._mirrored(lamp, tank.lamp_depth_m)
        return np.asarray(light * np.exp(-attenuation_per_m * in_water))

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
        size = 4 * len(places) * (self._terms.shape[1] + 1) * len(self.before)
        self._operator = lru_cache(int(np.clip(KEPT_BYTES / size, FEWEST, KEPT)))(self._operator_in)
        size = 4 * REFLECTIONS * len(places) * len(self.patches.centre)
        few = REFLECTIONS * len(places) <= LARGER * len(self.patches.centre)
        self._most_at_once = int(AT_ONCE_BYTES / size) if few else 0
        self._at_once: dict[tuple[float, float, Shares], AtOnce] = {}
        self._asked = Counter[tuple[float, float, Shares]]()
        self._ways = lru_cache(KEPT)(lambda lamp: Ways.of(lamp, self.fine))
        self._direct = lru_cache(1)(self._direct_of)
        self._mirrored = lru_cache(1)(self._mirrored_of)
        self._is_floor = self.patches.normal[:, 1] > _UPWARDS
        #: Light of a lamp at the readings, by attenuation, surface reflectance, shares of walls and floor.
        self._known: Callable[[Lamp], dict[tuple[float, float, Shares], Orders]]
        lamps = KEPT_BYTES / (4 * 8 * REFLECTIONS * len(places))
        self._known = lru_cache(int(np.clip(lamps, FEWEST, KEPT_LAMPS)))(lambda lamp: {})

    def light(self, lamp: Lamp, attenuation_per_m: float, tank: Tank) -> np.ndarray:
        """Light at the readings that was reflected by a wall at least once, shape (n,).

        Worked out at a few attenuations and reflectances, and interpolated: the logarithm of every order is
        nearly linear in the first (cubic between four nodes, which leaves no jump), light itself a low
        polynomial in the second, and in the albedo of the darker of walls and floor over that of the other.
        A fit that moves the water, the walls, the floor or the surface then costs nothing new.

        Parameters
        ----------
        tank : Tank
            Albedos and surface reflectance.
        """
        surface, share = tank.surface_reflectance, tank.floor_share
        albedo, darker = tank.wall_albedo * max(share, 1.0), min(share, 1.0 / share if share else 0.0)
        dim = FLOOR_NODES if share != 1 else (1.0,)
        shares = [(1.0, d) if share <= 1 else (d, 1.0) for d in dim]
        first = max(floor(attenuation_per_m / C_STEP) - 1, 0)
        nodes = [round(C_STEP * (first + i), 6) for i in range(4)]
        mirrors = (surface,) if surface in SURFACE_NODES else SURFACE_NODES
        known = self._known(lamp)
        for m, w in product(mirrors, shares):
            missing = [c for c in nodes if (c, m, w) not in known]
            known.update(zip(product(missing, [m], [w]), self._reached(lamp, missing, m, w), strict=True))
        along_c = lagrange(nodes, attenuation_per_m)
        every = [
            [Orders.between([known[c, m, w] for c in nodes], along_c).for_albedo(albedo) for m in mirrors]
            for w in shares
        ]
        by_mirror = np.tensordot(lagrange(dim, darker if len(dim) > 1 else 1.0), np.array(every), axes=1)
        return np.asarray(lagrange(mirrors, surface) @ by_mirror)

    def _reached(
        self, lamp: Lamp, attenuation_per_m: Sequence[float], surface: float, shares: Shares
    ) -> list[Orders]:
        """Light at the readings in each of some waters."""
        if not attenuation_per_m:
            return []
        lit = self.lit(lamp, attenuation_per_m, surface).reshape(len(attenuation_per_m), -1, self.parts**2)
        terms = lit @ self._terms
        whole = terms[..., 0] / self.parts  # the first term is the same all over a patch
        operators = [self._exchange(c, surface, shares) for c in attenuation_per_m]
        found = zip(operators, terms[:, self.before], whole, strict=True)
        return [Orders.of(operator.apply(t, w)) for operator, t, w in found]

    def lit(self, lamp: Lamp, attenuation_per_m: Sequence[float], surface: float) -> np.ndarray:
        """Irradiance of the fine patches by the lamp and its image, for unit on-axis intensity, m^-2.

        In each of m waters, shape (m, k).
        """
        rate = np.array(attenuation_per_m, np.float32)[:, None]
        unattenuated, in_water = self._direct(lamp)
        lit = unattenuated * np.exp(-rate * in_water)
        if surface:
            mirrored, in_water = self._mirrored(lamp)
            lit += np.float32(surface) * mirrored * np.exp(-rate * in_water)
        return np.asarray(lit)

    def _direct_of(self, lamp: Lamp) -> tuple[np.ndarray, np.ndarray]:
        """Irradiance of the fine patches without attenuation, and the way of the light in water, (k,)."""
        ways = self._ways(alike_in_place(lamp))
        return ways.lit(lamp), ways.in_water

    def _mirrored_of(self, lamp: Lamp) -> tuple[np.ndarray, np.ndarray]:
        """The same by way of the water surface, for unit reflectance multiplier."""
        arriving, light, in_water = image_of_lamp(lamp, self.top, self.fine.centre)
        light *= np.maximum(-(arriving * self.fine.normal).sum(axis=1), 0)
        return light.astype(np.float32), in_water.astype(np.float32)

    def _exchange(self, attenuation_per_m: float, surface: float, shares: Shares) -> Operators | AtOnce:
        """What walls and readings exchange: of few readings, when it was often asked for, at once."""
        of = attenuation_per_m, surface, shares
        self._asked[of] += 1
        if of not in self._at_once and self._most_at_once and self._asked[of] > OFTEN:
            least = min(self._at_once, key=lambda known: self._asked[known], default=of)
            if len(self._at_once) < self._most_at_once or self._asked[of] > 2 * self._asked[least]:
                if len(self._at_once) == self._most_at_once:
                    del self._at_once[least]
                self._at_once[of] = self._operator(*of).at_once()
        return self._at_once.get(of) or self._operator(*of)

    def _operator_in(self, attenuation_per_m: float, surface: float, shares: Shares) -> Operators:
        """What walls and readings exchange in one water, under one surface, over a floor."""
        among, reading = (t.through(attenuation_per_m) for t in (self.among, self.reading))
        if surface:
            among += np.float32(surface) * self.among_image.through(attenuation_per_m)
            reading += np.float32(surface) * self.reading_image.through(attenuation_per_m)
        albedo = np.where(self._is_floor, np.float32(shares[1]), np.float32(shares[0]))
        return Operators.of(among, reading, self._terms, self.before, albedo)

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


def lagrange(nodes: Sequence[float], at: float) -> np.ndarray:
    """Weights of polynomial interpolation at one place."""
    return np.array([prod((at - y) / (x - y) for y in nodes if y != x) for x in nodes])
