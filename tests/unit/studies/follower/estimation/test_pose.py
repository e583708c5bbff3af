"""Poses from readings: unbiased, as scattered as the bound says, with rivals, and over time."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from lightfield.errors import MeasurementError
from lightfield.report.follower.pose_page import poses_page
from lightfield.scene import Follower, Scene
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Space
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.elements import Elements, grid, on_sphere
from lightfield.studies.follower.estimation.pose import Estimator
from lightfield.studies.follower.estimation.sequence import Lost, Poses, poses_of
from lightfield.studies.follower.estimation.table import read_samples
from lightfield.studies.follower.estimation.tracking import Tracker
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.pose_search import Minima, box_of
from lightfield.studies.follower.rival_poses import nearest_alike, rivals

SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 3.81},
        "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.05},
        "array": {"size_m": 0.26, "radius_m": 0.19},
    }
)
LIGHT = FormulaLight(SCENE)
FLAT = grid((5, 5), 0.6)
HEMISPHERE = on_sphere(grid((5, 5), 0.26), 0.19)
NOISE = SensorNoise(brightest=0.01, ampere=1.0, amplifier=1e-9)
SPACE = Space(0.5, 4.5, 8.5)
FIVE = POSE[:5]
POSE_0 = np.array([0.2, 0.1, 6.0, 0.1, -0.05, 0.0])


def estimator(elements: Elements = HEMISPHERE, gain: float = 0.05) -> Estimator:
    nuisances = {"gain": gain} if gain else {}
    return Estimator(ArrayModel(LIGHT, elements), NOISE, FIVE, nuisances, SPACE)


def noisy(pose: np.ndarray, rng: np.random.Generator, elements: Elements = HEMISPHERE) -> np.ndarray:
    readings = ArrayModel(LIGHT, elements).readings(pose[None])[0]
    return readings + np.sqrt(NOISE.variance(readings)) * rng.standard_normal(len(readings))


@pytest.mark.parametrize("gain", [1.0, 1.1])
def test_readings_without_noise_give_their_pose(gain: float) -> None:
    """From no idea where, also when the gain is off and not known beforehand."""
    readings = gain * ArrayModel(LIGHT, HEMISPHERE).readings(POSE_0[None])[0]
    found = estimator(gain=np.inf).estimate(readings)
    np.testing.assert_allclose(found.pose, POSE_0, atol=2e-4)
    assert found.gain == pytest.approx(gain, rel=1e-4) and found.fits and not found.rivals


def test_a_lamp_that_may_point_elsewhere_moves_no_estimate_to_one_side() -> None:
    """Known to 2 degrees: sought as if its light faded by an exponential it put followers 0.2 m too far, with
    rivals that are none."""
    unknown = {"gain": 0.05, "lamp tilt x": np.radians(2.0), "lamp tilt y": np.radians(2.0)}
    seeking = Estimator(ArrayModel(LIGHT, HEMISPHERE), NOISE, FIVE, unknown, SPACE)
    rng, pose = np.random.default_rng(3), np.array([0.1, -0.05, 6.5, 0.05, 0.1, 0.0])
    found = [seeking.estimate(noisy(pose, rng)) for _ in range(24)]
    off = np.array([one.pose[2] - pose[2] for one in found])
    assert abs(off.mean()) < 3.5 * off.std(ddof=1) / np.sqrt(24)
    assert off.std() < 1.5 * estimator().estimate(noisy(pose, rng)).total.sigma["z"]
    assert not any(one.ambiguous for one in found)
    # Where it stands beside the axis it knows no better than where the lamp points.
    assert found[0].total.sigma["x"] == pytest.approx(6.5 * np.radians(2.0), rel=0.3)


def test_estimates_scatter_as_the_bound_says_and_fit_as_chi2() -> None:
    """200 draws: squared distances from the truth, and chi2, are those of their degrees of freedom."""
    rng, one = np.random.default_rng(2), estimator(gain=0.0)
    draws = [one.estimate(noisy(POSE_0, rng), POSE_0) for _ in range(200)]
    distances = []
    for d in draws:
        assert d.total is not None
        apart = (d.pose - POSE_0)[:5]
        distances.append(apart @ np.linalg.solve(d.total.covariance, apart))
    assert stats.kstest(distances, stats.chi2(5).cdf).pvalue > 1e-3
    assert stats.kstest([d.chi2 for d in draws], stats.chi2(20).cdf).pvalue > 1e-3
    assert np.mean([d.fits for d in draws]) > 0.95


def test_an_unknown_gain_is_in_the_error_and_not_in_the_scatter() -> None:
    """Readings of a gain 4 % high: one after the other hardly differs along the beam, but all are off."""
    rng, one = np.random.default_rng(3), estimator(HEMISPHERE, 0.02)
    draws = [one.estimate(1.04 * noisy(POSE_0, rng), POSE_0) for _ in range(100)]
    z = np.array([d.pose[2] for d in draws])
    first = draws[0]
    assert first.noise_only is not None and first.total is not None
    assert z.std() == pytest.approx(first.noise_only.sigma["z"], rel=4 / np.sqrt(200))
    assert abs(z.mean() - POSE_0[2]) > z.std() and abs(z.mean() - POSE_0[2]) < 4 * first.total.sigma["z"]


@pytest.mark.parametrize(
    ("x_m", "per_m", "known"),
    [(0.3, 0.3, 0.2), pytest.param(0.0, 0.1, 0.5, marks=pytest.mark.slow)],
)
def test_water_that_is_not_known_is_sought_with_the_pose(x_m: float, per_m: float, known: float) -> None:
    """60 readings, each in water of its own, by the formula of another scene: errors are those that are told,
    and chi2 knows that the water is another.

    Held at the believed water z was off by 2.3 of the errors in the first (root of the mean square).
    """
    rng = np.random.default_rng(5)
    believed = Scene.from_dict({"lamp": {"hwhm_deg": 3.81}, "water": {"absorption_per_m": per_m}})
    model = ArrayModel(FormulaLight(believed), HEMISPHERE)
    one = Estimator(model, NOISE, FIVE, {"gain": 0.05, "absorption": known, "scattering": known}, SPACE)
    pose, off, fits = np.array([x_m, 0.1, 6.5, 0.1, 0.0, 0.0]), [], []
    for _ in range(60):
        water = per_m * np.exp(known * rng.standard_normal())
        truth = FormulaLight(believed.with_values({"water.absorption_per_m": water}))
        read = ArrayModel(truth, HEMISPHERE).readings(pose[None])[0] * np.exp(0.05 * rng.standard_normal())
        found = one.estimate(read + np.sqrt(NOISE.variance(read)) * rng.standard_normal(len(read)))
        assert found.total is not None
        off.append((found.pose - pose)[:5] / list(found.total.sigma.values()))
        fits.append(found.fits)
    # Mean squares of 60 pulls: within four standard deviations of one.
    np.testing.assert_allclose(np.mean(np.square(off), axis=0), 1.0, atol=4 * np.sqrt(2 / 60))
    assert np.sum(fits) >= 56  # of 60, 0.6 expected not to


def test_a_follower_that_leans_as_its_scene_says_is_found() -> None:
    """About the axis of a round beam the light does not tell how it leans: it is what is stated."""
    leaning = SCENE.model_copy(update={"follower": Follower(roll_deg=20.0)})
    pose = np.append(POSE_0[:5], np.radians(20.0))
    one = Estimator.of_scene(leaning, LIGHT, SPACE)
    readings = one.model.readings(pose[None])[0]
    for last in (None, POSE_0):
        np.testing.assert_allclose(one.estimate(readings, last, more_starts=4).pose, pose, atol=2e-4)
    straight = Estimator.of_scene(SCENE, LIGHT, SPACE).estimate(readings).pose
    assert np.abs(straight - pose)[:2].max() > 0.02


def test_what_went_wrong_is_said() -> None:
    """A dead element, another lamp, darkness."""
    readings = ArrayModel(LIGHT, HEMISPHERE).readings(POSE_0[None])[0]
    dead = readings.copy()
    dead[int(readings.argmax())] = 0.0
    found = estimator().estimate(dead)
    assert not found.fits and found.as_data()["status"] == "readings do not fit the light"
    # A wider beam in darker water is explained well enough by a place that is too far away to be looked at.
    other = Scene.from_dict({"lamp": {"hwhm_deg": 6.0}, "water": {"absorption_per_m": 0.3}})
    found = estimator(FLAT).estimate(ArrayModel(FormulaLight(other), FLAT).readings(POSE_0[None])[0])
    assert not found.fits and found.edge and "edge" in found.as_text()
    lost = estimator().estimate(np.zeros(25))
    assert lost.lost and lost.as_data() == {"status": "light lost"} and "light lost" in lost.as_text()


def test_rival_of_a_flat_array() -> None:
    """With the gain unknown, 10 degrees of yaw at 0.30 m look like -20 degrees at 0.34 m (prototype: 1.2
    sigma).

    The prototype's light scatters (b = 0.05 1/m), this formula does not: the distance is somewhat larger.
    """
    pose = np.array([0.3, 0.0, 6.5, np.radians(10), 0.0, 0.0])
    noise, box = SensorNoise(brightest=0.01), box_of(SPACE)
    found = rivals(ArrayModel(LIGHT, FLAT), pose, FIVE, noise, box, nuisances={"gain": np.inf})
    assert len(found) == 1 and found[0].sigma < 2.0
    assert found[0].pose[0] == pytest.approx(0.34, abs=0.01)
    assert np.degrees(found[0].pose[3]) == pytest.approx(-20, abs=2)
    assert rivals(ArrayModel(LIGHT, FLAT), pose, FIVE, noise, box) == []
    assert rivals(ArrayModel(LIGHT, HEMISPHERE), pose, FIVE, noise, box, nuisances={"gain": np.inf}) == []
    # Four readings for five unknowns: as many rivals as one looks for.
    assert len(rivals(ArrayModel(LIGHT, grid((2, 2), 0.4)), pose, FIVE, noise, box)) > 10


@pytest.mark.slow
@pytest.mark.parametrize(("from_m", "to_m", "seed", "noise"), [(0.4, 0.2, 3, 3e-4), (0.3, 0.1, 0, 1e-3)])
def test_a_sequence_does_not_stay_at_a_mirrored_pose(from_m: float, to_m: float, seed: int, noise: float):
    """A flat array that turns through zero: there two minima of the cost are one, and part again.

    Begun at the last pose alone, 8 rows of the first and the last 17 of the second stayed with the wrong one,
    up to 30 in chi2 above the other. A row is never worse than by itself; what is wrong is called ambiguous.
    """
    sensor, flat = SensorNoise(brightest=noise), grid((5, 5), 0.26)
    one = Estimator(ArrayModel(LIGHT, flat), sensor, FIVE, {"gain": 0.05}, SPACE)
    rng, last, wrong = np.random.default_rng(seed), None, 0
    for t in np.linspace(0.0, 1.0, 30):
        pose = np.array([from_m + (to_m - from_m) * t, 0.05, 6.5, np.radians(25 * (2 * t - 1)), 0.0, 0.0])
        readings = one.model.readings(pose[None])[0]
        readings += np.sqrt(sensor.variance(readings)) * rng.standard_normal(len(readings))
        found, alone = one.estimate(readings, last), one.estimate(readings, more_starts=20)
        assert found.chi2 < alone.chi2 + 1.01
        if abs(np.degrees(found.pose - pose)[3]) > 5:
            wrong += 1
            assert found.ambiguous and "ambiguous" in found.as_text() and found.as_data()["ambiguous"]
        last = found.pose
    assert wrong <= 5  # as many as are by themselves: noise alone
    assert abs(np.degrees(found.pose - pose)[3]) < 3


def test_of_poses_that_are_alike_the_nearest_to_the_last_is_taken() -> None:
    """Within one sigma; a whole turn of roll is none; copies of one minimum are one."""
    near, far = np.array([0.1, 0, 6, 0.1, 0, 3.1]), np.array([0.2, 0, 6, -0.3, 0, 0.0])
    last = np.array([0.1, 0, 6, 0.1, 0, 3.15 - 2 * np.pi])
    for chi2, taken in ((20.5, 2), (21.5, 0)):
        poses, nothing = np.array([far, far + 1e-3, near]), np.zeros((3, 0))
        found = Minima(poses, np.ones(3), np.array([20.0, 20.01, chi2]), nothing)
        assert nearest_alike(found, last, 1.0) == taken
        assert nearest_alike(found, None, 1.0) == 0


ASIDE = np.array([0.4, 0, 0, 0, 0, 0])


def way(t: float) -> np.ndarray:
    return np.array([0.1 * np.sin(t), 0.05 * t, 6.5 - 0.1 * t, 0.05 * np.sin(t), 0.0, 0.0])


def test_a_filter_is_better_than_single_readings_and_knows_how_good_it_is() -> None:
    """Innovations and errors have the size that the filter says (NIS and NEES), over a smooth way."""
    rng, tracker = np.random.default_rng(4), Tracker(estimator(gain=0.0))
    times = 0.1 * np.arange(60)
    states = [tracker.update(noisy(way(t), rng), float(t)) for t in times]
    late = states[15:]
    errors = np.array([s.pose - way(s.time_s) for s in late])[:, :5]
    single = np.array([s.estimate.pose - way(s.time_s) for s in late])[:, :5]
    assert (errors.std(axis=0) < 0.9 * single.std(axis=0)).sum() >= 4
    # The motion allowed for is livelier than this way: distances are smaller than chi2 of 5, and never
    # larger.
    nis = np.mean([s.innovation for s in late])
    nees = np.mean([e @ np.linalg.solve(s.covariance, e) for e, s in zip(errors, late, strict=True)])
    assert 0.5 * 5 < nis < 5 + 4 * np.sqrt(10 / len(late))
    assert 0.2 * 5 < nees < 5 + 4 * np.sqrt(10 / 10)  # neighbours share readings: some ten are independent
    assert all(s.used for s in states)


def test_a_filter_outlives_darkness_and_refuses_what_cannot_be() -> None:
    rng, tracker = np.random.default_rng(5), Tracker(estimator())
    for t in 0.1 * np.arange(20):
        last = tracker.update(noisy(way(t), rng), float(t))
    dark = tracker.update(np.zeros(25), 2.0)
    assert dark.estimate.lost and not dark.used and np.isfinite(dark.pose).all()
    assert (np.diag(dark.covariance) > np.diag(last.covariance)).all()
    jump = tracker.update(noisy(way(2.1) + ASIDE, rng), 2.1)
    assert not jump.used and abs(jump.pose[0] - way(2.1)[0]) < 0.1
    for t in 2.2 + 0.1 * np.arange(12):  # it was true after all: the filter begins anew
        last = tracker.update(noisy(way(t) + ASIDE, rng), float(t))
    assert abs(last.pose[0] - way(last.time_s)[0] - 0.4) < 0.1


def test_what_light_loss_looks_like(tmp_path: Path) -> None:
    """Darkness for 0.3 s, then another lamp for 0.4 s: both are told, with what the filter then knows."""
    rng, times = np.random.default_rng(7), 0.1 * np.arange(22)
    readings = np.array([noisy(way(t), rng) for t in times])
    readings[8:11] = 0.0
    readings[14:18, :13] *= 1.5  # half of the array sees a second lamp
    found = poses_of(written(tmp_path / "way.csv", readings, times), SCENE, SPACE, filtered=True, photons=0)
    dark, strange = found.losses
    assert (dark.why, strange.why) == (Lost.LIGHT, Lost.BELIEF)
    np.testing.assert_allclose([dark.from_s, dark.to_s, dark.found_s], [0.8, 1.0, 1.1])
    np.testing.assert_allclose([strange.from_s, strange.to_s, strange.found_s], [1.4, 1.7, 1.8])
    assert dark.sigma_m is not None and dark.sigma_m[1] > 1.1 * dark.sigma_m[0]
    assert "light lost from 0.80 to 1.00 s" in found.as_text() and "found again at 1.10 s" in found.as_text()
    assert found.as_data()["losses"][0]["why"] == "light lost"
    assert '"why": "light lost"' in json.dumps(found.as_data()["losses"])
    assert str(dark).startswith("light lost from ")


def written(path: Path, readings: np.ndarray, times: np.ndarray | None = None) -> Path:
    header = [*([] if times is None else ["time_s"]), *(f"e{k + 1}" for k in range(readings.shape[1]))]
    rows = readings if times is None else np.column_stack([times, readings])
    path.write_text(
        "\n".join([",".join(header), *(",".join(f"{v:.9g}" for v in row) for row in rows)]) + "\n"
    )
    return path


def test_a_roll_goes_round() -> None:
    """Beside an oval beam it is sought: no pose ends at 180 degrees, where the range of angles does."""
    oval = FormulaLight(SCENE.with_values({"lamp.ellipticity": 1.3}))
    one = Estimator(ArrayModel(oval, HEMISPHERE), NOISE, POSE, {"gain": 0.05}, SPACE)
    rng, ends = np.random.default_rng(4), []
    for roll in (0.1, 1.5, 3.0):
        read = one.model.readings(np.append(POSE_0[:5], roll)[None])[0]
        read += np.sqrt(NOISE.variance(read)) * rng.standard_normal(len(read))
        found = one.estimate(read, more_starts=16)
        ends += [abs(pose[5]) for pose in (found.pose, *(rival.pose for rival in found.rivals))]
    assert len(ends) > 3 and not np.isclose(ends, np.pi, atol=1e-9).any()


def test_poses_at_the_edge_of_the_space_are_no_other_light(tmp_path: Path) -> None:
    """At 12 m, looked for up to 8.8: the light is the one that is believed in."""
    rng, far = np.random.default_rng(8), np.array([0.1, 0.0, 12.0, 0.0, 0.0, 0.0])
    readings = np.array([noisy(far, rng) for _ in range(4)])
    found = poses_of(written(tmp_path / "far.csv", readings), SCENE, SPACE, photons=0)
    (lost,) = found.losses
    assert lost.why is Lost.SPACE and found.as_data()["losses"][0]["why"] == Lost.SPACE.value
    assert "up to 34 degrees" in str(lost) and "another light" not in found.as_text()


def test_what_an_array_cannot_know_is_unknown_in_words() -> None:
    """Three elements for five unknowns: no error, and no probability."""
    three = estimator(Elements(HEMISPHERE.place_m[[0, 12, 20]], HEMISPHERE.normal[[0, 12, 20]]))
    found = three.estimate(three.model.readings(POSE_0[None])[0])
    text = found.as_text()
    assert "yaw unknown" in text and "inf" not in text and "as many unknowns as readings" in text
    last = Poses(SCENE, three.names, np.zeros(1), [found], None, False).last_known
    assert "inf" not in last and "at an unknown place aside" in last


def test_a_table_of_readings(tmp_path: Path) -> None:
    rng, times = np.random.default_rng(6), np.array([0.0, 0.1, 0.2])
    readings = np.array([noisy(way(t), rng) for t in times])
    scene = SCENE.with_values({"array.gain": 3.0})
    for filtered in (False, True):
        path = written(tmp_path / "way.csv", 3.0 * readings, times)
        found = poses_of(path, scene, SPACE, filtered=filtered, photons=0)
        assert [one.fits for one in found.estimates] == 3 * [True]
        assert abs(found.estimates[2].pose[0] - way(0.2)[0]) < 0.1
        assert "3 samples, 0 without light, 0 that do not fit" in found.as_text()
        assert found.as_data()["samples"][0]["frames"]["ros"]["position_m"][0] < -6
    np.testing.assert_allclose(
        read_samples(written(tmp_path / "b.csv", readings), 25, 5.0).time_s, [0, 0.2, 0.4]
    )


def test_an_element_that_was_not_read_tells_nothing() -> None:
    """The pose and its errors are those of the array without it."""
    read = np.arange(25) != 7
    readings = noisy(POSE_0, np.random.default_rng(7))
    fewer = Elements(HEMISPHERE.place_m[read], HEMISPHERE.normal[read])
    expected = estimator(fewer).estimate(readings[read])
    found = estimator().estimate(np.where(read, readings, np.nan))
    np.testing.assert_array_equal(found.pose, expected.pose)
    assert found.total is not None and expected.total is not None
    np.testing.assert_array_equal(found.total.covariance, expected.total.covariance)


def test_readings_in_another_unit_are_too_bright_or_too_dim(tmp_path: Path) -> None:
    """Both ask for array.gain; noise about nothing, and a little light, do not."""
    readings = np.array([noisy(way(t), np.random.default_rng(6)) for t in (0.0, 0.1)])
    with pytest.raises(MeasurementError, match=r"far brighter.*state array\.gain"):
        poses_of(written(tmp_path / "bright.csv", 1e6 * readings), SCENE, SPACE, photons=0)
    dim = poses_of(written(tmp_path / "dim.csv", 1e-9 * np.abs(readings)), SCENE, SPACE, photons=0)
    assert dim.lost == 2 and "State array.gain" in dim.as_text() and "State array.gain" in poses_page(dim)
    below = poses_of(written(tmp_path / "below.csv", -readings), SCENE, SPACE, photons=0).as_text()
    assert "less than 0 by more than noise in 2 of 2 lines" in below
    dark = 1e-12 * np.random.default_rng(6).standard_normal(readings.shape)
    assert not poses_of(written(tmp_path / "dark.csv", dark), SCENE, SPACE, photons=0).doubts


def test_dead_elements_are_left_empty_and_those_that_are_not_are_named(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    readings = np.array([noisy(way(t), rng) for t in (0.0, 0.1)])
    path = written(tmp_path / "way.csv", np.where(np.arange(25) == 7, 0.0, readings))
    wrong = poses_of(path, SCENE, SPACE, photons=0)
    assert wrong.silent == ("e8",) and "leave the cells of a dead element empty" in wrong.as_text()
    assert wrong.misfits == 2 and wrong.last_known == ""
    lines = path.read_text().splitlines()
    at = lines[0].split(",").index("e8")
    emptied = [
        ",".join("" if k == at else cell for k, cell in enumerate(one.split(","))) for one in lines[1:]
    ]
    path.write_text("\n".join([lines[0], *emptied]) + "\n")
    found = poses_of(path, SCENE, SPACE, photons=0)
    assert found.silent == () and all(one.fits for one in found.estimates)
    assert np.linalg.norm(found.estimates[0].pose[:3] - way(0.0)[:3]) < 0.5


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_table_with_decimal_commas(tmp_path: Path, separator: str) -> None:
    """As spreadsheets of half the world write it, with the mark of UTF-8 before it."""
    path = tmp_path / "readings.csv"
    text = "\r\n".join(["## by hand", "time_s;e1;e2", "0;1,5;2e-3", "0,25;1,25;0,5", ""])
    path.write_bytes(b"\xef\xbb\xbf" + text.replace(";", separator).encode())
    found = read_samples(path, 2, 10.0)
    assert found.time_s.tolist() == [0.0, 0.25] and found.readings.tolist() == [[1.5, 0.002], [1.25, 0.5]]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time_s,e1\n0,1\n", "column e2 is missing"),
        ("e1,e2,e2\n1,2,3\n", "twice"),
        ("e1,e2\n", "no line with readings"),
        ("e1,e2\n1,inf\n", "line 2"),
        ("e1,e2\n,nan\n", "no element was read"),
        ("time_s,e1,e2\n,1,1\n", "line 2"),
        ("e1,e2\n1\n", "line 2"),
        ("time_s,e1,e2\n1,1,1\n1,1,1\n", "must rise"),
        ("time_ms,e1,e2\n1,1,1\n", "column time_ms is not"),
        ("e1,e2,e3\n1,1,1\n", "column e3 is not one of this array's.*e1 to e2"),
    ],
)
def test_tables_that_are_none(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "readings.csv"
    path.write_text(text)
    with pytest.raises(MeasurementError, match=says):
        read_samples(path, 2, 10.0)
