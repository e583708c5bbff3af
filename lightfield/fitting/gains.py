"""Reading per unit of light: a gain per channel, and on an absolute scale the intensity of the lamp."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from lightfield.arrays import Array
from lightfield.fitting.light_source import LightSource
from lightfield.fitting.parameter import GAIN
from lightfield.fitting.scene_of_values import REMEMBERED, Chosen, chosen
from lightfield.formula.own_formulas import lit
from lightfield.readings import units
from lightfield.readings.unchecked import bands_of
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import paths_on
from lightfield.scene.bands import over_band, read_nm
from lightfield.scene.lamp.spectrum import axial_intensity

#: What makes the intensity on the axis: power, the beam that it is spread over, and the wavelengths read.
_LIT = frozenset(paths_on(Acts.POWER | Acts.BEAM | Acts.PLACES))
#: What an absolute gain cannot be told from.
LAMP_POWER = "lamp.power_w"


@dataclass(frozen=True, eq=False)
class Gains:
    """What the readings of a table are per unit of the light at their places."""

    light: LightSource

    @property
    def is_absolute(self) -> bool:
        """Are the readings in a unit of light, which the lamp's power gives?"""
        return bool(self.light.readings.scale == "absolute")

    @property
    def names(self) -> tuple[str, ...]:
        """One gain per channel on a relative scale; on an absolute one, one for all, next to 1."""
        wavelengths = self.light.diffuse.channels[0]
        if len(wavelengths) == 1 or self.is_absolute:
            return (GAIN,)
        return tuple(map(_of_channel, wavelengths))

    def of(self, values: Mapping[str, float]) -> Array:
        """Reading per unit of light from an on-axis intensity of one, shape (n,)."""
        wavelengths, channel = self.light.diffuse.channels
        if len(wavelengths) == 1:  # of a table that may have had others
            gains = np.array([values.get(GAIN, values.get(_of_channel(wavelengths[0]), 1.0))])
        else:
            gains = np.array([values.get(name, 1.0) for name in self.names])
        gain = gains[channel] if len(gains) > 1 else np.full(len(channel), gains[0])
        return np.asarray(gain * self._intensity(values)[channel] if self.is_absolute else gain)

    def _intensity(self, values: Mapping[str, float]) -> Array:
        """Radiant intensity on the axis, in the unit of absolute readings times m^2, shape (n_channels,)."""
        return self._remembered(chosen(values, _LIT))

    @cached_property
    def _remembered(self) -> Callable[[Chosen], Array]:
        return lru_cache(REMEMBERED)(self._made)

    @cached_property
    def _bands(self) -> list[tuple[float, float] | None]:
        """Band in nm of each channel; None: light at its wavelength."""
        wavelengths, table = self.light.diffuse.channels[0], self.light.readings
        whole = self.light.scenes.scene.detector.bands_nm[0]
        stated = bands_of(table, wavelengths)
        return [
            band or (whole if table.of_band or np.isnan(w) else None)
            for band, w in zip(stated, wavelengths, strict=True)
        ]

    def _made(self, those: Chosen) -> Array:
        light = self.light
        scene = light.scenes.of_chosen(those)
        lamp, shift = lit(scene).lamp, scene.detector.wavelength_shift_nm
        unit = units.to_si(light.readings.units, light.scenes.scene.detector.quantity)
        intensity = axial_intensity(lamp, read_nm(scene, light.diffuse.wavelengths_nm))
        for k, band in enumerate(self._bands):
            if band is not None:
                low, high = (edge + shift for edge in band)
                intensity[k] = over_band(lamp, low, high, scene.detector).intensity.mean()
        return np.asarray(intensity / unit)


def _of_channel(wavelength_nm: float) -> str:
    """Path of the gain at a wavelength among others."""
    return f"{GAIN}.{wavelength_nm:g}nm"
