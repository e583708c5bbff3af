"""Integrals over bands: of light that is known at some wavelengths, and of what a detector sees between."""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid

from lightfield.arrays import Array
from lightfield.errors import SceneError
from lightfield.scene import Detector
from lightfield.scene.spectral.detector_response import SILICON
from lightfield.storage.tables import read_columns


def shares_of(at: Array, fine: Array, seen: Array, lows: Array, highs: Array) -> Array:
    """What each wavelength stands for in every band, shape (n_bands, n_wavelengths).

    The integral over a band of what is seen, times what is one at a wavelength, none at the others and linear
    between.

    Parameters
    ----------
    at : array, shape (n_wavelengths,), nm
        Rising.
    fine, seen : array, shape (n,), nm
        Edges of bands and much between, with what is seen there.
    """
    hats = np.stack([np.interp(fine, at, each) for each in np.eye(len(at))], axis=1)
    summed = cumulative_trapezoid(seen[:, None] * hats, fine, axis=0, initial=0.0)
    low, high = (np.searchsorted(fine, edge) for edge in (lows, highs))
    return np.asarray(summed[high] - summed[low])


def responsivity(path: str | None, detector: Detector, at: Array) -> Array:
    """Response at wavelengths, in any unit: of a table, the scene's, or that of silicon."""
    if path is None:
        return np.interp(at, *SILICON) if detector.response is None else detector.spectral_response.at(at)
    try:
        known, response = read_columns(path, ("wavelength_nm", "response"))
    except OSError as error:
        raise SceneError(
            error.strerror or "cannot be read", where=path, rule="a CSV file", remedy="correct the path"
        ) from error
    return np.interp(at, known, response, left=0.0, right=0.0)
