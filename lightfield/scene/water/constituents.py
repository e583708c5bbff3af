"""Absorption and scattering of what is in the water: chlorophyll, dissolved organic matter, sediment."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array

#: Wavelength at which coefficients of particles are stated, nm.
REFERENCE_NM = 550.0
# Own fit to the coefficients A and E of Bricaud et al. (1998), J. Geophys. Res. 103, 31033, a = A Chl^E,
# 400-700 nm: A as a sum of Gaussians (centre nm, width nm, height m^2/mg), rms 0.2 % of its maximum; E as a
# Chebyshev series in (wavelength - 550) / 150, rms 0.006.
# The product is within 2 % of theirs at 1 mg/m^3, 4 % at 0.1 and 10.
_PIGMENTS = np.array(
    [
        [396.3, 21.81, 0.02174], [415.8, 9.24, 0.00923], [437.2, 13.02, 0.02916], [462.9, 13.61, 0.02396],
        [487.7, 14.18, 0.01687], [510.2, 17.92, 0.00962], [544.5, 20.61, 0.00589], [590.5, 15.69, 0.00388],
        [617.9, 11.83, 0.00215], [646.4, 19.03, 0.00564], [690.0, 79.97, 0.00168], [675.0, 10.09, 0.01479],
    ]
)  # fmt: skip
_EXPONENT = (
    0.786, 0.1527, 0.0022, -0.0244, 0.0849, 0.0376, -0.0219, 0.0148, 0.021, -0.01, -0.0171, 0.0011, 0.0056,
    -0.0007, -0.0025,
)  # fmt: skip


def chlorophyll_absorption_per_m(chlorophyll_mg_per_m3: float, wavelength_nm: ArrayLike) -> Array:
    """Phytoplankton absorption A(lambda) Chl^E(lambda), a fit to Bricaud et al. (1998); see the note above.

    Parameters
    ----------
    chlorophyll_mg_per_m3 : float, mg/m^3
        0.02-25 in the data.
    wavelength_nm : array, nm
        400-700; the value at the nearer end is used outside.
    """
    w = np.clip(np.asarray(wavelength_nm, dtype=float), 400.0, 700.0)
    if chlorophyll_mg_per_m3 <= 0:
        return np.zeros_like(w)
    centre, width, height = _PIGMENTS.T
    specific = np.exp(-0.5 * ((w[..., None] - centre) / width) ** 2) @ height
    exponent = np.polynomial.chebyshev.chebval((w - 550.0) / 150.0, _EXPONENT)
    return np.asarray(specific * chlorophyll_mg_per_m3**exponent)


def chlorophyll_scattering_per_m(chlorophyll_mg_per_m3: float, wavelength_nm: ArrayLike) -> Array:
    """Particle scattering that goes with chlorophyll: 0.416 Chl^0.766 (lambda / 550)^v.

    v = (log10 Chl - 0.3) / 2 below 2 mg/m^3 (as at 0.02 below), 0 above (Loisel & Morel 1998, Limnol.
    Oceanogr. 43, 847; Morel & Maritorena 2001, J. Geophys. Res. 106, 7163).

    Parameters
    ----------
    chlorophyll_mg_per_m3 : float, mg/m^3
        Chlorophyll.
    wavelength_nm : array, nm
        Visible.
    """
    w = np.asarray(wavelength_nm, dtype=float)
    if chlorophyll_mg_per_m3 <= 0:
        return np.zeros_like(w)
    slope = (
        0.5 * (np.log10(np.clip(chlorophyll_mg_per_m3, 0.02, 2.0)) - 0.3)
        if chlorophyll_mg_per_m3 < 2
        else 0.0
    )
    return np.asarray(0.416 * chlorophyll_mg_per_m3**0.766 * (w / 550.0) ** slope)


def scattering_shape(slope: float, wavelength_nm: ArrayLike) -> Array:
    """Scattering of particles over that at 550 nm: (550 nm / lambda)^eta.

    eta is 0 of particles large beside the wavelength, 1 in the open sea, and above 2 of minute ones (Gordon
    and Morel 1983, doi:10.1007/978-1-4684-6280-7).

    Parameters
    ----------
    slope : float
    wavelength_nm : array, nm
    """
    return np.asarray((REFERENCE_NM / np.asarray(wavelength_nm, dtype=float)) ** slope)


def cdom_absorption_per_m(
    absorption_440_per_m: float, slope_per_nm: float, wavelength_nm: ArrayLike
) -> Array:
    """Coloured dissolved organic matter, a(440) exp(-S (lambda - 440)) (Bricaud, Morel & Prieur 1981).

    S is 0.014 per nm in WASI, 0.0176 in the mean of European coasts (Babin et al. 2003).
    """
    w = np.asarray(wavelength_nm, dtype=float)
    return np.asarray(absorption_440_per_m * np.exp(-slope_per_nm * (w - 440.0)))


def sediment_absorption_per_m(sediment_g_per_m3: float, wavelength_nm: ArrayLike) -> Array:
    """Non-algal particles, 0.041 m^2/g exp(-0.011 (lambda - 440)): defaults of WASI (Gege 2021)."""
    return cdom_absorption_per_m(0.041 * sediment_g_per_m3, 0.011, wavelength_nm)


def sediment_scattering_per_m(sediment_g_per_m3: float, wavelength_nm: ArrayLike) -> Array:
    """Non-algal particles, 0.5 m^2/g (lambda / 555)^-0.5 (Babin et al. 2003, Limnol. Oceanogr. 48, 843)."""
    w = np.asarray(wavelength_nm, dtype=float)
    return np.asarray(sediment_g_per_m3 * 0.5 * (w / 555.0) ** -0.5)
