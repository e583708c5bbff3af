"""Peaks over wavelength: the spectrum of an LED, the window of a filter."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.acts import Acts
from lightfield.scene.parameters import Part, number

#: Knots of a peak: every quarter of its width, as far as 1e-10 of its height is left. Between them the
#: three-point rule by which bands are integrated is exact to 1e-6 (test_peaks.py).
_STEP, _REACH = 0.25, 3.0
_AREA = math.sqrt(math.pi / (4.0 * math.log(2.0)))  # of a Gaussian of width and height 1


class Peak(Part):
    """A Gaussian over wavelength.

    What an LED gives is close to that; its slope towards the red is a little longer, and a measured table is
    better where that counts.
    """

    peak_nm: float = number(..., "nm", "where it is highest", Acts.POWER, low=200.0, high=2000.0)
    fwhm_nm: float = number(..., "nm", "full width at half its height", Acts.POWER, low=0.01, high=1000.0)
    height: float = number(1.0, "1", "height over that of the other peaks", Acts.POWER, above=0.0, high=1e6)


#: Light-emitting diodes by name. Wavelengths and widths are typical (chosen: rounded from data sheets of
#: high-power LEDs, which give 20 nm for red and blue ones and 30 to 35 nm for cyan and green); single ones
#: lie up to 10 nm to either side. The white ones are blue ones under a phosphor, with heights for a colour
#: temperature of about 6400 K and 2900 K (test_peaks.py asks colour-science).
LEDS: dict[str, tuple[Peak, ...]] = {
    "led-royal-blue": (Peak(peak_nm=450.0, fwhm_nm=20.0),),
    "led-blue": (Peak(peak_nm=470.0, fwhm_nm=25.0),),
    "led-cyan": (Peak(peak_nm=505.0, fwhm_nm=30.0),),
    "led-green": (Peak(peak_nm=525.0, fwhm_nm=35.0),),
    "led-amber": (Peak(peak_nm=590.0, fwhm_nm=18.0),),
    "led-red": (Peak(peak_nm=625.0, fwhm_nm=20.0),),
    "led-deep-red": (Peak(peak_nm=660.0, fwhm_nm=20.0),),
    "led-white": (Peak(peak_nm=450.0, fwhm_nm=22.0), Peak(peak_nm=565.0, fwhm_nm=125.0, height=0.5)),
    "led-warm-white": (Peak(peak_nm=450.0, fwhm_nm=22.0, height=0.45), Peak(peak_nm=600.0, fwhm_nm=140.0)),
}


def heights(peaks: Sequence[Peak], wavelength_nm: ArrayLike) -> Array:
    """The sum of the peaks.

    Parameters
    ----------
    wavelength_nm : array, nm

    Returns
    -------
    array, 1
        Sum of h exp(-4 ln2 ((w - peak) / fwhm)^2).
    """
    at = np.asarray(wavelength_nm, float)[..., None]
    middle, width, height = (
        np.array([getattr(p, n) for p in peaks]) for n in ("peak_nm", "fwhm_nm", "height")
    )
    return np.asarray((height * np.exp(-4.0 * math.log(2.0) * ((at - middle) / width) ** 2)).sum(axis=-1))


def density_per_nm(peaks: Sequence[Peak], wavelength_nm: ArrayLike) -> Array:
    """The same with an integral of 1 over all wavelengths, 1/nm."""
    return heights(peaks, wavelength_nm) / (_AREA * sum(p.height * p.fwhm_nm for p in peaks))


def peak_knots_nm(peaks: Sequence[Peak]) -> Array:
    """Wavelengths between which the sum is smooth, nm, rising."""
    steps = np.arange(-_REACH, _REACH + 0.5 * _STEP, _STEP)
    return np.unique(np.concatenate([p.peak_nm + steps * p.fwhm_nm for p in peaks]))


def way_written(value: object) -> str:
    """Which of the ways to write a curve over wavelength this is; what errors tell them apart by."""
    if isinstance(value, list | tuple):
        return "several peaks"
    return "one peak" if isinstance(value, dict | Peak) else "a name"


def peaks_of(value: object) -> tuple[Peak, ...] | None:
    """The peaks of a curve as a scene has it; None: it is written by another name, or in a table."""
    if isinstance(value, Peak):
        return (value,)
    return LEDS.get(value) if isinstance(value, str) else tuple(value) if isinstance(value, tuple) else None
