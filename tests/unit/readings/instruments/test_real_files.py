"""Real spectrometer files, where they are at hand: every reader, and the way to readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from campaign import run

from lightfield.readings.instruments import labels
from lightfield.readings.instruments.formats import read_spectra


@pytest.fixture(scope="module")
def real(reference: Path) -> Path:
    folder = reference / "reference" / "spectrometer"
    folder = folder if folder.is_dir() else reference / "spectrometer"
    if not folder.is_dir():
        pytest.skip(f"no real spectrometer files at {folder}")
    return folder


# Read off with a text editor: pixels, first and last wavelength, exposure, average, boxcar, first value.
REAL = {
    "OO_comma.txt": ("SpectraSuite", 2048, 178.23, 884.34, 0.07, 15, 5, 401.471),
    "OOusb4000.txt": ("SpectraSuite", 3648, 178.65, 888.37, 0.02, 50, 30, 0.0),
    "OceanView.txt": ("OceanView", 2389, 187.92, 2116.5, 0.02, 10, 10, 18.995),
    "OceanView_halogen_HR.txt": ("OceanView", 2048, 187.836, 1101.758, 0.0273, 10, 0, 3.68),
    "jazspec.jaz": ("Jaz", 2048, 190.8535, 886.439331, 0.024, 1, 0, 0.0),
    "irrad.JazIrrad": ("Jaz irradiance", 2048, 191.016296, 891.915466, 0.495, 3, 5, 0.0),
}


@pytest.mark.parametrize("name", REAL)
def test_real_files(real, name):
    spectrum = read_spectra(real / name)[0]
    first, last = spectrum.wavelength_nm[[0, -1]]
    found = (
        len(spectrum),
        first,
        last,
        spectrum.integration_time_s,
        spectrum.spectra_averaged,
        spectrum.boxcar,
    )
    assert spectrum.format == REAL[name][0]
    assert (*found, spectrum.raw[0]) == pytest.approx(REAL[name][1:], rel=1e-12)
    assert labels.moment(spectrum.date) is not None


def test_irradiance_of_the_real_jaz_file_follows_from_its_counts_and_calibration(real):
    """The program's own P, in uW cm^-2 nm^-1, equals (S - D) C / (t A dlambda).

    The instrument computes in single precision: a wavelength is known to half its spacing;
    P is printed to 5e-7.
    """
    spectrum = read_spectra(real / "irrad.JazIrrad")[0]
    counts = spectrum.columns["signal"] - spectrum.columns["dark"]
    area = float(spectrum.header["Collection Area"])
    width = np.gradient(spectrum.wavelength_nm)
    mine = counts * spectrum.calibration / (spectrum.integration_time_s * area * width)
    error = np.abs(mine) * np.spacing(spectrum.wavelength_nm.astype(np.float32)) / (2 * width) + 1e-6
    assert (np.abs(mine - spectrum.columns["processed"]) <= error)[1:-1].all()


def test_the_percentage_of_the_real_jaz_file_follows_from_its_columns(real):
    c = read_spectra(real / "jazspec.jaz")[0].columns
    bright = c["reference"] - c["dark"] > 500
    mine = 100 * (c["signal"] - c["dark"])[bright] / (c["reference"] - c["dark"])[bright]
    assert np.abs(mine - c["processed"][bright]).max() < 1e-3


@pytest.mark.parametrize(
    ("name", "units", "raw", "exposure_s"),
    [
        ("OOusb4000.txt", "counts", ["value"], 0.02),
        ("OO_comma.txt", "counts", ["value"], 0.07),
        ("OceanView_halogen_HR.txt", "counts", ["value"], 0.0273),
        ("OceanView.txt", "relative", ["value"], 1.0),
        ("jazspec.jaz", "counts", ["signal", "dark"], 0.024),
        ("irrad.JazIrrad", "counts", ["signal", "dark"], 0.495),
        ("irrad.JazIrrad", "uW/cm^2/nm", ["processed"], 1.0),
    ],
)
def test_real_files_become_readings(reference, tmp_path, name, units, raw, exposure_s):
    path = reference / "reference" / "spectrometer" / name
    path = path if path.exists() else reference / "spectrometer" / name
    if not path.exists():
        pytest.skip(f"no real spectrometer files at {path}")
    readings = run(tmp_path, [f"{path},4.5"], "file,z_m", units=units)
    spectrum = read_spectra(path)[0]
    fine = np.linspace(500, 550, 500_001)
    means = [np.interp(fine, spectrum.wavelength_nm, spectrum.columns[column]).mean() for column in raw]
    expected = (means[0] - sum(means[1:])) / exposure_s
    # A mean on a grid of 1e-4 nm against the exact integral: 140 kinks, each good to 1e-4 nm of 50 nm.
    scale = max(np.abs(spectrum.columns[column]).max() for column in raw) / exposure_s
    assert readings.value[0] == pytest.approx(expected, abs=scale * 140 * 1e-4 / 50)
    assert not readings.saturated.any()
