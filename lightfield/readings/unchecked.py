"""What stands in a reading table, before anything of it is checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array, Mask
from lightfield.errors import MeasurementError
from lightfield.readings.columns import COLUMNS, ErrorBudget
from lightfield.readings.load_warning import LoadWarning

#: Entry of a table's head: `lightfield import` writes it.
_BANDS = "bands_nm"
#: A reading is that of a band whose middle its wavelength is, to so many nm.
_SAME_NM = 0.011


@dataclass(frozen=True, eq=False)
class Unchecked:
    """Detector readings; nan where a number is not known.

    Parameters
    ----------
    x_m, y_m, z_m : array, shape (n,), m
        Positions; z along the tank from the lamp's window.
    medium : array of str, shape (n,)
        "water" or "air".
    wavelength_nm : array, shape (n,), nm
        Band centre; nan is the scene's band.
    value, stderr : array, shape (n,), `units`
        Reading and its standard error.
    common_percent : array, shape (n,), %
        The part of `stderr`, in per cent of the reading, by which all bands of one spectrum are off together
        (a lamp that flickers): readings of one place, time and repeat. Unknown is none.
    time_s, integration_time_s : array, shape (n,), s
        When it was taken, and the exposure.
    role : array of str, shape (n,)
        "signal", or "reference" for repeats at a reference position.
    repeat, visit : array, shape (n,)
        Number of the repeat at this position; of the stay at this plane.
    saturated : array of bool, shape (n,)
        Saturated in the file or at least `budget.saturation_level`: a lower bound, not a value.
    budget : ErrorBudget
    quantity : str
        One of QUANTITIES, or "" when the table does not say.
    scale : str
        "relative" (one free gain) or "absolute" (a gain that is 1 but for the error of the calibration).
    units : str
        Unit of `value`, as the user gave it.
    source : str
        File it came from.
    metadata : dict
        Head entries that lightfield does not use.
    extra : dict of str to array of str, shape (n,)
        Columns that lightfield does not use, as text.
    warnings : tuple of LoadWarning
    line : array of int, shape (n,), optional
        Line of `source` that each reading stands in.
    of_band : bool
        The table states no wavelength: readings are means over the scene's only band, in whose middle
        `check_against` has put them.
    """

    x_m: Array
    y_m: Array
    z_m: Array
    medium: NDArray[np.str_]
    wavelength_nm: Array
    value: Array
    stderr: Array
    common_percent: Array
    time_s: Array
    integration_time_s: Array
    role: NDArray[np.str_]
    repeat: Array
    visit: Array
    saturated: Mask
    budget: ErrorBudget = field(default_factory=ErrorBudget)
    quantity: str = ""
    scale: str = "relative"
    units: str = ""
    source: str = ""
    metadata: Mapping[str, Any] = field(default_factory=dict)
    extra: Mapping[str, NDArray[np.str_]] = field(default_factory=dict)
    warnings: tuple[LoadWarning, ...] = ()
    line: NDArray[np.int_] | None = None
    of_band: bool = False

    def __post_init__(self) -> None:
        for array in [*(getattr(self, name) for name in COLUMNS), *self.extra.values()]:
            if array.shape != self.value.shape or array.ndim != 1:
                raise ValueError(f"columns of different length: {array.shape} and {self.value.shape}")
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.value)


def bands_of(readings: Unchecked, wavelengths_nm: Array) -> list[tuple[float, float] | None]:
    """The band in nm that readings at each wavelength are means over, as the head says; None: light there.

    Raises
    ------
    MeasurementError
        Bands in the head that are none.
    """
    stated = readings.metadata.get(_BANDS, [])
    bands = [_band(readings, row) for row in (stated if isinstance(stated, list) else [stated])]
    return [next((b for b in bands if abs(0.5 * sum(b) - w) < _SAME_NM), None) for w in wavelengths_nm]


def _band(readings: Unchecked, row: Any) -> tuple[float, float]:
    try:
        low, high = (float(v) for v in row)
    except (TypeError, ValueError):
        low = high = np.nan
    if not 0 < low < high < np.inf:
        raise MeasurementError(
            "a band that was read makes no sense", where=readings.source or None,
            found=f"{_BANDS}: {row}", rule="[from nm, to nm]", remedy="correct the head",
        )  # fmt: skip
    return low, high
