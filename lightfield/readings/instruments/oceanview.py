"""OceanView: `Data from ... Node`, wavelength and one value; unit and often end are not in the file."""

from __future__ import annotations

import re

from lightfield.readings.instruments.oceanoptics import Document, spectrum
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "OceanView"


def claims(document: Document) -> bool:
    """Is this an OceanView file?"""
    named = re.match(r"data from .* node", document.title.lower())
    return bool(named) or (document.block("spectr") is not None and document.block("processed") is None)


def read(document: Document) -> Spectrum:
    """Read it.

    Raises
    ------
    MeasurementError
        All problems of the file, with their lines.
    """
    block = document.block("spectr") or next(iter(document.blocks), None)
    return spectrum(document, NAME, block, ["value"], Problems(document.where))
