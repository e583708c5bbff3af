"""Numbers in columns, wherever they begin in a file, whatever parts them: names, units, cells."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.readings import text
from lightfield.readings.instruments import labels
from lightfield.readings.problems import Problems

#: What may part cells, the surer first: a comma may be a decimal mark.
_SEPARATORS = ("\t", ";", None, ",")
_WHEN = re.compile(r"[\d:/.\-_TZ+]*\d[:/\-_]\d[\d:/.\-_TZ+]*(\s+[\d:.]+)?(\s*[AaPp]\.?[Mm]\.?)?")
#: Wavelength in a name: 525, 525nm, Es525.0, ES(525.00), lambda_525.
_AT = re.compile(r"(?P<name>.*?)[\s_(\[]*(?P<nm>\d{3,4}(?:[.,]\d+)?)\s*(?:nm)?[)\]]?")
#: What stands in brackets in a name, which may have brackets of its own: L (mW/(m^2 nm sr)).
_BRACKETS = re.compile(r"\[([^\]]*)\]|\(((?:[^()]|\([^()]*\))*)\)")
#: A cell of a line of units.
_UNIT = re.compile(
    r"[\[(].*[\])]|nm|s|ms|m|cm|counts?|ts|rn|volts?|deg ?c|%|.*mol.*|[um\u00b5\u03bc]?w.*|", re.IGNORECASE
)
_WAVELENGTH = re.compile(r"(wave|lambda|λ|longitud|wellenl|longueur|lunghezza|w$|nm$)")
#: What may be thousands, by the mark between them, and what is less than one.
_GROUPED = {mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}[{mark}]\d{{3}}") for mark in ",."}
_HUNDREDS = re.compile(r"[+-]?[1-9]\d{0,2}")
_MARKS = {",": "comma", ".": "point"}
#: 525 nm is 525; in m^2 nm and m-2 nm-1 is a power.
_NM = re.compile(r"(?<![\w^.,-])(\d+(?:[.,]\d+)?)\s*nm", re.IGNORECASE)
#: A row may begin with a word (the name of a place) if more numbers than this follow.
_NAMELESS = 3
#: Of a line of units this part is known ones.
_MOSTLY = 0.6
#: So many lines above the numbers may name them.
_MOST_NAMED = 3
#: Beyond is another unit, as angstroms or pixels.
_SHORTEST_NM, _LONGEST_NM = 100.0, 5000.0
#: So many columns named by wavelengths are a spectrum, fewer may be chance.
LEAST_ACROSS = 3


@dataclass(frozen=True)
class NumberBlock:
    """A block of numbers.

    Parameters
    ----------
    head : tuple of str
        Lines before it.
    names, units : tuple of str
        Of the columns; "" where the file does not say.
    lines : tuple of int
        Line of each row.
    cells : list of list of str
    mark : str
        Decimal mark.
    separator : str, optional
        What parts the cells; None is white space.
    """

    head: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    lines: tuple[int, ...]
    cells: list[list[str]]
    mark: str
    separator: str | None

    @property
    def header(self) -> dict[str, str]:
        """Label and text of the lines before the table, which may be cells as its rows are."""
        return header_of(self.head, self.separator or "")

    def said(self, axis: str) -> str:
        """What the head says of the "x" or the "y" axis: its unit or its name; "" where it is silent."""
        label = re.compile(rf"{axis}[- ]?(axis|achse).*")
        return next((said for name, said in self.header.items() if label.fullmatch(labels.folded(name))), "")

    def column(self, index: int, problems: Problems, whole: bool = False) -> Array:
        """Numbers of a column; nan where a cell says there is none. What is no number goes to `problems`.

        `whole`: each cell must hold a number.
        """
        out = np.full(len(self.cells), np.nan)
        for k, row in enumerate(self.cells):
            cell = row[index]
            if not whole and self.is_blank(k, index):
                continue
            try:
                out[k] = text.parsed_number(cell, self.mark)
            except ValueError as error:
                problems.add(
                    f"{self.called(index)} {error}", place=self.lines[k], found=cell,
                    remedy="correct it, or export it again",
                )  # fmt: skip
        return out

    def is_blank(self, row: int, index: int) -> bool:
        """Does a cell say that there is no number?"""
        cell = self.cells[row][index]
        return not cell or text.NOT_A_NUMBER.fullmatch(cell) is not None

    def called(self, index: int) -> str:
        """Name of a column, or its number where it has none."""
        return self.names[index] or f"column {index + 1}"

    def across(self) -> dict[str, tuple[list[int], Array]]:
        """Columns that are named by wavelengths: what stands before the number, to their places and nm."""
        found: dict[str, list[tuple[int, float]]] = {}
        for k, name in enumerate(self.names):
            match = _AT.fullmatch(name)
            if match and _SHORTEST_NM <= (nm := float(match["nm"].replace(",", "."))) <= _LONGEST_NM:
                found.setdefault(match["name"].strip(), []).append((k, nm))
        return {
            name: ([k for k, _ in places], np.array([nm for _, nm in places]))
            for name, places in found.items()
            if len(places) >= LEAST_ACROSS
        }


def find_table(lines: Sequence[str], problems: Problems) -> NumberBlock | None:
    """The first block of two rows of numbers or more, with the names above it; None where there is none.

    Rows behind it that do not fit, and are followed by such that do, go to `problems`.
    """
    numbered = [(k, line.lstrip()) for k, line in enumerate(lines, 1) if line.strip()]
    for separator in _SEPARATORS:
        if separator and not any(separator in line for _, line in numbered):
            continue
        rows = _split(numbered, separator)
        first = _first(rows)
        if first is not None:
            return _table(rows, first, [line.rstrip() for _, line in numbered], separator, problems)
    return None


def _split(numbered: Sequence[tuple[int, str]], separator: str | None) -> list[tuple[int, list[str]]]:
    """Cells of every line. Blanks behind the last separator are none, unless the last column has some."""
    whole = [(k, _cells(line, separator)) for k, line in numbered]
    shorter = [(k, _without_end(cells, separator)) for k, cells in whole]
    if shorter == whole:
        return whole
    widths, fewer = ({len(cells) for _, cells in rows if _is_row(cells)} for rows in (whole, shorter))
    return whole if len(widths) == 1 < len(fewer) else shorter


def _without_end(cells: list[str], separator: str | None) -> list[str]:
    """Without a blank at the end; without all of them where tabulators are no more than white space."""
    if separator == "\t":
        return cells[: max((k for k, cell in enumerate(cells, 1) if cell), default=0)]
    return cells[:-1] if len(cells) > 2 and not cells[-1] else cells


def _cells(line: str, separator: str | None) -> list[str]:
    return [_NM.sub(r"\1", cell.strip().strip('"').strip()) for cell in line.split(separator)]


def _is_row(cells: Sequence[str]) -> bool:
    """Are these numbers, times and blanks by more than half?"""
    known = [_is_number(cell) or not cell or _WHEN.fullmatch(cell) is not None for cell in cells]
    begins = known[:1] == [True] or sum(known) > _NAMELESS
    return begins and len(cells) > 1 and 2 * sum(known) > len(cells) and any(map(_is_number, cells))


def _is_number(cell: str) -> bool:
    return text.NUMBER.fullmatch(cell.replace(",", ".", 1)) is not None or (
        text.NOT_A_NUMBER.fullmatch(cell) is not None
    )


def _first(rows: Sequence[tuple[int, list[str]]]) -> int | None:
    for k in range(len(rows) - 1):
        here, after = rows[k][1], rows[k + 1][1]
        if len(here) == len(after) and _is_row(here) and _is_row(after):
            return k
    return None


def _table(
    rows: Sequence[tuple[int, list[str]]],
    first: int,
    lines: Sequence[str],
    separator: str | None,
    problems: Problems,
) -> NumberBlock | None:
    width = len(rows[first][1])
    # Names that are wavelengths look like a row of numbers.
    kinds = [_is_number(cell) for cell in rows[first][1]]
    if any(not kind and _is_number(cell) for kind, cell in zip(kinds, rows[first + 1][1], strict=True)):
        first += 1
    fitting = [len(cells) == width and _is_row(cells) for _, cells in rows]
    last = max((k for k, fits in enumerate(fitting) if fits), default=first)
    if last == first:
        return None
    body = [rows[k] for k in range(first, last + 1) if fitting[k]]
    for k in range(first, last + 1):
        if not fitting[k]:
            problems.add(
                "the line does not fit the others",
                place=rows[k][0],
                found=lines[k],
                rule=f"{width} cells of numbers",
                remedy="export it again",
            )
    names, units, above = _names(rows, first, width)
    mark = mark_in((cell for _, cells in body for cell in cells if _is_number(cell)), problems)
    _refuse_thousands([cells for _, cells in body], mark, problems)
    return NumberBlock(
        tuple(lines[:above]), names, units, tuple(k for k, _ in body), [cells for _, cells in body], mark,
        separator,
    )  # fmt: skip


def _refuse_thousands(rows: Sequence[Sequence[str]], mark: str, problems: Problems) -> None:
    """A mark parts no decimals where each of a column may part thousands, and hundreds beside have none."""
    for column in zip(*rows, strict=True):
        marked = [cell for cell in column if mark in cell and _is_number(cell)]
        if not all(map(_GROUPED[mark].fullmatch, marked)):
            continue
        grouped = next((cell for cell in column if _GROUPED[mark].fullmatch(cell)), None)
        small = next((cell for cell in column if _HUNDREDS.fullmatch(cell)), None)
        if grouped and small:
            problems.add(
                f"a {_MARKS[mark]} may be a decimal or a thousands mark", found=f"{grouped} beside {small}",
                remedy="export it again without thousands marks",
            )  # fmt: skip
            return


def mark_in(cells: Iterable[str], problems: Problems) -> str:
    """The decimal mark of numbers that an instrument wrote."""
    return text.decimal_mark(cells, problems, "export it again with a decimal point")


def _names(
    rows: Sequence[tuple[int, list[str]]], first: int, width: int
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Names and units of the columns, and how many lines are above them."""
    top = first
    while top and len(rows[top - 1][1]) == width and first - top < _MOST_NAMED:
        top -= 1
    if top == first:
        return ("",) * width, ("",) * width, first
    named = [tuple(rows[k][1]) for k in range(top, first)]
    # A line of units, and one of how the values came about, may stand between the names and the numbers.
    below = next((k for k in range(1, len(named)) if _are_units(named[k])), None)
    if below is not None:
        return named[below - 1], tuple(cell.strip("[]() ") for cell in named[below]), top + below - 1
    names = named[-1]
    units = tuple((m[1] or m[2] or "").strip() if (m := _BRACKETS.search(name)) else "" for name in names)
    return names, units, first - 1


def _are_units(cells: Sequence[str]) -> bool:
    said = [cell for cell in cells if cell]
    return bool(said) and sum(_UNIT.fullmatch(cell) is not None for cell in said) >= _MOSTLY * len(said)


def wavelength_column(table: NumberBlock) -> int:
    """Which column is the wavelength: by its name or unit, else the first."""
    named = (k for k, name in enumerate(table.names) if _is_wavelength(name, table.units[k]))
    return next(named, 0)


def says_wavelength(table: NumberBlock) -> bool:
    """Does a column say that it holds wavelengths?"""
    return any(map(_is_wavelength, table.names, table.units))


def _is_wavelength(name: str, unit: str) -> bool:
    return unit == "nm" or _WAVELENGTH.match(labels.folded(name)) is not None


def header_of(head: Sequence[str], separator: str = "") -> dict[str, str]:
    """Label and text of the lines before a table.

    They are parted by a colon, an equals sign, a tabulator, or what parts the table's cells.
    """
    found: dict[str, str] = {}
    parts = re.escape(f":=\t{separator}")
    for number, line in enumerate(head, 1):
        match = re.fullmatch(rf"\W*([^{parts}]{{1,80}}?)\s*[{parts}]\s*(.*?)[\s\"]*", line)
        if match:
            found.setdefault(match[1].strip(), match[2].strip(" \"'"))
        else:
            found[f"line {number}"] = line.strip()
    return found


def check_axis(
    wavelength_nm: Array,
    lines: Sequence[int],
    problems: Problems,
    within_nm: tuple[float, float] = (_SHORTEST_NM, _LONGEST_NM),
) -> None:
    """Wavelengths that can be, and increase; what is wrong goes to `problems`."""
    low, high = within_nm
    for k in np.flatnonzero(~((wavelength_nm >= low) & (wavelength_nm <= high))).tolist():
        problems.add(
            "impossible wavelength",
            place=lines[k] if k < len(lines) else None,
            found=wavelength_nm[k].item(),
            rule=f"{low:g}-{high:g} nm",
            remedy="export wavelengths in nm, or say which column they are in",
        )
    with np.errstate(invalid="ignore"):
        falls = np.flatnonzero(np.diff(wavelength_nm) <= 0).tolist()
    for k in falls:
        problems.add(
            "the wavelength does not increase",
            place=lines[k + 1] if k + 1 < len(lines) else None,
            found=wavelength_nm[k + 1].item(),
            remedy="export it again",
        )
