"""What in a measurement's layout will make a diagnosis blind, said when the readings are loaded."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.readings.columns import LoadWarning

if TYPE_CHECKING:
    from lightfield.readings.readings import Readings

FEWEST_PLANES = (
    4  # amplitude and attenuation take two of them, a third effect of distance leaves nothing to check
)


def load_warnings(readings: Readings) -> tuple[LoadWarning, ...]:
    """What in this layout will hide effects or let them be mistaken for each other."""
    water = readings.medium == "water"
    if not water.any():
        water = np.ones(len(readings), dtype=bool)
    x, y, z = readings.x_m[water], readings.y_m[water], readings.z_m[water]
    found: list[LoadWarning] = []

    def warn(code: str, sentence: str, remedy: str) -> None:
        found.append(LoadWarning(code, sentence, remedy))

    if readings.saturated.any():
        warn(
            "saturated",
            f"{int(readings.saturated.sum())} of {len(readings)} readings are saturated and left out",
            "shorten the exposure there",
        )
    planes = np.unique(_place(z)).size
    if planes < FEWEST_PLANES:
        warn(
            "few_planes",
            f"only {planes} distance{'s' if planes > 1 else ''} along the tank: the fall with distance "
            "can be explained in many ways",
            "measure at five distances or more",
        )
    if not x.any() and not y.any():
        warn(
            "on_axis_only",
            "all readings are on the axis: the beam's shape and direction cannot be told",
            "scan across the beam",
        )
    elif x.any() and (np.all(x >= 0) or np.all(x <= 0)):
        warn(
            "x_one_side",
            "x is on one side of the axis only: offset, tilt, width and asymmetry look alike",
            "add readings on the other side",
        )
    _warn_time(readings, water, warn)
    exposure = readings.integration_time_s[np.isfinite(readings.integration_time_s)]
    if exposure.size == 0:
        warn(
            "constant_integration_time",
            "no integration times are given: dark signal and ambient light look alike",
            "give integration_time_s, and vary it",
        )
    elif np.ptp(exposure) <= 1e-6 * exposure.max():
        warn(
            "constant_integration_time",
            f"the integration time is {exposure[0]:g} s throughout: dark signal and ambient light look alike",
            "vary it, or read with the detector capped",
        )
    places = [_place(getattr(readings, name)).tolist() for name in ("x_m", "y_m", "z_m")]
    channel = np.nan_to_num(readings.wavelength_nm, nan=-1.0).tolist()
    keys = set(zip(readings.medium.tolist(), *places, channel, strict=True))
    if len(keys) == len(readings):
        warn(
            "no_repeats",
            "no position is read twice: drift shows only through the model, repositioning errors do not show",
            "repeat a reference position three times or more",
        )
    unknown = int(np.isnan(readings.stderr).sum())
    if unknown:
        warn(
            "no_stderr",
            f"{unknown} of {len(readings)} readings have no standard error: the noise has to be "
            "estimated from the misfit",
            "give stderr from repeated spectra",
        )
    terms = ["plane_gain_percent", "position_mm"]
    terms += ["calibration_percent"] if readings.scale == "absolute" else []
    missing = [name for name in terms if getattr(readings.budget, name) is None]
    if missing:
        warn(
            "no_error_budget",
            f"the error budget does not say {' and '.join(missing)}: values will be assumed, "
            "the gain estimated where a position is read in three visits",
            "state them in the head of the file",
        )
    return tuple(found)


def _warn_time(readings: Readings, water: NDArray[np.bool_], warn: Callable[[str, str, str], None]) -> None:
    time, z = readings.time_s[water], _place(readings.z_m[water])
    if np.isnan(time).any():
        warn(
            "no_time",
            "not all readings have a time: lamp drift cannot be tested",
            "give time_s, seconds since the first reading",
        )
        return
    order = np.argsort(time, kind="stable")
    scan = z[order]
    steps = np.diff(scan)
    if scan.min() < scan.max() and (np.all(steps >= 0) or np.all(steps <= 0)):
        warn(
            "scan_order",
            "the scan order is the plane order: every drift in time looks like a change with distance",
            "go back to the first plane at the end, or measure in random order",
        )


def _place(values: Array) -> Array:
    """Positions to a tenth of a millimetre: closer ones are the same place."""
    return np.where(np.abs(values) < 1e9, np.round(np.clip(values, -1e9, 1e9), 4), values)
