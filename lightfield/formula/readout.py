"""From light to the number an instrument shows: lamp power in time, then what the instrument does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightfield.arrays import TINY, Array
from lightfield.scene.curve import value_at

if TYPE_CHECKING:
    from lightfield.scene import Scene
    from lightfield.scene.detector import Detector


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


@dataclass(frozen=True)
class Halves:
    """Readings of half the wavelength in the same spectrum, by linear interpolation.

    Parameters
    ----------
    rows : array of int, shape (m,)
        Readings at twice the wavelength of others.
    below, above : array of int, shape (m,)
        Readings between which half their wavelength lies.
    weight : array, shape (m,)
        Of the one above.
    """

    rows: NDArray[np.int_]
    below: NDArray[np.int_]
    above: NDArray[np.int_]
    weight: Array

    def of(self, signal: Array) -> Array:
        """The signal at half the wavelength; 0 where none is read, shape (n,)."""
        out = np.zeros_like(signal)
        out[self.rows] = (1 - self.weight) * signal[self.below] + self.weight * signal[self.above]
        return out


@dataclass(frozen=True)
class Taken:
    """How readings were taken, beside where.

    Parameters
    ----------
    in_air : array of bool, optional
        Readings in air; absent, all are in water.
    spectrum : array of int, optional
        Number of the spectrum that each reading is of, see `spectra`; absent, each is read by itself.
    time_s : array, s, optional
        NaN (unknown) counts as 0, as if absent.
    halves : Halves, optional
        Where readings of half the wavelength are; absent, or no overlap, there is no second order.
    z_m : array, m, optional
        Distances; absent, every plane has the same gain.
    wavelength_nm : array, nm, optional
        As stated; NaN (unknown) counts as the middle of the scene's first band, as if absent.
    """

    in_air: ArrayLike | None = None
    spectrum: NDArray[np.int_] | None = None
    time_s: ArrayLike | None = None
    halves: Halves | None = None
    z_m: ArrayLike | None = None
    wavelength_nm: ArrayLike | None = None


def plane_gain(scene: Scene, z_m: ArrayLike | None) -> Array | float:
    """Gain of the readings at each distance over what it should be: exp(departure(z)).

    Parameters
    ----------
    scene : Scene
        detector.plane_departure.
    z_m : array, m, optional
        Absent, every plane has the same gain.
    """
    nodes = scene.detector.plane_departure
    return np.exp(value_at(nodes, np.asarray(z_m, dtype=float))) if nodes and z_m is not None else 1.0


def ambient(
    scene: Scene, time_s: ArrayLike | None = None, wavelength_nm: ArrayLike | None = None
) -> Array | float:
    """Reading without the lamp: (B + departure(wavelength)) (1 + d t) + course(t), and what is switched on.

    Parameters
    ----------
    scene : Scene
        detector.background, background_departure, background_drift_per_hour, background_course,
        background_step.
    time_s, wavelength_nm : array, s and nm, optional
        As `Taken` has them.
    """
    detector = scene.detector
    level: Array | float = float(detector.background)
    if detector.background_departure:
        middle = float(np.mean(detector.bands_nm[0]))
        wave = np.asarray(middle if wavelength_nm is None else wavelength_nm, dtype=float)
        level = level + value_at(detector.background_departure, np.where(np.isnan(wave), middle, wave))
    if time_s is None:
        return level
    time = np.nan_to_num(np.asarray(time_s, dtype=float))
    if detector.background_drift_per_hour:
        level = level * (1.0 + detector.background_drift_per_hour * time / 3600.0)
    if detector.background_course:
        level = level + value_at(detector.background_course, time)
    if detector.background_step:
        level = level + detector.background_step * _switched_on(detector, time)
    return level


def _switched_on(detector: Detector, time_s: Array) -> Array:
    """Part of the ambient light's step that is there at these times: none, all of it, or between."""

    def after(moment_s: float) -> Array:
        return np.asarray(0.5 * (1.0 + np.tanh((time_s - moment_s) / detector.background_step_over_s)))

    on = after(detector.background_step_s)
    lasts_s = detector.background_step_for_s
    return on - after(detector.background_step_s + lasts_s) if lasts_s else on


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


def spectra(*columns: ArrayLike) -> NDArray[np.int_] | None:
    """Which readings are of one spectrum: those alike in all columns (position, medium, time).

    Parameters
    ----------
    *columns : arrays, shape (n,)
        NaN is like NaN.

    Returns
    -------
    array of int, shape (n,), or None where no two readings are
    """
    stacked = np.stack([np.nan_to_num(np.asarray(c, dtype=float), nan=-1.0) for c in columns], axis=1)
    _, number, size = np.unique(stacked, axis=0, return_inverse=True, return_counts=True)
    return number.ravel() if size.max(initial=0) > 1 else None


def halves(spectrum: NDArray[np.int_] | None, wavelength_nm: ArrayLike | None) -> Halves | None:
    """Where in each spectrum half the wavelength of a reading lies; None where no two overlap so.

    Parameters
    ----------
    spectrum : array of int, shape (n,), optional
        As `spectra` numbers them.
    wavelength_nm : array, nm, shape (n,), optional
    """
    if spectrum is None or wavelength_nm is None:
        return None
    wave = np.asarray(wavelength_nm, dtype=float)
    known = np.flatnonzero(np.isfinite(wave))
    order = known[np.lexsort((wave[known], spectrum[known]))]
    # One rising number for spectrum and wavelength: apart by more than any wavelength.
    apart = 4.0 * float(wave[known].max(initial=1.0))
    keys = spectrum[order] * apart + wave[order]
    wanted = spectrum[order] * apart + 0.5 * wave[order]
    at = np.searchsorted(keys, wanted)
    exact = keys[np.minimum(at, len(keys) - 1)] == wanted
    low = np.where(exact, at, at - 1)
    there = (low >= 0) & (spectrum[order[np.maximum(low, 0)]] == spectrum[order])
    if not there.any():
        return None
    rows, low, high = order[there], order[low[there]], order[at[there]]
    gap = wave[high] - wave[low]
    part = np.divide(0.5 * wave[rows] - wave[low], gap, out=np.zeros(len(rows)), where=gap > 0)
    return Halves(rows, low, high, part)


_AS_USUAL = Taken()
#: Second order is taken out so many times, each from what is left: of half a wavelength, of its half...
_ORDERS = 8


def readout(scene: Scene, signal: ArrayLike, full: float | None = None, taken: Taken = _AS_USUAL) -> Array:
    """What an instrument shows: planes' gain, immersion, second order, stray light, background, saturation.

    A grating sends half a wavelength, in its second order, to where it sends the wavelength in its first
    (Palmer and Loewen 2005, Diffraction Grating Handbook, section 2.2): x(l) becomes x(l) + f x(l / 2).
    Stray light is light of other wavelengths inside a spectrometer: x_i becomes (1 - s) x_i + s mean(x), the
    same everywhere in the spectrum (Zong et al. 2006, Appl. Opt. 45, 1111, doi:10.1364/AO.45.001111, measure
    the whole matrix). With s = (signal + background) / full the reading is full s / (1 + k s) (saturation)
    and full s (1 - k s) (its quadratic form).

    Parameters
    ----------
    scene : Scene
        detector.plane_departure, immersion_factor, second_order, stray_light, background with its
        departure and drift, saturation, saturation_quadratic.
    signal : array
        Gain x light, in units of readings in air.
    full : float, optional
        Largest reading of the measurement; absent, the largest of `signal` + background.
    """
    detector = scene.detector
    reading = np.asarray(signal, dtype=float)
    if detector.plane_departure:
        reading = reading * plane_gain(scene, taken.z_m)
    if detector.immersion_factor != 1.0:
        reading = reading * immersed(scene, taken.in_air)
    if detector.second_order and taken.halves is not None:
        reading = reading + detector.second_order * taken.halves.of(reading)
    if detector.stray_light and taken.spectrum is not None:
        mean = np.bincount(taken.spectrum, reading) / np.bincount(taken.spectrum)
        reading = reading + detector.stray_light * (mean[taken.spectrum] - reading)
    reading = reading + ambient(scene, taken.time_s, taken.wavelength_nm)
    if detector.saturation or detector.saturation_quadratic:
        level = float(np.max(np.abs(reading), initial=TINY)) if full is None else full
        s = reading / level
        if detector.saturation:
            s = s / (1.0 + detector.saturation * s)
        if detector.saturation_quadratic:
            s = s * (1.0 - detector.saturation_quadratic * s)
        reading = level * s
    return reading


def signal_of(scene: Scene, reading: ArrayLike, full: float, taken: Taken = _AS_USUAL) -> tuple[Array, Array]:
    """The signal in water that an instrument shows so: `readout` backwards, but for the immersion factor.

    Parameters
    ----------
    scene : Scene
        As for `readout`.
    reading : array
    full : float
        Largest reading of the measurement.

    Returns
    -------
    signal, slope : array
        Gain x light over the immersion factor, and its derivative by the reading itself; NaN where no light
        is shown so, because the instrument saturates below.
    """
    detector, level = scene.detector, full or 1.0
    s = np.asarray(reading, dtype=float) / level
    slope = np.ones_like(s)
    with np.errstate(invalid="ignore", divide="ignore"):
        if k := detector.saturation_quadratic:
            root = np.sqrt(1.0 - 4.0 * k * s)
            s, slope = (1.0 - root) / (2.0 * k), 1.0 / root
        if k := detector.saturation:
            left = np.where(k * s < 1.0, 1.0 - k * s, np.nan)
            s, slope = s / left, slope / left**2
    signal = level * s - ambient(scene, taken.time_s, taken.wavelength_nm)
    if detector.stray_light and taken.spectrum is not None:
        mean = np.bincount(taken.spectrum, signal) / np.bincount(taken.spectrum)
        kept = 1.0 - detector.stray_light
        signal, slope = (signal - detector.stray_light * mean[taken.spectrum]) / kept, slope / kept
    if detector.second_order and taken.halves is not None:
        shown = signal
        for _ in range(_ORDERS):
            signal = shown - detector.second_order * taken.halves.of(signal)
    gain = plane_gain(scene, taken.z_m)
    return np.asarray(signal / gain), np.asarray(slope / gain)
