"""TriOS RAMSES: text that MSDA XE exports, one `[Spectrum]` after the other, of which the calibrated."""

from __future__ import annotations

import re

import numpy as np

from lightfield.readings import text, units
from lightfield.readings.instruments.document import Document
from lightfield.readings.instruments.number_block import check_axis
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "TriOS RAMSES"
#: In the exports units are codes and words: "$05 $00 Intensity", "$04 $06 mW/(m^2 nm Sr)".
_CODE = re.compile(r"^(\$\w+\s*)*")
_REMEDY = "export it again from MSDA XE, as CALIBRATED"


def claims(document: Document) -> bool:
    """Is this an export of MSDA XE?"""
    return any(line.strip().lower() == "[spectrum]" for line in document.lines[:40])


def read(document: Document) -> list[Spectrum]:
    """The calibrated spectra of an export, in its order; those of one device have its name as their label."""
    problems = Problems(document.where)
    spectra, raw = [], 0
    for attributes, rows, whole in _blocks(document):
        if attributes.get("IDDataTypeSub1", "CALIBRATED").upper() != "CALIBRATED":
            raw += 1
            continue
        if not whole:
            problems.add("a spectrum has no end", rule="[END] of [Spectrum]", remedy=_REMEDY)
            continue
        found = _spectrum(document, attributes, rows, problems)
        spectra += [found] if found is not None else []
    if not spectra and not problems:
        problems.add(
            "no calibrated spectrum in it",
            found=f"{raw} raw ones" if raw else "none at all",
            rule="raw ones count by pixel and have no wavelengths",
            remedy=_REMEDY,
        )
    problems.raise_any(f"not a usable {NAME} file")
    return spectra


def _blocks(document: Document) -> list[tuple[dict[str, str], list[tuple[int, str]], bool]]:
    """Attributes and lines of data of each spectrum, and whether it has its end."""
    out: list[tuple[dict[str, str], list[tuple[int, str]], bool]] = []
    attributes: dict[str, str] = {}
    rows: list[tuple[int, str]] = []
    inside, data = False, False
    for k, line in enumerate(document.lines, 1):
        word = line.strip().lower()
        if word == "[spectrum]":
            if inside:
                out.append((attributes, rows, False))
            attributes, rows, inside, data = {}, [], True, False
        elif word == "[end] of [spectrum]":
            if inside:
                out.append((attributes, rows, True))
            inside = False
        elif word in ("[data]", "[end] of [data]"):
            data = word == "[data]"
        elif inside and data and word:
            rows.append((k, line))
        elif inside and "=" in line:
            label, _, value = line.partition("=")
            attributes[label.strip()] = value.strip()
    if inside:
        out.append((attributes, rows, False))
    return out


def _spectrum(
    document: Document, attributes: dict[str, str], rows: list[tuple[int, str]], problems: Problems
) -> Spectrum | None:
    lines, pairs = [], []
    for k, line in rows:
        cells = line.split()
        if cells and re.fullmatch(r"0([.,]0*)?", cells[0]):
            continue  # the first line counts the exposure and nothing else
        try:
            pairs.append([_number(cell) for cell in cells[:2]])
        except ValueError as error:
            problems.add(f"{line.strip()!r:.40} {error}", place=k, remedy=_REMEDY)
            continue
        lines.append(k)
        if len(pairs[-1]) < 2:
            problems.add(
                "the line has no value", place=k, rule="wavelength, value, error, status", remedy=_REMEDY
            )
            return None
    if len(pairs) < 2:
        problems.add("a spectrum has no data", place=rows[0][0] if rows else None, remedy=_REMEDY)
        return None
    table = np.array(pairs)
    before = len(problems.found)
    check_axis(table[:, 0], lines, problems)
    if len(problems.found) > before:
        return None
    exposure = re.match(r"\d+(\.\d+)?", attributes.get("IntegrationTime", ""))
    seconds = float(exposure[0]) / 1e3 if exposure else float("nan")
    return Spectrum(
        source=document.where,
        format=NAME,
        wavelength_nm=table[:, 0],
        columns={"value": table[:, 1]},
        header={"title": NAME, **attributes},
        integration_time_s=seconds if seconds > 0 else float("nan"),
        spectrometer=attributes.get("IDDevice", ""),
        date=attributes.get("DateTime", ""),
        processed_unit=units.stated(_CODE.sub("", attributes.get("Unit2", ""))),
        label=attributes.get("IDDevice", ""),
    )


def _number(cell: str) -> float:
    return (
        float("nan")
        if text.NOT_A_NUMBER.fullmatch(cell)
        else text.parsed_number(cell, "," if "," in cell else ".")
    )
