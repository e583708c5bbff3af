"""What can be wrong with an index and its files, what is kept of them, and the average over a band."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import BAND, DARK, ROWS, codes, oceanview, problems, run
from hypothesis import given, settings
from hypothesis import strategies as st

from lightfield.errors import LightfieldError, MeasurementError
from lightfield.readings import ErrorBudget, read_table, write_table
from lightfield.readings.importing.importer import import_index
from lightfield.readings.importing.index import read_index
from lightfield.readings.importing.reduction import band_mean
from lightfield.readings.problems import Problems

# --- header, file, problems


def test_the_whole_header_is_kept_through_the_written_table(campaign):
    oceanview(campaign / "more.txt", DARK, 0.05, more=["Comment: left over"])
    path = campaign / "readings.csv"
    made = run(campaign, [*ROWS, "more.txt,6.5,0,99,signal"], budget=ErrorBudget(position_mm=2))
    write_table(made, path)
    again = read_table(path)
    instrument = again.metadata["instrument"]
    assert instrument["common"]["Spectrometer"] == "TEST1"
    assert instrument["files"]["more.txt"]["Comment"] == "left over"
    assert instrument["files"]["b.txt"]["Integration Time (sec)"] == "2.000000E-01"
    assert again.budget.position_mm == 2 and again.metadata["bands_nm"] == [[500, 550]]
    assert again.metadata["imported"]["unit_in_files"] == "counts"
    assert again.extra["file"].tolist() == ["a.txt", "b.txt", "more.txt"]


def test_all_problems_of_index_and_files_come_at_once(campaign):
    (campaign / "bad.txt").write_text("hello\n")
    found = problems(
        campaign,
        ["none.txt,4.5,0,0,signal", "bad.txt,4.5,0,0,signal", "a.txt,-1,x,0,lamp", "b.txt,,0,0,signal",
         "a.txt,4.5,0,0,signal", ",4.5,0,0,signal"],
    )  # fmt: skip
    expected = [
        (2, "none.txt: cannot read the spectrometer file"),
        (3, "bad.txt: not a spectrometer file"),
        (4, "x_m is not a number"),
        (4, "unknown role"),
        (4, "impossible position"),
        (5, "z_m is missing"),
        (6, "same file as line 4"),
        (7, "no file is named"),
    ]
    for line, word in expected:
        assert any(text.startswith(f"line {line}: ") and word in text for text in found), (word, found)


def test_two_spectrometers_in_one_table_are_refused_unless_calibrated(campaign):
    content = (campaign / "b.txt").read_text()
    (campaign / "b.txt").write_text(content.replace("TEST1", "TEST2"))
    assert "line 3: b.txt: another spectrometer than in line 2" in problems(campaign, ROWS)[0]
    assert "mixed_settings" in codes(run(campaign, ROWS[:2], units="uW/cm^2/nm"))


def test_signals_that_are_means_of_other_numbers_of_spectra_are_told(campaign):
    """One noise is told of all repeats; a dark may be a mean of more."""

    def averaged(name: str, number: int) -> None:
        title, rest = (campaign / name).read_text().split("\n", 1)
        (campaign / name).write_text(f"{title}\nScans to average: {number}\n{rest}")

    averaged("b.txt", 50)
    averaged("dark_b.txt", 200)
    assert "mixed_settings" not in codes(run(campaign, ROWS)), "the other file does not say"
    averaged("a.txt", 5)
    (told,) = (w for w in run(campaign, ROWS).warnings if w.code == "mixed_settings")
    assert told.sentence == "the files differ in averaging: 5 spectra, 50 spectra"


def test_coordinates_need_their_unit(campaign):
    found = problems(campaign, ["a.txt,4.5"], "file,z")
    assert "name it z_m" in found[0]


@pytest.mark.parametrize(
    ("name", "known"),
    [("x_mm", "x_m"), ("X_m", "x_m"), ("x (m)", "x_m"), ("time_min", "time_s"), ("Role", "role"),
     ("integration_time_ms", "integration_time_s")],
)  # fmt: skip
def test_a_column_that_only_looks_known_is_not_passed_over(campaign, name, known):
    """Two places 20 mm apart would else be replicates of one."""
    found = problems(campaign, ["a.txt,4.5,20", "b.txt,4.5,40"], f"file,z_m,{name}")
    assert any(f"line 1: the column {name} is not known" in f and f"name it {known}" in f for f in found), (
        found
    )


def test_one_file_under_two_spellings_is_one_file(campaign):
    found = problems(campaign, ["a.txt,4.5,0,0,signal", "./a.txt,5.5,0,60,signal"])
    assert any("the same file as line 2" in text and "leave out one" in text for text in found), found


@pytest.mark.parametrize(
    ("rows", "options", "remedy"),
    [
        (["a.txt,4.5,0,0,light"], {}, "write signal for the light of the lamp"),
        (ROWS[:2] + ROWS[2:3], {}, "add a dark of this exposure"),
        (["a.txt,4.5,0,0,Signal", "short.txt,,,10,DARK"], {}, "add a dark of the same pixels"),
        (ROWS, {"bands_nm": [(590, 640)]}, "choose a band within"),
    ],
)
def test_what_is_wrong_comes_with_its_remedy(campaign, rows, options, remedy):
    lines = (campaign / "dark_a.txt").read_text().replace("in Spectrum: 400", "in Spectrum: 399").splitlines()
    (campaign / "short.txt").write_text("\n".join(lines[:-1]) + "\n")
    assert remedy in problems(campaign, rows, **options)[0]


def test_a_band_beyond_the_spectrum(campaign):
    assert "not within 450" in problems(campaign, ROWS, bands_nm=[(590, 640)])[0]


def test_pixels_without_a_number_in_the_band(campaign):
    content = (campaign / "a.txt").read_text().split("\n")
    content[9 + 200] = content[9 + 200].split("\t")[0] + "\tNaN"
    (campaign / "a.txt").write_text("\n".join(content))
    assert "without a number" in problems(campaign, ROWS)[0]
    assert len(run(campaign, ROWS, bands_nm=[(460, 470)])) == 2


def test_ignored_files_are_not_even_opened(campaign):
    assert len(run(campaign, [*ROWS, "none.txt,,,,ignore"])) == 2


# --- the band average


@settings(max_examples=100)
@given(
    slope=st.floats(-100, 100),
    low=st.floats(451, 590),
    width=st.floats(1, 100),
    steps=st.lists(st.floats(0.05, 0.9), min_size=300, max_size=300),
)
def test_the_band_mean_of_a_straight_line_is_its_middle_on_any_grid(slope, low, width, steps):
    grid = 450 + np.cumsum(steps)
    high = low + width
    values = 3 + slope * (grid - 500)
    if not grid[0] <= low < high <= grid[-1]:
        with pytest.raises(ValueError, match="not within"):
            band_mean(grid, values, low, high)
    else:
        middle = 3 + slope * ((low + high) / 2 - 500)
        assert band_mean(grid, values, low, high) == pytest.approx(
            middle, abs=1e-9 * (1 + np.abs(values).max())
        )


# --- fuzzing of the index


LETTERS = "file,z_mxroleda.t;\t\"'#\n\r 0123456789-+eE"


@settings(max_examples=100)
@given(body=st.text(alphabet=LETTERS, max_size=150), encoding=st.sampled_from(["utf-8", "utf-16", "latin-1"]))
def test_any_index_is_an_error_of_ours_or_a_table(body, encoding, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp()
    oceanview(folder / "a.txt", DARK) if not (folder / "a.txt").exists() else None
    for start in ("file,z_m,role,x_m\n", "file,z_m\na.txt,4.5\n", ""):
        path = folder / "fuzz.csv"
        path.write_bytes((start + body).encode(encoding))
        try:
            found = import_index(path, quantity="irradiance", units="counts", bands_nm=[BAND])
        except LightfieldError as error:
            assert isinstance(error, MeasurementError)
            continue
        assert len(found) > 0 and (found.z_m > 0).all()


@settings(max_examples=100)
@given(data=st.binary(max_size=200))
def test_any_bytes_as_index(data, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(data)
    noted = Problems("fuzz")
    try:
        entries, _ = read_index(path, noted)
    except MeasurementError:
        return
    assert entries or noted
