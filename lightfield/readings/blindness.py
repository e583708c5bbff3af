"""What in a measurement's layout will make a diagnosis blind, said when the readings are loaded."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.readings.load_warning import LoadWarning, Remarks
from lightfield.readings.other_units import unit_warnings
from lightfield.readings.unchecked import Unchecked

#: One of so many readings is among the brightest.
_BRIGHTEST = 10
#: Amplitude and attenuation take two of them, a third effect of distance leaves nothing to check.
_FEWEST_PLANES = 4
#: Standard errors of bright readings below this part of them are no instrument's. Chosen: a hundredth of what
#: the steadiest lamps and the best of radiometers repeat.
LEAST_ERROR = 1e-5
#: So many readings that are exactly 0 are no chance. Chosen: one may be a place in the dark, or a slip.
_ZEROS = 3


def load_warnings(readings: Unchecked) -> tuple[LoadWarning, ...]:
    """What in this layout will hide effects or let them be mistaken for each other."""
    if not len(readings):
        return ()
    water = readings.medium == "water"
    if not water.any():
        water = np.ones(len(readings), dtype=bool)
    x, y, z = readings.x_m[water], readings.y_m[water], readings.z_m[water]
    found = [*unit_warnings(readings), *_of_errors(readings), *_of_zeros(readings)]
    if readings.saturated.any():
        counts = {"saturated": int(readings.saturated.sum()), "readings": len(readings)}
        found.append(LoadWarning(Remarks.SATURATED, counts))
    planes = np.unique(_place(z)).size
    if planes < _FEWEST_PLANES:
        found.append(LoadWarning(Remarks.FEW_PLANES, {"planes": planes}))
    if not x.any() and not y.any():
        found.append(LoadWarning(Remarks.ON_AXIS_ONLY))
    elif x.any() and (np.all(x >= 0) or np.all(x <= 0)):
        found.append(LoadWarning(Remarks.X_ONE_SIDE))
    found += _of_time(readings, water)
    exposure = readings.integration_time_s[np.isfinite(readings.integration_time_s)]
    # A dark signal that was subtracted is told from ambient light already.
    dark_known = all(str(name).strip() for name in readings.extra.get("dark", [""]))
    if not dark_known and (exposure.size == 0 or np.ptp(exposure) <= 1e-6 * exposure.max()):
        one = float(exposure[0]) if exposure.size else None
        found.append(LoadWarning(Remarks.CONSTANT_INTEGRATION_TIME, {"exposure_s": one}))
    places = [_place(getattr(readings, name)).tolist() for name in ("x_m", "y_m", "z_m")]
    channel = np.nan_to_num(readings.wavelength_nm, nan=-1.0).tolist()
    keys = set(zip(readings.medium.tolist(), *places, channel, strict=True))
    if len(keys) == len(readings):
        found.append(LoadWarning(Remarks.NO_REPEATS))
    unknown = int(np.isnan(readings.stderr).sum())
    if unknown:
        found.append(LoadWarning(Remarks.NO_STDERR, {"unknown": unknown, "readings": len(readings)}))
    terms = ["plane_gain_percent", "position_mm"]
    terms += ["calibration_percent"] if readings.scale == "absolute" else []
    missing = tuple(name for name in terms if getattr(readings.budget, name) is None)
    if missing:
        found.append(LoadWarning(Remarks.NO_ERROR_BUDGET, {"terms": missing}))
    return tuple(found)


def _of_errors(readings: Unchecked) -> list[LoadWarning]:
    known = np.flatnonzero(np.isfinite(readings.stderr) & np.isfinite(readings.value))
    size = np.abs(readings.value[known])
    brightest = known[np.argsort(size)[-max(1, len(known) // _BRIGHTEST) :]]
    stderr, value = readings.stderr[brightest], np.abs(readings.value[brightest])
    if len(known) and (stderr > value).all():
        return [LoadWarning(Remarks.LARGE_ERRORS)]
    if len(known) and (stderr < LEAST_ERROR * value).all():
        return [LoadWarning(Remarks.TINY_ERRORS, {"part": float((stderr / value).max())})]
    return []


def _of_zeros(readings: Unchecked) -> list[LoadWarning]:
    zeros, counted = int(np.sum(readings.value == 0)), int(np.isfinite(readings.value).sum())
    if not _ZEROS <= zeros < counted:
        return []
    return [LoadWarning(Remarks.EXACT_ZEROS, {"zeros": zeros, "readings": counted})]


def _of_time(readings: Unchecked, water: Mask) -> list[LoadWarning]:
    time, z = readings.time_s[water], _place(readings.z_m[water])
    if np.isnan(time).any():
        return [LoadWarning(Remarks.NO_TIME)]
    order = np.argsort(time, kind="stable")
    scan = z[order]
    steps = np.diff(scan)
    in_order = np.all(steps >= 0) or np.all(steps <= 0)
    return [LoadWarning(Remarks.SCAN_ORDER)] if scan.min() < scan.max() and in_order else []


def _place(values: Array) -> Array:
    """Positions to a tenth of a millimetre: closer ones are the same place."""
    return np.where(np.abs(values) < 1e9, np.round(np.clip(values, -1e9, 1e9), 4), values)
