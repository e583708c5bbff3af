"""Saturated pixels of a spectrum: above a stated level, or on a flat top."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.readings.instruments.spectrum import Spectrum

_SHORTEST_RUN = 4  # equal pixels in a row; three can be chance at the top of a peak printed to whole counts
#: A top that noise or a dark spectrum has left nearly flat: so many pixels within this part of the largest
#: number, and less than so many times as many within ten times that, where a round top has 3.2 times as many.
#: The darkest pixel lies below half. Chosen: a detector's noise at its end, and what smoothing rounds off.
_NEARLY_RUN, _NEARLY, _ROUNDER, _DARK = 8, 2e-3, 1.5, 0.5
_LEAST_STEPS = (
    50  # a top of fewer digitisation steps above the median may be flat because the steps are coarse
)


def saturated_pixels(spectrum: Spectrum, level: float | None = None) -> tuple[Mask, float | None]:
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
    run = flat_top(raw) or nearly_flat_top(raw)
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
    if finite.size <= _SHORTEST_RUN:
        return None
    top = finite.max()
    levels = np.unique(finite)
    if levels.size < 2 or (top - np.median(finite)) < _LEAST_STEPS * np.diff(levels).min():
        return None
    edges = np.diff(np.r_[False, values == top, False].astype(int))
    runs = [
        slice(int(a), int(b))
        for a, b in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True)
    ]
    inner = [run for run in runs if run.start > 0 and run.stop < len(values)]
    longest = max(inner, key=lambda run: run.stop - run.start, default=None)
    return longest if longest is not None and longest.stop - longest.start >= _SHORTEST_RUN else None


def nearly_flat_top(values: Array) -> slice | None:
    """The pixels of a top that ends in edges, where the dark or noise keeps them from being equal."""
    finite = values[np.isfinite(values)]
    if finite.size <= _SHORTEST_RUN or finite.min() > _DARK * finite.max() or finite.max() <= 0:
        return None
    peak = int(np.nanargmax(values))
    near, wide = (_run_about(values, peak, part) for part in (_NEARLY, 10 * _NEARLY))
    length = near.stop - near.start
    inner = wide.start > 0 and wide.stop < len(values)
    edged = wide.stop - wide.start < _ROUNDER * length
    return near if inner and edged and length >= _NEARLY_RUN else None


def _run_about(values: Array, peak: int, part: float) -> slice:
    """The pixels about the largest that are as large but for this part of it."""
    with np.errstate(invalid="ignore"):
        lower = np.flatnonzero(~(values >= (1 - part) * values[peak]))
    after = int(np.searchsorted(lower, peak))
    first = int(lower[after - 1]) + 1 if after else 0
    return slice(first, int(lower[after]) if after < len(lower) else len(values))
