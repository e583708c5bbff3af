"""Where the light of each colour of a table lies: at one wavelength, or in a band that was read as a whole.

    T(s) = sum of shares exp(-(a + b) s + excess(a, b)),   a, b at the wavelength of each part of the band

is what a band lets through: what is dimmed most is gone first, so -ln T grows less than straight. Shares are
those of the light that the detector sees in air.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.readings import Readings
from lightfield.readings.unchecked import bands_of
from lightfield.scene import Scene
from lightfield.scene.bands import over_band, read_nm
from lightfield.scene.water.coefficients import absorption_per_m, known_nm, scattering_per_m
from lightfield.scene.water.water import Water

#: Widest part of a band over which the water is taken to be the same, nm, and most parts: pure water's
#: attenuation changes by 0.01 per m over 2 nm at its steepest (590 nm).
_PART_NM, _MOST_PARTS = 2.0, 50


@dataclass(frozen=True, eq=False)
class Seen:
    """Wavelengths that stand for each colour.

    Parameters
    ----------
    wavelength_nm, share : array, shape (n_colours, n_parts), nm and 1
        Of the light that is seen in air; shares of a colour sum to 1.
    width_nm : array, shape (n_colours,), nm
        Of its band; 0 of light at one wavelength.
    """

    wavelength_nm: Array
    share: Array
    width_nm: Array

    def of(self, colours: Mask) -> Seen:
        """Of some of the colours."""
        return Seen(self.wavelength_nm[colours], self.share[colours], self.width_nm[colours])

    def coefficients(self, water: Water) -> tuple[Array, Array]:
        """Absorption and scattering of a water at each part, shape (n_colours, n_parts), 1/m.

        An end of a band beyond what the water is known for has the last value that is known.
        """
        low, high = known_nm(water)
        middle = self.wavelength_nm.mean(axis=1, keepdims=True)
        at = np.clip(self.wavelength_nm, np.minimum(low, middle), np.maximum(high, middle))
        return absorption_per_m(water, at), scattering_per_m(water, at)

    def hardened(self, water: Water, path_m: Array) -> Array:
        """Part by which K over such paths lies below the band's mean attenuation, shape (n_colours,)."""
        c = sum(self.coefficients(water))
        slope = -np.polyfit(path_m, self.mean_ln(-np.multiply.outer(path_m, c)), 1)[0]
        return np.asarray(1.0 - slope / (self.share * c).sum(axis=1))

    def mean_ln(self, ln_light: Array) -> Array:
        """ln of the mean over each band.

        Parameters
        ----------
        ln_light : array, shape (n_rows, n_colours, n_parts)
        """
        largest = ln_light.max(axis=2)
        with np.errstate(under="ignore"):
            left = np.exp(ln_light - largest[..., None])
        return np.asarray(largest + np.log(np.einsum("jlp,lp->jl", left, self.share)))


def seen_by(readings: Readings, scene: Scene, colours_nm: Array) -> Seen:
    """What stands for the colours of a table: the bands that its head states, else their wavelengths.

    Parameters
    ----------
    readings : Readings
        Checked against the scene: those without a wavelength are means over its only band.
    scene : Scene
        Spectrum of the lamp, response and wavelength shift of the detector.
    colours_nm : array, shape (n_colours,), nm
        As stated.

    Raises
    ------
    MeasurementError
        Bands in the head that are none.
    """
    found = bands_of(readings, colours_nm)
    if readings.of_band and not any(found):
        found = [scene.detector.bands_nm[0]] * len(found)
    width = np.array([0.0 if band is None else band[1] - band[0] for band in found])
    parts = int(np.clip(np.ceil(width.max(initial=0.0) / _PART_NM), 1, _MOST_PARTS))
    at, share = np.zeros((len(found), parts)), np.full((len(found), parts), 1.0 / parts)
    shift = scene.detector.wavelength_shift_nm
    for k, band in enumerate(found):
        if band is None:
            at[k] = read_nm(scene, colours_nm[k])
            continue
        at[k], power = over_band(scene.lamp, band[0] + shift, band[1] + shift, scene.detector, parts)
        if power.sum() > 0:
            share[k] = power / power.sum()
    return Seen(at, share, width)
