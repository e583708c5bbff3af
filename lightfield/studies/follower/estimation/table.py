"""Readings of an array from a CSV file or a table: one line per sample, one column per element."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from lightfield.arrays import Array
from lightfield.errors import Complaint, MeasurementError
from lightfield.storage.inputs import READINGS
from lightfield.storage.tables import LARGEST, header_and_rows

_TIME = "time_s"
#: Names of columns that look like an element's, or like times: taken for neither they would be lost unseen.
_LIKE_ONE = re.compile(r"e\d+|t|time.*", re.IGNORECASE)


@dataclass(frozen=True)
class Samples:
    """Readings of all elements at rising times.

    Parameters
    ----------
    time_s : array, shape (n,), s
    readings : array, shape (n, n_elements)
        NaN of an element that was not read.
    """

    time_s: Array
    readings: Array


def read_samples(source: str | os.PathLike[str] | pd.DataFrame, elements: int, rate_hz: float) -> Samples:
    """Read a table with the columns e1, e2, ... in the order of the array's elements, and time_s if known.

    Cells of elements that were not read, as of a dead one, are empty or say nan.

    Parameters
    ----------
    source : path-like or DataFrame
        CSV with a header line: cells parted by commas, or by semicolons or tabulators, and then with decimal
        points or commas. Lines that begin with # are comments.
    elements : int
        How many the array has.
    rate_hz : float, Hz
        Of samples without times.

    Raises
    ------
    MeasurementError
        Not such a table: all bad lines at once.
    """
    if isinstance(source, pd.DataFrame):
        rows = enumerate((["" if pd.isna(v) else str(v) for v in row] for row in source.to_numpy(object)), 1)
        return _samples([str(name) for name in source.columns], rows, elements, rate_hz, "readings")
    where = os.fspath(source)
    return _samples(*header_and_rows(where, READINGS), elements, rate_hz, where)


def _samples(
    header: list[str],
    rows: Iterable[tuple[int, Sequence[str]]],
    elements: int,
    rate_hz: float,
    where: str,
) -> Samples:
    wanted, timed = [f"e{k + 1}" for k in range(elements)], _TIME in header
    _check_header(header, wanted, where)
    columns = [header.index(name) for name in ([_TIME] if timed else []) + wanted]
    problems: list[Complaint] = []
    values: list[list[float]] = []
    for number, cells in rows:
        try:
            row = [float(cells[k].strip().replace(",", ".") or "nan") for k in columns]
        except (ValueError, IndexError):
            problems.append(Complaint(f"not {len(columns)} numbers", lines=(number,)))
            continue
        if np.isnan(row[-elements:]).all():
            problems.append(Complaint("no element was read", lines=(number,)))
        elif not np.nanmax(np.abs(row)) <= LARGEST or (timed and np.isnan(row[0])):
            problems.append(Complaint("not finite, or too large", lines=(number,)))
        elif timed and values and row[0] <= values[-1][0]:
            wrong = f"{_TIME} must rise above {values[-1][0]:g}"
            problems.append(Complaint(wrong, row[0], lines=(number,)))
        values.append(row)
    if not problems and not values:
        problems.append(Complaint("no line with readings"))
    if problems:
        raise MeasurementError(
            f"{len(problems)} bad line(s)", where=where, rule=f"finite numbers, {_TIME} rising",
            remedy="correct the table; leave the cells of a dead element empty", problems=problems,
        )  # fmt: skip
    found = np.array(values)
    if timed:
        return Samples(found[:, 0], found[:, 1:])
    return Samples(np.arange(len(found)) / rate_hz, found)


def _check_header(header: Sequence[str], wanted: Sequence[str], where: str) -> None:
    missing = [name for name in wanted if name not in header]
    columns = f"one column per element, e1 to {wanted[-1]}"
    if missing or len(set(header)) < len(header):
        raise MeasurementError(
            f"column {missing[0]} is missing" if missing else "a column stands there twice",
            where=where,
            found=",".join(header)[:80],
            rule=f"{columns}, and {_TIME} if it is known",
            remedy="name the columns in the first line, in the order of the array's elements: column by "
            "column in a grid, from the least x and y; ring by ring outwards; line by line of a table",
        )
    if unknown := [name for name in header if name not in {_TIME, *wanted} and _LIKE_ONE.fullmatch(name)]:
        raise MeasurementError(
            f"column {unknown[0]} is not one of this array's, or of times",
            where=where,
            found=",".join(unknown)[:80],
            rule=f"{columns}, and {_TIME} (seconds) if it is known",
            remedy=f"a scene whose array has these; call times in seconds {_TIME}; leave out the rest",
        )
