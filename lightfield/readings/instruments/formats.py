"""Finds the reader of a file: the first that claims it. A new format is a module with `claims` and `read`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType

from lightfield.errors import MeasurementError
from lightfield.readings.instruments import avantes, hyperocr, par, plain, ramses, seabass, unknown
from lightfield.readings.instruments.document import Document, take_apart
from lightfield.readings.instruments.oceanoptics import jaz, jaz_irradiance, oceanview, procspec, spectrasuite
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.text import decode
from lightfield.storage.inputs import SPECTRUM, read_bytes

#: Some programs pad names with zeros; of more than one in so many bytes a text is none.
_MOST_PADDING = 20
#: Readers of bytes: `claims(data)` and `read(data, where)`.
BINARY: tuple[ModuleType, ...] = (procspec, hyperocr)
#: Readers of text: `claims(document)` and `read(document)`, which raises MeasurementError with all problems
#: of the file and their lines. The more particular first.
READERS: tuple[ModuleType, ...] = (
    seabass, ramses, avantes, jaz_irradiance, jaz, oceanview, spectrasuite, par, plain,
)  # fmt: skip
#: These know their own files by words that nothing else has.
_OWN_WORDS = (seabass, ramses, avantes)
NAMES = tuple(reader.NAME for reader in (*READERS, *BINARY))


def read_spectra(path: str | Path, mapping: Mapping[str, str] | None = None) -> tuple[Spectrum, ...]:
    """All spectra of an instrument file of any known format.

    Parameters
    ----------
    path : path-like
    mapping : mapping of str to str, optional
        Which column is what, for files of plain columns: see `plain.MEANINGS`.

    Raises
    ------
    MeasurementError
        Unknown format, or all problems of the file with their lines.
    """
    return spectra_of(read_bytes(path, SPECTRUM), str(path), mapping)


def spectra_of(data: bytes, where: str, mapping: Mapping[str, str] | None = None) -> tuple[Spectrum, ...]:
    """The same of a file's bytes; `where` names them in errors."""
    for reader in BINARY:
        if not mapping and reader.claims(data):
            if reader is procspec and unknown_archive(data):
                break
            return _as_tuple(reader.read(data, where))
    try:
        content = decode(data, where)
    except MeasurementError as error:
        what, remedy = unknown.what_it_seems(data, where)
        if what:
            raise _refused(where, what, remedy) from error
        if data.count(0) * _MOST_PADDING > len(data):
            raise
        content = decode(data.replace(b"\0", b" "), where)
    document = take_apart(content, where)
    if mapping:
        return tuple(plain.read(document, mapping))
    return _text(document, data)


def unknown_archive(data: bytes) -> bool:
    """Is this zip archive an office document?"""
    return b"[Content_Types].xml" in data or b"mimetypeapplication/" in data[:80]


def _text(document: Document, data: bytes) -> tuple[Spectrum, ...]:
    what, remedy = unknown.what_it_seems(data, document.where)
    for reader in READERS:
        if what and reader not in _OWN_WORDS and not document.blocks:
            break  # it may have columns of numbers, but they are no spectrum
        if reader.claims(document):
            return _as_tuple(reader.read(document))
    raise _refused(document.where, what or document.title[:60], remedy)


def _as_tuple(found: Spectrum | list[Spectrum]) -> tuple[Spectrum, ...]:
    if isinstance(found, Spectrum):
        return (found,)
    if len(found) == 1:  # one alone needs no name
        return (replace(found[0], label=""),)
    return tuple(found)


def _refused(where: str, what: str, remedy: str) -> MeasurementError:
    return MeasurementError(
        "not a spectrometer file that lightfield knows",
        where=where,
        found=what,
        rule=f"one of {', '.join(NAMES)}",
        remedy=remedy or "export it as text, or say which of its columns hold wavelength and value",
    )
