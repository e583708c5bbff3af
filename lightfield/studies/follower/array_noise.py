"""Noise of an array's readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.formula.own_formulas import lit
from lightfield.scene import Scene
from lightfield.scene.bands import first_band_w_per_sr
from lightfield.studies import photocurrent

#: Part of a percent, of a second of bandwidth (Nyquist), of a converter's step (its variance, Bennett 1948).
PERCENT, _BANDWIDTH, _STEP_VARIANCE = 0.01, 0.5, 1 / 12


@dataclass(frozen=True)
class SensorNoise:
    """Variance of readings: relative, of the brightest, of light and amplifier, of the converter.

    Parameters
    ----------
    mismatch, brightest : float
        Standard deviations, part of every reading, and part of the brightest.
    ampere : float, A m^2
        Current per unit of reading (irradiance over the lamp's axial intensity, 1/m^2); 0: no electrical
        noise.
    dark_a : float, A
    amplifier : float, A/Hz^0.5
    sample_hz : float, Hz
    bits : int
        Of a converter that the brightest reading fills; 0: exact.
    """

    mismatch: float = 0.0
    brightest: float = 0.0
    ampere: float = 0.0
    dark_a: float = 0.0
    amplifier: float = 0.0
    sample_hz: float = 1.0
    bits: int = 0

    @classmethod
    def of_scene(cls, scene: Scene) -> SensorNoise:
        """Noise of the array of a scene, for a gain of one; none where it has no array."""
        if scene.array is None:
            return cls()
        array = scene.array
        intensity = first_band_w_per_sr(lit(scene))
        square_metres = 1e-6 * array.element_area_mm2
        return cls(
            PERCENT * array.gain_mismatch_percent,
            PERCENT * array.noise_percent,
            array.responsivity_a_per_w * square_metres * intensity,
            array.dark_current_a,
            array.read_noise_a_per_sqrt_hz,
            array.sample_hz,
            array.adc_bits,
        )

    def variance(self, readings: Array, brightest: Array | float | None = None) -> Array:
        """Variance of every reading, shape as given (..., n).

        Parameters
        ----------
        readings : array, shape (..., n), 1/m^2
        brightest : array or float, optional
            Reading that the noise of the brightest and the converter's range follow; the largest by default.
        """
        light = np.maximum(readings, 0.0)
        top = light.max(axis=-1, keepdims=True) if brightest is None else np.asarray(brightest)
        total = (self.mismatch * light) ** 2 + (self.brightest * top) ** 2
        if self.ampere > 0:
            current, bandwidth = self.ampere * light, _BANDWIDTH * self.sample_hz
            electric = photocurrent.variance(current, self.dark_a, self.amplifier, bandwidth)
            total = total + electric / self.ampere**2
        if self.bits:
            total = total + _STEP_VARIANCE * (top / 2.0**self.bits) ** 2
        return total
