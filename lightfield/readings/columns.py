"""What a reading table may hold: its columns, the entries of its head, the error budget."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

QUANTITIES = ("irradiance", "scalar_irradiance", "radiance")
SCALES = ("relative", "absolute")
MEDIA = ("water", "air")
ROLES = ("signal", "reference")

REQUIRED = ("z_m", "value")
#: Required of a layout: a reading table whose values do not exist yet.
LAYOUT = ("z_m",)
TEXT_COLUMNS = ("medium", "role")
# Order in which a table is written.
COLUMNS = (
    "medium",
    "x_m",
    "y_m",
    "z_m",
    "wavelength_nm",
    "value",
    "stderr",
    "common_percent",
    "time_s",
    "integration_time_s",
    "role",
    "repeat",
    "visit",
    "saturated",
)
#: Decimals in metres to which places are one place, and to which distances or lines are one; of wavelengths
#: in nm: finer than a stage or a spectrometer is set, coarser than the rounding of a table.
PLACE_DECIMALS, LINE_DECIMALS, WAVELENGTH_DECIMALS = 4, 3, 3
#: Places across the beam; a table without them is of the axis.
ACROSS = ("x_m", "y_m")
NUMBER_COLUMNS = tuple(name for name in COLUMNS if name not in TEXT_COLUMNS)
# Entries of the head that lightfield uses: text, and the terms of the error budget.
WORDS = ("quantity", "scale", "units")
TERMS = (
    "plane_gain_percent",
    "position_mm",
    "tolerance_percent",
    "outlier_percent",
    "saturation_level",
    "calibration_percent",
)
DEFAULTS: dict[str, Any] = {"medium": "water", "x_m": 0.0, "y_m": 0.0, "role": "signal", "saturated": False}


@dataclass(frozen=True)
class ErrorBudget:
    """What the standard errors do not contain; None is "not stated".

    Parameters
    ----------
    plane_gain_percent : float, %
        Repeatability of a whole plane: repositioning, window, lamp, per visit.
    position_mm : float, mm
        Error of a detector position.
    tolerance_percent : float, %
        Smooth misfit that is of no interest.
    outlier_percent : float, %
        Part of the readings that slips may spoil; more of them are a finding.
    saturation_level : float, unit of the values
        Readings at or above it are saturated.
    calibration_percent : float, %
        On an absolute scale: standard error of the factor from the readings to their unit.
    """

    plane_gain_percent: float | None = None
    position_mm: float | None = None
    tolerance_percent: float | None = None
    outlier_percent: float | None = None
    saturation_level: float | None = None
    calibration_percent: float | None = None
