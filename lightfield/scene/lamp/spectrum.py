"""Spectral power of the lamp: Planck, CIE illuminant A, peaks, or a table; and what departs from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.curve import value_at
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.profile import solid_angle_sr
from lightfield.scene.spectral import peaks
from lightfield.storage.tables import read_columns

_SECOND_RADIATION_NM_K = 1.438776877e7  # h c / k, CODATA 2018 (exact in the SI)
_ILLUMINANT_A_NM = 1.435e7 / 2848.0  # h c / (k T) as the CIE fixes it: 2855.5 K on today's scale


def planck_fraction_per_nm(wavelength_nm: ArrayLike, scale_nm: float) -> Array:
    """Part of a black body's radiation per nanometre (Planck's law over the Stefan-Boltzmann law).

    Parameters
    ----------
    wavelength_nm : array, nm
        In vacuum.
    scale_nm : float
        h c / (k T); with x = scale / wavelength the value is 15/pi^4 x^5 / (e^x - 1) / scale.

    Returns
    -------
    array, 1/nm
        Integrates to 1 over all wavelengths.
    """
    x = scale_nm / np.asarray(wavelength_nm, dtype=float)
    return np.asarray(15.0 / np.pi**4 * x**5 * np.exp(-x) / -np.expm1(-x) / scale_nm)


def spectral_power(lamp: Lamp, wavelength_nm: ArrayLike) -> Array:
    """Radiant power of the beam per nanometre.

    Parameters
    ----------
    lamp : Lamp
        Spectrum, temperature, power, spectrum_departure.
    wavelength_nm : array, nm
        Where.

    Returns
    -------
    array, W/nm
        Integrates to `power_w`, but for a departure; a table is zero outside its range.
    """
    at = np.asarray(wavelength_nm, dtype=float)
    factor = np.exp(value_at(lamp.spectrum_departure, at)) if lamp.spectrum_departure else 1.0
    return np.asarray(_stated_power(lamp, at) * factor)


def _stated_power(lamp: Lamp, at: Array) -> Array:
    """Without the departure."""
    if lamp.spectrum == "table":
        known, power = read_columns(str(lamp.spectrum_table), ("wavelength_nm", "power"))
        total = float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(known)))
        return np.asarray(lamp.power_w * np.interp(at, known, power, left=0.0, right=0.0) / total)
    if found := peaks.peaks_of(lamp.spectrum):
        return lamp.power_w * peaks.density_per_nm(found, at)
    scale = _ILLUMINANT_A_NM if lamp.spectrum == "cie-a" else _SECOND_RADIATION_NM_K / lamp.temperature_k
    return lamp.power_w * planck_fraction_per_nm(at, scale)


def knots_nm(lamp: Lamp) -> Array:
    """Wavelengths between which the spectrum is smooth, nm: of a table, of peaks, none of a black body."""
    bends = np.array([at for at, _ in lamp.spectrum_departure])
    if found := peaks.peaks_of(lamp.spectrum):
        return np.concatenate([peaks.peak_knots_nm(found), bends])
    if lamp.spectrum != "table":
        return bends
    return np.concatenate([read_columns(str(lamp.spectrum_table), ("wavelength_nm", "power"))[0], bends])


def axial_intensity(lamp: Lamp, wavelength_nm: ArrayLike) -> Array:
    """Radiant intensity on the beam's axis per nanometre, for which fields of unit intensity stand.

    Parameters
    ----------
    lamp : Lamp
        Spectrum and beam.
    wavelength_nm : array, nm

    Returns
    -------
    array, W/(sr nm)
        Of a pencil beam, which has no solid angle, the power, W/nm.
    """
    beam_sr = 1.0 if lamp.profile == "pencil" else solid_angle_sr(lamp)
    return np.asarray(spectral_power(lamp, wavelength_nm) / beam_sr)
