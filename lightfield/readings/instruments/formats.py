"""Finds the reader of a file: the first that claims it. A new format is a module with `claims` and `read`."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from lightfield.errors import MeasurementError
from lightfield.readings.instruments import jaz, jaz_irradiance, oceanview, spectrasuite
from lightfield.readings.instruments.oceanoptics import take_apart
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.text import Text, read_text
from lightfield.storage.inputs import SPECTRUM

# The more particular first.
READERS: tuple[ModuleType, ...] = (jaz_irradiance, jaz, oceanview, spectrasuite)


def read_spectrum(path: str | Path) -> Spectrum:
    """Read a spectrometer file of any known format.

    Raises
    ------
    MeasurementError
        Unknown format, or all problems of the file with their lines.
    """
    return parse_spectrum(read_text(path, SPECTRUM), str(path))


def parse_spectrum(content: Text, where: str) -> Spectrum:
    """A spectrum from the lines of a file; see `read_spectrum`."""
    document = take_apart(content, where)
    for reader in READERS:
        if reader.claims(document):
            found: Spectrum = reader.read(document)
            return found
    raise MeasurementError(
        "not a spectrometer file that lightfield knows",
        where=where,
        found=document.title[:60],
        rule=f"one of {', '.join(reader.NAME for reader in READERS)}",
        remedy="export it as text from the instrument's program",
    )
