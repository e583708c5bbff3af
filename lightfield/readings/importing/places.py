"""A table of one's own that has the places in it: a column for z, and values or a spectrum in each row."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import MeasurementError
from lightfield.readings.columns import MEDIA
from lightfield.readings.importing.index import ROLES, IndexLine
from lightfield.readings.importing.reduction import Shot
from lightfield.readings.instruments import plain
from lightfield.readings.instruments.number_block import NumberBlock, check_axis, find_table
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.load_warning import LoadWarning, Remarks
from lightfield.readings.problems import Problems
from lightfield.readings.text import read_text
from lightfield.readings.units import of_column
from lightfield.storage.inputs import READINGS

_PLACES = ("z_m", "x_m", "y_m", "time_s", "integration_time_s")
MEANINGS = (*_PLACES, "value", "stderr", "medium", "role")
#: Where they are columns, no reading lacks them.
_NEEDED = ("z_m", "x_m", "y_m", "value")
NAME = "table of places"
UNUSABLE = "not a usable table"
#: Units that a name may have in brackets, or behind an underscore, in metres and in seconds.
_FACTORS = {
    "m": {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048},
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
}


def read_places(
    where: str, columns: Mapping[str, str], bands_nm: Sequence[tuple[float, float]], problems: Problems
) -> tuple[list[Shot], list[LoadWarning]]:
    """One shot for each row: its place, and its value for the band, or its spectrum (wavelengths as names).

    And a warning of each column whose name does not say its unit.

    Parameters
    ----------
    where : str
        Path of the table.
    columns : mapping of str to str
        Which column is what, all of MEANINGS, by its name or number from 1. Lengths and times are in the
        unit that the name has in brackets ("depth (cm)") or behind an underscore, else in m and s.
    bands_nm : sequence of (float, float), nm
        The value, where one is named, is that of the only band.

    Raises
    ------
    MeasurementError
        The file cannot be read, or holds no table.
    """
    table = find_table(read_text(where, READINGS).lines, problems)
    if table is None:
        raise MeasurementError(
            "no table of numbers", where=where, rule="names of columns, and two rows or more below them",
            remedy="export it as CSV",
        )  # fmt: skip
    at = {m: plain.column_named(table, name, m, problems) for m, name in columns.items()}
    problems.raise_any(UNUSABLE)
    units = {m: _unit(table, m, at[m], problems) for m in _PLACES if m in at}
    numbers = {m: table.column(at[m], problems) * _factors(m).get(unit, 1.0) for m, unit in units.items()}
    value = table.column(at["value"], problems) if "value" in at else None
    errors = _errors(table, at, value, problems)
    if value is not None:
        unit = of_column(table.names[at["value"]], table.units[at["value"]])
        spectra = _one_band(where, value, unit, bands_nm, problems)
        ignored = plain.unused(table, at.values())
    else:
        spectra = _spectra(where, table, problems)
        spectral = (k for places, _ in table.across().values() for k in places)
        ignored = plain.unused(table, [*at.values(), *spectral])
    shots = []
    for k in range(len(table.cells)):
        entry = _entry(where, table, k, at, {m: float(values[k]) for m, values in numbers.items()})
        _check(entry, table, k, at, problems)
        if entry.role != "ignore" and k < len(spectra):
            spectrum = replace(spectra[k], ignored=ignored)
            shots.append(Shot(entry, spectrum, entry.integration_time_s, entry.time_s, float(errors[k])))
    taken = [
        LoadWarning(
            Remarks.UNIT_TAKEN, {"column": table.called(at[m]), "meaning": m, "unit": m.rpartition("_")[2]}
        )
        for m, unit in units.items()
        if unit not in _factors(m)
    ]
    return shots, taken


def _errors(table: NumberBlock, at: Mapping[str, int], value: Array | None, problems: Problems) -> Array:
    """Standard errors of the values, in their unit; NaN where none are stated."""
    if "stderr" not in at:
        return np.full(len(table.cells), np.nan)
    if value is None:
        problems.add(
            "errors of no value",
            found="stderr",
            rule="one value and its stderr",
            remedy="say which column is the value",
        )
    errors = table.column(at["stderr"], problems)
    return errors if value is None or table.units[at["stderr"]] != "%" else 0.01 * errors * np.abs(value)


def _entry(
    where: str, table: NumberBlock, row: int, at: Mapping[str, int], given: Mapping[str, float]
) -> IndexLine:
    """What an index would say of a row, whose numbers are given."""
    words = {m: table.cells[row][at[m]].lower() for m in ("medium", "role") if m in at}
    return IndexLine(
        line=table.lines[row],
        file=f"row {row + 1}",
        path=Path(where),
        medium=words.get("medium") or "water",
        role=words.get("role") or "signal",
        x_m=given.get("x_m", 0.0),
        y_m=given.get("y_m", 0.0),
        z_m=given["z_m"],
        time_s=given.get("time_s", float("nan")),
        integration_time_s=given.get("integration_time_s", float("nan")),
    )


def _check(entry: IndexLine, table: NumberBlock, row: int, at: Mapping[str, int], problems: Problems) -> None:
    if entry.medium not in MEDIA:
        problems.add("unknown medium", place=entry.line, found=entry.medium, rule=" or ".join(MEDIA))
    if entry.role not in ROLES:
        problems.add("unknown role", place=entry.line, found=entry.role, rule=", ".join(ROLES))
    if entry.role not in ("signal", "reference"):
        return
    for m in _NEEDED:
        if m in at and table.is_blank(row, at[m]):
            problems.add(f"{table.called(at[m])} is missing", place=entry.line, rule=f"{m} of every reading")
    if entry.z_m <= 0:
        problems.add("z_m is an impossible position", place=entry.line, found=entry.z_m, rule="z_m > 0")


def _factors(meaning: str) -> Mapping[str, float]:
    return _FACTORS[meaning.rpartition("_")[2]]


def _unit(table: NumberBlock, meaning: str, index: int, problems: Problems) -> str:
    """The unit in the name of a column of lengths or times; "" where it has none that is known."""
    name, known = table.names[index], _factors(meaning)
    said = (table.units[index] or (m[1] if (m := re.search(r"_([a-z]+)$", name)) else "")).strip().lower()
    if said not in known and table.units[index]:
        problems.add(
            f"unknown unit of {meaning}", found=said, rule=", ".join(known), remedy="rename the column"
        )
    return said if said in known else ""


def _one_band(
    where: str, value: Array, unit: str, bands_nm: Sequence[tuple[float, float]], problems: Problems
) -> list[Spectrum]:
    """The value of each row as a spectrum that is the same all over the only band."""
    if len(bands_nm) != 1:
        problems.add(
            "one value for several bands",
            found=f"{len(bands_nm)} bands",
            rule="one band for a column of values",
        )
    low, high = bands_nm[0]
    return [
        Spectrum(
            source=where,
            format=NAME,
            wavelength_nm=np.array([low, high]),
            columns={"value": np.full(2, each)},
            header={"title": NAME},
            processed_unit=unit,
            band_nm=(low, high),
        )
        for each in value
    ]


def _spectra(where: str, table: NumberBlock, problems: Problems) -> list[Spectrum]:
    across = table.across()
    if not across:
        problems.add(
            "no values",
            found=", ".join(table.names[:8]),
            rule="a column for value, or three and more named by wavelengths, as 525 or Ed525.0",
            remedy="say which column is the value",
        )
        return []
    if len(across) > 1:
        problems.add(
            "several spectra in each row",
            found=", ".join(across),
            rule="one",
            remedy="leave one in the table",
        )
    places, wavelength = next(iter(across.values()))
    check_axis(wavelength, (), problems)
    values = np.array([table.column(k, problems) for k in places])  # [n_wavelengths, n_rows]
    return [
        Spectrum(
            source=where, format=NAME, wavelength_nm=wavelength, columns={"value": values[:, k]},
            header={"title": NAME},
        )
        for k in range(values.shape[1])
    ]  # fmt: skip
