"""SpectraSuite: `SpectraSuite Data File`, wavelength and one processed value; its unit is not in the file."""

from __future__ import annotations

from lightfield.readings.instruments.document import Document, spectrum
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "SpectraSuite"


def claims(document: Document) -> bool:
    """Is this a SpectraSuite file?"""
    return "spectrasuite" in document.title.lower() or document.block("processed", "spectr") is not None


def read(document: Document) -> Spectrum:
    """Read it."""
    block = document.numbers
    return spectrum(document, NAME, block, ["value"], Problems(document.where))
