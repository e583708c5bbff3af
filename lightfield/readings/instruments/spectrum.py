"""One spectrum as an instrument's program wrote it, with everything its file says about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from lightfield.arrays import Array
from lightfield.readings.instruments.oddity import Oddity


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A spectrum and its header.

    Parameters
    ----------
    source, format : str
        File; name of the format.
    wavelength_nm : array, shape (n_pixels,), nm
        Increasing.
    columns : dict of str to array, shape (n_pixels,)
        "value" where a file holds one column (in what unit only the user knows); else of "dark", "reference",
        "signal" (counts) and "processed". nan where the file has no number.
    header : dict of str to str
        The whole header, label to text; lines without a label under "line N".
    integration_time_s : float, s
        nan when the header does not say.
    spectra_averaged, boxcar : int, optional
        Number of spectra in the average; half-width of the smoothing in pixels.
    electric_dark_corrected, nonlinearity_corrected : bool, optional
        None when the header does not say.
    calibration : array, shape (n_pixels,), optional
        Energy per count, in the unit of the file.
    processed_unit : str
        Unit of "processed", or of "value", where the format fixes it, else "".
    label : str
        What tells it from the others of its file: a column or an instrument; "" where it is alone.
        Spectra of one label were taken one after the other.
    immersion : array, shape (n_pixels,), optional
        By how much the numbers grow where the head is in water.
    band_nm : (float, float), nm, optional
        The instrument has no spectrum but one number for this band; the two pixels are its edges.
    photons : bool
        The number counts photons, not power.
    notes : tuple of Oddity
        What is odd about the file but does not prevent its use.
    ignored : tuple of str
        Columns of the file that are not used.
    """

    source: str
    format: str
    wavelength_nm: Array
    columns: Mapping[str, Array]
    header: Mapping[str, str]
    integration_time_s: float = float("nan")
    spectra_averaged: int | None = None
    boxcar: int | None = None
    spectrometer: str = ""
    date: str = ""
    electric_dark_corrected: bool | None = None
    nonlinearity_corrected: bool | None = None
    calibration: Array | None = None
    processed_unit: str = ""
    label: str = ""
    immersion: Array | None = None
    band_nm: tuple[float, float] | None = None
    photons: bool = False
    notes: tuple[Oddity, ...] = ()
    ignored: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.wavelength_nm)

    @property
    def raw(self) -> Array:
        """The numbers closest to the detector: "signal", or the only column."""
        return self.columns["signal"] if "signal" in self.columns else self.columns["value"]
