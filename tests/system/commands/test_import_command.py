"""`lightfield import` as a user meets it: instrument files and an index in, one reading table out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import in_process, lightfield

from lightfield.readings import read_table

WAVELENGTH = np.arange(480.0, 580.0, 0.5)


@pytest.fixture
def index(tmp_path: Path) -> Path:
    """Three spectra of 100 counts above a dark of 20, at 0.1 s: 800 counts/s."""
    for name, counts in (("a", 99), ("b", 100), ("c", 101), ("dark", 20)):
        lines = [
            "SpectraSuite Data File",
            "Integration Time (usec): 100000 (X)",
            ">>>>>Begin Processed Spectral Data<<<<<",
            *(f"{w:.2f}\t{counts:.3f}".replace(".", ",") for w in WAVELENGTH),
            ">>>>>End Processed Spectral Data<<<<<",
        ]
        (tmp_path / f"{name}.txt").write_text("\r\n".join(lines) + "\r\n")
    path = tmp_path / "index.csv"
    rows = ["file;z_m;time_s;role", "a.txt;4,5;0;", "b.txt;4,5;1;", "c.txt;4,5;2;signal", "dark.txt;;;dark"]
    path.write_text("\n".join(rows) + "\n")
    return path


def test_files_become_a_reading_table(index):
    out = index.parent / "new folder" / "readings.csv"
    done = lightfield(
        "import", index, "--quantity", "irradiance", "--units", "counts", "--band", "500:550",
        "--band", "560:570",
        "--position-mm", "1", "-o", out,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == str(out)
    assert "4 files (SpectraSuite) -> 2 readings of irradiance in counts/s" in done.stdout
    readings = read_table(out)
    assert readings.value == pytest.approx([800, 800], rel=1e-12)
    # Three spectra 10 counts/s apart: standard deviation 10, its mean's error 10 / sqrt(3).
    assert readings.stderr == pytest.approx([10 / np.sqrt(3)] * 2, rel=1e-9)
    assert readings.wavelength_nm.tolist() == [525, 565]
    assert readings.budget.position_mm == 1 and readings.quantity == "irradiance"


WRONG = {
    "nothing stated": ([], "not stated: quantity, units, bands"),
    "no unit": (["--quantity", "irradiance", "--band", "500:550"], "not stated: units"),
    "unit of another quantity": (
        ["--quantity", "radiance", "--units", "W/m2/nm", "--band", "500:550"],
        "unusable unit",
    ),
    "no band": (["--quantity", "irradiance", "--units", "counts"], "not stated: bands"),
    "band without end": (["--quantity", "irradiance", "--units", "counts", "--band", "500"], "LOW:HIGH"),
    "band turned": (["--quantity", "irradiance", "--units", "counts", "--band", "550:500"], "low < high"),
    "band beyond": (["--quantity", "irradiance", "--units", "counts", "--band", "500:650"], "not within"),
    "level is text": (["--saturation-level", "full"], "--saturation-level"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_requests_end_with_code_2_an_explanation_and_no_file(index, case):
    options, word = WRONG[case]
    out = index.parent / "readings.csv"
    done = in_process("import", index, *options, "-o", out)
    assert done.returncode == 2 and word in done.stderr and "Traceback" not in done.stderr
    assert not out.exists() and not done.stdout


def test_missing_index_and_missing_output(index):
    asked = ["--quantity", "irradiance", "--units", "counts", "--band", "500:550"]
    done = in_process("import", index.parent / "none.csv", *asked, "-o", index.parent / "r.csv")
    assert done.returncode == 2 and "none.csv: cannot read the index" in done.stderr
    done = in_process("import", index, *asked)
    assert done.returncode == 2 and "-o READINGS.csv" in done.stderr
    done = in_process("import", index, *asked, "-o", index / "r.csv")
    assert done.returncode == 2 and "cannot write here" in done.stderr


def test_no_spectrum_that_the_index_names_is_written_over(index):
    raw = (index.parent / "b.txt").read_bytes()
    done = lightfield(
        "import", index, "--quantity", "irradiance", "--units", "counts", "--band", "500:550",
        "-o", index.parent / "b.txt",
    )  # fmt: skip
    assert done.returncode == 2 and "in use in the same run" in done.stderr
    assert (index.parent / "b.txt").read_bytes() == raw
