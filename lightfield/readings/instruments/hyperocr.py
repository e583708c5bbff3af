"""Satlantic HyperOCR and other hyperspectral heads: binary frames (.raw), the calibration (.cal) beside them.

A calibration file lists the fields of a frame in their order: `type id 'units' bytes kind lines fit`, each
followed by its coefficients. Pixels have the fit OPTIC3, value = a1 (counts - a0) cint / exposure, times the
immersion coefficient in water (Satlantic, Instrument File Format, SAT-DN-00134). pySatlantic reads the same.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.errors import MeasurementError
from lightfield.readings import text, units
from lightfield.readings.instruments.number_block import check_axis
from lightfield.readings.instruments.oddity import Odd, Oddity
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems
from lightfield.storage.inputs import CALIBRATION

NAME = "Satlantic HyperOCR"
_HEADER = re.compile(rb"SAT[A-Z]{3}\d{4}")
_FIELD = re.compile(r"(\S+)\s+(\S+|'')\s+'([^']*)'\s+(\w+)\s+(\w+)\s+(\d+)\s+(\w+)")
#: SatView appends three bytes of day (yyyyddd) and four of time (hhmmssmmm) to each frame.
_STAMP = 7
_UNUSABLE = "not a usable Satlantic calibration"


@dataclass(frozen=True)
class Calibration:
    """The frame of one instrument: where its pixels are, and what their counts mean."""

    header: bytes
    length: int
    exposure_at: tuple[int, int]
    exposure_per_count: float
    checked_at: int | None
    pixels_at: NDArray[np.int64]
    wavelength_nm: Array
    coefficients: Array
    unit: str


def claims(data: bytes) -> bool:
    """Are there frames of a Satlantic instrument among binary numbers?"""
    return b"\x00" in data and _HEADER.search(data) is not None


def read(data: bytes, where: str) -> list[Spectrum]:
    """The spectra of a file in its order; the instrument is their label (SATHSE: light, SATHED: dark).

    Raises
    ------
    MeasurementError
        No calibration file for any of its instruments in its folder; a calibration file that cannot be read.
    """
    folder = Path(where).parent
    calibrations = {}
    for path in sorted(p for p in folder.glob("*.[cC][aA][lL]") if p.is_file()):
        found = read_calibration(path)
        if found is not None:
            calibrations[found.header] = found
    inside = sorted({match[0] for match in _HEADER.finditer(data)})
    known = [header for header in inside if header in calibrations]
    if not known:
        raise MeasurementError(
            "no calibration for these frames",
            where=where,
            found=", ".join(header.decode() for header in inside[:5]),
            rule="the .cal file of the instrument lies beside the .raw file",
            remedy=f"copy it into {folder or '.'}",
        )
    spectra = []
    for header in known:
        spectra += _decoded(data, calibrations[header], where)
    if not spectra:
        raise MeasurementError("no whole frame in it", where=where, remedy="copy or record it again")
    return spectra


def read_calibration(path: Path) -> Calibration | None:
    """The calibration of a hyperspectral head; None where the file is another instrument's.

    Raises
    ------
    MeasurementError
        It is one, and wrong; the message says in which line.
    """
    content, problems = text.read_text(path, CALIBRATION), Problems(str(path))
    lines = [(k, line.strip()) for k, line in enumerate(content.lines, 1)]
    fields = _fields([(k, line) for k, line in lines if line and not line.startswith("#")], problems)
    if fields is None:
        return None
    named = {field.kind: field for field in fields}
    head, serial, exposure = (named.get(kind) for kind in ("INSTRUMENT", "SN", "INTTIME"))
    pixels = [field for field in fields if field.fit == "OPTIC3"]
    for field in pixels:
        if not field.has("BU", 4) or field.width != 2:
            problems.add(
                "not a pixel of two bytes with four coefficients", place=field.line, found=field.words
            )
    if head is None or serial is None or exposure is None or not head.tag.startswith("SAT"):
        return None
    if not pixels or not exposure.has("BU", 2):
        return None
    wavelengths = [_numbers(field.line, field.tag, problems) for field in pixels]
    problems.raise_any(_UNUSABLE)
    table = np.array([[*nm, *field.numbers[0]] for nm, field in zip(wavelengths, pixels, strict=True)])
    check_axis(table[:, 0], (), problems)
    problems.raise_any(_UNUSABLE)
    return Calibration(
        header=f"{head.tag}{serial.tag}".encode(),
        length=fields[-1].place + fields[-1].width,
        exposure_at=(exposure.place, exposure.width),
        exposure_per_count=exposure.numbers[0][1],
        checked_at=named["CHECK"].place if "CHECK" in named else None,
        pixels_at=np.array([field.place for field in pixels]),
        wavelength_nm=table[:, 0],
        coefficients=table[:, 1:],
        unit=pixels[-1].unit,
    )


class _FrameField(NamedTuple):
    """A field of a frame: its line in the calibration, its first byte and how many, and its coefficients."""

    line: int
    words: str
    kind: str
    tag: str
    unit: str
    place: int
    width: int
    form: str
    fit: str
    numbers: list[list[float]]

    def has(self, form: str, coefficients: int) -> bool:
        """Is it written in this form, with so many coefficients in its first line?"""
        return self.form == form and bool(self.numbers) and len(self.numbers[0]) == coefficients


def _fields(lines: Sequence[tuple[int, str]], problems: Problems) -> list[_FrameField] | None:
    """The fields that a calibration lists; None where frames vary in length, or it is none of this kind."""
    found: list[_FrameField] = []
    at = place = 0
    while at < len(lines):
        line, words = lines[at]
        match = _FIELD.fullmatch(words)
        if match is None or not match[4].isdecimal():
            return None
        kind, tag, unit, width, form, coefficients, fit = match.groups()
        below = lines[at + 1 : at + 1 + int(coefficients)]
        numbers = [_numbers(k, cells, problems) for k, cells in below]
        found.append(_FrameField(line, words, kind, tag, unit, place, int(width), form, fit, numbers))
        place += int(width)
        at += 1 + int(coefficients)
    return found


def _numbers(line: int, words: str, problems: Problems) -> list[float]:
    out = []
    for word in words.split():
        try:
            out.append(text.parsed_number(word))
        except ValueError as error:
            problems.add(f"{word!r:.40} {error}", place=line, remedy="copy the calibration again")
            out.append(float("nan"))
    return out


def _decoded(data: bytes, calibration: Calibration, where: str) -> list[Spectrum]:
    starts = [m.start() for m in re.finditer(re.escape(calibration.header), data)]
    frames, stamps, damaged = [], [], 0
    for start in starts:
        end = start + calibration.length
        frame = data[start:end]
        if len(frame) < calibration.length:
            damaged += 1
        elif calibration.checked_at is not None and sum(frame[: calibration.checked_at + 1]) % 256:
            damaged += 1  # the sum of all bytes up to the check is a multiple of 256
        else:
            frames.append(frame)
            stamps.append(_stamp(data[end : end + _STAMP]))
    if not frames:
        return []
    table = np.frombuffer(b"".join(frames), np.uint8).reshape(len(frames), calibration.length).astype(int)
    at, width = calibration.exposure_at
    ticks = sum(table[:, at + k] << (8 * (width - 1 - k)) for k in range(width))
    exposure = np.asarray(ticks * calibration.exposure_per_count, dtype=float)
    counts = (
        256 * table[:, calibration.pixels_at] + table[:, calibration.pixels_at + 1]
    )  # [n_frames, n_pixels]
    a0, a1, immersion, full = calibration.coefficients.T
    notes = (Oddity(Odd.DAMAGED_FRAMES, damaged),) if damaged else ()
    with np.errstate(divide="ignore", invalid="ignore"):
        values = np.where(exposure[:, None] > 0, a1 * (counts - a0) * full / exposure[:, None], np.nan)
    label = calibration.header.decode()
    return [
        Spectrum(
            source=where,
            format=NAME,
            wavelength_nm=calibration.wavelength_nm,
            columns={"value": values[k]},
            header={"title": NAME, "instrument": label, "unit": calibration.unit},
            integration_time_s=float(exposure[k]) if exposure[k] > 0 else float("nan"),
            spectrometer=label[3:] if label[3:5] != "HS" else label[5:],
            date=stamps[k],
            processed_unit=units.stated(calibration.unit),
            label=label,
            immersion=immersion,
            notes=notes,
        )
        for k in range(len(frames))
    ]


def _stamp(tail: bytes) -> str:
    """Day and time of a frame; "" where none follow it."""
    if len(tail) < _STAMP or tail.startswith(b"SAT"):
        return ""
    day, clock = int.from_bytes(tail[:3], "big"), int.from_bytes(tail[3:], "big")
    hours, minutes, seconds = clock // 10_000_000, clock // 100_000 % 100, clock // 1000 % 100
    year, of_year = divmod(day, 1000)
    if not (1990 <= year < 2100 and 1 <= of_year <= 366 and hours < 24 and minutes < 60 and seconds < 60):
        return ""
    when = datetime.combine(date(year, 1, 1), datetime.min.time()) + timedelta(
        days=of_year - 1, hours=hours, minutes=minutes, seconds=seconds
    )
    return when.strftime("%Y-%m-%d %H:%M:%S UTC")
