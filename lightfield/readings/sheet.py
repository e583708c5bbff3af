"""A delimited text file, cell by cell: comma, semicolon or tabulator; decimal point or comma."""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass

from lightfield.readings import text
from lightfield.readings.problems import Problems


@dataclass
class Sheet:
    """A delimited text file: head lines, column names, rows; cells as they stand."""

    head: list[tuple[int, str]]
    names: list[str]
    name_line: int
    rows: list[tuple[int, list[str]]]
    mark: str
    encoding: str


def read_sheet(
    lines: text.Text,
    problems: Problems,
    known: Sequence[str],
    required: Sequence[str],
    numbers: Sequence[str],
    add: str = "add it to the line of column names",
) -> Sheet:
    """Split a CSV file into cells.

    Parameters
    ----------
    problems : Problems
        Takes what is wrong; rows that cannot be split are left out.
    known, required, numbers : sequence of str
        Names of columns: all that mean something, those that must be there, those that hold numbers.
    add : str
        What to do about one that is missing.
    """
    head: list[tuple[int, str]] = []
    names: list[str] = []
    name_line, delimiter = 0, ","
    rows: list[tuple[int, list[str]]] = []
    for k, line in enumerate(lines.lines, start=1):
        if line.lstrip().startswith("#"):
            if not names:  # later comments are comments
                head.append((k, line.lstrip()[1:].removeprefix(" ")))
        elif line.strip():
            if not names and re.fullmatch(r"\[[\w.]+\]|\w+\s*=.*", line.strip()):
                problems.add(
                    "this is TOML, not a table",
                    place=k,
                    found=line.strip(),
                    remedy="were the scene and the readings taken for each other?",
                )
                return Sheet(head, [], k, [], ".", lines.encoding)
            if not names:
                delimiter = max(",;\t", key=lambda d: (len({*_cells(line, d)} & {*known}), line.count(d)))
                names, name_line = _cells(line, delimiter), k
                _check_names(names, k, problems, known, required, add)
                continue
            try:
                cells = next(csv.reader([line], delimiter=delimiter, strict=True))
            except csv.Error as error:
                problems.add(f"not a CSV row: {error}", place=k, found=line)
                continue
            if len(cells) != len(names):
                more = len(cells) > len(names)
                comma = more and delimiter == "," and "." not in line
                problems.add(
                    f"the row has {len(cells)} cells",
                    place=k,
                    rule=f"{len(names)} cells, like the column names",
                    remedy="with decimal commas, separate the cells by semicolons"
                    if comma
                    else "name every column, or take out what is too many"
                    if more
                    else "complete the row",
                )
                continue
            rows.append((k, cells))
    if not names:
        problems.add("there are no column names", rule=f"at least {', '.join(required)}")
    numeric = [c for c, name in enumerate(names) if name in numbers]
    every = (cells[c].strip() for _, cells in rows for c in numeric)
    mark = text.decimal_mark(every, problems, "use one mark throughout, and no thousands mark")
    return Sheet(head, names, name_line, rows, mark, lines.encoding)


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error:  # a field beyond the csv module's limit
        return [cell.strip() for cell in line.split(delimiter)]


UNITS = {"m": "metres", "nm": "nanometres", "s": "seconds"}


def _check_names(
    names: list[str], line: int, problems: Problems, known: Sequence[str], required: Sequence[str], add: str
) -> None:
    for name in required:
        if name not in names:
            close = look_alike(name, [n for n in names if n not in known])
            unit = UNITS.get(name.rsplit("_", 1)[-1])
            rename = f"rename {close!r} to {name}" + (f", in {unit}" if unit else "")
            problems.add(
                f"the column {name} is missing",
                place=line,
                found=", ".join(names),
                rule=f"required: {', '.join(required)}",
                remedy=rename if close else add,
                column=name,
                whole=True,
            )
    for name in dict.fromkeys(names):
        if name == "":
            problems.add("a column has no name", place=line, remedy="name it, or remove the extra delimiter")
        elif names.count(name) > 1:
            problems.add(
                f"the column {name} occurs {names.count(name)} times", place=line, remedy="keep one of them"
            )


#: What others call the columns.
_ALSO_CALLED = {
    "z_m": ("distance", "range"),
    "wavelength_nm": ("lambda",),
    "value": ("irradiance", "radiance", "intensity", "reading", "signal"),
    "stderr": ("sigma", "error", "err", "std", "sd", "uncertainty"),
    "integration_time_s": ("exposure",),
}


def look_alike(name: str, others: Sequence[str]) -> str | None:
    """Which of other columns seems to mean the one called `name`."""
    stems = (name.split("_")[0], *_ALSO_CALLED.get(name, ()))
    for other in others:
        if other.lower() == name or re.split(r"[_ (\[]", other.lower())[0] in stems:
            return other
    near = difflib.get_close_matches(name, others, n=1, cutoff=0.85)
    return near[0] if near else None
