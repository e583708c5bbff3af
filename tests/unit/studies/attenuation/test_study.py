"""Apparent attenuation: errors common to all colours, refraction at the window, faint and lonely readings."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import campaign
import numpy as np
import pytest

from lightfield.errors import MeasurementError
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.readings.importing.importer import import_index
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene
from lightfield.studies.attenuation.apparent import apparent_attenuation
from lightfield.studies.attenuation.common_errors import Design, stays
from lightfield.studies.attenuation.ratios import ratios_of
from lightfield.studies.attenuation.remark import Studied
from lightfield.studies.attenuation.study import attenuation
from lightfield.studies.attenuation.text import as_data, as_text, headline

DISTANCES = np.array([4.5, 5.5, 6.5, 7.5, 8.5])
COLOURS = np.array([450.0, 500.0, 600.0])  # too few to look for constituents
WATER = {"base": "pure", "cdom_440_per_m": 0.05}


def scene(**lamp: float) -> Scene:
    return Scene.from_dict({"lamp": {"hwhm_deg": 3.81, **lamp}, "water": WATER})


def truth_per_m(colours: np.ndarray = COLOURS) -> np.ndarray:
    """c of that water from the loss of direct light between two places, which no fit takes part in."""
    near, far = (direct_field(scene(), *np.zeros((2, 3)), np.full(3, z), colours) * z**2 for z in (1.0, 2.0))
    return np.log(near / far)


def table(
    lamp: Scene, noise: float = 0.0, stay: float = 0.0, x: float = 0.0, seed: int = 0,
    colours: np.ndarray = COLOURS, stated: float | None = None, **given,
) -> Readings:  # fmt: skip
    """Direct light alone at all distances, in both media; errors of readings, and of whole stays."""
    rng = np.random.default_rng(seed)
    z, colour, air = (v.ravel() for v in np.meshgrid(DISTANCES, colours, [False, True], indexing="ij"))
    medium = np.where(air, "air", "water")
    light = direct_field(lamp, x + 0 * z, 0 * z, z, colour, medium)
    shared = stay * rng.standard_normal((5, 2))[np.searchsorted(DISTANCES, z), air.astype(int)]
    value = light * np.exp(shared + noise * rng.standard_normal(len(z)))
    stderr = (stated or max(noise, 1e-4)) * value
    columns = {"x_m": x, "wavelength_nm": colour, "medium": medium, "stderr": stderr}
    budget = {"plane_gain_percent": 100 * stay, "position_mm": 0.0}
    return Readings.from_arrays(z_m=z, value=value, **{**columns, **budget, **given})


@pytest.mark.parametrize(
    ("remarks", "said"), [(["no_dark"], 1), (["lit_dark"], 1), (["restless"], 0), ([], 0)]
)
def test_what_import_said_of_darks_is_said_again(remarks: list[str], said: int) -> None:
    notes = ratios_of(table(scene(), metadata={"imported": {"remarks": remarks}}), scene()).notes
    assert sum(note.studied is Studied.DARK_LEFT for note in notes) == said


def test_what_the_scene_knows_of_changing_water_and_readings_keep_is_said() -> None:
    """Water that clouds while air is read first and water later: K is that of the time, and it says why."""
    clouding = scene().with_values({"water.drift_per_m_per_hour": 0.02})
    light = table(scene(), noise=0.0, stated=0.003)
    found = attenuation(light, clouding)
    said = [note for note in found.notes if note.studied is Studied.READOUT_LEFT]
    assert [note.why for note in said] == ["water.drift_per_m_per_hour"]
    assert "note: water.drift_per_m_per_hour of the scene is not taken out of the readings" in as_text(found)
    assert not [n for n in ratios_of(light, scene()).notes if n.studied is Studied.READOUT_LEFT]


def test_it_is_the_loss_of_the_direct_light() -> None:
    found = attenuation(table(scene()), scene()).apparent[0]
    assert found.K_per_m == pytest.approx(truth_per_m(), abs=1e-7)


def test_elimination_equals_the_whole_covariance_matrix_inverted() -> None:
    """Aitken's estimate written out: every colour and place in one vector, one dense covariance."""
    rng = np.random.default_rng(1)
    rows, colours, stay = 6, 4, np.array([0, 0, 1, 2, 3, 3])
    stay_stderr = np.array([0.01, 0.02, 0.005, 0.01])
    X = rng.standard_normal((rows, colours, 2))
    y, sigma = rng.standard_normal((rows, colours)), rng.uniform(0.003, 0.02, (rows, colours))
    y[1, 2] = np.nan
    sigma[1, 2] = np.nan
    found = Design(sigma, X, stays(stay, 4), stay_stderr).estimate(y)

    at = [(j, k) for j in range(rows) for k in range(colours) if np.isfinite(y[j, k])]
    whole = np.zeros((len(at), 2 * colours))
    C = np.diag([sigma[j, k] ** 2 for j, k in at])
    for m, (j, k) in enumerate(at):
        whole[m, 2 * k : 2 * k + 2] = X[j, k]
        for n, (i, _) in enumerate(at):
            C[m, n] += stay_stderr[stay[j]] ** 2 * (stay[i] == stay[j])
    value, inverse = np.array([y[j, k] for j, k in at]), np.linalg.inv(C)
    covariance = np.linalg.inv(whole.T @ inverse @ whole)
    theta = covariance @ whole.T @ inverse @ value
    left = value - whole @ theta
    assert found.theta.ravel() == pytest.approx(theta, rel=1e-8)
    assert found.chi2 == pytest.approx(left @ inverse @ left, rel=1e-8)
    assert found.dof == len(at) - 2 * colours
    assert found.covariance(1) == pytest.approx(covariance[1::2, 1::2], rel=1e-7)


def test_error_of_K_is_the_closed_form() -> None:
    """sigma_K^2 = (s_eps^2 + s_stay^2) / S, S = sum (z - mean)^2 = 10 m^2; 0.5 and 0.7 %: 0.0027 per m."""
    readings = table(scene(), noise=0.005 / np.sqrt(2), stay=0.007 / np.sqrt(2))
    found = attenuation(readings, scene()).apparent[0]
    assert found.K_stderr == pytest.approx(np.sqrt((0.005**2 + 0.007**2) / 10), rel=1e-3)
    assert found.shared_stderr == pytest.approx(0.007 / np.sqrt(10), rel=1e-3)
    covariance = found.estimate.covariance(1)
    assert covariance[0, 1] == pytest.approx(0.007**2 / 10, rel=1e-3)


def test_what_it_says_of_its_errors_is_how_it_errs() -> None:
    """Over 200 experiments: spread of K and of its mean over colours, and chi-square, as stated."""
    lamp, truth = scene(), truth_per_m()
    tables = (table(lamp, 0.005, 0.007, seed=k) for k in range(200))
    several = [apparent_attenuation(ratios_of(readings, lamp)) for readings in tables]
    score = np.array([(one.K_per_m - truth) / one.K_stderr for one in several])
    mean = np.array([(one.mean()[0] - truth.mean()) / one.mean()[1] for one in several])
    # 200 scores: standard error of their mean 0.07, of their standard deviation 0.05
    assert np.abs(score.mean(axis=0)).max() < 0.25 and abs(mean.mean()) < 0.25
    assert np.abs(score.std(axis=0) - 1).max() < 0.2 and abs(mean.std() - 1) < 0.2
    assert np.mean([one.estimate.chi2 / one.estimate.dof for one in several]) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("in_air", [True, False])
def test_readings_beside_the_beam_know_that_they_stand_beside_their_place(in_air: bool) -> None:
    """2 mm along and across a beam whose light falls by 10 to 40 % in 5 cm: chi-square and K are as stated
    over 100 experiments. Were places exact, chi-square would be many times its degrees of freedom."""
    lamp, off_m = scene(hwhm_deg=9.0), 0.002
    places = [(x, z, air) for z in (0.7, 1.1, 1.5, 1.9, 2.4) for x in (-0.1, 0.0, 0.1, 0.2) for air in (0, 1)]
    x, z, air = (np.repeat(v, len(COLOURS)) for v in np.array([p for p in places if in_air or not p[2]]).T)
    colour, medium = np.tile(COLOURS, len(x) // len(COLOURS)), np.where(air > 0, "air", "water")

    def read(seed: int) -> Readings:
        rng = np.random.default_rng(seed)
        stood = np.repeat(off_m * rng.standard_normal((len(x) // len(COLOURS), 2)), len(COLOURS), axis=0)
        carriage = off_m * rng.standard_normal((5, 2))[np.searchsorted(np.unique(z), z), air.astype(int)]
        value = direct_field(lamp, x + stood[:, 0], stood[:, 1], z + carriage, colour, medium)
        value = value * (1 + 0.003 * rng.standard_normal(len(x)))
        budget = {"plane_gain_percent": 0.0, "position_mm": 1000 * off_m}
        return Readings.from_arrays(
            x_m=x, z_m=z, value=value, stderr=0.003 * value, wavelength_nm=colour, medium=medium, **budget
        )

    several = [apparent_attenuation(ratios_of(read(seed), lamp, in_air)) for seed in range(100)]
    score = np.array([(one.K_per_m - truth_per_m()) / one.K_stderr for one in several])
    assert 0.7 < np.mean([one.estimate.chi2 / one.estimate.dof for one in several]) < 1.1
    assert np.abs(score.mean(axis=0)).max() < 0.4 and 0.6 < score.std(axis=0).mean() < 1.15


def test_a_window_between_media_is_free_and_spoils_one_distance_alone() -> None:
    """n^2 of a lamp in water and in air: -ln(n^2) / z, -0.128 per m at 4.5 m and -0.068 at 8.5 m."""
    found = attenuation(table(scene(window_index=1.334)), scene()).apparent[0]
    assert found.K_per_m == pytest.approx(truth_per_m(), abs=1e-6)
    assert found.estimate.theta[:, 0] == pytest.approx(2 * np.log(1.334), abs=1e-6)
    off = found.one_distance() - truth_per_m()
    assert off[0] == pytest.approx(-0.128, abs=5e-4) and off[-1] == pytest.approx(-0.068, abs=5e-4)


def test_refraction_off_the_axis_is_taken_from_the_scene() -> None:
    """Beside the axis air shows another part of the beam; the scene's window undoes that."""
    lamp = scene(window_index=1.334)
    found = attenuation(table(lamp, x=0.3), lamp).apparent[0]
    assert found.K_per_m == pytest.approx(truth_per_m(), abs=1e-6)
    naive = attenuation(table(lamp, x=0.3), scene()).apparent[0]
    assert np.abs(naive.K_per_m - truth_per_m()).min() > 0.01


def test_a_lamp_that_has_faded_leaves_errors_the_part_of_a_reading_that_they_are() -> None:
    """Half of the light after an hour, with errors of the same per cent: ln(water / air) is as well known."""
    fading = scene(drift_per_hour=-0.5)
    whole = table(scene(), noise=0.005, common_percent=0.3)
    columns = {k: getattr(whole, k) for k in ("z_m", "medium", "wavelength_nm", "common_percent")}
    faded = Readings.from_arrays(
        **columns, value=0.5 * whole.value, stderr=0.5 * whole.stderr, time_s=3600.0, plane_gain_percent=0.0
    )
    right, found = ratios_of(whole, scene()), ratios_of(faded, fading)
    assert found.y == pytest.approx(right.y, abs=1e-9)
    assert found.stderr == pytest.approx(right.stderr, rel=1e-9)
    assert found.place_stderr == pytest.approx(right.place_stderr, rel=1e-9)


def test_bands_that_scatter_less_than_stated_share_the_rest() -> None:
    """0.1 % of their own where 1 % is stated: it is said, and no band's own error changes."""
    colours = np.linspace(450.0, 600.0, 8)
    told, held = (
        ratios_of(table(scene(), noise=0.001, colours=colours, stated=0.01, common_percent=common), scene())
        for common in (None, 0.0)
    )
    assert [n.studied for n in told.notes] == [Studied.SHARED_FROM_SCATTER] and not held.notes
    assert np.hypot(told.stderr, told.place_stderr[:, None]) == pytest.approx(held.stderr, rel=1e-6)
    assert told.place_stderr == pytest.approx(0.01 * np.sqrt(2 * 0.96), rel=0.02)
    mean, alone = (apparent_attenuation(one).mean()[1] for one in (told, held))
    assert mean / alone == pytest.approx(np.sqrt(8 * 0.96 + 0.04), rel=0.02)


def test_without_air_the_formula_stands_for_it() -> None:
    readings = table(scene())
    found = attenuation(readings, scene(), in_air=False).apparent[0]
    assert found.ratios.reference == "formula" and found.K_per_m == pytest.approx(truth_per_m(), abs=1e-7)
    wet = attenuation(readings.subset(readings.medium == "water"), scene()).apparent[0]
    assert wet.ratios.reference == "formula"


def test_per_cent_over_a_distance() -> None:
    found = attenuation(table(scene(), noise=0.005, stay=0.007), scene()).apparent[0]
    value, error = found.percent(8.5)
    left = np.exp(-8.5 * found.K_per_m)
    assert value == pytest.approx(100 * (1 - left)) and error == pytest.approx(850 * left * found.K_stderr)


def test_what_has_no_partner_or_no_light_is_left_out_and_said() -> None:
    whole = table(scene())
    lonely = (whole.medium == "air") & (whole.z_m == 6.5) & (whole.wavelength_nm == 500)
    faint = np.where((whole.z_m == 7.5) & (whole.wavelength_nm == 600), 0.5 * whole.value, whole.stderr)
    readings = Readings.from_arrays(
        **{k: getattr(whole, k)[~lonely] for k in ("z_m", "value", "medium", "wavelength_nm")},
        stderr=faint[~lonely],
    )
    found = attenuation(readings, scene())
    left, faint_pairs, gain = (
        next(note for note in found.notes if note.studied is studied)
        for studied in (Studied.NOT_IN_AIR, Studied.FAINT, Studied.GAIN_ASSUMED)
    )
    assert "1 readings in water have none in air" in str(left) and "the first at z = 6.5 m, 500 nm" in str(
        left
    )
    assert str(faint_pairs).startswith("1 of 14 pairs are fainter")
    assert "plane_gain_percent" in str(gain)
    data = json.loads(json.dumps(as_data(found)))
    assert data["notes"] == [str(note) for note in found.notes]
    assert {"studied": "faint", "count": 1, "among": 14, "limit": 12.0, "first": "z = 7.5 m, 600 nm"} in data[
        "remarks"
    ]
    assert found.apparent[0].K_per_m == pytest.approx(truth_per_m(), abs=1e-4)


def test_water_and_air_exchanged_are_suspected() -> None:
    """K is then less than none at every wavelength; with the media as they are nothing is said."""
    whole = table(scene(), noise=1e-3)
    swapped = replace(whole, medium=np.where(whole.medium == "air", "water", "air"))
    grows = [note for note in attenuation(swapped, scene()).notes if note.studied is Studied.GROWS]
    assert [(note.count, note.among) for note in grows] == [(3, 3)]
    assert "exchanged" in str(grows[0])
    assert headline(attenuation(swapped, scene())).startswith("Light in water grows with distance")
    assert not [note for note in attenuation(whole, scene()).notes if note.studied is Studied.GROWS]


def test_one_table_is_no_two_receivers() -> None:
    for first, second in ((table(scene()), table(scene())), (table(scene()),) * 2):
        with pytest.raises(MeasurementError, match="the same readings twice"):
            attenuation([first, second], scene())


def test_repeats_give_the_error_that_the_table_does_not_state() -> None:
    whole, rng = table(scene()), np.random.default_rng(2)
    five = {k: np.repeat(getattr(whole, k), 5) for k in ("z_m", "value", "medium", "wavelength_nm")}
    five["repeat"] = np.tile(np.arange(1.0, 6.0), len(whole))
    five["value"] = five["value"] * np.exp(0.004 * rng.standard_normal(len(five["value"])))
    found = ratios_of(Readings.from_arrays(**five), scene())
    # 120 degrees of freedom: the spread is known to 7 %
    assert np.mean(found.stderr) == pytest.approx(0.004 * np.sqrt(2 / 5), rel=0.2)
    assert apparent_attenuation(found).K_per_m == pytest.approx(truth_per_m(), abs=0.005)


@pytest.mark.parametrize(
    "chosen, words",
    [
        (lambda r: (r.medium == "air") & (r.z_m > 0), "no readings in water"),
        (lambda r: r.z_m == 4.5, "several distances"),
        (lambda r: (r.z_m == 4.5) | (r.medium == "water"), "several distances"),
    ],
)
def test_what_cannot_be_answered_is_one_error(chosen, words) -> None:
    readings = table(scene())
    with pytest.raises(MeasurementError, match=words):
        attenuation(readings.subset(chosen(readings)), scene())


def test_several_tables_are_of_the_same_colours_and_have_their_scenes() -> None:
    readings = table(scene())
    with pytest.raises(MeasurementError, match="different wavelengths"):
        attenuation([readings, readings.subset(readings.wavelength_nm > 460)], scene())
    with pytest.raises(MeasurementError, match="one scene for each"):
        attenuation([readings, readings, readings], [scene(), scene()])


def test_what_is_no_straight_line_is_said() -> None:
    """A layer between 6 and 7 m takes 3 % of the light behind it: readings good to 0.1 % show it."""
    whole = table(scene(), noise=0.001, stay=0.001)
    behind = (whole.z_m > 6) & (whole.medium == "water")
    columns = {k: getattr(whole, k) for k in ("z_m", "medium", "wavelength_nm", "stderr")}
    bent = Readings.from_arrays(
        **columns, value=np.where(behind, 0.97, 1.0) * whole.value, plane_gain_percent=0.1, position_mm=0.0
    )
    found = attenuation(bent, scene())
    assert "straight lines do not fit" in as_text(found)
    one = found.apparent[0]
    times = np.sqrt(one.estimate.chi2 / one.estimate.dof)
    assert f"errors of K are multiplied by {times:.2g}" in as_text(found) and times > 1
    stated = attenuation(whole, scene()).apparent[0].K_stderr
    assert one.K_stderr == pytest.approx(times * stated, rel=0.05), "of the same errors that were stated"
    assert "straight lines fit" in as_text(attenuation(whole, scene()))


def test_a_rejected_fit_of_constituents_says_so_and_widens_its_intervals() -> None:
    """Errors that are stated five times too small: the intervals are those of the right ones again."""
    colours = np.linspace(420.0, 650.0, 12)
    right, small = (
        attenuation(table(scene(), noise=0.01, colours=colours, stated=stated), scene())
        for stated in (0.01, 0.002)
    )
    (one, other) = (found.content.beer_lambert for found in (right, small))
    assert not one.rejected and one.errors_times == 1.0
    assert other.rejected and other.p < 1e-50
    assert other.errors_times == pytest.approx(5.0, rel=0.2)
    (mine, theirs) = (found.amounts["cdom_440_per_m"] for found in (one, other))
    assert theirs.value == pytest.approx(mine.value, rel=0.02)
    for a, b in ((mine.stderr, theirs.stderr), (mine.high_95, theirs.high_95), (mine.low_95, theirs.low_95)):
        assert b == pytest.approx(a, rel=0.2)
    words = as_text(small)
    assert f"errors × {other.errors_times:.2g}" in words and "not to be trusted" in words
    assert "rejected" not in as_text(right) and "not to be trusted" not in as_text(right)
    data = json.loads(json.dumps(as_data(small)))["constituents"]["beer_lambert"]
    assert data["rejected"] is True and data["errors_times"] == other.errors_times


def test_words_and_data_hold_the_same_numbers_with_errors() -> None:
    found = attenuation(table(scene(), noise=0.005, stay=0.007), scene())
    data = json.loads(json.dumps(as_data(found)))["apparent"][0]
    own, modes = np.array(data["attenuation_stderr_own"]), np.array(data["attenuation_stderr_modes"])
    assert np.diag(own**2) + modes @ modes.T == pytest.approx(found.apparent[0].estimate.covariance(1))
    assert f"± {found.apparent[0].K_stderr[1]:.4f} per m), the least of 3 wavelengths" in as_text(found)


def test_from_instrument_files_to_attenuation(tmp_path) -> None:
    """Jaz files, each with its own dark spectrum, in air and in water, whose light falls as exp(-0.1 s)."""
    rows = []
    for z in (4.5, 6.5, 8.5):
        for medium, K in (("air", 0.0), ("water", 0.1)):
            level, name = np.exp(-K * z) * (4.5 / z) ** 2, f"{medium}{z}.jaz"
            signal = campaign.DARK + 0.05 * campaign.rate(campaign.WAVELENGTH, level)
            campaign.jaz(tmp_path / name, campaign.DARK, signal)
            rows.append(f"{name},{z},{medium}")
    index = campaign.write_index(tmp_path, rows, "file,z_m,medium")
    bands = [(500.0, 510.0), (520.0, 530.0), (540.0, 550.0)]
    readings = import_index(index, quantity="irradiance", units="counts", bands_nm=bands)
    found = attenuation(readings, scene()).apparent[0]
    assert found.ratios.reference == "air" and found.ratios.wavelength_nm.tolist() == [505, 525, 545]
    assert found.K_per_m == pytest.approx(0.1, abs=1e-5)


@pytest.mark.parametrize("blue", [0.0, 5e-4])
def test_daylight_that_drifts_is_taken_from_every_reading(blue: float) -> None:
    """Half of the faintest light, doubled within an hour; of one colour, and of two."""
    there = {"detector.background_drift_per_hour": 0.8, "detector.background": 1e-3}
    ends = COLOURS[0], COLOURS[-1]
    lamp = scene().with_values(there | {"detector.background_departure": ((ends[0], blue), (ends[1], 0.0))})
    clear = table(scene())
    time = np.linspace(0, 4500, len(clear))
    sky = 1e-3 + np.interp(clear.wavelength_nm, ends, (blue, 0.0))
    daylight = sky * (1 + 0.8 * time / 3600)
    assert daylight.max() > 0.5 * clear.value.min()
    columns = {k: getattr(clear, k) for k in ("z_m", "medium", "wavelength_nm", "stderr")}
    lit = Readings.from_arrays(value=clear.value + daylight, time_s=time, **columns)
    found = apparent_attenuation(ratios_of(lit, lamp))
    assert found.K_per_m == pytest.approx(truth_per_m(), abs=1e-3)


def test_a_colour_without_light_leaves_the_errors_of_others_alone() -> None:
    """Repeats that scatter around nothing are no relative error."""
    whole, rng = table(scene()), np.random.default_rng(4)
    five = {k: np.repeat(getattr(whole, k), 5) for k in ("z_m", "value", "medium", "wavelength_nm")}
    five["repeat"] = np.tile(np.arange(1.0, 6.0), len(whole))
    dark = five["wavelength_nm"] == COLOURS[-1]
    scattered = five["value"] * np.exp(0.004 * rng.standard_normal(len(dark)))
    five["value"] = np.where(dark, 1e-6 * rng.standard_normal(len(dark)), scattered)
    found = ratios_of(Readings.from_arrays(**five), scene())
    assert found.wavelength_nm == pytest.approx(COLOURS[:-1])
    assert np.mean(found.stderr) == pytest.approx(0.004 * np.sqrt(2 / 5), rel=0.2)


def test_grey_water_of_a_scene_is_least_nowhere() -> None:
    """Of a scene that dims all colours alike it was said that attenuation "would be least at 600 nm"."""
    grey = Scene.from_dict({"lamp": {"hwhm_deg": 3.81}, "water": {"absorption_per_m": 0.4}})
    said = as_text(attenuation(table(scene(), noise=3e-3), grey, partial(response_for, photons=20_000)))
    assert "The scene states another water than the readings show" in said
    assert "would be 0.4000 per m" in said and "would be least" not in said
