"""Readers of other makers' files: each gives the spectrum that was written, or says what is wrong.

The files are made up after the facts of the formats; one frame of a HyperOCR is real.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import ocean_files
import pytest
from campaign import run
from hypothesis import given, settings
from hypothesis import strategies as st
from instrument_files import (
    COUNTS,
    DARK,
    TEXTS,
    WAVELENGTH,
    avantes,
    avantes8,
    calibration,
    is_truth,
    procspec,
    ramses,
    spanish,
    written,
)
from repository import ROOT

from lightfield.errors import MeasurementError
from lightfield.readings.importing.importer import import_index
from lightfield.readings.instruments.formats import BINARY, NAMES, READERS, read_spectra
from lightfield.readings.instruments.hyperocr import read as read_frames
from lightfield.readings.instruments.oceanoptics.procspec import read as read_procspec
from lightfield.readings.instruments.oddity import Odd, Oddity

FRAME = ROOT / "tests" / "data" / "instruments" / "satlantic_frame.hex"


@pytest.mark.parametrize("name", TEXTS)
def test_the_reader_is_found_by_the_file_and_gives_its_spectrum(tmp_path, name):
    spectra = read_spectra(written(tmp_path, TEXTS[name]()))
    assert len(spectra) == (2 if name == "plain columns across" else 1)
    is_truth(spectra[0])
    assert name.startswith(spectra[0].format)
    # These formats have a place for the exposure.
    if not name.startswith(("SeaBASS", "plain columns ")):
        assert spectra[0].integration_time_s == pytest.approx(0.07, rel=1e-12)


def test_a_file_that_ends_within_its_last_row_says_so(tmp_path):
    """The row may have lost digits: it is not used. A whole file says nothing."""
    name = next(name for name in TEXTS if name.startswith("SeaBASS"))
    whole = TEXTS[name]()
    assert whole.endswith("\n") and read_spectra(written(tmp_path, whole))[0].notes == ()
    more = whole + whole.splitlines()[-1]
    alone, first = (read_spectra(written(tmp_path, text)) for text in (whole.rstrip("\n"), more))
    for (spectrum,) in (alone, first):
        assert spectrum.notes == (Oddity(Odd.CUT_LINE),)
    assert first[0].raw.tolist() == pytest.approx(COUNTS.tolist())
    assert alone[0].raw[:-1].tolist() == pytest.approx(COUNTS[:-1].tolist()) and np.isnan(alone[0].raw[-1])


def test_settings_in_the_words_of_other_languages(tmp_path):
    for text in (spanish(), avantes(), avantes8()):
        found = read_spectra(written(tmp_path, text))[0]
        assert (found.spectra_averaged, found.boxcar) == (15, 5) and found.spectrometer.startswith("TEST1")


@pytest.mark.parametrize("text", [avantes(), avantes8()])
def test_columns_of_avantes(tmp_path, text):
    columns = read_spectra(written(tmp_path, text))[0].columns
    assert columns["dark"].tolist() == pytest.approx(DARK.tolist())
    assert columns["reference"].tolist() == pytest.approx((2 * COUNTS).tolist())
    assert columns["processed"].tolist() == pytest.approx((COUNTS / 20).tolist(), abs=5.001e-4)


def test_names_padded_with_zeros_are_text_all_the_same(tmp_path):
    """AvaSoft fills the name of the spectrometer with zero bytes."""
    is_truth(read_spectra(written(tmp_path, avantes().replace("TEST1       ", "TEST1\0\0\0\0")))[0])


def test_procspec(tmp_path):
    found = read_spectra(written(tmp_path, procspec()))[0]
    is_truth(found)
    assert found.format == "ProcSpec" and found.columns["dark"].tolist() == pytest.approx(DARK.tolist())
    assert (found.integration_time_s, found.spectra_averaged, found.boxcar) == (0.07, 15, 5)
    assert found.nonlinearity_corrected is True and found.date == "2016-03-16 13:18:31 UTC"
    bad = {
        "<p>": "<!DOCTYPE p [<!ENTITY a 'aaaa'>]><p>", "</p>": "", "pixelValues": "nothing",
        "<double>400.750</double>": "<double>4.0</double>", "<double>401.500</double>": "",
    }  # fmt: skip
    for old, new in bad.items():
        with pytest.raises(MeasurementError):
            read_procspec(procspec(**{old: new}), "x")


def test_a_real_frame_of_a_hyperocr(tmp_path):
    """Counts as pySatlantic decodes them; then a1 (counts - a0) cint / exposure, with cint = exposure."""
    frame = bytes.fromhex(FRAME.read_text().replace("\n", ""))
    written(tmp_path, calibration(), "HSL0251.cal")
    spectra = read_spectra(written(tmp_path, b"SATHDR\0" + frame + frame[:-30] + frame, "cast.raw"))
    assert len(spectra) == 2 and spectra[0].notes[0] == Oddity(Odd.DAMAGED_FRAMES, 1)
    found = spectra[0]
    assert (found.integration_time_s, found.label) == (pytest.approx(2.048), "SATHSL0251")
    counts = found.raw / 1.5e-5 + 2000.5
    assert counts[:6].tolist() == pytest.approx([2121, 2069, 2240, 2120, 2107, 2228], rel=1e-9)
    assert counts[-4:].tolist() == pytest.approx([2151, 2105, 2092, 2145], rel=1e-9)
    assert len(found) == 180 and found.processed_unit == "uW/cm^2/nm/sr"


def test_a_frame_of_which_a_byte_is_changed_is_left_out(tmp_path):
    frame = bytearray(bytes.fromhex(FRAME.read_text().replace("\n", "")))
    frame[100] ^= 1
    written(tmp_path, calibration(), "HSL0251.cal")
    with pytest.raises(MeasurementError, match="no whole frame"):
        read_frames(bytes(frame), str(tmp_path / "cast.raw"))


def test_frames_without_their_calibration_say_what_is_missing(tmp_path):
    frame = bytes.fromhex(FRAME.read_text().replace("\n", ""))
    with pytest.raises(MeasurementError, match=r"SATHSL0251.*\.cal"):
        read_spectra(written(tmp_path, frame, "cast.raw"))


def test_a_damaged_calibration_of_another_instrument_does_not_count(tmp_path):
    frame = bytes.fromhex(FRAME.read_text().replace("\n", ""))
    written(tmp_path, calibration(), "HSL0251.cal")
    written(tmp_path, calibration("OCR").replace("2000.5", "two"), "OCR.cal")
    assert len(read_spectra(written(tmp_path, frame, "cast.raw"))) == 1


def test_numbers_grow_by_the_immersion_coefficient_in_water(tmp_path):
    frame = bytes.fromhex(FRAME.read_text().replace("\n", ""))
    written(tmp_path, calibration(), "HSL0251.cal")
    written(tmp_path, frame, "cast.raw")
    index = written(
        tmp_path, "file,z_m,medium,spectrum\ncast.raw,1,air,\ncast.raw,2,water,SATHSL0251\n", "i.csv"
    )
    asked = dict(quantity="radiance", units="uW/cm^2/nm/sr", bands_nm=[(500.0, 550.0)])
    air, water = import_index(index, **asked).value
    assert water / air == pytest.approx(1.75, rel=1e-12)
    with pytest.raises(MeasurementError, match="not mW"):
        import_index(index, **{**asked, "units": "mW m^-2 sr^-1 nm^-1"})


PAR = (
    '"TOA5","CR6","x"\n"TIMESTAMP","RECORD","PAR_up_Avg","Temp"\n'
    '"TS","RN","µmol/s/m²","Deg C"\n"","","Avg","Avg"\n'
    '"2020-01-01 00:00:00",1,100.0,20.0\n"2020-01-01 00:00:10",2,102.0,20.1\n'
)


def test_a_par_logger_gives_one_number_for_its_band_and_no_other(tmp_path):
    written(tmp_path, PAR, "par.dat")
    asked = dict(quantity="scalar_irradiance", units="relative", bands_nm=[(400.0, 700.0)])
    index = written(tmp_path, "file,z_m\npar.dat,2\n", "i.csv")
    readings = import_index(index, **asked)
    # The mean of two, and the standard error of that mean: |102 - 100| / 2.
    assert readings.value.tolist() == [101.0] and readings.stderr.tolist() == pytest.approx([1.0])
    assert any("photons" in str(note) for note in readings.warnings)
    assert not any("non-linearity" in str(note) for note in readings.warnings)  # that is of an array's pixels
    for wrong, said in (
        ({"bands_nm": [(500.0, 550.0)]}, "one number for 400-700 nm"),
        ({"units": "umol m^-2 s^-1"}, "relative"),
        ({"units": "W m^-2 nm^-1"}, "photons"),
    ):
        with pytest.raises(MeasurementError, match=said):
            import_index(index, **{**asked, **wrong})


def test_spectra_of_one_label_are_repetitions_and_unlike_ones_are_chosen(tmp_path):
    lines = [
        ";".join([f"{w:.2f}", f"{k:.1f}", f"{k + 1:.1f}"])
        for w, k in zip(range(450, 600), range(150), strict=True)
    ]
    written(tmp_path, "wavelength;near;far\n" + "\n".join(lines) + "\n", "wide.csv")
    with pytest.raises(MeasurementError, match=r"unlike spectra.*near, far.*column spectrum"):
        run(tmp_path, ["wide.csv,4"], "file,z_m", units="relative")
    found = run(tmp_path, ["wide.csv,4,near", "wide.csv,5,far"], "file,z_m,spectrum", units="relative")
    # The middle of 500-550 nm: 525 - 450 = 75.
    assert found.value.tolist() == pytest.approx([75.0, 76.0], rel=1e-12)
    with pytest.raises(MeasurementError, match="no such spectrum"):
        run(tmp_path, ["wide.csv,4,middle"], "file,z_m,spectrum", units="relative")
    many = "t," + ",".join(f"Ed{w}" for w in range(490, 562, 2)) + "\n"
    many += "".join(f"{k}" + f",{k}.0" * 36 + "\n" for k in (1, 2, 3))
    written(tmp_path, many, "series.csv")
    found = run(tmp_path, ["series.csv,4"], "file,z_m", units="relative")
    assert found.value.tolist() == pytest.approx([2.0]) and found.stderr[0] == pytest.approx(1 / np.sqrt(3))


def test_columns_by_name_or_number(tmp_path):
    table = "pixel;dark;nm;scope\n" + "".join(f"{k};10;{480 + k}.0;{110 + k}\n" for k in range(100))
    path = written(tmp_path, table)
    asked = dict(quantity="irradiance", units="counts", bands_nm=[(500.0, 550.0)])
    index = written(tmp_path, "file,z_m,integration_time_s\na.txt,2,0.5\n", "i.csv")
    for mapping in (
        {"wavelength_nm": "nm", "value": "scope", "dark": "dark"},
        {"wavelength_nm": "3", "value": "4", "dark": "2"},
    ):
        # At 525 nm: k = 45, so (155 - 10) / 0.5 s.
        assert import_index(index, **asked, columns=mapping).value.tolist() == pytest.approx([290.0])
    with pytest.raises(MeasurementError, match="no column for value"):
        read_spectra(path, {"value": "sample"})


def test_a_table_of_ones_own_with_places_in_it(tmp_path):
    table = "station,depth (cm),x_mm,Ed(500),Ed(525),Ed(550)\nA,250,10,1,2,3\nB,300,-10,2,4,6\n"
    path = written(tmp_path, table)
    asked = dict(quantity="irradiance", units="relative", columns={"z_m": "depth (cm)", "x_m": "x_mm"})
    found = import_index(path, bands_nm=[(500.0, 550.0)], **asked)
    assert found.z_m.tolist() == [2.5, 3.0] and found.x_m.tolist() == [0.01, -0.01]
    assert found.value.tolist() == [2.0, 4.0]
    asked["columns"] = {"z_m": "depth (cm)", "value": "Ed(525)"}
    assert import_index(path, bands_nm=[(510.0, 540.0)], **asked).value.tolist() == [2.0, 4.0]
    for mapping, said in (
        ({"z_m": "station"}, "is not a number"),
        ({"z_m": "deep"}, "no column for z_m"),
        ({"z_m": "2", "depth": "3"}, "unknown meaning"),
        ({"x_m": "x_mm"}, "say too which column is z_m"),
        ({"z_m": "x_mm"}, "impossible position"),
    ):
        with pytest.raises(MeasurementError, match=said):
            import_index(path, bands_nm=[(500.0, 550.0)], **{**asked, "columns": mapping})


def test_a_table_of_ones_own_says_all_that_is_wrong_and_what_it_leaves_aside(tmp_path):
    """Cells by their line and column; columns that are not used, and a unit that is taken for granted."""
    path = written(tmp_path, "depth,x_mm,Scope,temp\n1,0,5,20\n2,0,abc,20\n,0,x,20\n4,,nan,20\n5,0,3,20\n")
    columns = {"z_m": "depth", "x_m": "x_mm", "value": "Scope"}
    asked = dict(quantity="irradiance", units="relative", bands_nm=[(500.0, 550.0)])
    with pytest.raises(MeasurementError, match="not a usable table: 5 problems") as refused:
        import_index(path, **asked, columns=columns)
    assert [one.head for one in refused.value.problems] == [
        "line 3: Scope is not a number", "line 4: Scope is not a number", "line 4: depth is missing",
        "line 5: x_mm is missing", "line 5: Scope is missing",
    ]  # fmt: skip
    path = written(tmp_path, "depth,x_mm,Scope,temp\n1,0,5,20\n2,0,4,20\n")
    notes = [str(note) for note in import_index(path, **asked, columns=columns).warnings]
    assert any("not used: temp" in note for note in notes)
    assert any("'depth' does not say its unit: z_m is taken to be in m" in note for note in notes)
    with pytest.raises(MeasurementError, match="did you mean value"):
        import_index(path, **asked, columns={"z_m": "depth", "valu": "Scope"})
    with pytest.raises(MeasurementError, match="say which column is z: column z_m=NAME"):
        import_index(path, **asked)


def test_standard_errors_of_a_table_of_ones_own_are_taken_over(tmp_path):
    """Of repeats in a row the error of their mean; what is stated counts, not how two of them scatter."""
    path = written(tmp_path, "z,light,sd,\n1,5.0,0.2,\n1,5.1,0.4,\n2,4,0.3,\n")
    columns = {"z_m": "z", "value": "light", "stderr": "sd"}
    asked = dict(quantity="irradiance", units="relative", bands_nm=[(500.0, 550.0)])
    found = import_index(path, **asked, columns=columns)
    assert found.value.tolist() == pytest.approx([5.05, 4.0])
    assert found.stderr.tolist() == pytest.approx([np.hypot(0.2, 0.4) / 2, 0.3])
    with pytest.raises(MeasurementError, match="errors of no value"):
        import_index(path, **asked, columns={"z_m": "z", "stderr": "sd"})


SEEMS = {
    "old.xls": (b"\xd0\xcf\x11\xe0" + bytes(50), "Excel"),
    "new.xlsx": (b"PK\x03\x04" + bytes(26) + b"[Content_Types].xml", "Excel"),
    "map.nc": (b"\x89HDF\r\n\x1a\n" + bytes(50), "HDF5 or NetCDF"),
    "old.trm": (bytes(range(60)), "AvaSoft"),
    "a.raw8": (b"AVS84" + bytes(50), "AvaSoft 8"),
    "a.jdx": (b"##TITLE=SpectraSuite\n##XYDATA=1\n1 2\n3 4\n", "JCAMP"),
    "a.mlb": (b"%SlaveAddress = None\n%c001 %c002\nNaN 1\n", "no wavelengths"),
    "a.json": (b'{"spectrum": [1, 2]}', "JSON"),
    "scene.toml": (b"[lamp]\npower_w = 1\n", "a scene"),
    "r.csv": (b"x_m,z_m,value\n0,1,2\n0,2,3\n", "reading table already"),
    "raw.dat": (ramses()[: ramses().index("[Spectrum]", 9)].encode() + b"[Spectrum]\n", "no wavelengths"),
    "old.mat": (b"MATLAB 5.0 MAT-file, Platform: PCWIN64".ljust(126) + b"IM" + bytes(50), "a MATLAB file"),
    "a.txt.gz": (b"\x1f\x8b\x08\x00" + bytes(40), "gzip"),
    "a.fits": (b"SIMPLE  =                    T".ljust(160), "FITS"),
    "shopping.txt": (b"milk\nbread\n", "milk"),
}  # fmt: skip


@pytest.mark.parametrize("name", SEEMS)
def test_what_cannot_be_read_is_refused_with_what_it_seems_to_be(tmp_path, name):
    content, word = SEEMS[name]
    with pytest.raises(MeasurementError) as caught:
        read_spectra(written(tmp_path, content, name))
    assert word in str(caught.value)
    if name != "raw.dat":
        assert all(format in str(caught.value) for format in ("SeaBASS", "OceanView", "plain columns"))


def test_the_page_of_formats_names_every_reader():
    page = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    for reader in (*READERS, *BINARY):
        assert f"`{reader.__name__.split('instruments.')[1].replace('.', '/')}`" in page, reader.__name__


# --- damaged files: an error of ours, or a spectrum that can be


def test_no_reader_is_left_out_of_the_damage(tmp_path):
    """What tests of damaged files begin with, here and in `test_damaged`: every reader has some."""
    whole = [
        *(make() for make in TEXTS.values()), procspec(), PAR,
        *("\n".join(lines()) + "\n" for lines, _ in ocean_files.FORMATS.values()),
    ]  # fmt: skip
    found = {spectrum.format for one in whole for spectrum in read_spectra(written(tmp_path, one))}
    written(tmp_path, calibration(), "a.cal")
    frame = bytes.fromhex(FRAME.read_text().replace("\n", ""))
    found |= {spectrum.format for spectrum in read_spectra(written(tmp_path, frame, "a.raw"))}
    assert found == set(NAMES)


@settings(max_examples=100, deadline=None)
@given(
    name=st.sampled_from([*TEXTS, "ProcSpec", "PAR"]),
    edits=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), st.binary(max_size=8)), max_size=4),
)
def test_damaged_files(tmp_path_factory, name, edits):
    whole = {"ProcSpec": procspec(), "PAR": PAR.encode()}
    data = bytearray(whole[name] if name in whole else TEXTS[name]().encode())
    for place, length, insert in edits:
        start = int(place * len(data))
        data[start : start + length] = insert
    check(written(tmp_path_factory.getbasetemp(), bytes(data), "fuzz.txt"))


@settings(max_examples=60, deadline=None)
@given(
    cut=st.floats(0, 1),
    edits=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), st.binary(max_size=8)), max_size=3),
    cal=st.booleans(),
)
def test_damaged_frames_and_calibrations(tmp_path_factory, cut, edits, cal):
    folder = tmp_path_factory.getbasetemp()
    frame = bytes.fromhex(FRAME.read_text().replace("\n", ""))
    data = bytearray(calibration().encode() if cal else frame + frame[: int(cut * len(frame))] + frame)
    for place, length, insert in edits:
        start = int(place * len(data))
        data[start : start + length] = insert
    written(folder, bytes(data) if cal else calibration(), "fuzz.cal")
    check(written(folder, frame if cal else bytes(data), "fuzz.raw"))
    (folder / "fuzz.cal").unlink()


def check(path: Path) -> None:
    try:
        spectra = read_spectra(path)
    except MeasurementError as error:
        assert all("\n" not in str(one) for one in error.problems)
        return
    for spectrum in spectra:
        assert np.isfinite(spectrum.wavelength_nm).all() and (np.diff(spectrum.wavelength_nm) > 0).all()
        assert all(len(column) == len(spectrum) for column in spectrum.columns.values())
        assert np.isnan(spectrum.integration_time_s) or spectrum.integration_time_s > 0


@pytest.mark.parametrize("name", [name for name, text in TEXTS.items() if "/end_header" in text()])
def test_a_file_that_ends_with_its_header_is_one_error(tmp_path, name):
    whole = TEXTS[name]()
    cut = whole[: whole.index("/end_header") + len("/end_header")]
    with pytest.raises(MeasurementError, match="no rows"):
        read_spectra(written(tmp_path, cut, "cut.sb"))


@settings(max_examples=60, deadline=None)
@given(name=st.sampled_from([*TEXTS]), cut=st.floats(0, 1))
def test_a_cut_file_is_an_error_or_its_numbers_are_true(tmp_path_factory, name, cut):
    whole = TEXTS[name]()
    path = written(tmp_path_factory.getbasetemp(), whole[: int(cut * len(whole))], "cut.txt")
    try:
        found = read_spectra(path)[0]
    except MeasurementError:
        return
    known = np.isfinite(found.raw)
    truth = dict(zip(WAVELENGTH.round(3), COUNTS, strict=True))
    assert known.sum() >= len(found) - 1
    for nm, value in zip(found.wavelength_nm[known], found.raw[known], strict=True):
        assert truth.get(round(nm, 3)) == pytest.approx(value, abs=1e-9)
