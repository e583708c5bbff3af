"""From one spectrum to one number per band: dark subtraction, exposure normalisation, band average."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import RuleError
from lightfield.readings import units
from lightfield.readings.importing.index import IndexLine
from lightfield.readings.instruments.spectrum import Spectrum

#: Of so many pixels or more, a step of so many usual ones is a gap, and matters where it is this part of a
#: band. Chosen: pixels of one spectrometer are alike apart to a factor of two.
_A_SPECTRUM, _GAP, _OF_BAND = 20, 3.5, 0.1
SAME_EXPOSURE = 1e-3  # relative; headers print three to seven digits


@dataclass(frozen=True)
class Shot:
    """A spectrum with its line of the index, exposure and time settled.

    Parameters
    ----------
    stated : float
        Standard error of its one number, in the same unit; NaN where none is stated.
    """

    entry: IndexLine
    spectrum: Spectrum
    exposure_s: float
    time_s: float
    stated: float = float("nan")


def band_mean(wavelength_nm: Array, values: Array, low_nm: float, high_nm: float) -> float:
    """Mean over a band: trapezoidal integral between its edges, divided by its width.

    Parameters
    ----------
    wavelength_nm, values : array, shape (n_pixels,)
        Increasing wavelengths.
    low_nm, high_nm : float, nm
        Edges; values there are interpolated.

    Raises
    ------
    ValueError
        The spectrum does not reach over the band, or has no number within it.
    """
    if not (wavelength_nm[0] <= low_nm < high_nm <= wavelength_nm[-1]):
        raise RuleError(
            f"the band {low_nm:g}-{high_nm:g} nm is not within {wavelength_nm[0]:g}-{wavelength_nm[-1]:g} nm",
            "choose a band within",
        )
    within = (wavelength_nm > low_nm) & (wavelength_nm < high_nm)
    # The neighbours of the edges count too: they are interpolated.
    first = max(int(np.searchsorted(wavelength_nm, low_nm, side="right")) - 1, 0)
    last = min(int(np.searchsorted(wavelength_nm, high_nm, side="left")), len(wavelength_nm) - 1)
    part = slice(first, last + 1)
    if not np.isfinite(values[part]).all():
        raise ValueError(f"pixels without a number in the band {low_nm:g}-{high_nm:g} nm")
    if not within.any():
        raise ValueError(f"no pixel in the band {low_nm:g}-{high_nm:g} nm")
    _refuse_gap(wavelength_nm, wavelength_nm[part], low_nm, high_nm)
    grid = np.r_[low_nm, wavelength_nm[within], high_nm]
    heights = np.asarray(np.interp(grid, wavelength_nm[part], values[part]))
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sum(np.diff(grid) * (heights[1:] / 2 + heights[:-1] / 2)) / (high_nm - low_nm))


def _refuse_gap(every_nm: Array, in_band_nm: Array, low_nm: float, high_nm: float) -> None:
    """Lines that are lost between others are no straight line."""
    steps = np.diff(in_band_nm)
    widest = int(np.argmax(steps))
    usual = float(np.median(np.diff(every_nm)))
    if len(every_nm) < _A_SPECTRUM or steps[widest] < _GAP * usual:
        return
    lost = min(in_band_nm[widest + 1], high_nm) - max(in_band_nm[widest], low_nm)
    if lost > _OF_BAND * (high_nm - low_nm):
        raise RuleError(
            f"no pixels from {in_band_nm[widest]:g} to {in_band_nm[widest + 1]:g} nm in the band "
            f"{low_nm:g}-{high_nm:g} nm, where they are {usual:.3g} nm apart",
            "export the file again, or choose a band beside it",
        )


def signal(shot: Shot, unit: str) -> Array:
    """The column of a file that holds numbers in this unit, its own dark column subtracted.

    Parameters
    ----------
    unit : str
        Canonical unit of the numbers in the file, from the user.

    Raises
    ------
    ValueError
        The file has no such column; the message says what it has.
    """
    spectrum = shot.spectrum
    if "value" in spectrum.columns:
        said = spectrum.processed_unit
        if units.is_logarithmic(said):
            raise RuleError(
                f"the file says that its numbers are logarithms ({said}), of which no mean is light",
                "export them on a linear scale",
            )
        if said and unit != units.RELATIVE and not _same_unit(unit, said):
            taken = said if units.stated(said) else units.RELATIVE
            raise ValueError(
                f"the file says that its numbers are in {said}, not {unit}: take the unit {taken}"
            )
        if spectrum.photons and unit != units.RELATIVE:
            raise ValueError(f"a {spectrum.format} counts photons: take the unit relative")
        return spectrum.columns["value"]
    if unit == "counts":
        with np.errstate(over="ignore", invalid="ignore"):
            return (
                spectrum.columns["signal"] - spectrum.columns["dark"] if has_dark(spectrum) else spectrum.raw
            )
    if not units.is_absolute(unit):
        raise ValueError(f"a {spectrum.format} file holds counts, not {unit}: take the unit counts")
    if not spectrum.processed_unit or "processed" not in spectrum.columns:
        raise ValueError(f"this {spectrum.format} file holds no calibrated irradiance: take the unit counts")
    if not _same_unit(unit, spectrum.processed_unit):
        raise ValueError(f"a {spectrum.format} file is in {spectrum.processed_unit}, not {unit}")
    return spectrum.columns["processed"]


def _same_unit(one: str, other: str) -> bool:
    """Are both the same, or do they mean the same of one quantity?"""
    if one == other:
        return True
    for quantity in units.SI:
        try:
            first, second = units.to_si(one, quantity), units.to_si(other, quantity)
        except ValueError:
            continue
        return abs(first - second) <= 1e-9 * second
    return False


def band_of(spectrum: Spectrum, values: Array, low_nm: float, high_nm: float) -> float:
    """Mean of a spectrum over a band, or the one number of an instrument that has this band.

    Raises
    ------
    ValueError
        The spectrum does not reach over the band; the instrument has another.
    """
    if spectrum.band_nm is None:
        return band_mean(spectrum.wavelength_nm, values, low_nm, high_nm)
    low, high = spectrum.band_nm
    if (low_nm, high_nm) != (low, high):
        raise ValueError(f"it has one number for {low:g}-{high:g} nm, and none for {low_nm:g}-{high_nm:g} nm")
    return float(values[0])


def has_dark(spectrum: Spectrum) -> bool:
    """Does the file bring its own dark spectrum?"""
    dark = spectrum.columns.get("dark")
    return dark is not None and bool(np.nan_to_num(dark).any())


def choose_darks(shot: Shot, darks: Sequence[Shot], need_exposure: bool, lit_s: Array) -> list[Shot]:
    """The dark spectra that belong to a shot: same spectrometer pixels and exposure, nearest in time.

    With the nearest go all that were taken with it, no spectrum of light between them, and those that are
    equally near (or all, when a time is missing).

    Parameters
    ----------
    darks : sequence of Shot
    lit_s : array, shape (n,), s
        Times of all spectra of light, in order.
    need_exposure : bool
        Must the exposures be known? Where not, unknown ones match.

    Raises
    ------
    ValueError
        None belongs to it.
    """
    grid = shot.spectrum.wavelength_nm
    pixels = [
        d
        for d in darks
        if len(d.spectrum) == len(grid) and np.abs(d.spectrum.wavelength_nm - grid).max() <= 0.02
    ]
    if not pixels:
        raise RuleError(
            f"no dark spectrum has its wavelengths, {len(grid)} from {grid[0]:g} to {grid[-1]:g} nm",
            "add a dark of the same pixels; where lines of the file are lost, export it again",
        )
    matching = [d for d in pixels if _same_exposure(d.exposure_s, shot.exposure_s, need_exposure)]
    if not matching:
        found = ", ".join(sorted({f"{d.exposure_s:g} s" for d in pixels}))
        raise RuleError(
            f"no dark spectrum has its exposure of {shot.exposure_s:g} s, only {found}",
            "add a dark of this exposure, or correct integration_time_s in the index",
        )
    away = np.array([abs(d.time_s - shot.time_s) for d in matching])
    if np.isnan(away).any():
        return matching
    series = np.searchsorted(lit_s, [d.time_s for d in matching])
    nearest = set(series[away <= away.min()])
    return [d for d, number in zip(matching, series, strict=True) if number in nearest]


def _same_exposure(one: float, other: float, needed: bool) -> bool:
    if np.isnan(one) or np.isnan(other):
        return not needed
    return abs(one - other) <= SAME_EXPOSURE * other


def mean_and_error(values: Sequence[float]) -> tuple[float, float]:
    """Mean of replicates and its standard error; nan where it cannot be told (one value, or all equal)."""
    array = np.asarray(values, dtype=float)
    with np.errstate(over="ignore", invalid="ignore"):
        if len(array) < 2 or np.ptp(array) == 0:
            return float(array.mean()), float("nan")
        return float(array.mean()), float(array.std(ddof=1) / np.sqrt(len(array)))
