"""Response of a detector, with the filter before it, over wavelength."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.spectral.peaks import heights, peak_knots_nm, peaks_of
from lightfield.storage.tables import read_columns

if TYPE_CHECKING:
    from lightfield.scene.detector import Detector

#: A silicon photodiode: wavelengths, nm, and responsivity, A/W; a typical one, of no particular maker.
SILICON = (
    (400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0),
    (0.12, 0.20, 0.26, 0.31, 0.35, 0.39, 0.43, 0.46),
)
COLUMNS = ("wavelength_nm", "response")


def response_at(detector: Detector, wavelength_nm: ArrayLike) -> Array:
    """Reading per light at wavelengths, in any unit.

    Parameters
    ----------
    detector : Detector
    wavelength_nm : array, nm

    Returns
    -------
    array, any unit
        1 everywhere where the scene says nothing; 0 beyond a table.
    """
    at, response = np.asarray(wavelength_nm, float), detector.response
    if response is None:
        return np.ones_like(at)
    if peaks := peaks_of(response):
        return heights(peaks, at)
    if response == "silicon":
        return np.asarray(np.interp(at, *SILICON))
    known, table = read_columns(str(detector.response_table), COLUMNS)
    return np.asarray(np.interp(at, known, table, left=0.0, right=0.0))


def response_knots_nm(detector: Detector) -> Array:
    """Wavelengths between which the response is smooth, nm."""
    response = detector.response
    if response is None:
        return np.zeros(0)
    if peaks := peaks_of(response):
        return peak_knots_nm(peaks)
    if response == "silicon":
        return np.array(SILICON[0])
    return read_columns(str(detector.response_table), COLUMNS)[0]
