"""A made-up measurement in instrument files, for the tests of the import.

The lamp gives a rate (counts per second) linear in wavelength, so that its mean over a band is its value in
the middle, exactly.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.errors import MeasurementError
from lightfield.readings import Readings
from lightfield.readings.importing.importer import import_index

WAVELENGTH = 450 + 0.37 * np.arange(400)  # to 597.6 nm; pixels fall on no edge of a band
DARK = 1100 + 20 * np.sin(WAVELENGTH / 7)
BAND = (500.0, 550.0)


def rate(wavelength, level=1.0):
    return level * (20000 + 150 * (np.asarray(wavelength) - 450))


def oceanview(
    path: Path, counts, exposure_s=0.05, date="Tue Mar 03 11:12:13 CET 2020", nonlinearity="true", more=()
):
    lines = [
        "Data from x Node",
        f"Date: {date}",
        "Spectrometer: TEST1",
        f"Integration Time (sec): {exposure_s:.6E}",
        "Boxcar width: 0",
        f"Nonlinearity correction enabled: {nonlinearity}",
        *more,
        f"Number of Pixels in Spectrum: {len(WAVELENGTH)}",
        ">>>>>Begin Spectral Data<<<<<",
        *(f"{w:.6f}\t{c:.6f}" for w, c in zip(WAVELENGTH, counts, strict=True)),
    ]
    path.write_text("\n".join(lines) + "\n")


def jaz(path: Path, dark, signal, exposure_s=0.05):
    lines = [
        "Jaz Data File",
        f"Integration Time (usec): {1e6 * exposure_s:.0f} (J)",
        ">>>>>Begin Processed Spectral Data<<<<<",
        "W\tD\tS",
        *(f"{w:.6f}\t{d:.6f}\t{s:.6f}" for w, d, s in zip(WAVELENGTH, dark, signal, strict=True)),
        ">>>>>End Processed Spectral Data<<<<<",
    ]
    path.write_text("\n".join(lines) + "\n")


def write_index(folder: Path, rows: list[str], names="file,z_m,x_m,time_s,role") -> Path:
    path = folder / "index.csv"
    path.write_text("\n".join([names, *rows]) + "\n")
    return path


def run(folder: Path, rows: list[str], names="file,z_m,x_m,time_s,role", **options) -> Readings:
    asked = {"quantity": "irradiance", "units": "counts", "bands_nm": [BAND], **options}
    return import_index(write_index(folder, rows, names), **asked)


def problems(folder: Path, rows: list[str], names="file,z_m,x_m,time_s,role", **options) -> list[str]:
    with pytest.raises(MeasurementError) as caught:
        run(folder, rows, names, **options)
    return [*map(str, caught.value.problems)]


def codes(readings: Readings) -> set[str]:
    return {warning.code for warning in readings.warnings}


ROWS = ["a.txt,4.5,0,0,signal", "b.txt,5.5,0.1,60,signal", "dark_a.txt,,,10,dark", "dark_b.txt,,,70,dark"]


def two_exposures(folder: Path) -> Path:
    """Two exposures with a dark spectrum each, and one at which no light was read."""
    for name, exposure, level in (("a", 0.05, 1.0), ("b", 0.2, 0.3)):
        oceanview(
            folder / f"{name}.txt", DARK * (1 + exposure) + exposure * rate(WAVELENGTH, level), exposure
        )
        oceanview(folder / f"dark_{name}.txt", DARK * (1 + exposure), exposure)
    return folder
