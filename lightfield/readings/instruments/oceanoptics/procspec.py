"""ProcSpec: what SpectraSuite saves, XML in a zip archive: signal, dark, reference, processed."""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from datetime import datetime, timezone
from xml.etree import ElementTree

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import MeasurementError
from lightfield.readings import text
from lightfield.readings.instruments.number_block import check_axis
from lightfield.readings.instruments.oddity import Odd, Oddity
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems
from lightfield.storage.inputs import SPECTRUM

NAME = "ProcSpec"
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
_REMEDY = "open it in SpectraSuite, and save it again or as text"


def claims(data: bytes) -> bool:
    """Is this a zip archive?"""
    return data.startswith(b"PK\x03\x04")


def read(data: bytes, where: str) -> Spectrum:
    """Read it.

    Raises
    ------
    MeasurementError
        No archive of this kind; or all problems of the file.
    """
    root = _parse(_unpacked(data, where), where)
    problems = Problems(where)
    source = root.find("sourceSpectra")
    shot = None if source is None else next(iter(source), None)
    parts = {
        "signal": shot,
        "dark": _first(root, "darkSpectrum"),
        "reference": _first(root, "referenceSpectrum"),
        "processed": root,
    }
    columns = {
        name: _doubles(part, "processedPixels" if name == "processed" else "pixelValues", problems)
        for name, part in parts.items()
        if part is not None
    }
    columns = {name: values for name, values in columns.items() if len(values)}
    axis = _first(root, "channelWavelengths")
    wavelength = np.array([]) if axis is None else _numbers(axis, problems)
    if shot is None or "signal" not in columns or not len(wavelength):
        problems.add("there are no spectral data", rule="pixel values and wavelengths", remedy=_REMEDY)
        problems.raise_any(f"not a usable {NAME} file")
    for name, values in columns.items():
        if len(values) != len(wavelength):
            problems.add(
                f"{name} does not fit the wavelengths",
                found=f"{len(values)} pixels",
                rule=f"{len(wavelength)}",
                remedy=_REMEDY,
            )
    check_axis(wavelength, (), problems)
    problems.raise_any(f"not a usable {NAME} file")
    said = {e.tag: (e.text or "").strip() for e in (shot if shot is not None else ()) if not len(e)}
    exposure = text.number_or_nan(said.get("integrationTime", ""))
    moment = text.number_or_nan("" if shot is None else shot.findtext("acquisitionTime/milliTime", ""))
    return Spectrum(
        source=where,
        format=NAME,
        wavelength_nm=wavelength,
        columns=columns,
        header={"title": NAME, **said},
        integration_time_s=exposure / 1e6 if 0 < exposure < 1e12 else float("nan"),
        spectra_averaged=_count(said.get("scansToAverage", "")),
        boxcar=_count(said.get("boxcarWidth", "")),
        spectrometer=said.get("spectrometerSerialNumber", ""),
        date=_date(moment),
        electric_dark_corrected=_flag(said.get("correctForElectricalDark")),
        nonlinearity_corrected=_flag(said.get("correctForNonLinearity")),
        notes=(Oddity(Odd.CALLED_SATURATED),) if said.get("saturated") == "true" else (),
    )


def _unpacked(data: bytes, where: str) -> bytes:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            name = next((n for n in archive.namelist() if re.fullmatch(r"ps_\d+\.xml", n)), None)
            if name is None:
                raise MeasurementError(
                    "a zip archive without a spectrum",
                    where=where,
                    found=", ".join(archive.namelist()[:3]) or "nothing in it",
                    rule="ps_0.xml, as in a ProcSpec file",
                    remedy="unpack it, and name the files in it",
                )
            with archive.open(name) as file:
                content = file.read(SPECTRUM.most_bytes + 1)
    except (
        zipfile.BadZipFile,
        zlib.error,
        OSError,
        RuntimeError,
        NotImplementedError,
        EOFError,
        ValueError,
    ) as error:
        raise MeasurementError(
            "a damaged zip archive", where=where, found=str(error) or "an early end", remedy="copy it again"
        ) from error
    if len(content) > SPECTRUM.most_bytes:
        raise MeasurementError("too large for a spectrum when unpacked", where=where, remedy=_REMEDY)
    return content


def _parse(content: bytes, where: str) -> ElementTree.Element:
    # Names of users are not always in the encoding of the file, and entities could grow without end.
    words = _NOT_XML.sub("", re.sub(r"^\s*<\?xml[^>]*\?>", "", content.decode("utf-8", "replace")))
    try:
        if "<!" in words:
            raise ElementTree.ParseError("declarations do not belong into it")
        return ElementTree.fromstring(words)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise MeasurementError(
            f"not a usable {NAME} file", where=where, found=str(error), rule="whole XML", remedy=_REMEDY
        ) from error


def _first(root: ElementTree.Element, tag: str) -> ElementTree.Element | None:
    """The first of its name that is written out, not referred to."""
    return next((e for e in root.iter(tag) if "reference" not in e.attrib), None)


def _doubles(part: ElementTree.Element, tag: str, problems: Problems) -> Array:
    found = part.find(tag)
    if found is None:  # the values may lie one element deeper
        found = _first(part, tag)
    return np.array([]) if found is None else _numbers(found, problems)


def _numbers(element: ElementTree.Element, problems: Problems) -> Array:
    out = np.full(len(element), np.nan)
    for k, child in enumerate(element):
        cell = (child.text or "").strip()
        if text.NOT_A_NUMBER.fullmatch(cell):
            continue
        try:
            out[k] = text.parsed_number(cell)
        except ValueError as error:
            problems.add(f"{element.tag}: {cell!r:.40} {error}", remedy=_REMEDY)
    return out


def _count(cell: str) -> int | None:
    return int(cell) if re.fullmatch(r"\d{1,9}", cell, re.ASCII) else None


def _flag(cell: str | None) -> bool | None:
    return {"true": True, "false": False}.get(cell or "")


def _date(milliseconds: float) -> str:
    if not 0 < milliseconds < 1e14:
        return ""
    return datetime.fromtimestamp(int(milliseconds // 1000), timezone.utc).strftime("%Y-%m-%d %H:%M:%S UTC")
