"""Reading small tables of numbers that a scene file names, with every bad line reported."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import Complaint, RuleError, SceneError
from lightfield.storage.inputs import TABLE, FileKind, kept_by_file, kept_while, read_utf8

Value = TypeVar("Value")

#: Coefficients of water, as in a scene; and numbers in any other unit, whose squares must not overflow.
_LARGEST_PER_M, LARGEST = 100.0, 1e30


def read_columns(path: str, columns: Sequence[str]) -> tuple[Array, ...]:
    """Named columns of a CSV file; the first must rise, none may be negative.

    Parameters
    ----------
    path : str
        CSV file with a header line: cells parted by commas, or by semicolons or tabulators, and then with
        decimal points or commas. Lines that begin with # are comments.
    columns : sequence of str
        Column names, any order in the file; other columns are ignored.

    Returns
    -------
    tuple of array, shape (n,)
        One per name.

    Raises
    ------
    SceneError
        Missing columns, or lines that are not numbers: all at once.
    """
    return _read(path, tuple(columns), True)


def read_rows(path: str, columns: Sequence[str]) -> tuple[Array, ...]:
    """Named columns of a CSV file whose rows have no order: numbers of either sign, one row and more.

    Parameters, results and errors as of `read_columns`.
    """
    return _read(path, tuple(columns), False)


def kept_by_tables(most: int) -> Callable[[Callable[..., Value]], Callable[..., Value]]:
    """`kept_while` the tables of the parts of a scene that a function is of are the same."""
    return kept_while(most, lambda *given: [path for one in given for path in getattr(one, "tables", ())])


def column_names(path: str) -> list[str]:
    """Names in the header line of a CSV file; none in an empty one.

    Raises
    ------
    SceneError
        No text.
    """
    return header_and_rows(path, TABLE)[0]


def header_and_rows(path: str, kind: FileKind) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Names in the header line of a CSV file, and cells of the other lines that are no comments, each with
    its number.

    Raises
    ------
    LightfieldError
        Of the `kind`: no text.
    """
    lines = read_utf8(path, kind, "CSV", "utf-8-sig").splitlines()
    told = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and line[0] != "#"]
    separator = max(",;\t", key=told[0][1].count) if told else ","
    (_, names), *rows = [(number, line.split(separator)) for number, line in told] or [(0, [])]
    return [name.strip() for name in names], rows


def readable(reader: Callable[..., Any], *arguments: Any) -> None:
    """Try to read a table while a scene is checked; its complaint becomes one of the scene's.

    Parameters
    ----------
    reader : callable
        Reads the table.
    *arguments
        For the reader.

    Raises
    ------
    RuleError
        With the reader's message on one line.
    """
    try:
        reader(*arguments)
    except SceneError as error:
        raise RuleError.of(error) from error


@kept_by_file(64)
def _read(path: str, columns: tuple[str, ...], ordered: bool) -> tuple[Array, ...]:
    header, rows = header_and_rows(path, TABLE)
    missing = [name for name in columns if name not in header]
    if missing:
        raise SceneError(
            f"column {', '.join(missing)} missing", where=path, found=",".join(header),
            rule=f"columns {', '.join(columns)}", remedy="name the columns in the first line",
        )  # fmt: skip
    places = [header.index(name) for name in columns]
    largest = [_LARGEST_PER_M if name.endswith("_per_m") else LARGEST for name in columns]
    problems: list[Complaint] = []
    values: list[list[float]] = []
    numbers = [cells[place] for _, cells in rows for place in places if place < len(cells)]
    if any("." in cell for cell in numbers) and any("," in cell for cell in numbers):
        problems.append(Complaint("decimal points and decimal commas"))
    for number, cells in rows:
        try:
            row = [float(cells[place].replace(",", ".")) for place in places]
        except (ValueError, IndexError):
            problems.append(Complaint("not numbers", ",".join(cells), lines=(number,)))
            continue
        if not ordered:
            wrong = "" if all(abs(value) <= LARGEST for value in row) else "too large or not finite"
        else:
            wrong = _wrong_in_order(row, largest, columns[0], values[-1][0] if values else -math.inf)
        if wrong:
            problems.append(Complaint(wrong, ",".join(cells), lines=(number,)))
        values.append(row)
    if not problems and len(values) < 1 + ordered:
        problems.append(Complaint("fewer than two rows" if ordered else "no row"))
    if problems:
        rule = f"numbers up to {LARGEST:g}"
        if ordered:
            per_m = f" ({_LARGEST_PER_M:g} per m)" if _LARGEST_PER_M in largest else ""
            rule = f"numbers from 0 to {LARGEST:g}{per_m}, first column rising"
        raise SceneError(
            f"{len(problems)} bad line(s) in a table", where=path, rule=rule, remedy="correct the table",
            problems=problems,
        )  # fmt: skip
    result = tuple(np.array(column) for column in zip(*values, strict=True))
    for column in result:
        column.setflags(write=False)
    return result


def _wrong_in_order(row: Sequence[float], largest: Sequence[float], first: str, above: float) -> str:
    """What is wrong with a row, whose first number has to lie above another; or nothing."""
    if not all(math.isfinite(value) and value >= 0 for value in row):
        return "negative or not finite"
    if any(value > most for value, most in zip(row, largest, strict=True)):
        return "too large"
    return "" if row[0] > above else f"{first} must rise above {above:g}"
