"""Plain columns: wavelength and values beside it, or a spectrum a row under wavelengths as names."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from lightfield.arrays import Array
from lightfield.readings import units
from lightfield.readings.instruments import labels
from lightfield.readings.instruments.document import Document, without_cut_number
from lightfield.readings.instruments.number_block import (
    NumberBlock,
    check_axis,
    says_wavelength,
    wavelength_column,
)
from lightfield.readings.instruments.oddity import Oddity
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "plain columns"
#: What the first column of a spectrum may hold beside wavelengths in nm.
_NO_NM = re.compile(
    r"pixel|raman|wave ?number|wellenzahl|cm\s*\^?-1|1/cm|energ|\bev\b|frequen|\bt?hz\b|angstr|"
    r"\b[uµμ]m\b|micro|[\[(]a[\])]"
)
#: What a mapping may name.
MEANINGS = ("wavelength_nm", "value", "dark", "reference")


def claims(document: Document) -> bool:
    """Is there a block of numbers with wavelengths down or across?"""
    table = document.columns()
    if table is None:
        return False
    if table.across() or says_wavelength(table) or _other_axis(table, wavelength_column(table)):
        return True
    problems = Problems(document.where)
    axis = table.column(wavelength_column(table), problems, whole=True)
    check_axis(axis[::-1] if _falls(axis) else axis, table.lines, problems)
    # A few bad lines are reported; a column of something else is another file.
    return len(problems.found) <= max(1, len(axis) // 10)


def read(document: Document, mapping: Mapping[str, str] | None = None) -> list[Spectrum]:
    """The spectra of a table: one for each column beside the wavelength, or one for each row.

    Parameters
    ----------
    mapping : mapping of str to str, optional
        Which column is what (of MEANINGS), by its name or number from 1; the others are left aside.
    """
    problems = Problems(document.where)
    table = document.columns(problems)
    if table is None:
        problems.refuse(
            "not a usable file of columns", "there are no columns of numbers", remedy="export it as text"
        )
    across = table.across()
    if across and not mapping:
        return _across(document, table, across, problems)
    chosen = {
        meaning: column_named(table, name, meaning, problems) for meaning, name in (mapping or {}).items()
    }
    problems.raise_any("not a usable file of columns")
    axis = chosen.get("wavelength_nm", wavelength_column(table))
    if "wavelength_nm" not in chosen and (other := _other_axis(table, axis)):
        problems.refuse(
            "the first column is not wavelength in nm", other, remedy="export wavelengths in nm",
        )  # fmt: skip
    wavelength = table.column(axis, problems, whole=True)
    turn = slice(None, None, -1 if _falls(wavelength) else 1)
    check_axis(wavelength[turn], table.lines[turn], problems)
    if "value" in chosen and len(chosen) > 1 + ("wavelength_nm" in chosen):
        named = {"signal" if m == "value" else m: k for m, k in chosen.items() if m != "wavelength_nm"}
        sets = [
            (
                "",
                {meaning: table.column(k, problems) for meaning, k in named.items()},
                _unit(table, chosen["value"]),
            )
        ]
    else:
        wanted = [chosen["value"]] if "value" in chosen else [k for k in range(len(table.names)) if k != axis]
        sets = [
            ("" if "value" in chosen else table.called(k),
             {"value": table.column(k, problems)}, _unit(table, k))
            for k in wanted
        ]  # fmt: skip
    problems.raise_any("not a usable file of columns")
    notes = without_cut_number(document, [values for _, columns, _ in sets for values in columns.values()])
    ignored = unused(table, [axis, *chosen.values()]) if "value" in chosen else ()
    turned = [
        (label, {name: values[turn] for name, values in columns.items()}, unit)
        for label, columns, unit in sets
    ]
    return [
        replace(_spectrum(document, table, wavelength[turn], columns, label, unit, notes), ignored=ignored)
        for label, columns, unit in turned
    ]


def _falls(wavelength_nm: Array) -> bool:
    """Does it go down throughout, as some programs write it?"""
    return len(wavelength_nm) > 1 and bool(np.all(np.diff(wavelength_nm) < 0))


def _other_axis(table: NumberBlock, axis: int) -> str:
    """What the column of wavelengths says it holds, where that is not wavelengths in nm; else ""."""
    said = table.names[axis], f"({table.units[axis]})", table.said("x")
    return next((text for text in said if _NO_NM.search(labels.folded(text))), "")


def _unit(table: NumberBlock, column: int) -> str:
    """The unit that a column of values states, or what the head says of all."""
    return units.of_column(table.names[column], table.units[column]) or units.of_column("", table.said("y"))


def unused(table: NumberBlock, used: Collection[int]) -> tuple[str, ...]:
    """Columns of a table that are not among those used."""
    return tuple(table.called(k) for k in range(len(table.names)) if k not in used)


def column_named(table: NumberBlock, name: str, meaning: str, problems: Problems) -> int:
    """Which column has this name, or this number from 1; a problem where none has."""
    plain = [labels.folded(known) for known in table.names]
    if labels.folded(name) in plain:
        return plain.index(labels.folded(name))
    if name.isdecimal() and 1 <= int(name) <= len(table.names):
        return int(name) - 1
    known = ", ".join(n for n in table.names if n) or f"1 to {len(table.names)}"
    problems.add(f"no column for {meaning}", found=name, rule=f"one of {known}", remedy="correct the name")
    return 0


def _across(
    document: Document, table: NumberBlock, across: dict[str, tuple[list[int], Array]], problems: Problems
) -> list[Spectrum]:
    out = []
    for name, (places, wavelength) in across.items():
        check_axis(wavelength, (), problems)
        columns = [table.column(k, problems) for k in places]
        out += [
            _spectrum(
                document, table, wavelength, {"value": np.array([c[row] for c in columns])}, name,
                units.of_column("", table.units[places[0]]), (),
            )
            for row in range(len(table.cells))
        ]  # fmt: skip
    problems.raise_any("not a usable file of columns")
    return out


def _spectrum(
    document: Document,
    table: NumberBlock,
    wavelength: Array,
    columns: Mapping[str, Array],
    label: str,
    unit: str,
    notes: tuple[Oddity, ...],
) -> Spectrum:
    header = table.header
    seconds, odd = labels.exposure_said(header)
    return Spectrum(
        source=document.where,
        format=NAME,
        wavelength_nm=wavelength,
        columns=columns,
        header={"title": document.title, **header},
        integration_time_s=seconds,
        processed_unit=unit,
        label=label,
        notes=(*notes, *odd),
    )
