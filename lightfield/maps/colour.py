"""Colour of a spectrum, for previews only: no number of a result passes through here."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import TINY

# Multi-lobe fits of the CIE 1931 2 degree colour matching functions: Wyman, Sloan & Shirley (2013),
# "Simple analytic approximations to the CIE XYZ color matching functions", JCGT 2(2), eq. 4.
# Each lobe: height, centre in nm, width factor below and above the centre.
_LOBES = (
    ((1.056, 599.8, 0.0264, 0.0323), (0.362, 442.0, 0.0624, 0.0374), (-0.065, 501.1, 0.0490, 0.0382)),
    ((0.821, 568.8, 0.0213, 0.0247), (0.286, 530.9, 0.0613, 0.0322)),
    ((1.217, 437.0, 0.0845, 0.0278), (0.681, 459.0, 0.0385, 0.0725)),
)
# IEC 61966-2-1 (sRGB), XYZ to linear RGB, D65.
_XYZ_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def colour_matching(wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIE 1931 colour matching functions x, y, z.

    Parameters
    ----------
    wavelength_nm : array, shape (n,), nm

    Returns
    -------
    array, shape (n, 3)

    Source: Wyman, Sloan & Shirley 2013, eq. 4 (rms error below 1 % of the peak).
    """
    wavelength_nm = np.asarray(wavelength_nm, dtype=float)
    columns = []
    for lobes in _LOBES:
        column = np.zeros_like(wavelength_nm)
        for height, centre, below, above in lobes:
            offset = wavelength_nm - centre
            column += height * np.exp(-0.5 * (offset * np.where(offset < 0, below, above)) ** 2)
        columns.append(column)
    return np.stack(columns, axis=-1)


#: Primaries and white of IEC 61966-2-1 (sRGB), in which all our RGB is: x, y of red, green, blue, white.
CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


def spectrum_to_rgb(value: NDArray[np.float64], wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear sRGB of a spectral image, brightest channel 1; see `linear_rgb`."""
    rgb = linear_rgb(value, wavelength_nm)
    peak = float(rgb.max()) if rgb.size else 0.0
    return rgb / peak if peak > 0 else rgb


def linear_rgb(value: NDArray[np.float64], wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear sRGB of a spectral image, colours outside the gamut clipped.

    Parameters
    ----------
    value : array, shape (n, ...), any unit per nm
    wavelength_nm : array, shape (n,), nm
        In any order.

    Returns
    -------
    array, shape (..., 3), that unit times nm; of a single wavelength per nm
    """
    rising = np.argsort(wavelength_nm)
    wavelength_nm, value = np.asarray(wavelength_nm, dtype=float)[rising], np.asarray(value)[rising]
    weight = np.gradient(wavelength_nm) if wavelength_nm.size > 1 else np.ones(1)
    xyz = np.tensordot(
        np.moveaxis(np.asarray(value, dtype=float), 0, -1),
        weight[:, None] * colour_matching(wavelength_nm),
        1,
    )
    rgb = np.clip(xyz @ _XYZ_TO_RGB.T, 0.0, None)
    peak = float(rgb.max()) if rgb.size else 0.0
    # Bands outside the visible have no colour: show them grey rather than black.
    if peak < 1e-6 * max(float(np.max(np.abs(value), initial=0.0)), TINY):
        rgb = np.repeat(np.clip(np.mean(value, axis=0), 0.0, None)[..., None], 3, axis=-1)
    return rgb
