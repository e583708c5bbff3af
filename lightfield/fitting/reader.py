"""From light at the places of a table to its readings: gain, lamp power, then what the instrument does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache

import numpy as np

from lightfield.arrays import Array
from lightfield.fitting.gains import Gains
from lightfield.fitting.scene_of_values import REMEMBERED, Chosen, SceneOfValues, chosen
from lightfield.formula import own_formulas
from lightfield.formula.closed_form import air_mask
from lightfield.formula.readout import Taken, halves, immersed, plane_gain, readout, spectra, time_factor
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import paths_on
from lightfield.scene.own.own_effect import OwnEffect, Places, Stage

#: Parameters that act on the reading after the light has arrived; everything else makes the light field anew.
READOUT = paths_on(Acts.READOUT)
_READOUT, _TIME = frozenset(READOUT), frozenset(paths_on(Acts.TIME))
#: Where the light comes from and which way it shines, of which formulas may speak.
_POSE = frozenset(paths_on(Acts.SOURCE | Acts.BEAM))


class Reader:
    """Reads light at the places of a table.

    Parameters
    ----------
    full : float
        Reading that saturation is relative to.
    """

    def __init__(self, scenes: SceneOfValues, readings: Readings, gains: Gains, full: float) -> None:
        self.scenes, self.readings, self.gains, self.full = scenes, readings, gains, full
        self._time = np.nan_to_num(np.asarray(readings.time_s, float))
        air = np.asarray(readings.medium) == "air"
        spectrum = spectra(readings.x_m, readings.y_m, readings.z_m, air, self._time)
        overlap = halves(spectrum, readings.wavelength_nm)
        z_m = np.asarray(readings.z_m, float)
        wave = readings.wavelength_nm
        self._taken = Taken(air_mask(air), spectrum, self._time, overlap, z_m, wave)

    def read(self, field: Array, values: Mapping[str, float]) -> Array:
        """Readings from light for unit on-axis intensity: gain, lamp power, then what the instrument does."""
        signal = self.gains.of(values) * field * self.power(values) * self._own(values)
        reading = readout(self._scene(values), signal, self.full, self._taken)
        own = self._acting(values, "readout")
        return own_formulas.read_through(own, reading, self.full, self._here(values)) if own else reading

    def per_light(self, values: Mapping[str, float]) -> Array:
        """Reading per unit of light, before saturation, shape (n,)."""
        return self.gains.of(values) * self.power(values) * self.shown(values) * self._own(values)

    def power(self, values: Mapping[str, float]) -> Array:
        """Lamp power over its value at time zero, shape (n,)."""
        return self._power(chosen(values, _TIME, own=False))

    def shown(self, values: Mapping[str, float]) -> Array | float:
        """Factors of the readout on all light: of the plane, and of readings in water."""
        scene = self._scene(values)
        gain = plane_gain(scene, self._taken.z_m)
        return gain * immersed(scene, self._taken.in_air)

    def _scene(self, values: Mapping[str, float]) -> Scene:
        return self.scenes.of_chosen(chosen(values, _READOUT, own=False))

    def _own(self, values: Mapping[str, float]) -> Array | float:
        """What the user's own effects at source and receiver make of all light, shape (n,)."""
        own = self._acting(values, "source", "receiver")
        return own_formulas.product(own, self._here(values)) if own else 1.0

    def _acting(self, values: Mapping[str, float], *stages: Stage) -> list[OwnEffect]:
        """The user's own effects at some stages."""
        return self._of_stages(chosen(values, frozenset()), stages) if self.scenes.scene.effect else []

    def _here(self, values: Mapping[str, float]) -> Places:
        """What formulas may speak of."""
        return self._places(chosen(values, _POSE, own=False))

    @cached_property
    def _places(self) -> Callable[[Chosen], Places]:
        r = self.readings
        where = r.x_m, r.y_m, r.z_m, r.wavelength_nm, r.time_s
        return lru_cache(REMEMBERED)(lambda those: own_formulas.places(self.scenes.of_chosen(those), *where))

    @cached_property
    def _of_stages(self) -> Callable[[Chosen, tuple[Stage, ...]], list[OwnEffect]]:
        """Which act at some stages, for these values of their parameters."""

        def acting(those: Chosen, stages: tuple[Stage, ...]) -> list[OwnEffect]:
            return own_formulas.acting(self.scenes.effects(those), *stages)

        return lru_cache(REMEMBERED)(acting)

    @cached_property
    def _power(self) -> Callable[[Chosen], Array]:
        """Lamp power over its value at time zero, shape (n,), for these values; read alone."""

        def power(those: Chosen) -> Array:
            factor = np.array(time_factor(self.scenes.of_chosen(those), self._time))
            factor.setflags(write=False)
            return factor

        return lru_cache(REMEMBERED)(power)
