"""Light that walls and surface reflected, any number of times, and nothing scattered: free of noise.

The mirror image of the lamp in the water surface, and radiosity between patches of the walls (Goral,
Torrance, Greenberg and Battaile 1984; here with attenuation on the way, and with mirror images of the patches
in the surface); where there are panes, their images of the lamp, and what walls send by way of them is left
to a trace:

    E_i = E0_i + sum over j of  rho E_j F_ij e^{-c d_ij}

Waves smear the image of the lamp (`waves`); between walls, and on its way from lamp to walls, light meets a
surface that is flat.

The transport response holds the same light with the noise of its trace; readings lie in few small cells, so
there it is noisier than a fit can bear. Used for irradiance; what was scattered as well stays with the
response.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lightfield.render.reflected.from_lamp import alike_in_place, image_of_lamp
from lightfield.render.reflected.panes import Images, Mirrored
from lightfield.render.reflected.room import KEPT_LAMPS, Room
from lightfield.render.reflected.waves import Glitter, glitter, twice
from lightfield.scene import Lamp, Scene, Tank, receiver

#: Error of the light of waves, as a part of it: what meets three facets in a row, and the sum over what meets
#: two. Beside walks of photons the mean of a plane is right to 0.3 %, for slopes of 6 to 12 degrees
#: (`tests/physics/light/test_waves.py` has those of 2.5 and 10).
MORE_FACETS = 0.005


#: Lamps, and places of lamps, of which is remembered what panes show of them. Chosen: megabytes each.
_KEPT_IMAGES = 8


class _Ways:
    """How light comes by walls and by the surface to places in the tank of a scene, (n_places, 3) m."""

    def __init__(self, scene: Scene, places: np.ndarray) -> None:
        self.scene, self.places = scene, places
        #: The walls, with a lid or with an open top.
        self.room = cache(lambda lid: Room(scene, places, lid))
        self.smeared = lru_cache(1)(self._smeared_of)
        self.mirrored = lru_cache(KEPT_LAMPS)(self._mirrored_of)
        self.images = lru_cache(_KEPT_IMAGES)(self._images_of)
        self.by_panes = lru_cache(_KEPT_IMAGES)(self._by_panes_of)

    def _mirrored_of(self, lamp: Lamp, top_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Light by way of a flat surface without attenuation, and its way in water; (n,)."""
        arriving, light, in_water = image_of_lamp(lamp, top_m, self.places)
        return light * receiver.response(self.scene.detector, list(arriving.T)), in_water

    def _images_of(self, lamp: Lamp, surface: bool) -> Images:
        """What panes, and the surface, show of a lamp where this one stands."""
        assert self.scene.tank is not None
        read = partial(receiver.response, self.scene.detector)
        return Images(lamp, self.scene.tank, self.places, surface, lambda arriving: read(list(arriving)))

    def _by_panes_of(self, lamp: Lamp, surface: bool) -> Mirrored:
        return self.images(alike_in_place(lamp), surface).of(lamp)

    def _smeared_of(self, lamp: Lamp, slope_deg: float) -> list[_Facets]:
        """Light by way of the waves, of one facet and of two in a row, for unit reflectance of each."""
        assert self.scene.tank is not None
        tank = self.scene.tank.model_copy(update={"surface_slope_deg": slope_deg, "surface_reflectance": 1.0})
        return [self._read(glitter(lamp, tank, self.places)), self._read(twice(lamp, tank, self.places))]

    def _read(self, parts: Iterable[Glitter]) -> _Facets:
        """What the detector reads of the light at some of the places after the others."""
        found = [
            (
                some.place,
                some.light * receiver.response(self.scene.detector, list(some.arriving)),
                some.in_water,
            )
            for some in parts
        ]
        return _Facets(len(self.places), *(np.concatenate(column) for column in zip(*found, strict=True)))


class _Facets(NamedTuple):
    """Light that facets send to n places, without attenuation: to which, how much, its way in water; (k,)."""

    n: int
    place: np.ndarray
    light: np.ndarray
    in_water: np.ndarray

    def through(self, attenuation_per_m: float) -> np.ndarray:
        """What comes through water, shape (n,)."""
        arrived = self.light * np.exp(-attenuation_per_m * self.in_water)
        return np.bincount(self.place, arrived, self.n)


@dataclass(frozen=True, eq=False)
class ReflectedLight:
    """Reflected, unscattered light at n readings in the tank of a scene.

    Parameters
    ----------
    ways : _Ways
        Worked out once for all places; readings of several colours at one place share theirs.
    which : array of int, shape (n,)
        Place of each reading.
    """

    ways: _Ways
    which: np.ndarray

    @classmethod
    def at(cls, scene: Scene, x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray) -> ReflectedLight:
        """At readings, arrays of shape (n,), of a scene with a tank and an irradiance detector."""
        every = np.stack([x_m, y_m, z_m], axis=1).astype(float)
        places, which = np.unique(every, axis=0, return_inverse=True)
        return cls(_Ways(scene, places), which.ravel())

    def some(self, rows: np.ndarray) -> ReflectedLight:
        """At some of the readings, from what is worked out for all of them."""
        return replace(self, which=self.which[rows])

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
        light = np.zeros((len(rates), len(self.ways.places)))
        surface, panes = tank.surface_reflectance, tank.pane_reflectance
        if panes > 0:
            by_mirrors = self.ways.by_panes(scene.lamp, surface > 0)
            if tank.slope > 0:  # of what met a pane as well the surface mirrors as if it were flat
                by_mirrors = by_mirrors.without_surface_alone()
            light += by_mirrors.through(rates, panes, surface)
        if surface > 0 and (tank.slope > 0 or panes == 0):
            light += surface * self._image(scene.lamp, rates, tank)
        covered = 1.0 - self._bare(tank)
        if tank.wall_albedo > 0 and covered > 0:
            room = self.ways.room(surface == 0)
            light += covered * room.light(scene.lamp, rates, tank)
        return np.asarray(light[:, self.which].reshape(*np.shape(attenuation_per_m), -1))

    def _bare(self, tank: Tank) -> float:
        """How near its panes are to those of the trace beside it."""
        assert self.ways.scene.tank is not None
        return bareness(tank.pane_reflectance, self.ways.scene.tank.bare_panes)

    def uncertain(self, scene: Scene, attenuation_per_m: np.ndarray) -> np.ndarray:
        """Error of the light of waves, which knows nothing that met three facets in a row; (n_waters, n)."""
        tank = scene.tank
        if tank is None or tank.slope == 0:
            return np.zeros((len(attenuation_per_m), len(self.which)))
        image = self._image(scene.lamp, attenuation_per_m, tank)
        return np.asarray(MORE_FACETS * tank.surface_reflectance * image[:, self.which])

    def by_faces(self, scene: Scene, attenuation_per_m: np.ndarray) -> np.ndarray:
        """Light from walls over that of a floor and an end as in the constructor's scene, beside walls as in
        this one; shape (n_waters, n)."""
        tank, stated = scene.tank, self.ways.scene.tank
        assert tank is not None and stated is not None
        as_stated = tank.model_copy(
            update={"floor_over_walls": stated.floor_over_walls, "end_over_walls": stated.end_over_walls}
        )
        if not tank.wall_albedo or tank == as_stated:
            return np.ones((len(attenuation_per_m), len(self.which)))
        room = self.ways.room(tank.surface_reflectance == 0)
        light, plain = (room.light(scene.lamp, attenuation_per_m, t) for t in (tank, as_stated))
        ratio = np.divide(light, plain, out=np.ones_like(light), where=plain > 0)
        return np.asarray(ratio[:, self.which])

    def _image(self, lamp: Lamp, attenuation_per_m: np.ndarray, tank: Tank) -> np.ndarray:
        """Light mirrored by the water surface alone, for unit reflectance multiplier; (n_waters, n)."""
        if tank.slope > 0:
            once, again = self.ways.smeared(lamp, tank.surface_slope_deg)
            # One water at a time: there are thousands of facets for each place.
            mirrored = tank.surface_reflectance
            return np.stack([once.through(c) + mirrored * again.through(c) for c in attenuation_per_m])
        light, in_water = self.ways.mirrored(lamp, tank.lamp_depth_m)
        return np.asarray(light * np.exp(-attenuation_per_m[:, None] * in_water))


def bareness(panes: float, traced: float) -> float:
    """How near panes are to those of a trace: 0 where they are covered, 1 where they mirror as much."""
    return min(panes / traced, 1.0) if panes else 0.0


def applies(scene: Scene) -> bool:
    """Is the reflected, unscattered light of this scene known without a trace?"""
    detector = scene.detector
    return scene.tank is not None and detector.quantity == "irradiance" and detector.aim == "axis"
