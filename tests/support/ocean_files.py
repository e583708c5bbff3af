"""Files of Ocean Optics, made up after the facts of their formats, with one known spectrum."""

from __future__ import annotations

from instrument_files import COUNTS, DARK, WAVELENGTH

from lightfield.readings.instruments.formats import spectra_of
from lightfield.readings.instruments.oceanoptics import jaz, jaz_irradiance, oceanview, spectrasuite
from lightfield.readings.instruments.spectrum import Spectrum


def begin(what: str) -> str:
    return f">>>>>Begin {what} Data<<<<<"


def end(what: str) -> str:
    return f">>>>>End {what} Data<<<<<"


def rows(*columns) -> list[str]:
    return ["\t".join(f"{number:.3f}" for number in row) for row in zip(*columns, strict=True)]


def spectrasuite_lines() -> list[str]:
    return [
        "SpectraSuite Data File",
        "++++++++++++++++++++++++++++++++++++",
        "Date: Tue Mar 03 11:12:13 CET 2020",
        "User: someone",
        "Spectrometers: TEST1",
        "Integration Time (usec): 70000 (TEST1)",
        "Spectra Averaged: 15 (TEST1)",
        "Boxcar Smoothing: 5 (TEST1)",
        "Correct for Electrical Dark: No (TEST1)",
        "Correct for Detector Non-linearity: Yes (TEST1)",
        "Correct for Stray Light: No (TEST1)",
        f"Number of Pixels in Processed Spectrum: {len(WAVELENGTH)}",
        begin("Processed Spectral"),
        *rows(WAVELENGTH, COUNTS),
        end("Processed Spectral"),
    ]


def oceanview_lines() -> list[str]:
    return [
        "Data from test_001.txt Node",
        "",
        "Date: Tue Mar 03 11:12:13 CET 2020",
        "Spectrometer: TEST1",
        "Autoset integration time: false",
        "Integration Time (sec): 7.000000E-2",
        "Scans to average: 15",
        "Electric dark correction enabled: false",
        "Nonlinearity correction enabled: true",
        "Boxcar width: 5",
        "XAxis mode: Wavelengths",
        f"Number of Pixels in Spectrum: {len(WAVELENGTH)}",
        begin("Spectral"),
        *(f"{w / 100:.5f}E2\t{1000 * c:.1f}E-3" for w, c in zip(WAVELENGTH, COUNTS, strict=True)),
    ]


def jaz_lines(columns: str = "WDRSP") -> list[str]:
    parts = {"W": WAVELENGTH, "D": DARK, "R": 2 * COUNTS, "S": COUNTS, "P": 100 * (COUNTS - DARK) / 1000}
    head = [line.replace("SpectraSuite", "Jaz") for line in spectrasuite_lines()[:13]]
    return [*head, "\t".join(columns), *rows(*(parts[c] for c in columns)), end("Processed Spectral")]


def jaz_irradiance_lines() -> list[str]:
    lines = [line.replace("Jaz Data", "Jaz Absolute Irradiance") for line in jaz_lines("WDSP")]
    lines.insert(12, "Collection Area: 0.4")
    lines.insert(13, "Int. Sphere: No")
    return [
        *lines,
        begin("Calibration"),
        "[uJoule/count]",
        *(f"{1e-6 * w:.8e}" for w in WAVELENGTH),
        end("Calibration"),
    ]


FORMATS = {
    "SpectraSuite": (spectrasuite_lines, spectrasuite),
    "OceanView": (oceanview_lines, oceanview),
    "Jaz": (jaz_lines, jaz),
    "Jaz irradiance": (jaz_irradiance_lines, jaz_irradiance),
}


def parse(content: str | bytes) -> Spectrum:
    data = content if isinstance(content, bytes) else content.encode()
    return spectra_of(data, "test.txt")[0]


def text_of(name: str) -> str:
    return "\n".join(FORMATS[name][0]()) + "\n"
