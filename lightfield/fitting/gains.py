"""Reading per unit of light: a gain per channel, and on an absolute scale the intensity of the lamp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.fitting.light_source import LightSource
from lightfield.fitting.parameter import GAIN
from lightfield.formula.own_formulas import lit
from lightfield.readings import units
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
        return tuple(f"{GAIN}.{w:g}nm" for w in wavelengths)

    def of(self, values: Mapping[str, float]) -> Array:
        """Reading per unit of light from an on-axis intensity of one, shape (n,)."""
        channel = self.light.diffuse.channels[1]
        gains = np.array([values.get(name, 1.0) for name in self.names])
        gain = gains[channel] if len(gains) > 1 else np.full(len(channel), gains[0])
        return np.asarray(gain * self._intensity(values)[channel] if self.is_absolute else gain)

    def _intensity(self, values: Mapping[str, float]) -> Array:
        """Radiant intensity on the axis, in the unit of absolute readings times m^2, shape (n_channels,)."""
        light = self.light
        scene = light.scenes.of_those(values, _LIT)
        lamp, shift = lit(scene).lamp, scene.detector.wavelength_shift_nm
        unit = units.to_si(light.readings.units, light.scenes.scene.detector.quantity)
        intensity = axial_intensity(lamp, read_nm(scene, light.diffuse.wavelengths_nm))
        whole = np.isnan(light.diffuse.channels[0]) | light.readings.of_band
        if whole.any():
            low, high = scene.detector.bands_nm[0]
            intensity[whole] = over_band(lamp, low + shift, high + shift, scene.detector).intensity.mean()
        return np.asarray(intensity / unit)
