"""Plain columns: wavelength and values beside it, or a spectrum a row under wavelengths as names."""

from __future__ import annotations

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
    wavelength_column,
)
from lightfield.readings.instruments.oddity import Oddity
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "plain columns"
#: What a mapping may name.
MEANINGS = ("wavelength_nm", "value", "dark", "reference")


def claims(document: Document) -> bool:
    """Is there a block of numbers with wavelengths down or across?"""
    table = document.columns()
    if table is None:
        return False
    if table.across():
        return True
    problems = Problems(document.where)
    axis = table.column(wavelength_column(table), problems, whole=True)
    check_axis(axis, table.lines, problems)
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
    wavelength = table.column(axis, problems, whole=True)
    check_axis(wavelength, table.lines, problems)
    if "value" in chosen and len(chosen) > 1 + ("wavelength_nm" in chosen):
        named = {"signal" if m == "value" else m: k for m, k in chosen.items() if m != "wavelength_nm"}
        sets = [
            (
                "",
                {meaning: table.column(k, problems) for meaning, k in named.items()},
                table.units[chosen["value"]],
            )
        ]
    else:
        wanted = [chosen["value"]] if "value" in chosen else [k for k in range(len(table.names)) if k != axis]
        sets = [
            ("" if "value" in chosen else table.called(k),
             {"value": table.column(k, problems)}, table.units[k])
            for k in wanted
        ]  # fmt: skip
    problems.raise_any("not a usable file of columns")
    notes = without_cut_number(document, [values for _, columns, _ in sets for values in columns.values()])
    ignored = unused(table, [axis, *chosen.values()]) if "value" in chosen else ()
    return [
        replace(_spectrum(document, table, wavelength, columns, label, unit, notes), ignored=ignored)
        for label, columns, unit in sets
    ]


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
                table.units[places[0]], (),
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
        processed_unit=units.stated(unit),
        label=label,
        notes=(*notes, *odd),
    )
