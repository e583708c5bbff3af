"""Avantes: text that AvaSoft 6 to 8 exports (.ttt, .trt, .txt, .csv), one to four columns of it."""

from __future__ import annotations

import re

from lightfield.arrays import Array
from lightfield.readings.instruments import labels
from lightfield.readings.instruments.document import Document, without_cut_number
from lightfield.readings.instruments.number_block import check_axis, header_of, wavelength_column
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "Avantes"
_UNUSABLE = f"not a usable {NAME} file"
_SAID = re.compile(
    r"data measured with spectrometer|filename-->|nr of pixels used for smoothing|averaging nr\."
)
#: What the columns hold, by the first letters of their names; the rest is what the program made of them.
_HOLDS = {
    "refl": "processed",
    "dark": "dark",
    "dunkel": "dark",
    "ref": "reference",
    "white": "reference",
    "weiss": "reference",
    "sample": "signal",
    "probe": "signal",
    "scope": "signal",
}


def claims(document: Document) -> bool:
    """Is this an AvaSoft file?"""
    return any(_SAID.search(line.lower()) for line in document.lines[:12])


def read(document: Document) -> Spectrum:
    """Read it."""
    problems = Problems(document.where)
    table = document.columns(problems)
    if table is None:
        rule, remedy = "lines of numbers", "export it again"
        problems.refuse(_UNUSABLE, "there are no spectral data", rule=rule, remedy=remedy)
    axis = wavelength_column(table)
    wavelength = table.column(axis, problems, whole=True)
    check_axis(wavelength, table.lines, problems)
    columns: dict[str, Array] = {}
    ignored: list[str] = []
    for k, name in enumerate(table.names):
        if k != axis:
            words = labels.folded(name)
            holds = next(
                (meaning for start, meaning in _HOLDS.items() if words.startswith(start)), "processed"
            )
            if holds in columns and holds != "processed":
                ignored.append(table.called(k))
            columns.setdefault(holds, table.column(k, problems))
    if set(columns) == {"processed"}:
        columns = {"value": columns["processed"]}
    elif "signal" not in columns:
        problems.add(
            "no column of the sample", found=", ".join(table.names), remedy="export it with the counts"
        )
    problems.raise_any(_UNUSABLE)
    notes = without_cut_number(document, columns.values())
    header = header_of(document.lines[: table.lines[0] - 1])
    exposure = _after(header, r"int(egration|\.) ?time.*")
    unit = {"ms": 1e-3, "us": 1e-6, "s": 1.0}.get(_unit(*exposure), 1e-3) if exposure else 1.0
    seconds = unit * _number(exposure[1]) if exposure else float("nan")
    named = _after(header, r"data measured with spectrometer.*")
    averaged, smoothed = _after(header, r"(averag|nrofaverages).*"), _after(header, r".*smoothing.*")
    return Spectrum(
        source=document.where,
        format=NAME,
        wavelength_nm=wavelength,
        columns=columns,
        header={"title": document.title, **header},
        integration_time_s=seconds if 0 < seconds < 1e5 else float("nan"),
        spectra_averaged=_whole(averaged),
        boxcar=_whole(smoothed),
        spectrometer=named[1] if named else "",
        notes=notes,
        ignored=tuple(ignored),
    )


def _after(header: dict[str, str], pattern: str) -> tuple[str, str] | None:
    found = next(((k, v) for k, v in header.items() if re.fullmatch(pattern, labels.folded(k))), None)
    return found and (found[0], re.sub(r"^[->,;\s]*", "", found[1]))


def _unit(label: str, said: str) -> str:
    match = re.search(r"[\[(](\w+)[\])]", label) or re.search(r"\d\s*(ms|us|s)\b", said)
    return match[1].lower() if match else ""


def _number(said: str) -> float:
    match = re.match(r"\d+([.,]\d+)?", said)
    return float(match[0].replace(",", ".")) if match else float("nan")


def _whole(said: tuple[str, str] | None) -> int | None:
    match = re.match(r"\d{1,9}", said[1]) if said else None
    return int(match[0]) if match else None
