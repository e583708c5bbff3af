"""Reads the reading table: a CSV file with a TOML head."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

import numpy as np

from lightfield.errors import MeasurementError
from lightfield.readings import text
from lightfield.readings.blindness import load_warnings
from lightfield.readings.checks import against_scene, check_values
from lightfield.readings.columns import (
    ACROSS,
    COLUMNS,
    DEFAULTS,
    NUMBER_COLUMNS,
    REQUIRED,
    TERMS,
    TEXT_COLUMNS,
    WORDS,
    ErrorBudget,
)
from lightfield.readings.load_warning import LoadWarning, Remarks
from lightfield.readings.problems import Problems
from lightfield.readings.readings import Readings
from lightfield.readings.sheet import Sheet, look_alike, read_sheet
from lightfield.storage import toml
from lightfield.storage.inputs import MOST_ROWS, READINGS

if TYPE_CHECKING:
    from lightfield.scene import Scene

#: A line of the head with a number as it is written where the decimal mark is a comma.
_WITH_COMMA = re.compile(r"^(\s*\w+\s*=\s*[+-]?\d+),(\d+(?:[eE][+-]?\d+)?)(\s*(?:#.*)?)$", re.ASCII)
_TRUE, _FALSE = ("1", "true", "yes"), ("0", "false", "no")


def read_table(
    path: str | PathLike[str], scene: Scene | None = None, required: Sequence[str] = REQUIRED
) -> Readings:
    """Read a reading table.

    Parameters
    ----------
    path : path-like
    scene : Scene, optional
        Also check against its tank, bands and quantity, and fill in its band.
    required : sequence of str
        Columns that must be there: `LAYOUT` lets the values be absent, they are then 1, and the wavelengths:
        every place is then one for each of the scene's bands.

    Raises
    ------
    MeasurementError
        All problems of the file, each with its line; or more rows than are read within seconds.
    """
    return table_of_text(text.read_text(fspath(path), READINGS), fspath(path), scene, required)


def table_of_text(
    content: text.Text, where: str, scene: Scene | None = None, required: Sequence[str] = REQUIRED
) -> Readings:
    """The same from the lines of a table that is called so."""
    problems = Problems(where)
    _refuse_too_long(content, where)
    sheet = read_sheet(content, problems, COLUMNS, required, NUMBER_COLUMNS)
    if "value" in required:
        _refuse_other_files(sheet, problems)
    _refuse_places_by_another_name(sheet, problems)
    head = _read_head(_with_points(sheet), problems)
    _settle_words(sheet, head, problems)
    columns, extra, lines = _read_columns(sheet, problems)
    budget = ErrorBudget(**{name: head.pop(name) for name in TERMS if name in head})
    words = {name: head.pop(name) for name in WORDS if name in head}
    readings = Readings(
        **columns,
        budget=budget,
        **words,
        source=where,
        metadata=head,
        extra=extra,
        line=np.array(lines, dtype=np.int_),
    )
    if scene is not None and "value" not in required and np.isnan(readings.wavelength_nm).all():
        readings = _in_every_band(readings, scene)
    check_values(readings, problems)
    if scene is not None:
        readings = against_scene(readings, scene, problems)
    problems.raise_any()
    readings = readings.saturated_by_level()
    return replace(readings, warnings=(*_file_warnings(sheet, head), *load_warnings(readings)))


def _refuse_too_long(content: text.Text, where: str) -> None:
    rows = sum(1 for line in content.lines if line and not line.startswith("#")) - 1
    if rows > MOST_ROWS:
        raise MeasurementError(
            "too many readings", where=where, found=f"{rows} rows", rule=f"at most {MOST_ROWS}",
            remedy="is this the right file? if so, average what was read at one place, or split it",
        )  # fmt: skip


def _refuse_other_files(sheet: Sheet, problems: Problems) -> None:
    """An index of instrument files, or one of these files, is no table with a few faults."""
    remedy = "import it: make a reading table of it, from an index that names the instrument's files"
    if "file" in sheet.names and "value" not in sheet.names:
        problems.found.clear()
        problems.add("an index of instrument files", place=sheet.name_line, remedy=remedy)
        problems.raise_any()
    alike = any(look_alike(name, sheet.names) for name in COLUMNS)
    if sheet.names and not alike:
        problems.found.clear()
        problems.add(
            "none of the columns is one of a reading table", place=sheet.name_line,
            found=", ".join(sheet.names), rule=f"required: {', '.join(REQUIRED)}",
            remedy=f"name them; a spectrum as an instrument wrote it is none: {remedy}",
        )  # fmt: skip
        problems.raise_any()


def _refuse_places_by_another_name(sheet: Sheet, problems: Problems) -> None:
    """A column x is no x_m: without one every reading would be on the axis."""
    unused = [name for name in sheet.names if name not in COLUMNS]
    alike = {name: look_alike(name, unused) for name in ACROSS if name not in sheet.names}
    for name, other in alike.items():
        if other is not None:
            problems.add(
                f"the column {other!r} is none of a reading table, and {name} is missing",
                place=sheet.name_line,
                rule="places are in metres, their columns x_m, y_m and z_m",
                remedy=f"call it {name}, its numbers in metres; if it is something else, call it otherwise",
            )
    if any(alike.values()):
        problems.raise_any()


def _in_every_band(places: Readings, scene: Scene) -> Readings:
    """Places without a wavelength, as a spectrometer reads them: in all bands at once."""
    centres = np.array([0.5 * (low + high) for low, high in scene.detector.bands_nm])
    every = places.subset(np.repeat(np.arange(len(places)), len(centres)))
    return replace(every, wavelength_nm=np.tile(centres, len(places)))


def _with_points(sheet: Sheet) -> list[tuple[int, str]]:
    """Lines of the head, where a comma is the decimal mark if it is that of the columns: one program wrote
    both."""
    if sheet.mark != ",":
        return sheet.head
    return [(k, _WITH_COMMA.sub(r"\1.\2\3", line)) for k, line in sheet.head]


def _read_head(head: list[tuple[int, str]], problems: Problems) -> dict[str, Any]:
    try:
        found = toml.loads("\n".join(line for _, line in head))
    except ValueError as error:
        # Parsers say the line in words alone; a field for it is of Python 3.14.
        at = re.search(r"at line (\d+)", str(error))
        row = min(int(at[1]), len(head)) - 1 if at else len(head) - 1
        problems.add(
            f"the head is not TOML: {error}",
            place=head[row][0],
            found=head[row][1],
            rule='lines like `# scale = "relative"`',
            remedy=_head_remedy(head[row][1]),
        )
        found = _lines_that_read(head)
    places = {m[1]: line for line, content in reversed(head) if (m := re.match(r"\s*(\w+)\s*=", content))}
    problems.head = places
    for name in (*WORDS, *TERMS):
        if name not in found:
            continue
        value = found[name]
        if name in WORDS:
            good, kind, rule = isinstance(value, str), "text", f'text: {name} = "..."'
        else:
            good = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300
            kind = rule = "a number"
        if not good:
            problems.add(f"{name} is not {kind}", place=places.get(name), found=value, rule=rule)
            del found[name]
        elif name in TERMS:
            found[name] = float(value)
    return found


def _head_remedy(line: str) -> str:
    """What to do about a line of the head that is not TOML."""
    if bare := re.fullmatch(r"\s*(\w+)\s*=\s*([^\W\d][^\"'#]*?)\s*(#.*)?", line):
        return f'put text in quotes: # {bare[1]} = "{bare[2]}"'
    if comma := _WITH_COMMA.fullmatch(line):
        return f"write numbers with a point, as in the columns: # {comma[1].strip()}.{comma[2]}"
    return "begin free comments with ##"


def _lines_that_read(head: list[tuple[int, str]]) -> dict[str, Any]:
    """Entries of a head that is broken elsewhere."""
    found: dict[str, Any] = {}
    for _, content in head:
        try:
            found |= toml.loads(content)
        except ValueError:
            continue
    return found


def _settle_words(sheet: Sheet, head: dict[str, Any], problems: Problems) -> None:
    """quantity, scale and units may also stand in a column; then they must be the same throughout."""
    for name in WORDS:
        if name not in sheet.names:
            continue
        column = sheet.names.index(name)
        for line, cells in sheet.rows:
            cell = cells[column].strip()
            if cell and cell != head.setdefault(name, cell):
                problems.add(
                    f"mixed {name}",
                    place=line,
                    found=cell,
                    rule=f"{head[name]!r}, as above in this file",
                    remedy=f"one file for each {name}",
                )


def _read_columns(sheet: Sheet, problems: Problems) -> tuple[dict[str, Any], dict[str, Any], list[int]]:
    place = {name: c for c, name in reversed(list(enumerate(sheet.names)))}
    good: list[tuple[int, list[str], dict[str, Any]]] = []
    # Nothing at all across the beam is on the axis; nothing in one row among others is a gap.
    told = {name for name in ACROSS if name in place and any(c[place[name]].strip() for _, c in sheet.rows)}
    for line, cells in sheet.rows:
        row: dict[str, Any] = {}
        for name in COLUMNS:
            if name not in place:
                row[name] = 1.0 if name == "value" else DEFAULTS.get(name, np.nan)
                continue
            cell = cells[place[name]].strip()
            try:
                row[name] = _value(name, cell, sheet.mark, name in told)
            except ValueError as error:
                problems.add(f"{name} {error}", place=line, found=cell, remedy=_remedy(name), column=name)
                row[name] = DEFAULTS[name] if name in TEXT_COLUMNS else np.nan  # the others are still checked
        good.append((line, cells, row))
    kinds: dict[str, Any] = {name: np.float64 for name in COLUMNS}
    kinds.update({name: np.str_ for name in TEXT_COLUMNS}, saturated=np.bool_)
    columns = {name: np.array([row[name] for *_, row in good], dtype=kinds[name]) for name in COLUMNS}
    extra = {
        name: np.array([cells[c] for _, cells, _ in good], dtype=np.str_)
        for name, c in place.items()
        if name and name not in COLUMNS
    }
    return columns, {name: extra[name] for name in sheet.names if name in extra}, [line for line, *_ in good]


def _value(name: str, cell: str, mark: str, told: bool) -> Any:
    if name in TEXT_COLUMNS:
        return cell.lower() or DEFAULTS[name]
    if cell == "":
        if name in REQUIRED or told:
            raise ValueError("is missing")
        return DEFAULTS.get(name, np.nan)
    if name == "saturated":
        if cell.lower() not in (*_TRUE, *_FALSE):
            raise ValueError("is neither 0 nor 1")
        return cell.lower() in _TRUE
    return text.parsed_number(cell, mark)


def _remedy(name: str) -> str:
    if name in ACROSS:
        return "write 0 for the axis, or remove the row"
    known = name in REQUIRED
    return "correct it, or remove the row" if known else "correct it, or leave it blank for not known"


def _file_warnings(sheet: Sheet, head: dict[str, Any]) -> list[LoadWarning]:
    out = []
    if sheet.encoding == "latin-1":
        out.append(LoadWarning(Remarks.ENCODING))
    unused = [name for name in sheet.names if name not in COLUMNS]
    for name in (n for n in COLUMNS if n not in sheet.names):
        other = look_alike(name, unused)
        if other:
            out.append(LoadWarning(Remarks.UNUSED_COLUMN, {"unused": other, "missing": name}))
    for name in (n for n in (*WORDS, *TERMS) if n not in head):
        other = next(iter(difflib.get_close_matches(name, list(head), n=1, cutoff=0.75)), None)
        if other:
            out.append(LoadWarning(Remarks.UNUSED_ENTRY, {"unused": other, "missing": name}))
    return out
