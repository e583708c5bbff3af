"""Response of a detector, with the filter before it, over wavelength."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.spectral.peaks import Peak, heights, peak_knots_nm, peaks_of
from lightfield.storage.tables import read_columns

#: A silicon photodiode: wavelengths, nm, and responsivity, A/W; a typical one, of no particular maker.
SILICON = (
    (400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0),
    (0.12, 0.20, 0.26, 0.31, 0.35, 0.39, 0.43, 0.46),
)
COLUMNS = ("wavelength_nm", "response")


@dataclass(frozen=True)
class DetectorResponse:
    """Reading per light over wavelength, in any unit.

    Parameters
    ----------
    kind : "silicon", "table", Peak or tuple of Peak, optional
        As the scene says it; None: 1 everywhere.
    table : str, optional
        File of the table.
    """

    kind: str | Peak | tuple[Peak, ...] | None
    table: str | None

    def at(self, wavelength_nm: ArrayLike) -> Array:
        """At wavelengths in nm; 0 beyond a table."""
        at = np.asarray(wavelength_nm, float)
        if self.kind is None:
            return np.ones_like(at)
        if peaks := peaks_of(self.kind):
            return heights(peaks, at)
        if self.kind == "silicon":
            return np.asarray(np.interp(at, *SILICON))
        known, table = read_columns(str(self.table), COLUMNS)
        return np.asarray(np.interp(at, known, table, left=0.0, right=0.0))

    @property
    def knots_nm(self) -> Array:
        """Wavelengths between which it is smooth, nm."""
        if self.kind is None:
            return np.zeros(0)
        if peaks := peaks_of(self.kind):
            return peak_knots_nm(peaks)
        if self.kind == "silicon":
            return np.array(SILICON[0])
        return read_columns(str(self.table), COLUMNS)[0]
