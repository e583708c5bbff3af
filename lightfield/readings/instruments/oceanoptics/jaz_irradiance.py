"""Jaz irradiance: `Jaz Absolute Irradiance File`, columns W D S P and a calibration block.

P is the spectral irradiance in uW cm^-2 nm^-1: (S - D) calibration / (exposure x area x width of a pixel);
the calibration is in uJ per count, the collection area in cm^2.
"""

from __future__ import annotations

import re
from dataclasses import replace

from lightfield.readings.instruments.document import Document, block_numbers
from lightfield.readings.instruments.oceanoptics import jaz
from lightfield.readings.instruments.oddity import Odd, Oddity
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "Jaz irradiance"
_UNIT = "uW cm^-2 nm^-1"


def claims(document: Document) -> bool:
    """Is this a Jaz file of absolute irradiance?"""
    title = document.title.lower()
    return jaz.claims(document) and ("irradiance" in title or document.block("calibration") is not None)


def read(document: Document) -> Spectrum:
    """Read it."""
    problems = Problems(document.where)
    found = jaz.read_lettered(document, NAME, problems)
    sphere = next((v for k, v in document.header.items() if "sphere" in k.lower()), "No")
    # With an integrating sphere the program gives power, not irradiance.
    unit = _UNIT if sphere.strip().lower() == "no" else ""
    notes = found.notes if unit else (*found.notes, Oddity(Odd.SPHERE))
    block = document.block("calibration")
    if block is None or not block.lines:
        return replace(found, processed_unit=unit, notes=(*notes, Oddity(Odd.NO_CALIBRATION)))
    has_unit = re.fullmatch(r"\[.*\]", block.lines[0][1])
    rows = replace(block, lines=block.lines[1:] if has_unit else block.lines)
    calibration = block_numbers(rows, 1, problems)[:, 0]
    if len(calibration) != len(found) and not problems:
        problems.add(
            "the calibration does not fit the spectrum",
            found=f"{len(calibration)} numbers",
            rule=f"{len(found)}, one for each pixel",
            remedy="copy or export it again",
        )
    problems.raise_any(f"not a usable {NAME} file")
    return replace(found, calibration=calibration, processed_unit=unit, notes=notes)
