"""Readers of instrument files: made-up files in every dialect, and damaged ones.

The made-up files follow the facts of the formats: labels, markers, columns. Their numbers come from one known
spectrum, so that every dialect must give the same one.
"""

from __future__ import annotations

from datetime import datetime

import numpy as np
import pytest
from instrument_files import WAVELENGTH, is_truth
from ocean_files import FORMATS, end, jaz_irradiance_lines, jaz_lines, parse, text_of

from lightfield.errors import MeasurementError
from lightfield.readings.importing.saturation import saturated_pixels
from lightfield.readings.instruments import labels
from lightfield.readings.instruments.oddity import Odd, Oddity
from lightfield.readings.instruments.spectrum import Spectrum


@pytest.mark.parametrize("name", FORMATS)
def test_the_reader_is_found_by_the_file_and_reads_all_it_says(name):
    spectrum = parse(text_of(name))
    is_truth(spectrum)
    assert spectrum.format == name
    assert spectrum.integration_time_s == pytest.approx(0.07, rel=1e-12)
    assert (spectrum.spectra_averaged, spectrum.boxcar) == (15, 5)
    assert spectrum.spectrometer.startswith("TEST1")
    assert spectrum.electric_dark_corrected is False and spectrum.nonlinearity_corrected is True
    assert spectrum.date == "Tue Mar 03 11:12:13 CET 2020"
    assert spectrum.notes == ()


@pytest.mark.parametrize("name", FORMATS)
def test_the_whole_header_is_kept(name):
    header = parse(text_of(name)).header
    for line in FORMATS[name][0]():
        if ">>>>>" in line:
            break
        label, colon, value = line.partition(":")
        assert not colon or header[label] == value.strip()
    assert header["title"] == FORMATS[name][0]()[0]


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize(
    "change",
    [
        lambda s: s.replace("\n", "\r\n"),
        lambda s: s.replace("\n", "\r"),
        lambda s: s.replace("\n", "\n\n"),
        lambda s: s.replace("\n", "\r\r\n"),
        lambda s: s.encode("utf-8-sig"),
        lambda s: s.encode("utf-16"),
        lambda s: s.replace("someone", "Zoë").encode("latin-1"),
        lambda s: s.replace("\t", ";"),
        lambda s: s.replace("\t", "  "),
        lambda s: "".join(
            line.replace(".", ",") if line[:1].isdigit() else line for line in s.splitlines(keepends=True)
        ),
        lambda s: "\n" + s,
    ],
    ids=[
        "CRLF",
        "CR",
        "blank lines",
        "CRCRLF",
        "BOM",
        "UTF-16",
        "Latin-1",
        "semicolons",
        "spaces",
        "comma",
        "late title",
    ],
)
def test_dialects_give_the_same_spectrum(name, change):
    is_truth(parse(change(text_of(name))))


@pytest.mark.parametrize("name", ["SpectraSuite", "Jaz", "OceanView"])
def test_an_end_marker_may_be_missing(name):
    is_truth(parse(text_of(name).replace(end("Processed Spectral") + "\n", "")))


def test_other_columns_of_jaz():
    spectrum = parse("\n".join(jaz_lines("WS")) + "\n")
    is_truth(spectrum)
    assert set(spectrum.columns) == {"signal"}
    assert set(parse(text_of("Jaz")).columns) == {"dark", "reference", "signal", "processed"}


def test_calibration_block():
    spectrum = parse(text_of("Jaz irradiance"))
    assert spectrum.calibration.tolist() == pytest.approx((1e-6 * WAVELENGTH).tolist(), rel=1e-8)
    assert spectrum.processed_unit == "uW cm^-2 nm^-1"
    assert parse(text_of("Jaz irradiance").replace("Sphere: No", "Sphere: Yes")).processed_unit == ""


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "∞", "\ufffd"])
def test_a_pixel_without_a_number_is_nan_not_zero(number):
    lines = jaz_lines()
    lines[20] = "\t".join([*lines[20].split("\t")[:-1], number])
    spectrum = parse("\n".join(lines) + "\n")
    is_truth(spectrum)
    assert np.isnan(spectrum.columns["processed"]).sum() == 1


@pytest.mark.parametrize(
    ("label", "value", "seconds"),
    [
        ("Integration Time (usec)", "70000 (A)", 0.07),
        ("Integration Time (sec)", "2,730000E-2", 0.0273),
        ("Integration Time (sec)", "2.5", 2.5),
        ("Integrationszeit (ms)", "12,5", 0.0125),
        ("Temps d'intégration (µs)", "3800", 0.0038),
        ("Tiempo de integración (seg.)", "1", 1.0),
        ("Tiempo de integración (seg)", "1,000000E-1", 0.1),
        ("Integrationszeit (Sek.)", "0,5", 0.5),
        ("Tiempo de integración (ciclos)", "1", None),
        ("Integration Time", "20 ms", 0.02),
        ("Integration Time", "20", None),
        ("Integration Time (usec)", "70.000", None),  # 70 us, or 70 ms in a country with thousands points?
        ("Integration Time (usec)", "70,000", None),
        ("Integration Time (usec)", "soon", None),
        ("Integration Time (sec)", "0", None),
        ("Integration Time (sec)", "1e999", None),
        ("Autoset integration time", "false", None),
    ],
)
def test_exposures(label, value, seconds):
    content = text_of("SpectraSuite").replace("Integration Time (usec): 70000 (TEST1)", f"{label}: {value}")
    spectrum = parse(content)
    if seconds is None:
        assert np.isnan(spectrum.integration_time_s)
    else:
        assert spectrum.integration_time_s == pytest.approx(seconds, rel=1e-12)


@pytest.mark.parametrize(
    ("written", "when", "zone"),
    [
        ("Fri Aug 19 13:19:52 CDT 2016", datetime(2016, 8, 19, 13, 19, 52), "CDT"),
        ("Mo Mär 14 17:36:35 MEZ 2008", datetime(2008, 3, 14, 17, 36, 35), "MEZ"),
        ("mar. août 02 01:02:03 CEST 2016", datetime(2016, 8, 2, 1, 2, 3), "CEST"),
        ("2016-08-19 13:19:52", datetime(2016, 8, 19, 13, 19, 52), ""),
        ("dom out 28 10:11:12 BRT 2011", datetime(2011, 10, 28, 10, 11, 12), "BRT"),
    ],
)
def test_dates_of_many_countries(written, when, zone):
    assert labels.moment(written) == (when, zone)


@pytest.mark.parametrize(
    "written", ["", "yesterday", "Fri Foo 19 13:19:52 2016", "Aug 41 13:19:52 2016", "13:19:52"]
)
def test_dates_that_cannot_be_told(written):
    assert labels.moment(written) is None


def line21(content: str) -> str:
    return content.split("\n")[20] + "\n"


BAD = {
    "cut after a line": (lambda s: "\n".join(s.split("\n")[:-5]) + "\n", "is cut"),
    "a line lost": (lambda s: s.replace(line21(s), ""), "is cut"),
    "a line twice": (lambda s: s.replace(line21(s), 2 * line21(s)), "does not increase"),
    "a number lost": (lambda s: s.replace(s.split("\n")[20], s.split("\n")[20].split("\t")[0]), "line 21"),
    "a word": (lambda s: s.replace(s.split("\n")[20], "hello\t1"), "line 21"),
    "two marks": (lambda s: s.replace(s.split("\n")[20], s.split("\n")[20].replace(".", ",")), "decimal"),
    "no data": (lambda s: s[: s.index("<<<<<") + 6], "no spectral data"),
    "no marker": (lambda s: s.replace(">>>>>", "").replace("<<<<<", ""), "no spectral data"),
    "pixels as axis": (lambda s: s.replace("Wavelengths", "Pixels"), "not wavelength"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_files(case):
    change, word = BAD[case]
    with pytest.raises(MeasurementError) as caught:
        parse(change(text_of("OceanView" if case == "pixels as axis" else "SpectraSuite")))
    assert word in str(caught.value)


def test_jaz_columns_and_calibration_that_do_not_fit():
    with pytest.raises(MeasurementError, match="unknown column names"):
        parse("\n".join(["W\tX\tS" if line == "W\tD\tR\tS\tP" else line for line in jaz_lines()]))
    with pytest.raises(MeasurementError, match="calibration does not fit"):
        parse("\n".join(line for k, line in enumerate(jaz_irradiance_lines()) if k != 70))


def test_unknown_files_are_refused_by_name():
    with pytest.raises(MeasurementError, match="SpectraSuite"):
        parse("wavelength,counts\n400,1\n")


def test_more_pixels_than_announced_is_odd_but_usable():
    spectrum = parse(text_of("OceanView").replace("Spectrum: 40", "Spectrum: 30"))
    is_truth(spectrum)
    assert spectrum.notes == (Oddity(Odd.MORE_PIXELS, 40, 30),)
    assert "40 pixels, though the header says 30" in str(spectrum.notes[0])


# --- saturation: a lamp line of 60000 counts on a detector that ends at 20000


def line_spectrum(top: float, boxcar: int | None = None) -> Spectrum:
    wavelength = 400 + np.arange(200.0)
    counts = np.minimum(60000 * np.exp(-(((wavelength - 500) / 10) ** 2)) + np.arange(200) * 0.01, top)
    return Spectrum("made", "test", wavelength, {"value": counts}, {}, boxcar=boxcar)


def test_a_flat_top_is_found_without_being_told_the_level():
    mask, level = saturated_pixels(line_spectrum(20000))
    # 60000 exp(-d^2/100) >= 20000 for |d| <= 10 sqrt(ln 3) = 10.48 nm: 21 pixels of 1 nm.
    assert level == 20000 and mask.sum() == 21 and mask[90:111].all()


def test_a_round_top_and_padded_ends_are_no_saturation():
    assert not saturated_pixels(line_spectrum(1e9))[0].any()
    padded = Spectrum(
        "made", "test", 400 + np.arange(50.0), {"value": np.r_[[500.0] * 8, np.arange(42) * 0.5]}, {}
    )
    assert not saturated_pixels(padded)[0].any()
    coarse = Spectrum(
        "made", "test", 400 + np.arange(50.0), {"value": np.r_[np.zeros(20), [7.0] * 6, np.ones(24)]}, {}
    )
    assert not saturated_pixels(coarse)[0].any()


def test_a_stated_level_masks_what_reaches_it_and_smoothing_widens_the_mask():
    mask, level = saturated_pixels(line_spectrum(1e9), 30000)
    assert level is None and mask.sum() == 17  # 10 sqrt(ln 2) = 8.33 nm
    assert saturated_pixels(line_spectrum(1e9, boxcar=3), 30000)[0].sum() == 17 + 2 * 3


# --- fuzzing: every reader gives an error of ours, or what is in the file
