"""A text file taken apart: labelled header, marked blocks as programs of Ocean Optics write, columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.readings import text
from lightfield.readings.instruments import labels
from lightfield.readings.instruments.number_block import NumberBlock, check_axis, find_table, mark_in
from lightfield.readings.instruments.oddity import Odd, Oddity
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

#: Wavelengths that instruments of this maker have.
_WITHIN_NM = (50.0, 30000.0)
# Other languages have words behind the arrows: ">>>>> Comienza Data<<<<< Espectral Procesado Del EL".
_MARKER = re.compile(r"\s*>{3,}\s*(.*?)\s*<{3,}\s*(.*?)\s*")
_BEGINS = re.compile(r"begin|beginn|anfang|start|comienz|inici|debut|iniz")
_ENDS = re.compile(r"end|ende|fin|fine|fim|termin|extremo|einde|konec")
_HOLE = ("\u221e", "-\u221e", "\ufffd")  # how Java writes infinity and not-a-number


@dataclass
class MarkedLines:
    """Lines between a begin and an end marker, blank ones left out."""

    title: str
    lines: list[tuple[int, str]] = field(default_factory=list)
    closed: bool = False


@dataclass
class Document:
    """A file in parts.

    Parameters
    ----------
    title : str
        First line that is not blank.
    header : dict of str to str
    blocks : list of MarkedLines
    ended : bool
        Does the last line have an end?
    lines : tuple of str
        All of it, as it stands.
    """

    where: str
    title: str
    header: dict[str, str]
    blocks: list[MarkedLines]
    ended: bool
    lines: tuple[str, ...] = ()

    def block(self, *words: str) -> MarkedLines | None:
        """The first block whose title holds all these words."""
        return next((b for b in self.blocks if all(word in labels.folded(b.title) for word in words)), None)

    @cached_property
    def _columns(self) -> tuple[NumberBlock | None, Problems]:
        problems = Problems(self.where)
        return find_table(self.lines, problems), problems

    def columns(self, problems: Problems | None = None) -> NumberBlock | None:
        """Its first block of columns of numbers, sought once; what is wrong in it goes to `problems`."""
        table, found = self._columns
        if problems is not None:
            problems.found += found.found
        return table

    @property
    def numbers(self) -> MarkedLines | None:
        """The block of the spectrum: the first of which every language's words are left aside."""
        return self.block("spectr") or next(iter(self.blocks), None)


def take_apart(content: text.Text, where: str) -> Document:
    """Title, header and blocks of a file; lines are told by what stands in them, never by their number."""
    title = ""
    header: dict[str, str] = {}
    blocks: list[MarkedLines] = []
    for number, line in enumerate(content.lines, start=1):
        marker = _MARKER.fullmatch(line)
        if marker:
            words = f"{marker[1]} {marker[2]}".strip()
            if not _ends(words, blocks):
                blocks.append(MarkedLines(words))
            elif blocks:
                blocks[-1].closed = True
        elif not line.strip():
            continue
        elif blocks:
            if not blocks[-1].closed:
                blocks[-1].lines.append((number, line.strip()))
            else:
                header[f"line {number}"] = line.strip()
        elif not title:
            title = line.strip()
        else:
            _note_header(header, number, line.strip())
    return Document(where, title, header, blocks, content.ended, content.lines)


def _ends(words: str, blocks: Sequence[MarkedLines]) -> bool:
    """Does this marker end a block? By its word where that is known; else if a block is open."""
    if _BEGINS.match(labels.folded(words)):
        return False
    if _ENDS.match(labels.folded(words)):
        return True
    return bool(blocks) and not blocks[-1].closed and bool(blocks[-1].lines)


def _note_header(header: dict[str, str], number: int, line: str) -> None:
    label, colon, value = line.replace("：", ":", 1).partition(":")
    if not colon:
        if line.strip("+-=* "):
            header[f"line {number}"] = line
        return
    name, again = label.strip(), 2
    while name in header:
        name, again = f"{label.strip()} ({again})", again + 1
    header[name] = value.strip()


def block_numbers(block: MarkedLines, width: int, problems: Problems) -> Array:
    """The numbers of a block, shape (n_lines, width); nan where a cell says that there is none.

    What cannot be read is noted in `problems`, with its line.
    """
    lines = block.lines
    separator = next((s for s in "\t;" if any(s in line for _, line in lines)), None)
    if separator is None and width > 1 and not any(" " in line for _, line in lines):
        separator = ","
    rows = [(number, [c.strip() for c in line.split(separator)]) for number, line in lines]
    mark = mark_in((cell for _, cells in rows for cell in cells), problems)
    out = np.full((len(rows), width), np.nan)
    for k, (number, cells) in enumerate(rows):
        if len(cells) != width:
            problems.add(
                f"the line has {len(cells)} numbers",
                place=number,
                rule=f"{width} numbers",
                remedy="export it again",
            )
            continue
        for c, cell in enumerate(cells):
            if c > 0 and (cell in _HOLE or text.NOT_A_NUMBER.fullmatch(cell)):
                continue
            try:
                out[k, c] = text.parsed_number(cell, mark)
            except ValueError as error:
                problems.add(f"{cell!r:.40} {error}", place=number, remedy="export it again")
    return out


def without_cut_number(document: Document, columns: Iterable[Array]) -> tuple[Oddity, ...]:
    """Take out the last numbers where the file ends within a line: they may have lost digits."""
    if document.ended:
        return ()
    for values in columns:
        values[-1] = np.nan
    return (Oddity(Odd.CUT_LINE),)


def spectrum(
    document: Document,
    name: str,
    block: MarkedLines | None,
    columns: Sequence[str],
    problems: Problems,
    **more: Any,
) -> Spectrum:
    """A spectrum from a block of numbers whose first column is the wavelength.

    Parameters
    ----------
    name : str
        Of the format.
    block : MarkedLines, optional
        Lines of numbers; None is noted as a problem.
    columns : sequence of str
        Names of the columns behind the wavelength.
    **more
        Further fields of Spectrum.

    Raises
    ------
    MeasurementError
        All problems of the file.
    """
    header = document.header
    if block is None or not block.lines:
        problems.refuse(
            f"not a usable {name} file",
            "there are no spectral data",
            rule="numbers behind a line like >>>>>Begin ... Data<<<<<",
            remedy="export it again",
        )
    table = block_numbers(block, 1 + len(columns), problems)
    wavelength = table[:, 0]
    _check_axis(wavelength, block, header, problems)
    notes = _check_complete(document, block, table, problems)
    problems.raise_any(f"not a usable {name} file")
    exposure, odd = labels.exposure_said(header)
    spectrometer, date = labels.lookup(header, "spectrometer"), labels.lookup(header, "date")
    return Spectrum(
        source=document.where,
        format=name,
        wavelength_nm=wavelength,
        columns={column: table[:, c] for c, column in enumerate(columns, start=1)},
        header={"title": document.title, **header},
        integration_time_s=exposure,
        spectra_averaged=labels.count(header, "averaged"),
        boxcar=labels.count(header, "boxcar"),
        spectrometer=spectrometer[1] if spectrometer else "",
        date=date[1] if date else "",
        electric_dark_corrected=labels.flag(header, "electric_dark"),
        nonlinearity_corrected=labels.flag(header, "nonlinearity"),
        notes=(*notes, *odd),
        **more,
    )


def _check_axis(wavelength: Array, block: MarkedLines, header: dict[str, str], problems: Problems) -> None:
    axis = labels.lookup(header, "axis")
    if axis and re.search(r"pixel|raman|shift|wavenumber|energ", labels.folded(axis[1])):
        problems.add(
            "the x axis is not wavelength", found=f"{axis[0]}: {axis[1]}", remedy="export wavelengths in nm"
        )
    if not np.isnan(wavelength).any():  # else noted already
        check_axis(wavelength, [number for number, _ in block.lines], problems, _WITHIN_NM)


def _check_complete(document: Document, block: MarkedLines, table: Array, problems: Problems) -> list[Oddity]:
    notes: list[Oddity] = []
    announced, rows = labels.count(document.header, "pixels"), len(table)
    if announced is not None and rows < announced:
        problems.add(
            "the file is cut",
            found=f"{rows} pixels",
            rule=f"{announced}, as its header says",
            remedy="copy or export it again",
        )
    elif announced is not None and rows > announced:
        notes.append(Oddity(Odd.MORE_PIXELS, rows, announced))
    elif announced is None and not block.closed:
        notes.append(Oddity(Odd.END_UNKNOWN))
    if not block.closed:
        notes += without_cut_number(document, table.T[1:])
    return notes
