"""Scattering and refractive index of pure water and sea water."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array

_BOLTZMANN = 1.380649e-23
_AVOGADRO = 6.02214076e23
_MOLAR_MASS_KG = 18e-3
DEPOLARISATION = 0.039


def refractive_index(wavelength_nm: ArrayLike, temperature_c: float, salinity_psu: float) -> Array:
    """Refractive index of water relative to air (Quan & Fry 1995, Appl. Opt. 34, 3477, eq. 3).

    Parameters
    ----------
    wavelength_nm : array, nm
        400-700 nm, usable to about 350 and 900.
    temperature_c : float, degC
        0-30.
    salinity_psu : float
        0-35.
    """
    w, t, s = np.asarray(wavelength_nm, dtype=float), temperature_c, salinity_psu
    salt = (1.779e-4 - 1.05e-6 * t + 1.6e-8 * t * t) * s
    per_wavelength = 15.868 + 0.01155 * s - 0.00423 * t
    return np.asarray(1.31405 + salt - 2.02e-6 * t * t + per_wavelength / w - 4382.0 / w**2 + 1.1455e6 / w**3)


def molecular_scattering_per_m(
    wavelength_nm: ArrayLike, temperature_c: float = 20.0, salinity_psu: float = 0.0
) -> Array:
    """Scattering coefficient of particle-free water (Zhang, Hu & He 2009, Opt. Express 17, 5698).

    Density and salt-concentration fluctuations; depolarisation ratio 0.039; index of Quan & Fry (1995) times
    that of air (Ciddor 1996), compressibility of Lepple & Millero (1971), density of UNESCO 38 (1981).

    Parameters
    ----------
    wavelength_nm : array, nm
        In vacuum.
    temperature_c : float, degC
        0-30.
    salinity_psu : float
        0-40.

    Returns
    -------
    array, 1/m
    """
    w, t, s = np.asarray(wavelength_nm, dtype=float), temperature_c, salinity_psu
    air = _air_index(w)
    n = refractive_index(w, t, s) * air
    index_per_salinity = (1.779e-4 - 1.05e-6 * t + 1.6e-8 * t * t + 0.01155 / w) * air
    density_change = (n**2 - 1) * (1 + 2 / 3 * (n**2 + 2) * (n / 3 - 1 / (3 * n)) ** 2)
    cabannes = (6 + 6 * DEPOLARISATION) / (6 - 7 * DEPOLARISATION)
    k4 = (w * 1e-9) ** -4
    density = (
        0.5 * math.pi**2 * k4 * _BOLTZMANN * (t + 273.15) * _compressibility_per_pa(t, s) * density_change**2
    )
    fluctuation = s * _MOLAR_MASS_KG * index_per_salinity**2 / _density_kg_per_m3(t, s) / _AVOGADRO
    salt = 2 * math.pi**2 * k4 * n**2 * fluctuation / -_log_activity_slope(t, s)
    at_90 = (density + salt) * cabannes
    return np.asarray(8 * math.pi / 3 * at_90 * (2 + DEPOLARISATION) / (1 + DEPOLARISATION))


def _air_index(wavelength_nm: Array) -> Array:
    """Ciddor (1996), Appl. Opt. 35, 1566."""
    sigma2 = (1e3 / wavelength_nm) ** 2
    return 1.0 + (5792105.0 / (238.0185 - sigma2) + 167917.0 / (57.362 - sigma2)) * 1e-8


def _compressibility_per_pa(t: float, s: float) -> float:
    """Isothermal compressibility (Lepple & Millero 1971, Deep-Sea Res. 18, 1233)."""
    water = 19652.21 + t * (148.4206 + t * (-2.327105 + t * (1.360477e-2 - 5.155288e-5 * t)))
    salt = 54.6746 + t * (-0.603459 + t * (1.09987e-2 - 6.167e-5 * t))
    salt_root = 7.944e-2 + t * (1.6483e-2 - 5.3009e-4 * t)
    return 1e-5 / (water + salt * s + salt_root * s**1.5)


def _density_kg_per_m3(t: float, s: float) -> float:
    """Density of sea water at one atmosphere (UNESCO 1981)."""
    water = 999.842594 + t * (
        6.793952e-2 + t * (-9.09529e-3 + t * (1.001685e-4 + t * (-1.120083e-6 + 6.536332e-9 * t)))
    )
    salt = 8.24493e-1 + t * (-4.0899e-3 + t * (7.6438e-5 + t * (-8.2467e-7 + 5.3875e-9 * t)))
    salt_root = -5.72466e-3 + t * (1.0227e-4 - 1.6546e-6 * t)
    return water + salt * s + salt_root * s**1.5 + 4.8314e-4 * s * s


def _log_activity_slope(t: float, s: float) -> float:
    """Change of the logarithm of water activity with salinity (Millero & Leung 1976, fit of Zhang et al.)."""
    first = -5.58651e-4 + t * (2.40452e-7 + t * (-3.12165e-9 + 2.40808e-11 * t))
    root = 1.79613e-5 + t * (-9.9422e-8 + t * (2.08919e-9 - 1.39872e-11 * t))
    second = -2.31065e-6 + t * (-1.37674e-9 - 1.93316e-11 * t)
    return first + 1.5 * root * math.sqrt(s) + 2 * second * s
