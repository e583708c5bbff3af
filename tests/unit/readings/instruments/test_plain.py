"""Plain columns: what their head says of exposure and unit, and that they are parsed once."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaign import problems, run
from instrument_files import written

from lightfield.errors import MeasurementError
from lightfield.readings.instruments import document
from lightfield.readings.instruments.formats import read_spectra
from lightfield.readings.instruments.number_block import find_table

GERMAN = "Geraet;MiniSpec\nIntegrationszeit [ms];400,0\n\nWellenlaenge [nm];Signal [counts]\n" + "".join(
    f"{480 + k},00;{100 + k},5\n" for k in range(100)
)


@pytest.mark.parametrize(
    "said",
    ["Integrationszeit [ms];400,0", "Belichtungszeit;400 ms", "exposure (us);400000",
     "Integration time: 0.4 s", "Exposure time;0,4;s", "integration_time_ms;400"],
)  # fmt: skip
def test_the_exposure_in_the_head_of_plain_columns_is_read(tmp_path, said):
    found = read_spectra(written(tmp_path, GERMAN.replace("Integrationszeit [ms];400,0", said)))[0]
    assert found.integration_time_s == pytest.approx(0.4) and found.header["Geraet"] == "MiniSpec"


def test_an_exposure_and_a_unit_that_the_file_contradicts_are_refused(tmp_path):
    written(tmp_path, GERMAN)
    names = "file,z_m,integration_time_s"
    assert run(tmp_path, ["a.txt,2,"], names).value.tolist() == pytest.approx([145.5 / 0.4])
    (line,) = problems(tmp_path, ["a.txt,2,400"], names)
    assert "400 s and 0.4 s of a.txt" in line and "in seconds" in line
    (line,) = problems(tmp_path, ["a.txt,2,0.4"], names, units="mW/m2/nm")
    assert "the file says that its numbers are in counts, not mW/m2/nm" in line


def test_the_columns_of_a_file_are_sought_once(tmp_path, monkeypatch):
    sought = []
    monkeypatch.setattr(document, "find_table", lambda *given: sought.append(1) or find_table(*given))
    read_spectra(written(tmp_path, GERMAN))
    assert sought == [1]


def test_a_comma_that_may_part_thousands_is_no_decimal_mark(tmp_path: Path) -> None:
    """856, 1,234 and 950 counts: as decimals they would be a thousandfold apart. Three decimals beside each
    other, or one cell that can only be decimal, are decimals."""
    file = tmp_path / "counts.txt"
    file.write_text("Wavelength (nm)\tCounts\n450\t856\n455\t1,234\n460\t950\n465\t2,100\n")
    with pytest.raises(MeasurementError, match=r"decimal or a thousands mark.*'1,234 beside 856'"):
        read_spectra(file)
    file.write_text("Wavelength (nm)\tCounts\n450\t856\n455\t1,234\n460\t950\n465\t0,5\n")
    assert read_spectra(file)[0].columns["value"].tolist() == [856.0, 1.234, 950.0, 0.5]
    file.write_text("Wavelength (nm)\tCounts\n450\t1,856\n455\t1,234\n460\t2,950\n465\t3,500\n")
    assert read_spectra(file)[0].columns["value"].tolist() == [1.856, 1.234, 2.95, 3.5]
