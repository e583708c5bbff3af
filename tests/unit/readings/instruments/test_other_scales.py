"""Files whose numbers are no light over wavelengths in nm, as they say; or are, but written otherwise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from campaign import codes, problems, run
from instrument_files import written

from lightfield.errors import MeasurementError
from lightfield.readings.importing.importer import import_index
from lightfield.readings.importing.reduction import band_mean
from lightfield.readings.importing.saturation import saturated_pixels
from lightfield.readings.instruments.formats import read_spectra
from lightfield.readings.instruments.spectrum import Spectrum

NM = np.arange(450.0, 600.0)
LIGHT = 1000 + 5 * (NM - 450)
NAMES = "file,z_m,integration_time_s"


def columns(first: str, second: str, axis=NM, values=LIGHT) -> str:
    return f"{first};{second}\n" + "".join(f"{a:g};{v:g}\n" for a, v in zip(axis, values, strict=True))


@pytest.mark.parametrize(
    ("name", "axis"),
    [
        ("Wavenumber (cm-1)", NM),
        ("Raman Shift [cm^-1]", NM),
        ("Pixel", NM),
        ("Energy (eV)", NM / 100),
        ("Wavelength (um)", NM / 1000),
        ("Wavelength (A)", 10 * NM),
        ("Wavelength [Angstrom]", 10 * NM),
    ],
)
def test_an_axis_that_says_it_holds_something_else_is_no_wavelength(tmp_path: Path, name, axis) -> None:
    with pytest.raises(MeasurementError, match="not wavelength in nm") as caught:
        read_spectra(written(tmp_path, columns(name, "Counts", axis)))
    assert name in str(caught.value) and "export wavelengths in nm" in str(caught.value)
    # Who knows better may say so.
    if axis is NM:
        told = read_spectra(written(tmp_path, columns(name, "Counts")), {"wavelength_nm": "1"})
        assert told[0].wavelength_nm.tolist() == NM.tolist()


@pytest.mark.parametrize("name", ["Wavelength (nm)", "nm", "lambda", "Wellenlänge", "x"])
def test_an_axis_of_wavelengths_is_one_whatever_it_is_called(tmp_path: Path, name: str) -> None:
    (found,) = read_spectra(written(tmp_path, columns(name, "Counts")))
    assert found.wavelength_nm.tolist() == NM.tolist()


@pytest.mark.parametrize("name", ["Power (dBm)", "Absorbance (OD)", "Absorbance", "log10(counts)"])
@pytest.mark.parametrize("units", ["counts", "relative"])
def test_logarithms_are_no_light(tmp_path: Path, name: str, units: str) -> None:
    written(tmp_path, columns("nm", name))
    (line,) = problems(tmp_path, ["a.txt,2,0.1"], NAMES, units=units)
    assert "logarithms" in line and "linear scale" in line


def test_the_head_says_the_unit_where_the_column_does_not(tmp_path: Path) -> None:
    written(tmp_path, "X-axis unit,nm_air\nY-axis unit,dBm\n[Data]\n" + columns("", "").replace(";", ",")[2:])
    (line,) = problems(tmp_path, ["a.txt,2,0.1"], NAMES, units="relative")
    assert "logarithms (dbm)" in line


def test_a_logger_is_no_logarithm(tmp_path: Path) -> None:
    written(tmp_path, columns("nm", "Logger a"))
    assert run(tmp_path, ["a.txt,2,0.1"], NAMES, units="relative").value.tolist() == pytest.approx([1375.0])


@pytest.mark.parametrize("unit", ["%", "W", "mV"])
def test_a_unit_that_is_no_count_and_no_light_per_nm_is_relative(tmp_path: Path, unit: str) -> None:
    written(tmp_path, columns("nm", f"Signal ({unit})"))
    (line,) = problems(tmp_path, ["a.txt,2,0.1"], NAMES)
    assert f"in {unit}, not counts: take the unit relative" in line
    assert run(tmp_path, ["a.txt,2,0.1"], NAMES, units="relative").value.tolist() == pytest.approx([1375.0])


def test_wavelengths_that_fall_are_turned(tmp_path: Path) -> None:
    """As spectrophotometers write them; one that goes to and fro is none, and says so."""
    (found,) = read_spectra(written(tmp_path, columns("Wavelength (nm)", "%T", NM[::-1], LIGHT[::-1])))
    assert found.wavelength_nm.tolist() == NM.tolist()
    assert found.columns["value"].tolist() == LIGHT.tolist()
    # A last line that is cut may have lost digits, and is that of the shortest wavelength.
    cut = columns("Wavelength (nm)", "%T", NM[::-1], LIGHT[::-1])[:-2]
    (found,) = read_spectra(written(tmp_path, cut))
    assert np.flatnonzero(np.isnan(found.columns["value"])).tolist() == [0]
    both = np.r_[NM, NM[::-1]]
    with pytest.raises(MeasurementError, match="the wavelength does not increase"):
        read_spectra(written(tmp_path, columns("Wavelength (nm)", "Counts", both, np.r_[LIGHT, LIGHT])))


def test_a_point_that_may_part_thousands_is_no_decimal_mark(tmp_path: Path) -> None:
    file = tmp_path / "counts.txt"
    file.write_text("Wavelength (nm)\tCounts\n450\t856\n455\t45.123\n460\t950\n465\t2.100\n")
    with pytest.raises(
        MeasurementError, match=r"a point may be a decimal or a thousands mark.*'45\.123 beside"
    ):
        read_spectra(file)
    file.write_text("Wavelength (nm)\tCounts\n450.5\t856\n455.5\t1.234\n460.5\t950\n465.5\t2.5\n")
    assert read_spectra(file)[0].columns["value"].tolist() == [856.0, 1.234, 950.0, 2.5]


def test_lost_lines_within_a_band_are_no_straight_line() -> None:
    """Of 150 pixels of 1 nm forty are lost; of a coarse table nothing is."""
    left = (NM < 505) | (NM > 545)
    with pytest.raises(ValueError, match=r"no pixels from 504 to 546 nm in the band 500-550 nm.* 1 nm apart"):
        band_mean(NM[left], LIGHT[left], 500, 550)
    assert band_mean(NM[left], LIGHT[left], 460, 500) == pytest.approx(1150.0)
    one = NM != 520
    assert band_mean(NM[one], LIGHT[one], 500, 550) == pytest.approx(1375.0)
    assert band_mean(NM[::25], LIGHT[::25], 500, 550) == pytest.approx(1375.0)


def test_units_of_radiance_as_programs_write_them(tmp_path: Path) -> None:
    written(tmp_path, columns("nm", "L (mW/(m^2 nm Sr))"))
    (line,) = problems(tmp_path, ["a.txt,2,0.1"], NAMES, units="mW m^-2 nm^-1")
    assert "mW/(m^2 nm Sr)" in line


@pytest.mark.parametrize("left", ["the dark taken away", "noise"])
def test_a_top_that_is_nearly_flat_is_the_end_of_the_detector(left: str) -> None:
    """Clipped at 65535 counts; a lamp's round top that is not clipped has no edges, with noise or without."""
    rng, pixel = np.random.default_rng(4), np.arange(2000.0)
    lamp = 90000 * np.exp2(-(((pixel - 1000) / 400) ** 2))
    rest = 150 + 15 * rng.standard_normal(2000)
    clipped = np.minimum(lamp + 150, 65535) - (
        rest if left.startswith("the") else 20 * rng.standard_normal(2000)
    )

    def marked(values):
        return saturated_pixels(Spectrum("made", "test", 400 + 0.2 * pixel, {"value": values}, {}))[0]

    # 90000 exp2(-(d/400)^2) = 65385 for d = 400 sqrt(log2(90000 / 65385)) = 271.6 pixels.
    assert 0.9 * 543 < marked(clipped).sum() < 1.1 * 543
    for size in (0.0, 20.0, 200.0):
        assert not marked(0.7 * lamp + size * rng.standard_normal(2000)).any()
    assert not marked(65535 / (1 + ((pixel - 1000) / 3) ** 2) + rest).any()


@pytest.mark.parametrize(("present", "code"), [("Yes", "dark_in_program"), ("No", "no_dark")])
def test_a_file_that_says_the_program_held_a_dark_is_not_called_without(tmp_path, present, code) -> None:
    rows = "".join(f"{a:.2f}\t{v:.2f}\n" for a, v in zip(NM, LIGHT, strict=True))
    written(
        tmp_path,
        f"SpectraSuite Data File\nDark Spectrum Present: {present}\nIntegration Time (usec): 100000\n"
        f">>>>>Begin Processed Spectral Data<<<<<\n{rows}>>>>>End Processed Spectral Data<<<<<\n",
    )
    found = codes(run(tmp_path, ["a.txt,2,"], NAMES))
    assert found & {"dark_in_program", "no_dark"} == {code}


def avantes(names: str) -> str:
    rows = "".join(f"{a:.2f};{v:.2f};{0.1 * v:.2f}\n" for a, v in zip(NM, LIGHT, strict=True))
    units = ";".join(["[nm]", "[counts]", "[counts]"])
    head = "x\nIntegration time [ms]: 100.0\nData measured with spectrometer [name]: 12U1\n"
    return f"{head}{names}\n{units}\n\n{rows}"


def test_german_columns_of_avasoft_and_a_second_channel(tmp_path: Path) -> None:
    written(tmp_path, avantes("Wellenlänge;Probe;Dunkel"))
    assert run(tmp_path, ["a.txt,2,"], NAMES).value.tolist() == pytest.approx([0.9 * 1375 / 0.1])
    written(tmp_path, avantes("Wave;Sample;Sample"))
    found = run(tmp_path, ["a.txt,2,"], NAMES)
    assert "ignored_columns" in codes(found) and found.value.tolist() == pytest.approx([13750.0])


@pytest.mark.parametrize(
    ("zones", "seconds"), [(("CEST", "CET"), 3600.0), (("CET", "CET"), 0.0), (("CST", "CDT"), None)]
)
def test_times_of_a_night_in_which_summer_time_ends(tmp_path: Path, zones, seconds) -> None:
    """02:30 twice, an hour apart; of a zone whose word means several there are no times, and that is said."""
    rows = "".join(f"{a:.2f}\t{v:.2f}\n" for a, v in zip(NM, LIGHT, strict=True))
    for name, zone in zip("ab", zones, strict=True):
        (tmp_path / f"{name}.txt").write_text(
            f"SpectraSuite Data File\nDate: Sun Oct 25 02:30:00 {zone} 2026\n"
            "Integration Time (usec): 100000\n"
            f">>>>>Begin Processed Spectral Data<<<<<\n{rows}>>>>>End Processed Spectral Data<<<<<\n"
        )
    found = run(tmp_path, ["a.txt,2,", "b.txt,3,"], NAMES)
    if seconds is None:
        assert "unlike_zones" in codes(found) and np.isnan(found.time_s).all()
    else:
        assert np.ptp(found.time_s) == seconds


def own_table(folder: Path, text: str, **columns: str):
    (folder / "own.csv").write_text(text)
    meant = {"z_m": "z (m)", "value": "v", **columns}
    return import_index(
        folder / "own.csv", quantity="irradiance", units="relative", bands_nm=[(500, 550)], columns=meant
    )


def test_a_table_of_ones_own_says_its_scales_too(tmp_path: Path) -> None:
    """Errors in per cent are of the value; logarithms, thousands and times of day are refused."""
    found = own_table(tmp_path, "z (m),v,Fehler (%)\n2,100,0.5\n3,50,0.5\n", stderr="Fehler (%)")
    assert found.stderr.tolist() == pytest.approx([0.5, 0.25])
    for text, columns, words in (
        ("z (m),v (dB)\n2,-10\n3,-16\n", {"value": "v (dB)"}, "logarithms"),
        ("z (m),v\n2,1.234\n3,999\n2.5,2.100\n", {}, "thousands mark"),
        ("z (m),v,t\n2,10,10:00:30\n3,20,10:00:50\n", {"time_s": "t"}, "time of day, and no number"),
    ):
        with pytest.raises(MeasurementError, match=words):
            own_table(tmp_path, text, **columns)
