"""TriOS RAMSES: text that MSDA XE exports, one `[Spectrum]` after the other, of which the calibrated."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

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
    for block in _blocks(document):
        if block.attributes.get("IDDataTypeSub1", "CALIBRATED").upper() != "CALIBRATED":
            raw += 1
            continue
        if not block.ended:
            problems.add("a spectrum has no end", rule="[END] of [Spectrum]", remedy=_REMEDY)
            continue
        found = _spectrum(document, block, problems)
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


@dataclass
class _Exported:
    """Attributes and numbered lines of data of a spectrum, and whether its end was met."""

    attributes: dict[str, str] = field(default_factory=dict)
    rows: list[tuple[int, str]] = field(default_factory=list)
    ended: bool = False


def _blocks(document: Document) -> list[_Exported]:
    blocks: list[_Exported] = []
    data = False
    for k, line in enumerate(document.lines, 1):
        word = line.strip().lower()
        if word == "[spectrum]":
            blocks.append(_Exported())
            data = False
        elif word in ("[data]", "[end] of [data]"):
            data = word == "[data]"
        elif not blocks or blocks[-1].ended:
            continue
        elif word == "[end] of [spectrum]":
            blocks[-1].ended = True
        elif data and word:
            blocks[-1].rows.append((k, line))
        elif "=" in line:
            label, _, value = line.partition("=")
            blocks[-1].attributes[label.strip()] = value.strip()
    return blocks


def _spectrum(document: Document, block: _Exported, problems: Problems) -> Spectrum | None:
    attributes, lines, pairs = block.attributes, [], []
    for k, line in block.rows:
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
        problems.add("a spectrum has no data", place=block.rows[0][0] if block.rows else None, remedy=_REMEDY)
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
