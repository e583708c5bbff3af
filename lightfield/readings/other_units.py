"""Which unit numbers seem to be in that should be in metres or seconds."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array
from lightfield.readings.load_warning import LoadWarning, Remarks
from lightfield.readings.unchecked import Unchecked

#: Parts of a metre, the larger first: readings reach over much of a tank, not over a hundredth of it.
_LENGTHS = {"centimetres": 100.0, "millimetres": 1000.0}
#: One reading may lie outside by a slip; in another unit half of them lie this many times as far as anything.
_BEYOND = 2.0
#: No lamp in water is read from farther away than this, in metres, nor so many times farther to the side than
#: in front of it. Chosen.
_FAR_M, _ASIDE = 80.0, 10.0
#: From place to place no detector moves faster, in m/s, nor takes longer, in s. Chosen: carriages of tow
#: tanks make 2 to 3 m/s.
_FAST, _SLOW_S = 5.0, 3600.0
#: Readings begin no later than so many times as long after time 0 as they took. A lamp of power 1 + d t that
#: grows by a part p while it is read, k times as long after 0, has d t = p k / (1 - p k) there: none from
#: p = 1 / k on.
_LATE = 5.0
#: Times closer than this are one.
_AT_ONCE_S = 1e-6


def unit_of_lengths(values: Array, low_m: float, high_m: float) -> tuple[str, float] | None:
    """The unit in which lengths would lie between two ends, and how many of it make a metre.

    Parameters
    ----------
    values : array, shape (n,)
        As given, for metres.
    """
    values = values[np.isfinite(values)]
    away = np.abs(values[values != 0])
    if not away.size or np.median(away) < _BEYOND * max(abs(low_m), abs(high_m)):
        return None
    for name, parts in _LENGTHS.items():
        if np.all((values >= parts * low_m) & (values <= parts * high_m)):
            return name, parts
    return None


def unit_warnings(readings: Unchecked) -> list[LoadWarning]:
    """Positions that are hardly in metres, and times that are hardly in seconds, or count from elsewhere."""
    return [*_of_places(readings), *_of_zero(readings), *_of_times(readings)]


def _of_places(readings: Unchecked) -> list[LoadWarning]:
    far = {name: float(np.abs(getattr(readings, name)).max()) for name in ("x_m", "y_m", "z_m")}
    limit = {"x_m": min(_FAR_M, _ASIDE * far["z_m"]), "z_m": _FAR_M}
    limit["y_m"] = limit["x_m"]
    return [
        LoadWarning(Remarks.FAR_PLACES, {"name": name, "far_m": value})
        for name, value in far.items()
        if value > limit[name]
    ]


def _of_zero(readings: Unchecked) -> list[LoadWarning]:
    """By how far from time 0 readings begin, as those with seconds of the day do."""
    time_s = readings.time_s[np.isfinite(readings.time_s)]
    if not time_s.size:
        return []
    first, span = float(time_s.min()), float(np.ptp(time_s))
    if not 0 < _LATE * span < first:
        return []
    told = {"first_s": float(f"{first:.6g}"), "percent": float(f"{100 * span / first:.2g}")}
    return [LoadWarning(Remarks.LATE_TIMES, told)]


def _of_times(readings: Unchecked) -> list[LoadWarning]:
    """By the speed at which the detector would have moved from place to place, and by how long it took."""
    known = np.flatnonzero(np.isfinite(readings.time_s))
    order = known[np.argsort(readings.time_s[known], kind="stable")]
    took_s = np.diff(readings.time_s[order])
    places = np.stack([readings.x_m, readings.y_m, readings.z_m], axis=1)[order]
    moved_m = np.linalg.norm(np.diff(places, axis=0), axis=1)
    moves = (took_s > _AT_ONCE_S) & (moved_m > 0)
    if not moves.any():
        return []
    speed, step_s = float(np.median(moved_m[moves] / took_s[moves])), float(np.median(took_s[moves]))
    if speed > _FAST:
        return [LoadWarning(Remarks.FAST_TIMES, {"speed": float(f"{speed:.2g}")})]
    if step_s > _SLOW_S:
        return [LoadWarning(Remarks.SLOW_TIMES, {"step_s": float(f"{step_s:.2g}")})]
    return []
