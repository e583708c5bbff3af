"""From spectra to readings: dark, exposure, band, replicates, saturation, and all that has to be asked for.

The made-up lamp gives a rate (counts per second) linear in wavelength, so that its mean over a band is
its value in the middle, exactly.
"""

from __future__ import annotations

import numpy as np
import pytest
from campaign import BAND, DARK, ROWS, WAVELENGTH, codes, jaz, oceanview, problems, rate, run

from lightfield.errors import MeasurementError
from lightfield.readings.importing.reduction import band_mean


def test_dark_and_exposure_are_taken_out(campaign):
    readings = run(campaign, ROWS)
    # Mean of a straight line over 500-550 nm is its value at 525 nm.
    assert readings.value == pytest.approx([rate(525), rate(525, 0.3)], rel=1e-9)
    assert readings.units == "counts/s" and readings.scale == "relative" and readings.quantity == "irradiance"
    assert readings.integration_time_s.tolist() == [0.05, 0.2]
    assert readings.wavelength_nm.tolist() == [525, 525]
    assert readings.extra["dark"].tolist() == ["dark_a.txt", "dark_b.txt"]
    assert (readings.z_m.tolist(), readings.x_m.tolist()) == ([4.5, 5.5], [0, 0.1])


def test_several_bands(campaign):
    readings = run(campaign, ROWS, bands_nm=[BAND, (560, 570)])
    assert readings.wavelength_nm.tolist() == [525, 565, 525, 565]
    assert readings.value == pytest.approx([rate(w, k) for k in (1, 0.3) for w in (525, 565)], rel=1e-9)


def test_jaz_files_bring_their_own_dark(tmp_path):
    jaz(tmp_path / "j.jaz", DARK, DARK + 0.05 * rate(WAVELENGTH))
    oceanview(tmp_path / "d.txt", 0 * DARK)
    readings = run(tmp_path, ["j.jaz,4.5,0,0,signal", "d.txt,,,0,dark"])
    assert readings.value == pytest.approx([rate(525)], rel=1e-9)
    assert readings.extra["dark"].tolist() == ["own column"]


def test_of_darks_with_the_same_exposure_the_nearest_in_time_is_taken(campaign):
    oceanview(campaign / "late.txt", DARK * 1.05 + 500, 0.05)
    rows = ["a.txt,4.5,0,90,signal", "dark_a.txt,,,0,dark", "late.txt,,,100,dark"]
    readings = run(campaign, rows)
    assert readings.extra["dark"].tolist() == ["late.txt"]
    assert readings.value == pytest.approx([rate(525) - 500 / 0.05], rel=1e-9)


def test_darks_taken_together_are_averaged_and_their_scatter_is_in_the_error(campaign):
    """One of four darks would leave its own noise in all readings of that exposure."""
    oceanview(campaign / "again.txt", DARK * 1.05 + 8 + 0.05 * rate(WAVELENGTH), 0.05)
    rows = ["a.txt,4.5,0,90,signal", "again.txt,4.5,0,91,signal", "dark_a.txt,,,0,dark"]
    for k, more in enumerate((20.0, -30.0, 40.0, 10.0)):
        oceanview(campaign / f"late_{k}.txt", DARK * 1.05 + more, 0.05)
        rows.append(f"late_{k}.txt,,,{100 + k},dark")
    readings = run(campaign, rows)
    assert readings.value == pytest.approx([rate(525) - (10.0 - 4.0) / 0.05], rel=1e-9)
    of_darks = np.std([20, -30, 40, 10], ddof=1) / 2
    assert readings.stderr == pytest.approx([np.hypot(of_darks, 4.0) / 0.05], rel=1e-6)


@pytest.mark.parametrize(("part", "told"), [(0.0, False), (0.02, False), (0.25, True), (1.5, True)])
def test_a_dark_that_shows_the_lamp_is_warned_of(campaign, part, told):
    """One spectrum taken for dark by mistake, or with the lamp not covered."""
    lamp = np.exp(-(((WAVELENGTH - 530) / 40) ** 2))
    for name, light in (("lit", 1.0), ("other", part)):
        oceanview(campaign / f"{name}.txt", DARK + 3000 * light * lamp, 0.05)
    readings = run(campaign, ["lit.txt,4.5,0,0,signal", "other.txt,,,1,dark"])
    assert ("lit_dark" in codes(readings)) == told


def test_darks_without_times_are_averaged(campaign):
    oceanview(campaign / "late.txt", DARK * 1.05 + 500, 0.05)
    readings = run(campaign, ["a.txt,4.5,0,,signal", "dark_a.txt,,,,dark", "late.txt,,,0,dark"])
    assert readings.value == pytest.approx([rate(525) - 250 / 0.05], rel=1e-9)


def test_a_dark_of_another_exposure_is_not_used(campaign):
    found = problems(campaign, [ROWS[0], ROWS[1], ROWS[2]])
    assert len(found) == 1 and found[0].startswith(
        "line 3: b.txt: no dark spectrum has its exposure of 0.2 s"
    )


def test_without_dark_the_reader_is_told(campaign):
    readings = run(campaign, ROWS[:2])
    assert "no_dark" in codes(readings)
    dark = float(band_mean(WAVELENGTH, DARK, *BAND))
    assert readings.value[0] == pytest.approx(rate(525) + 1.05 * dark / 0.05, rel=1e-9)


# --- replicates


def test_spectra_in_a_row_at_one_place_become_one_reading_with_the_error_of_the_mean(campaign):
    levels = [1.00, 1.02, 0.98, 1.04]
    for k, level in enumerate(levels):
        oceanview(campaign / f"r{k}.txt", DARK * 1.05 + 0.05 * rate(WAVELENGTH, level), 0.05)
    rows = [f"r{k}.txt,4.5,0,{20 * k},signal" for k in range(4)]
    readings = run(campaign, [*rows, "dark_a.txt,,,0,dark"])
    assert len(readings) == 1
    assert readings.value[0] == pytest.approx(rate(525) * 1.01, rel=1e-9)
    # Standard deviation of the four levels is sqrt(0.002 / 3), its mean's error half of that.
    assert readings.stderr[0] == pytest.approx(rate(525) * np.sqrt(0.002 / 3) / 2, rel=1e-6)
    assert readings.time_s.tolist() == [30] and readings.extra["n_spectra"].tolist() == ["4"]
    assert "single_spectra" not in codes(readings)


def test_the_scatter_of_several_darks_adds_to_the_error(campaign):
    for k in range(2):
        oceanview(campaign / f"r{k}.txt", DARK + 0.05 * rate(WAVELENGTH) + 10 * k, 0.05)
        oceanview(campaign / f"d{k}.txt", DARK + 20 * k, 0.05)
    rows = [f"r{k}.txt,4.5,0,,signal" for k in range(2)]
    readings = run(campaign, [*rows, "d0.txt,,,,dark", "d1.txt,,,,dark"])
    # Two values 10 counts apart: error of the mean 5 counts; darks 20 apart: 10 counts; exposure 0.05 s.
    assert readings.stderr[0] == pytest.approx(np.hypot(5, 10) / 0.05, rel=1e-6)


def test_coming_back_later_is_another_reading_of_another_visit(campaign):
    for k in range(4):
        oceanview(campaign / f"r{k}.txt", DARK + 0.05 * rate(WAVELENGTH, 1 + k), 0.05)
    rows = [
        "r0.txt,4.5,0,0,reference",
        "r1.txt,5.5,0,1,signal",
        "r2.txt,5.5,0.1,2,signal",
        "r3.txt,4.5,0,3,reference",
    ]
    readings = run(campaign, rows)
    assert readings.z_m.tolist() == [4.5, 5.5, 5.5, 4.5]
    assert readings.repeat.tolist() == [0, 0, 0, 1]
    assert readings.visit.tolist() == [0, 1, 1, 2]
    assert readings.role.tolist() == ["reference", "signal", "signal", "reference"]


def test_time_and_not_the_lines_of_the_index_give_the_order(campaign):
    readings = run(campaign, ["b.txt,5.5,0,60,signal", "a.txt,4.5,0,0,signal"])
    assert readings.time_s.tolist() == [0, 60]


def test_other_exposures_at_one_place_are_other_readings(campaign):
    rows = ["a.txt,4.5,0,0,signal", "b.txt,4.5,0,60,signal"]
    readings = run(campaign, rows)
    assert readings.integration_time_s.tolist() == [0.05, 0.2] and len(readings) == 2


def test_single_spectra_have_no_error_and_it_is_said_why(campaign):
    readings = run(campaign, ROWS)
    assert np.isnan(readings.stderr).all() and {"single_spectra", "no_stderr"} <= codes(readings)


def test_identical_replicates_have_no_error_rather_than_zero(campaign):
    (campaign / "copy.txt").write_bytes((campaign / "a.txt").read_bytes())
    readings = run(campaign, ["a.txt,4.5,0,0,signal", "copy.txt,4.5,0,1,signal"])
    assert len(readings) == 1 and np.isnan(readings.stderr[0])


# --- times, exposures


def test_times_come_from_the_headers_when_the_index_has_none(campaign):
    oceanview(campaign / "later.txt", DARK, 0.05, date="Tue Mar 03 11:13:00 CET 2020")
    readings = run(campaign, ["a.txt,4.5", "later.txt,5.5"], "file,z_m")
    assert readings.time_s.tolist() == [0, 47] and "time_from_header" in codes(readings)


def test_headers_of_two_time_zones_are_not_compared(campaign):
    oceanview(campaign / "later.txt", DARK, 0.05, date="Tue Mar 03 11:13:00 IST 2020")
    readings = run(campaign, ["a.txt,4.5", "later.txt,5.5"], "file,z_m")
    assert np.isnan(readings.time_s).all() and "no_time" in codes(readings)


def test_an_exposure_that_the_file_lacks_is_asked_for(tmp_path):
    oceanview(tmp_path / "a.txt", DARK)
    content = (tmp_path / "a.txt").read_text().replace("Integration Time (sec)", "Integration Time")
    (tmp_path / "a.txt").write_text(content)
    found = problems(tmp_path, ["a.txt,4.5,0,0,signal"])
    assert "give integration_time_s in the index" in found[0] and "no unit of time" in found[0]
    assert found[0].count("exposure is not known") == 1
    readings = run(tmp_path, ["a.txt,4.5,0.05"], "file,z_m,integration_time_s")
    assert readings.integration_time_s.tolist() == [0.05]


def test_exposures_that_contradict_each_other(campaign):
    found = problems(campaign, ["a.txt,4.5,0.07"], "file,z_m,integration_time_s")
    assert "state different exposures" in found[0] and "0.07 s and 0.05 s" in found[0]


# --- saturation and flags


def test_saturated_bands_are_marked_and_others_are_not(campaign):
    readings = run(campaign, ROWS, saturation_level=float(DARK.max() * 1.05 + 0.05 * rate(560)),
                   bands_nm=[BAND, (570, 590)])  # fmt: skip
    first = readings.subset(readings.z_m == 4.5)
    assert first.saturated.tolist() == [False, True]
    assert len(readings.usable()) < len(readings) and "saturated" in codes(readings)


def test_a_flat_top_is_reported_as_saturation(campaign):
    clipped = np.minimum(DARK * 1.05 + 0.05 * rate(WAVELENGTH, 3), 6000)
    clipped[-1] = 5000  # a run that reaches the end of the spectrum could be the margin of a smoothing
    oceanview(campaign / "flat.txt", clipped, 0.05)
    readings = run(campaign, ["flat.txt,4.5,0,0,signal", "dark_a.txt,,,0,dark"])
    assert readings.saturated.tolist() == [True]
    warning = next(w for w in readings.warnings if w.code == "flat_top")
    assert "6000" in warning.sentence and "flat.txt" in warning.sentence


def test_one_saturated_spectrum_marks_the_reading_of_all_its_replicates(campaign):
    (campaign / "low.txt").write_bytes((campaign / "a.txt").read_bytes())
    oceanview(campaign / "high.txt", DARK * 1.05 + 0.05 * rate(WAVELENGTH, 2), 0.05)
    level = float((DARK * 1.05 + 0.05 * rate(WAVELENGTH, 1.5)).max())
    readings = run(campaign, ["low.txt,4.5,0,0,signal", "high.txt,4.5,0,1,signal"], saturation_level=level)
    assert readings.saturated.tolist() == [True]


@pytest.mark.parametrize(
    ("flags", "word"), [(["true", "true"], "yes"), (["false", "false"], "no"), (["true", "false"], "mixed")]
)
def test_nonlinearity_flags_travel_with_the_readings(tmp_path, flags, word):
    for k, flag in enumerate(flags):
        oceanview(tmp_path / f"{k}.txt", DARK + 0.05 * rate(WAVELENGTH), nonlinearity=flag)
    readings = run(tmp_path, [f"{k}.txt,4.5,0,{k},signal" for k in range(2)])
    assert readings.extra["nonlinearity_corrected"].tolist() == [word]
    assert ("nonlinearity" in codes(readings)) == (word != "yes")


def test_a_wild_repeat_among_many_places_is_told_by_its_reading(campaign):
    """Of 24 places with three spectra each, 1 % apart, the fifth has one with a fifth of the light."""
    rng, rows = np.random.default_rng(1), ["dark_a.txt,,,0,dark"]
    for place in range(24):
        for k in range(3):
            level = 0.2 if (place, k) == (4, 1) else 1 + 0.01 * rng.standard_normal()
            name = f"p{place}_{k}.txt"
            oceanview(campaign / name, DARK * 1.05 + 0.05 * rate(WAVELENGTH, level), 0.05)
            rows.append(f"{name},{3 + 0.5 * place},0,{60 * place + k},signal")
    readings = run(campaign, rows)
    (told,) = [w for w in readings.warnings if w.code == "restless"]
    assert told.values["readings"] == (5,) and "readings 5 scatter far more" in told.sentence
    others = np.delete(readings.stderr / readings.value, 4)
    assert others == pytest.approx(0.01 / np.sqrt(3), rel=0.3)  # each by itself: a tenth to twice of it
    # Darks that were subtracted leave no dark signal to vary the exposure for.
    assert "constant_integration_time" not in codes(readings)
    without = run(campaign, rows[1:])
    assert {"constant_integration_time", "no_dark"} <= codes(without)


def test_values_that_no_exposure_divides_are_told(campaign):
    """Raw counts that are called relative: those of 0.2 s are four times as large."""
    assert "undivided" in codes(run(campaign, ROWS, units="relative"))
    assert "undivided" not in codes(run(campaign, ROWS))
    assert "undivided" not in codes(run(campaign, [ROWS[0], ROWS[2]], units="relative"))


# --- units: asked for, never guessed


@pytest.mark.parametrize("option", ["quantity", "units", "bands_nm"])
def test_what_is_not_stated_is_asked_for_by_its_name(campaign, option):
    with pytest.raises(
        MeasurementError, match="not stated: " + ("bands" if option == "bands_nm" else option)
    ):
        run(campaign, ROWS, **{option: None})


def test_all_that_is_missing_is_asked_for_at_once(campaign):
    with pytest.raises(MeasurementError, match="not stated: quantity, units, bands"):
        run(campaign, ROWS, quantity=None, units="", bands_nm=[])


@pytest.mark.parametrize(
    "options",
    [
        {"quantity": "light"},
        {"units": "lux"},
        {"units": "W m^-2 sr^-1 nm^-1"},  # of radiance, and the quantity is irradiance
        {"bands_nm": [(550, 500)]},
        {"bands_nm": [(float("nan"), 500)]},
        {"bands_nm": [(500, 550), (510, 540)]},
        {"saturation_level": -1},
    ],
)
def test_statements_that_make_no_sense(campaign, options):
    with pytest.raises(MeasurementError):
        run(campaign, ROWS, **options)


def test_numbers_that_are_normalised_or_calibrated_already_are_not_divided_by_the_exposure(tmp_path):
    oceanview(tmp_path / "a.txt", rate(WAVELENGTH))
    for unit, scale in (("counts/s", "relative"), ("relative", "relative"), ("uW/cm^2/nm", "absolute")):
        readings = run(tmp_path, ["a.txt,4.5,0,0,signal"], units=unit)
        assert readings.value == pytest.approx([rate(525)], rel=1e-9)
        assert (readings.units, readings.scale) == (unit, scale)


def test_jaz_counts_cannot_be_called_an_irradiance(tmp_path):
    jaz(tmp_path / "j.jaz", DARK, DARK + 1)
    assert "take the unit counts" in problems(tmp_path, ["j.jaz,4.5,0,0,signal"], units="uW/cm^2/nm")[0]
    assert "take the unit counts" in problems(tmp_path, ["j.jaz,4.5,0,0,signal"], units="counts/s")[0]


def test_columns_of_an_index_that_mean_nothing_are_named(campaign):
    readings = run(campaign, ["a.txt,4.5,0.1,signal", "dark_a.txt,,,dark"], "file,z_m,pos_x_m,role")
    (told,) = (w for w in readings.warnings if w.code == "unknown_columns")
    assert "pos_x_m" in told.sentence and "x_m" in told.remedy


def test_one_spectrum_that_stands_for_two_places_is_remarked(campaign):
    lines = ["a.txt,4.5,0,signal", "b.txt,5.5,0,signal", "dark_a.txt,,,dark", "dark_b.txt,,,dark"]
    before = run(campaign, lines, "file,z_m,x_m,role").warnings
    assert not [w for w in before if w.code == "copied"]
    (campaign / "copy.txt").write_bytes((campaign / "a.txt").read_bytes())
    readings = run(campaign, [*lines, "copy.txt,6.5,0,signal"], "file,z_m,x_m,role")
    (told,) = (w for w in readings.warnings if w.code == "copied")
    assert told.values["files"] == ("a.txt", "copy.txt")
    # Beside the first, at its place, it is a repeat.
    readings = run(campaign, [*lines, "copy.txt,4.5,0,signal"], "file,z_m,x_m,role")
    assert not [w for w in readings.warnings if w.code == "copied"]
