"""From the bytes of a text file to lines and numbers, whatever program and country it came from."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from lightfield.errors import MeasurementError, brief
from lightfield.readings.problems import Problems
from lightfield.storage.inputs import FileKind, read_bytes

NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
NOT_A_NUMBER = re.compile(r"[+-]?(?:nan|na|n/a|inf|infinity|null|none|-?1\.#\w+)", re.IGNORECASE)
_CLOCK = re.compile(
    r"(?:^|[ T])\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?\s*(?:[ap]m|z)?$", re.ASCII | re.IGNORECASE
)
_BREAK = re.compile(r"\r\n|\r|\n")
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0e-\x1f\x7f]")
_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # before UTF-16, whose mark is the beginning of this one
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


@dataclass(frozen=True)
class Text:
    """Lines of a file, without their ends.

    Parameters
    ----------
    lines : tuple of str
        Line 1 is `lines[0]`.
    encoding : str
        How the bytes were read.
    ended : bool
        Does the last line have an end? If not, the file may be cut.
    """

    lines: tuple[str, ...]
    encoding: str
    ended: bool


def read_text(path: str | Path, kind: FileKind) -> Text:
    """The lines of a text file: UTF-8, UTF-16 or Latin-1; ends of any kind.

    Raises
    ------
    MeasurementError
        No such file, too large, empty, or not a text file.
    """
    return decode(read_bytes(path, kind), str(path))


def decode(data: bytes, where: str) -> Text:
    """The lines of the bytes of a text file.

    Raises
    ------
    MeasurementError
        Empty, or not text.
    """
    if not data.strip():
        raise MeasurementError("the file is empty", where=where, remedy="export it again")
    text, encoding = _decode(data)
    control = _CONTROL.search(text)
    if control:
        line = len(_BREAK.findall(text, 0, control.start())) + 1
        raise MeasurementError(
            "not a text file",
            where=f"{where}, line {line}",
            found=control.group(),
            rule="text in UTF-8, UTF-16 with a byte order mark, or Latin-1",
            remedy="export it as text",
        )
    if not text.strip():
        raise MeasurementError("the file is empty", where=where, remedy="export it again")
    lines = _BREAK.split(text)
    ended = lines[-1] == ""
    return Text(tuple(lines[:-1] if ended else lines), encoding, ended)


def _decode(data: bytes) -> tuple[str, str]:
    candidates = [name for mark, name in _BOMS if data.startswith(mark)]
    if not candidates and len(data) % 2 == 0 and data[:64].count(0) >= len(data[:64]) // 3:
        # Latin letters in UTF-16 have every second byte zero, and some programs leave the mark out.
        candidates = ["utf-16-le" if data[1] == 0 else "utf-16-be"]
    for name in [*candidates[:1], "utf-8"]:
        try:
            return data.decode(name), name
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1"), "latin-1"


def decimal_mark(cells: Iterable[str], problems: Problems, remedy: str) -> str:
    """The decimal mark of numbers that are cells of their own: "." or ",".

    A point where both marks occur, so that neither reading is safe: `problems` are told which cells.
    """
    try:
        return _mark(cells)
    except ValueError as error:
        problems.add(f"cannot tell the decimal mark: {error}", remedy=remedy)
        return "."


def _mark(cells: Iterable[str]) -> str:
    point = comma = None
    for cell in cells:
        if "." in cell and NUMBER.fullmatch(cell.replace(",", ".", 1)):
            point = point or cell
        if "," in cell and NUMBER.fullmatch(cell.replace(",", ".", 1)):
            comma = comma or cell
        if "," in cell and "." in cell and cell[0] in "+-.0123456789":
            raise ValueError(f"{brief(cell)} has a point and a comma")
    if point and comma:
        raise ValueError(f"{brief(point)} has a decimal point and {brief(comma)} a decimal comma")
    return "," if comma else "."


def number_or_nan(cell: str) -> float:
    """A finite number, nan where it is none."""
    try:
        return parsed_number(cell)
    except ValueError:
        return float("nan")


def parsed_number(cell: str, mark: str = ".") -> float:
    """A finite number.

    Raises
    ------
    ValueError
        It is not; the message says in which way.
    """
    text = cell.strip()
    if NOT_A_NUMBER.fullmatch(text):
        raise ValueError("is not a finite number")
    if mark == "," and "." not in text:
        text = text.replace(",", ".")
    if _CLOCK.search(text):
        raise ValueError("is a time of day, and no number of seconds")
    if not NUMBER.fullmatch(text):
        raise ValueError("is not a number")
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise ValueError("is too large for a number")
    return value
