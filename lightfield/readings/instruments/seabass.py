"""SeaBASS (.sb): NASA's text format, `/begin_header` to `/end_header`, one spectrum a row or one a column.

Source: https://seabass.gsfc.nasa.gov/wiki/data_format
"""

from __future__ import annotations

import re

import numpy as np

from lightfield.arrays import Array
from lightfield.readings import text, units
from lightfield.readings.instruments.document import Document
from lightfield.readings.instruments.number_block import LEAST_ACROSS, check_axis
from lightfield.readings.instruments.oddity import Odd, Oddity
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "SeaBASS"
_DELIMITERS = {"comma": ",", "space": None, "tab": "\t", "semicolon": ";"}
_FIELD = re.compile(r"(?P<name>[A-Za-z_]+?)_?(?P<nm>\d{3,4}(?:\.\d+)?)")


def claims(document: Document) -> bool:
    """Is this a SeaBASS file?"""
    return document.title.lower().startswith("/begin_header")


def read(document: Document) -> list[Spectrum]:
    """The spectra of a SeaBASS file: the rows of fields with wavelengths in their names, or columns."""
    problems = Problems(document.where)
    header, end = _header(document.lines, problems)
    names = [name.strip() for name in header.get("fields", "").split(",")]
    given = [unit.strip() for unit in header.get("units", "").split(",")]
    problems.raise_any(f"not a usable {NAME} file")
    if len(given) != len(names):
        given = [""] * len(names)
    missing = {text.number_or_nan(header.get(key, "-999")) for key in ("missing", "below_detection_limit")}
    lines, rows = _rows(document, end, len(names), header.get("delimiter", "space"), problems)
    notes = _without_cut_line(document, lines, rows)
    problems.raise_any(f"not a usable {NAME} file")
    low = [name.lower() for name in names]
    if "wavelength" in low or "lambda" in low:
        axis = low.index("wavelength" if "wavelength" in low else "lambda")
        wavelength = np.array([text.number_or_nan(row[axis]) for row in rows])
        check_axis(wavelength, lines, problems)
        problems.raise_any(f"not a usable {NAME} file")
        return [
            _spectrum(
                document, header, wavelength, _column(rows, [k], missing)[:, 0], names[k], given[k], "", notes
            )
            for k in range(len(names))
            if k != axis and not low[k].endswith(("_sd", "_unc", "_se"))
        ]
    found: dict[str, list[tuple[int, float]]] = {}
    for k, name in enumerate(names):
        match = _FIELD.fullmatch(name)
        if match:
            found.setdefault(match["name"], []).append((k, float(match["nm"])))
    groups = {name: sorted(p, key=lambda p: p[1]) for name, p in found.items() if len(p) >= LEAST_ACROSS}
    if not groups:
        problems.refuse(
            f"not a usable {NAME} file",
            "no field is a spectrum",
            found=", ".join(names[:6]),
            rule="a field wavelength, or fields like Es353.2",
            remedy="take a file of radiometry",
        )
    out = []
    for name, places in groups.items():
        wavelength, which = np.array([nm for _, nm in places]), [k for k, _ in places]
        check_axis(wavelength, (), problems)
        values = _column(rows, which, missing)
        out += [
            _spectrum(
                document, header, wavelength, values[r], name, given[which[0]], _moment(low, row), notes
            )
            for r, row in enumerate(rows)
        ]
    problems.raise_any(f"not a usable {NAME} file")
    return out


def _header(lines: tuple[str, ...], problems: Problems) -> tuple[dict[str, str], int]:
    header: dict[str, str] = {}
    for k, line in enumerate(lines, 1):
        plain = line.strip()
        if plain.lower().startswith("/end_header"):
            if not header.get("fields"):
                problems.add("/fields is missing", remedy="download or export it again")
            return header, k
        if plain.startswith("/") and "=" in plain:
            label, _, value = plain[1:].partition("=")
            header[label.strip().lower()] = value.strip()
        elif plain.startswith("!") and plain.strip("! "):
            header[f"line {k}"] = plain.strip("! ")
    problems.add("the header has no end", rule="/end_header", remedy="download or export it again")
    return header, len(lines)


def _rows(
    document: Document, end: int, width: int, delimiter: str, problems: Problems
) -> tuple[list[int], list[list[str]]]:
    mark = _DELIMITERS.get(delimiter.lower())
    lines, rows = [], []
    for k, line in enumerate(document.lines[end:], end + 1):
        if not line.strip() or line.lstrip().startswith("!"):
            continue
        cells = [cell.strip() for cell in line.split(mark)]
        if len(cells) != width:
            problems.add(f"the row has {len(cells)} cells", place=k, rule=f"{width}, as /fields says")
            continue
        lines.append(k)
        rows.append(cells)
    if not rows and not problems:
        problems.add("there are no rows behind the header", remedy="download or export it again")
    return lines, rows


def _without_cut_line(document: Document, lines: list[int], rows: list[list[str]]) -> tuple[Oddity, ...]:
    """Take out a last row that the file ends within, of a single one its last number: digits may be lost."""
    if document.ended or not rows:
        return ()
    if len(rows) == 1:
        rows[0][-1] = ""
    else:
        rows.pop()
        lines.pop()
    return (Oddity(Odd.CUT_LINE),)


def _column(rows: list[list[str]], which: list[int], missing: set[float]) -> Array:
    """Numbers of some fields, shape (n_rows, n_fields); nan where the file says that there is none."""
    values = np.array([[text.number_or_nan(row[k]) for k in which] for row in rows])
    for code in missing:
        values[values == code] = np.nan
    return values


def _moment(names: list[str], row: list[str]) -> str:
    cells = dict(zip(names, row, strict=True))
    date = re.fullmatch(r"(\d{4})(\d{2})(\d{2})", cells.get("date", ""))
    return f"{date[1]}-{date[2]}-{date[3]} {cells.get('time', '')}" if date else ""


def _spectrum(
    document: Document,
    header: dict[str, str],
    nm: Array,
    values: Array,
    name: str,
    unit: str,
    date: str,
    notes: tuple[Oddity, ...],
) -> Spectrum:
    return Spectrum(
        source=document.where,
        format=NAME,
        wavelength_nm=nm,
        columns={"value": values},
        header={"title": NAME, **header},
        spectrometer=" ".join(
            filter(None, (header.get("instrument_manufacturer"), header.get("instrument_model")))
        ),
        date=date,
        processed_unit=units.stated(unit),
        label=name,
        notes=notes,
    )
