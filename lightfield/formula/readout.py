"""From light to the number an instrument shows: lamp power in time, immersion, background, saturation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array

if TYPE_CHECKING:
    from lightfield.scene import Scene


def time_factor(scene: Scene, time_s: ArrayLike) -> Array:
    """Lamp power over that at time 0: (1 + d t) (1 + f (1 - exp(-t / tau))).

    Parameters
    ----------
    scene : Scene
        lamp.drift_per_hour, warmup_fraction, warmup_time_s.
    time_s : array, s
        NaN (unknown) counts as 0.
    """
    lamp, t = scene.lamp, np.asarray(time_s, dtype=float)
    t = np.where(np.isnan(t), 0.0, t)
    factor = 1.0 + lamp.drift_per_hour * t / 3600.0
    if lamp.warmup_fraction:
        factor = factor * (1.0 - lamp.warmup_fraction * np.expm1(-t / lamp.warmup_time_s))
    return np.asarray(factor)


def immersed(scene: Scene, in_air: ArrayLike | None = None) -> Array | float:
    """Part of the signal in air that the same irradiance makes: less in water, by the immersion factor.

    A collector in water sends more of the light back out than in air (Zibordi & Darecki 2006, J. Opt. A 8,
    252, doi:10.1088/1464-4258/8/3/005).

    Parameters
    ----------
    scene : Scene
        detector.immersion_factor.
    in_air : array of bool, optional
        Readings in air; absent, all are in water.
    """
    wet = 1.0 / scene.detector.immersion_factor
    return wet if in_air is None else np.where(in_air, 1.0, wet)


def readout(
    scene: Scene, signal: ArrayLike, full: float | None = None, in_air: ArrayLike | None = None
) -> Array:
    """What the instrument shows: less of light in water, background added, then saturation.

    With s = (signal + background) / full the reading is full s / (1 + k s) (saturation) and full s (1 - k s)
    (its quadratic form).

    Parameters
    ----------
    scene : Scene
        detector.immersion_factor, background, saturation, saturation_quadratic.
    signal : array
        Gain x light, in units of readings in air.
    full : float, optional
        Largest reading of the measurement; absent, the largest of `signal` + background.
    in_air : array of bool, optional
        Readings in air; absent, all are in water.
    """
    detector = scene.detector
    reading = np.asarray(signal, dtype=float)
    if detector.immersion_factor != 1.0:
        reading = reading * immersed(scene, in_air)
    reading = reading + detector.background
    if not detector.saturation and not detector.saturation_quadratic:
        return reading
    level = float(np.max(np.abs(reading), initial=1e-300)) if full is None else full
    s = reading / level
    if detector.saturation:
        s = s / (1.0 + detector.saturation * s)
    if detector.saturation_quadratic:
        s = s * (1.0 - detector.saturation_quadratic * s)
    return level * s
