"""What readings must fulfil to be readings at all, and to fit a scene."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.readings import units
from lightfield.readings.columns import MEDIA, NUMBER_COLUMNS, QUANTITIES, ROLES, SCALES, TERMS
from lightfield.readings.other_units import unit_of_lengths
from lightfield.readings.problems import Problems
from lightfield.readings.unchecked import Unchecked

if TYPE_CHECKING:
    from lightfield.scene import Scene, Tank

#: No lamp is read from farther away: positions beyond were not given in metres.
FARTHEST_M = 300.0
#: No unit makes light so large a number; squares of much larger ones overflow.
_LARGEST = 1e30
Given = TypeVar("Given", bound=Unchecked)
_LOGARITHMIC = re.compile(r"\bdB[A-Za-z]*\b")
#: Instruments tell apart a millionth of full scale at best; one value so far beyond all others is a slip.
_LARGEST_STEP = 1e9
#: And the least of a reading's error, of the largest reading: below it squares come to nothing.
_SMALLEST_ERROR = 1e-12
#: A part may be larger than the whole by what a table's digits leave open.
_ROUNDED = 1e-3
#: A campaign of four months, no clock's seconds since 1970: what drifts counts from zero. And a warm-up seen
#: from long before zero is beyond any number.
_EARLIEST_S, _LATEST_S = -1e5, 1e7


def check_values(readings: Unchecked, problems: Problems | None = None) -> None:
    """Refuse values that cannot be readings.

    Parameters
    ----------
    problems : Problems, optional
        Where to note what is wrong; without it, MeasurementError is raised.

    Raises
    ------
    MeasurementError
        All problems, when `problems` is not given.
    """
    noted = problems if problems is not None else _problems(readings)
    lines = _places(readings)
    if len(readings) == 0 and not noted:
        noted.add("there is no reading", remedy="add rows below the column names")
    refuse = partial(_refuse, readings, noted, lines)
    for name in ("x_m", "y_m", "z_m", "value"):
        refuse(~np.isfinite(getattr(readings, name)), name, "is not a finite number", "a finite number")
    for name in (name for name in NUMBER_COLUMNS if name not in ("x_m", "y_m", "z_m", "value", "saturated")):
        refuse(np.isinf(getattr(readings, name)), name, "is infinite", "a finite number, or nothing")
    for name in ("x_m", "y_m", "z_m"):
        far = np.isfinite(getattr(readings, name)) & (np.abs(getattr(readings, name)) > FARTHEST_M)
        refuse(
            far,
            name,
            "is farther than any lamp",
            f"at most {FARTHEST_M:g} m",
            "give positions in metres: millimetres over 1000, centimetres over 100",
        )
    for name in ("value", "stderr"):
        large = np.isfinite(getattr(readings, name)) & (np.abs(getattr(readings, name)) > _LARGEST)
        refuse(large, name, "is too large for light in any unit", f"at most {_LARGEST:g}")
    refuse(
        (readings.time_s < _EARLIEST_S) | (readings.time_s > _LATEST_S),
        "time_s",
        "is impossible",
        f"{_EARLIEST_S:g} to {_LATEST_S:g} s",
        "count seconds from when the lamp was switched on, not milliseconds, not from 1970",
    )
    refuse(
        readings.z_m <= 0, "z_m", "is an impossible position", "z_m > 0: in front of the lamp's window",
        "count distances from the window along the beam",
    )  # fmt: skip
    refuse(
        readings.stderr <= 0, "stderr", "is not positive", "stderr > 0", "leave it blank when it is not known"
    )
    refuse(readings.common_percent < 0, "common_percent", "is negative", "common_percent >= 0")
    with np.errstate(invalid="ignore", over="ignore"):
        part = readings.common_percent / 100 * np.abs(readings.value) / readings.stderr
    refuse(
        part > 1 + _ROUNDED, "common_percent", "is more than the standard error that it is a part of",
        "at most stderr, in per cent of the reading", "give both of one reading, as standard errors",
    )  # fmt: skip
    refuse(readings.wavelength_nm <= 0, "wavelength_nm", "is not positive", "wavelength_nm > 0")
    refuse(
        readings.integration_time_s <= 0, "integration_time_s", "is not positive", "integration_time_s > 0"
    )
    for name in ("repeat", "visit"):
        number = getattr(readings, name)
        refuse((number < 0) | (np.mod(number, 1) > 0), name, "is not a count", "0, 1, 2, ...")
    refuse(~np.isin(readings.medium, MEDIA), "medium", "is unknown", " or ".join(MEDIA), "write one of them")
    refuse(
        ~np.isin(readings.role, ROLES),
        "role",
        "is unknown",
        " or ".join(ROLES),
        "subtract dark readings first, as an import does",
    )
    _check_duplicates(readings, noted, lines)
    _check_head(readings, noted)
    if problems is None:
        noted.raise_any("not usable readings")


def _problems(readings: Unchecked) -> Problems:
    return Problems(readings.source or "readings", "reading" if readings.line is None else "line")


def _places(readings: Unchecked) -> list[int]:
    return list(range(1, len(readings) + 1)) if readings.line is None else [int(k) for k in readings.line]


def _refuse(
    readings: Unchecked,
    noted: Problems,
    lines: Sequence[int],
    bad: Any,
    name: str,
    what: str,
    rule: str,
    remedy: str | None = None,
) -> None:
    """Note the bad ones among the cells of a column, but for those that could not even be read."""
    unread, values = noted.unread, getattr(readings, name)
    for k in np.flatnonzero(bad).tolist():
        if not unread & {(name, None), (name, lines[k])}:
            noted.add(f"{name} {what}", place=lines[k], found=values[k].item(), rule=rule, remedy=remedy)


def _check_duplicates(readings: Unchecked, noted: Problems, lines: Sequence[int]) -> None:
    first: dict[tuple[object, ...], int] = {}
    numbers = [getattr(readings, n) for n in ("x_m", "y_m", "z_m", "wavelength_nm", "time_s", "repeat")]
    for k in range(len(readings)):
        if not np.isfinite([c[k] for c in numbers[:3]]).all():
            continue
        # nan differs from itself, an unknown time does not differ from another unknown time
        key = (str(readings.medium[k]), *(None if np.isnan(c[k]) else float(c[k]) for c in numbers))
        if key in first:
            noted.add(
                "this reading is there already",
                place=lines[k],
                found=f"{noted.noun} {lines[first[key]]}",
                rule="medium, x_m, y_m, z_m, wavelength_nm and time_s together occur once",
                remedy="give replicates their time_s, or number them in a column repeat",
            )
        else:
            first[key] = k


def _check_head(readings: Unchecked, noted: Problems) -> None:
    if readings.quantity and readings.quantity not in QUANTITIES:
        place = noted.head.get("quantity")
        noted.add("unknown quantity", place=place, found=readings.quantity, rule=", ".join(QUANTITIES))
    if readings.scale not in SCALES:
        noted.add(
            "unknown scale", place=noted.head.get("scale"), found=readings.scale, rule=" or ".join(SCALES)
        )
    elif readings.scale == "absolute":
        quantity = readings.quantity if readings.quantity in QUANTITIES else "irradiance"
        remedy = f'write units = "{units.SI[quantity]}" (or in uW/cm^2/nm ...), or scale = "relative"'
        if not readings.units:
            noted.add("absolute readings without units", rule="units are never guessed", remedy=remedy)
        else:
            try:
                units.to_si(readings.units, quantity)
            except ValueError as error:
                noted.add(f"unusable units: {error}", found=readings.units, remedy=remedy)
    for name in TERMS:
        value = getattr(readings.budget, name)
        low_open = name == "saturation_level"
        if value is not None and not (np.isfinite(value) and (value > 0 if low_open else value >= 0)):
            rule = f"{name} {'>' if low_open else '>='} 0"
            noted.add(f"{name} is impossible", place=noted.head.get(name), found=value, rule=rule)
    slips = readings.budget.outlier_percent
    if slips is not None and slips > 100:
        rule = "outlier_percent is a part of all readings, 0 to 100"
        noted.add(
            "outlier_percent is impossible", place=noted.head.get("outlier_percent"), found=slips, rule=rule
        )


def against_scene(readings: Given, scene: Scene, problems: Problems | None = None) -> Given:
    """The readings with the scene's band filled in; see `Readings.check_against`."""
    bands = [(float(low), float(high)) for low, high in scene.detector.bands_nm]
    wavelength = readings.wavelength_nm
    noted = problems if problems is not None else _problems(readings)
    lines = _places(readings)
    of_band = len(bands) == 1 and (readings.of_band or bool(np.isnan(wavelength).all()))
    if len(bands) == 1:
        wavelength = np.where(np.isnan(wavelength), sum(bands[0]) / 2, wavelength)
    filled = replace(readings, wavelength_nm=wavelength, of_band=of_band)
    refuse = partial(_refuse, filled, noted, lines)
    shown = ", ".join(f"{low:g}-{high:g} nm" for low, high in bands)
    unknown = np.isnan(wavelength)
    for k in np.flatnonzero(unknown).tolist():
        rule, remedy = f"one of the scene's bands: {shown}", "add a column wavelength_nm"
        noted.add("no wavelength", place=lines[k], rule=rule, remedy=remedy)
    inside = np.any([(low <= wavelength) & (wavelength <= high) for low, high in bands], axis=0)
    refuse(
        ~inside & ~unknown, "wavelength_nm", "is outside the scene's bands", f"detector.bands_nm: {shown}",
        "add its band to the scene",
    )  # fmt: skip
    quantity = str(scene.detector.quantity)
    if readings.quantity and readings.quantity != quantity:
        noted.add(
            "the readings are of another quantity than the scene's detector",
            found=readings.quantity,
            rule=f"detector.quantity = {quantity!r}",
            remedy="change it in the scene",
        )
    _check_linear(readings, noted)
    _check_slips(readings, refuse)
    if scene.tank is not None:
        _check_tank(readings, scene.tank, refuse)
    least = scene.lamp.least_distance_m
    near = (readings.z_m < least) & (readings.z_m > 0)  # what lies behind the window is refused already
    refuse(
        near, "z_m", "is too near to where the light comes from",
        f"at least {least:g}, twice -lamp.apparent_distance_m", "write an apparent_distance_m nearer to 0",
    )  # fmt: skip
    drift = scene.lamp.drift_per_hour
    for k in np.flatnonzero(1.0 + drift * readings.time_s / 3600.0 <= 0.0).tolist():
        noted.add(
            "the lamp has no light left",
            place=lines[k],
            found=f"time_s = {readings.time_s[k]:g}",
            rule=f"power is that of time 0 times 1 + t x lamp.drift_per_hour, here {drift:g}",
            remedy="correct lamp.drift_per_hour, or the times",
        )
    if problems is None:
        noted.raise_any("does not fit the scene")
    return replace(filled, quantity=readings.quantity or quantity)


def _check_linear(readings: Unchecked, noted: Problems) -> None:
    """Refuse decibels: by their unit, or because light is not negative, but for noise."""
    if _LOGARITHMIC.search(readings.units):
        noted.add(
            "readings in decibels", place=noted.head.get("units"), found=readings.units,
            rule="light in linear units", remedy="turn them into linear values first: 10^(value / 10)",
        )  # fmt: skip
    value = readings.value[np.isfinite(readings.value) & (np.abs(readings.value) <= _LARGEST)]
    negative = value < 0
    if -value[negative].sum() > value[~negative].sum():
        noted.add(
            "the values are more negative than positive",
            found=f"{int(negative.sum())} of {len(value)} readings below 0, down to {value.min():.3g}",
            rule="light in linear units, from which a dark signal was subtracted once",
            remedy="turn decibels or logarithms into linear values first (10^(value / 10) for dB)",
        )


def _check_slips(readings: Unchecked, refuse: Callable[..., None]) -> None:
    """One number that is out of all proportion would drown all others in a fit."""
    size = np.where(np.isfinite(readings.value), np.abs(readings.value), 0.0)
    next_largest = np.sort(size)[-2] if len(size) > 2 else 0.0
    beyond = (next_largest > 0) & (size > _LARGEST_STEP * next_largest) & (size <= _LARGEST)
    refuse(
        beyond, "value", "is beyond all others", f"at most {_LARGEST_STEP:g} times the next largest",
        "correct it, or remove the row",
    )  # fmt: skip
    sure = (readings.stderr > 0) & (readings.stderr < _SMALLEST_ERROR * np.max(size, initial=0.0))
    refuse(
        sure, "stderr", "is smaller than any instrument's",
        f"at least {_SMALLEST_ERROR:g} of the largest reading", "leave it blank when it is not known",
    )  # fmt: skip


def _check_tank(readings: Unchecked, tank: Tank, refuse: Callable[..., None]) -> None:
    across, up, (_, end) = tank.box_m
    ends = {"x_m": across, "y_m": up, "z_m": (0.0, end)}

    def beyond(values: Array, name: str) -> Mask:
        low, high = ends[name]
        return (readings.medium == "water") & ((values < low - 1e-9) | (values > high + 1e-9))

    at_z = remedy = "correct it (positions are in metres), or the tank's size"
    if not (beyond(readings.y_m, "x_m") | beyond(readings.x_m, "y_m")).any():
        remedy += "; exchanged, x_m and y_m would lie inside"
    for name, (low, high) in ends.items():
        values = getattr(readings, name)
        inside = at_z if name == "z_m" else remedy
        if unit := unit_of_lengths(values[readings.medium == "water"], low, high):
            inside = f"they look like {unit[0]}: give metres, {name} over {unit[1]:g}"
        outside = beyond(values, name) & (np.abs(values) <= FARTHEST_M)  # else that was said
        refuse(outside, name, "is outside the tank", f"{low:g} <= {name} <= {high:g}", inside)
