"""Writes the reading table as a CSV file with a TOML head, exact to the last bit."""

from __future__ import annotations

import csv
import io
import re
from os import PathLike
from typing import Any

import numpy as np
import tomli_w

from lightfield.errors import OutputError
from lightfield.readings.columns import COLUMNS, DEFAULTS, REQUIRED, TERMS, WORDS
from lightfield.readings.readings import Readings
from lightfield.storage.files import write_text

_UNWRITABLE = re.compile(r"[\x00-\x1f\x7f]")


def write_table(readings: Readings, path: str | PathLike[str]) -> None:
    """Write a reading table that `read_table` reads back to the last bit.

    Raises
    ------
    OutputError
        The file cannot be written, or its texts cannot stand in a CSV file with a TOML head.
    """
    write_text(path, dumps(readings))


def dumps(readings: Readings) -> str:
    """The text of a reading table; see `write_table`."""
    head: dict[str, Any] = {name: getattr(readings, name) for name in WORDS if getattr(readings, name)}
    head.update({n: v for n in TERMS if (v := getattr(readings.budget, n)) is not None})
    names = [name for name in COLUMNS if _worth_writing(readings, name)]
    _check_writable(readings)
    head.update(readings.metadata)
    try:
        content = "".join(f"# {line}".rstrip(" ") + "\n" for line in tomli_w.dumps(head).split("\n")[:-1])
        content.encode("utf-8")
    except (TypeError, ValueError, RecursionError) as error:
        raise OutputError(
            "the metadata cannot be written as TOML", found=str(error), remedy="use plain values"
        ) from error
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*names, *readings.extra])
    cells = [[_cell(name, v) for v in getattr(readings, name).tolist()] for name in names]
    cells += [column.tolist() for column in readings.extra.values()]
    writer.writerows(zip(*cells, strict=True))
    return content + out.getvalue()


def _worth_writing(readings: Readings, name: str) -> bool:
    column = getattr(readings, name)
    if name == "wavelength_nm" and readings.of_band:
        return False
    if name in ("medium", "x_m", "y_m", *REQUIRED):
        return True
    if name in DEFAULTS:
        return bool((column != DEFAULTS[name]).any())
    return bool(np.isfinite(column).any())


def _cell(name: str, value: Any) -> str:
    if isinstance(value, float) and np.isnan(value):
        return ""
    if name in ("repeat", "visit", "saturated"):
        return str(int(value))
    return repr(value) if isinstance(value, float) else str(value)


def _check_writable(readings: Readings) -> None:
    cells = [cell for column in readings.extra.values() for cell in column.tolist()]
    for cell in (*readings.extra, *cells):
        try:
            cell.encode("utf-8")
            good = not _UNWRITABLE.search(cell.replace("\t", " "))
        except UnicodeEncodeError:
            good = False
        if not good:
            raise OutputError(
                "text that cannot stand in a CSV cell",
                found=cell,
                rule="no line breaks or control characters",
            )
    for name in readings.extra:
        if not name or name != name.strip() or name in COLUMNS:
            raise OutputError(
                "unusable name of an extra column", found=name, rule="not blank, not one of lightfield's own"
            )
    for name in readings.metadata:
        if name in (*WORDS, *TERMS):
            raise OutputError("metadata under a name of lightfield's own", found=name, remedy="rename it")
