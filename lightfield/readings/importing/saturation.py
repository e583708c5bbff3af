"""Saturated pixels of a spectrum: above a stated level, or on a flat top."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.readings.instruments.spectrum import Spectrum

SHORTEST_RUN = 4  # equal pixels in a row; three can be chance at the top of a peak printed to whole counts
LEAST_STEPS = (
    50  # a top of fewer digitisation steps above the median may be flat because the steps are coarse
)


def saturated_pixels(
    spectrum: Spectrum, level: float | None = None
) -> tuple[NDArray[np.bool_], float | None]:
    """Where the detector was at its end.

    Parameters
    ----------
    spectrum : Spectrum
        Its raw numbers are judged, before any subtraction.
    level : float, in the file's own unit
        Full scale, when the user states it.

    Returns
    -------
    mask : array of bool, shape (n_pixels,)
        Saturated pixels, and those into which the smoothing of the file has spread them.
    flat_top : float or None
        Level of a flat top that nobody stated.
    """
    raw = spectrum.raw
    with np.errstate(invalid="ignore"):
        mask = raw >= level if level is not None else np.zeros(len(raw), dtype=bool)
    run = flat_top(raw)
    found = None
    if run is not None and not mask[run].any():
        mask = mask.copy()
        mask[run] = True
        found = float(raw[run.start])
    if spectrum.boxcar and mask.any():
        width = 2 * min(spectrum.boxcar, len(mask)) + 1
        mask = np.convolve(mask, np.ones(width), mode="full")[width // 2 :][: len(mask)] > 0.5
    return np.asarray(mask, dtype=bool), found


def flat_top(values: Array) -> slice | None:
    """The longest run of pixels that all have the spectrum's largest value, when it cannot be chance.

    Runs at the ends do not count: some programs fill their smoothing's margin with one value.
    """
    finite = values[np.isfinite(values)]
    if finite.size <= SHORTEST_RUN:
        return None
    top = finite.max()
    levels = np.unique(finite)
    if levels.size < 2 or (top - np.median(finite)) < LEAST_STEPS * np.diff(levels).min():
        return None
    edges = np.diff(np.r_[False, values == top, False].astype(int))
    runs = [
        slice(int(a), int(b))
        for a, b in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True)
    ]
    inner = [run for run in runs if run.start > 0 and run.stop < len(values)]
    longest = max(inner, key=lambda run: run.stop - run.start, default=None)
    return longest if longest is not None and longest.stop - longest.start >= SHORTEST_RUN else None
