"""From light to the number an instrument shows: lamp power in time, background, saturation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.curve import value_at

if TYPE_CHECKING:
    from lightfield.scene import Scene


def time_factor(scene: Scene, time_s: ArrayLike) -> Array:
    """Lamp power over that at time 0: (1 + d t) (1 + f (1 - exp(-t / tau))) exp(departure(t)).

    Parameters
    ----------
    scene : Scene
        lamp.drift_per_hour, warmup_fraction, warmup_time_s, power_departure.
    time_s : array, s
        NaN (unknown) counts as 0.
    """
    lamp, t = scene.lamp, np.asarray(time_s, dtype=float)
    t = np.where(np.isnan(t), 0.0, t)
    factor = 1.0 + lamp.drift_per_hour * t / 3600.0
    if lamp.warmup_fraction:
        factor = factor * (1.0 - lamp.warmup_fraction * np.expm1(-t / lamp.warmup_time_s))
    if lamp.power_departure:
        factor = factor * np.exp(value_at(lamp.power_departure, t))
    return np.asarray(factor)


def readout(scene: Scene, signal: ArrayLike, full: float | None = None) -> Array:
    """What the instrument shows: background added, then saturation.

    With s = (signal + background) / full the reading is full s / (1 + k s) (saturation) and full s (1 - k s)
    (its quadratic form).

    Parameters
    ----------
    scene : Scene
        detector.background, saturation, saturation_quadratic.
    signal : array
        Gain x light, in units of the readings.
    full : float, optional
        Largest reading of the measurement; absent, the largest of `signal` + background.
    """
    detector = scene.detector
    reading = np.asarray(signal, dtype=float) + detector.background
    if not detector.saturation and not detector.saturation_quadratic:
        return reading
    level = float(np.max(np.abs(reading), initial=1e-300)) if full is None else full
    s = reading / level
    if detector.saturation:
        s = s / (1.0 + detector.saturation * s)
    if detector.saturation_quadratic:
        s = s * (1.0 - detector.saturation_quadratic * s)
    return level * s
