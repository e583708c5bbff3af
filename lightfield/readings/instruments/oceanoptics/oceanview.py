"""OceanView: `Data from ... Node`, wavelength and one value; unit and often end are not in the file."""

from __future__ import annotations

import re

from lightfield.readings.instruments.document import Document, spectrum
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "OceanView"


def claims(document: Document) -> bool:
    """Is this an OceanView file?"""
    named = re.match(r"data from .* node", document.title.lower())
    if named or "spectrasuite" in document.title.lower():
        return bool(named)
    return bool(document.blocks) and document.block("processed", "spectr") is None


def read(document: Document) -> Spectrum:
    """Read it."""
    block = document.numbers
    return spectrum(document, NAME, block, ["value"], Problems(document.where))
