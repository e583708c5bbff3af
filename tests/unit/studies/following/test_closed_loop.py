"""The closed loop: followers end where the theory of a wrong model says, and what went wrong is said."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lightfield import cli
from lightfield.errors import BackendError, OutputError, SceneError
from lightfield.report.follower.follow_page import follow_sweep_page, following_page
from lightfield.scene import Scene
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.belief import belief
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.follower.estimation.tracking import Filter
from lightfield.studies.follower.frames import POSE, wrapped
from lightfield.studies.following import sweep
from lightfield.studies.following.leader import way_of
from lightfield.studies.following.loop import _Moving
from lightfield.studies.following.metrics import OverRuns, metrics_of
from lightfield.studies.following.study import Followed, Following, follow, with_belief
from lightfield.studies.following.sweep import QUANTITY, as_data, run_follow_sweep
from lightfield.studies.following.truth_and_belief import Truth, belief_of
from lightfield.sweep.axes import parse_axis
from lightfield.sweep.results import open_store, verify

SCENE = Scene.from_dict(
    {
        "name": "<water>",
        "lamp": {"hwhm_deg": 3.81},
        "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.05},
        "array": {"count": [3, 3], "size_m": 0.26, "radius_m": 0.19, "sample_hz": 5.0},
        "follower": {"water_known_percent": 0.0, "mission": {"duration_s": 24.0, "leader": "still"}},
    }
)
KNOWN = SCENE.with_values({"array.gain_drift_percent": 0.0, "array.gain_mismatch_percent": 0.0})


def run(scene: Scene = KNOWN, runs: int = 2, **values: object) -> Followed:
    told = {(f"follower.mission.{k}" if "." not in k else k): v for k, v in values.items()}
    return follow({scene.name: scene.with_values(told)}, runs=runs, seed=3, photons=0).cases[0]


@pytest.mark.parametrize("believes", ["exact", "fitted", pytest.param("clear", marks=pytest.mark.slow)])
def test_a_follower_ends_where_its_wrong_light_puts_it(believes: str) -> None:
    """Truth is another c than is believed: the distance at which the belief, of `pose bias`, says 6.5 m."""
    truth = FormulaLight(KNOWN)
    elements = elements_of(KNOWN.array)  # type: ignore[arg-type]
    other = KNOWN.with_values({"water.absorption_per_m": 0.12, "follower.mission.duration_s": 30.0})
    model, _ = belief_of("exact", FormulaLight(other), elements, 6.5)
    if believes != "exact":
        model, _ = belief_of(believes, truth, elements, 6.5)
    # By bisection on the static theory, which knows nothing of a loop.
    near, far = 5.0, 8.0
    for _ in range(30):
        z = 0.5 * (near + far)
        found = belief(
            ArrayModel(truth, elements),
            model,
            np.array([0, 0, z, 0, 0, 0.0]),
            "xyz",
            SensorNoise(brightest=0.01),
        )
        near, far = (z, far) if found.believed[2] < 6.5 else (near, z)
    run_ = run(believes=believes, duration_s=30.0)
    if believes == "exact":
        assert run_.spreads["standoff_at_end"].mean == pytest.approx(6.5, abs=0.02)
    else:
        assert run_.spreads["standoff_at_end"].mean == pytest.approx(z, abs=0.02)


@pytest.mark.parametrize(
    "water", [{}, {"base": "pure"}, {"chlorophyll_mg_per_m3": 1.0, "scattering_per_m": 0.0}]
)
def test_water_that_is_not_known_is_drawn_as_the_bound_takes_it(water: dict[str, object]) -> None:
    """Absorption and scattering as a whole, whatever they are made of, each by a factor of its own."""
    scene = KNOWN.with_values({f"water.{k}": v for k, v in water.items()})
    scene = scene.with_values({"follower.water_known_percent": 20.0})
    elements, runs = elements_of(scene.array), 200  # type: ignore[arg-type]
    truth = Truth.of(scene, FormulaLight(scene), elements, runs, np.random.default_rng(1))
    at = np.array([525.0])
    for coefficient in (absorption_per_m, scattering_per_m):
        drawn = np.array([coefficient(one[0].light.scene.water, at)[0] for one in truth.models])
        log = np.log(drawn / coefficient(scene.water, at)[0])
        assert log.std(ddof=1) == pytest.approx(0.2, abs=4 * 0.2 / np.sqrt(2 * runs))
        assert abs(log.mean()) < 4 * 0.2 / np.sqrt(runs)


def test_the_lamps_direction_is_drawn_as_the_bound_takes_it() -> None:
    """A lamp that points elsewhere by d is a spot moved by z tan d: readings of a scene with that tilt."""
    scene = KNOWN.with_values({"follower.lamp_tilt_known_deg": 1.0})
    elements, runs = elements_of(scene.array), 200  # type: ignore[arg-type]
    truth = Truth.of(scene, FormulaLight(scene), elements, runs, np.random.default_rng(1))
    tilts = np.degrees(truth.tilts)
    assert tilts.std(axis=0, ddof=1) == pytest.approx([1.0, 1.0], abs=4 / np.sqrt(2 * runs))
    pose = np.array([0.1, -0.2, 6.0, 0.05, 0.02, 0.0])
    for k, (x, y) in enumerate(tilts[:3]):
        tilted = scene.with_values({"lamp.tilt_x_deg": float(x), "lamp.tilt_y_deg": float(y)})
        expected = ArrayModel(FormulaLight(tilted), elements).readings(pose[None])[0]
        read = truth.readings(np.tile(pose, (runs, 1)), 0.0)[k]
        np.testing.assert_allclose(read, expected, rtol=2e-3)


@pytest.fixture(scope="module")
def brief() -> Followed:
    return run(duration_s=4.0)


def test_a_swing_beyond_the_distance_asked_for_is_overshoot(brief: Followed) -> None:
    """From 6.5 m, asked for 6.5 m: to 7.5 m is 1 m; from 8 m only what is nearer than 6.5 m counts."""
    pose = brief.track.pose.copy()
    pose[..., 2] = 6.5
    pose[3, 0, 2], pose[3, 1, 2] = 7.5, 6.1
    swung = replace(brief.track, pose=pose)
    assert metrics_of(swung, brief.mission)["overshoot"].tolist() == pytest.approx([1.0, 0.4])
    pose[:3, :, 2] = 8.0
    assert metrics_of(swung, brief.mission)["overshoot"].tolist() == pytest.approx([0.0, 0.4])


def test_the_nearest_is_a_distance_from_the_lamp(brief: Followed) -> None:
    """A vehicle that passes 0.5 m beside the lamp, and on behind it, was never nearer than that."""
    pose = np.zeros_like(brief.track.pose)
    pose[:, 0, 0], pose[:, 0, 2] = 0.5, np.linspace(3.0, -1.0, len(pose))
    near = metrics_of(replace(brief.track, pose=pose), brief.mission)["nearest"]
    assert near[0] == pytest.approx(np.hypot(0.5, np.abs(pose[:, 0, 2]).min()), rel=1e-12)


def test_followers_that_were_asked_for_different_things_are_told_each_by_itself() -> None:
    """One keeps 6.5 m, one 5 m, one docks: what was asked of the first is not said of the others."""
    asked = {
        "far": KNOWN,
        "near": KNOWN.with_values({"follower.mission.standoff_m": 5.0, "follower.z_m": 5.0}),
        "home": KNOWN.with_values({"follower.mission.task": "dock", "follower.mission.law": "lqr"}),
    }
    short = {name: one.with_values({"follower.mission.duration_s": 2.0}) for name, one in asked.items()}
    found = follow(short, runs=1, photons=0)
    for words in (
        "far: a follower",
        "where 6.5 m was asked",
        "near: a follower",
        "where 5 m was asked",
        "home: a",
    ):
        assert found.verdict.count(words) == 1
    first_two = Following(found.cases[:2])
    assert "where 5 m was asked" in first_two.verdict and "Asked for" not in first_two.verdict
    home = found.cases[2]
    assert Following([home, home]).verdict.count("home: a follower") == 1
    assert Following([found.cases[0]] * 2).verdict.startswith("Asked for 6.5 m:")
    page = following_page(found)
    assert "far, near: bluerov2-heavy" in page and "law pid" in page and "home: bluerov2-heavy" in page
    assert "law lqr" in page


def test_equal_seeds_give_equal_runs(brief: Followed) -> None:
    assert np.array_equal(brief.track.pose, run(duration_s=4.0).track.pose)
    other = follow({"": KNOWN.with_values({"follower.mission.duration_s": 4.0})}, runs=2, seed=4, photons=0)
    assert not np.array_equal(brief.track.pose, other.cases[0].track.pose)


def test_a_vehicle_that_has_spun_is_turned_as_one_that_has_not() -> None:
    """Whole turns count as none in the pose, for the filter, and so in the numbers of a run."""
    begun = np.array([0.0, 0.0, 6.5, np.radians(5.0), 0.0, 0.0])
    state = _Moving.at(begun, 2)
    state.place[1, 5] += 4 * np.pi
    np.testing.assert_allclose(state.pose(np.zeros(3)), [begun, begun], atol=1e-12)
    np.testing.assert_allclose(wrapped(np.pi * np.array([1.0, -1.0, 2.5])), np.pi * np.array([1, 1, 0.5]))
    filter_ = Filter(POSE)
    for angle in (np.pi - 0.01, 0.01 - np.pi):
        measured = np.array([[0.0, 0.0, 6.5, 0.0, 0.0, angle]])
        innovation, used = filter_.correct(measured, 1e-2 * np.eye(6)[None], np.array([True]))
    assert used[0] and innovation[0] < 0.1
    assert abs(abs(filter_.poses[0, 5]) - np.pi) < 0.02
    filter_.state[0, 5] = 3 * np.pi + 0.1
    assert filter_.poses[0, 5] == pytest.approx(0.1 - np.pi)


def test_light_lost_and_found() -> None:
    """In the dark the filter grows uncertain and the current carries the vehicle off; then it comes back."""
    scene = KNOWN.with_values({"follower.mission.current_x_m_per_s": 0.05})
    found = run(scene, dark_from_s=10.0, dark_for_s=4.0, duration_s=30.0)
    track = found.track
    dark = (track.time_s >= 10) & (track.time_s < 14)
    assert not track.lit[dark].any() and track.lit[~dark].all()
    growing = track.sigma[dark, :, 2]
    assert (np.diff(growing, axis=0) > 0).all()
    assert found.spreads["without_light"].mean == pytest.approx(4.0, abs=0.2)
    assert 0 < found.spreads["back_after"].mean < 20
    assert abs(found.spreads["standoff_at_end"].mean - 6.5) < 0.1


def test_docking_by_its_rule() -> None:
    # So near the lamp one of three by three elements is lit, which tells no yaw: five by five.
    home = {"follower.z_m": 2.6, "array.count": (5, 5)}
    found = run(task="dock", standoff_m=2.6, dock_m=1.5, approach_m_per_s=0.1, duration_s=30.0, **home)
    time, aside, _, speed = found.track.contact.T
    assert (found.runs["docked"] == 1).all() and "docks in 2 of 2 runs" in found.verdict
    assert (aside < 0.1).all() and (speed < 0.1).all() and (time > 8).all()
    short = run(task="dock", standoff_m=2.6, dock_m=1.5, approach_m_per_s=0.1, duration_s=10.0, **home)
    assert "not come to the dock yet: 2 of 2 runs were on their way when their 10 s" in short.verdict
    # Who only sees a dark lamp never comes home.
    blind = run(
        task="dock", standoff_m=2.6, dock_m=1.5, dark_from_s=0.0, dark_for_s=99.0, duration_s=5.0, **home
    )
    assert (blind.runs["docked"] == 0).all()
    assert re.search(r"never comes to the dock: after \d+ s it is \d\.\d m from the lamp", blind.verdict)


def test_water_that_changes_on_the_way() -> None:
    """The follower's belief is of the first water: with more scattering (here: loss) it stays too near."""
    found = run(turbid_factor=2.0, turbid_from_s=6.0, turbid_for_s=4.0, duration_s=24.0)
    z, time = found.track.pose[..., 2], found.track.time_s
    assert abs(z[time < 6].mean() - 6.5) < 0.1
    assert z[time > 20].mean() < 6.5 - 0.5 and "too near" in found.verdict
    assert found.runs["doubtful"].shape == (2,)


def test_leaders_begin_where_they_are() -> None:
    for leader in ("still", "sway", "lawnmower"):
        mission = KNOWN.with_values({"follower.mission.leader": leader}).follower.mission  # type: ignore[union-attr]
        way = way_of(mission)
        assert np.array_equal(way(0.0), np.zeros(3))
        # No faster than a small vehicle follows.
        steps = np.array([way(0.1 * k) for k in range(240)])
        assert np.linalg.norm(np.diff(steps, axis=0), axis=1).max() < 0.1 * 0.1


def test_a_leader_from_a_table(tmp_path: Path) -> None:
    table = tmp_path / "way.csv"
    table.write_text("time_s,x_m,y_m,z_m\n0,1,0,0\n10,1,0,0.5\n")
    scene = Scene.from_dict(
        {**KNOWN.to_dict(), "follower": {"mission": {"leader": "table", "leader_table": "way.csv"}}},
        folder=tmp_path,
    )
    way = way_of(scene.follower.mission)  # type: ignore[union-attr]
    np.testing.assert_allclose([way(0.0), way(5.0), way(20.0)], [[0, 0, 0], [0, 0, 0.25], [0, 0, 0.5]])
    scene.save(tmp_path / "saved.toml")
    assert 'leader_table = "way.csv"' in (tmp_path / "saved.toml").read_text()


@pytest.mark.usefixtures("undrawn")
def test_walls_stop_the_leader_and_are_told_of_the_follower() -> None:
    """A tank of 2 m, lanes of 1.2 m: the second turn is at -0.6 m ahead, behind the lamp's wall at -0.5 m."""
    tank = {"width_m": 2.0, "depth_m": 1.0, "length_m": 9.0, "behind_lamp_m": 0.5}
    near = KNOWN.to_dict() | {"tank": tank, "detector": {"planes_m": [4.0]}}
    scene = Scene.from_dict(near).with_values({"follower.mission.duration_s": 60.0})
    with pytest.raises(SceneError, match=r"leader drives through a wall.*-0\.6.*-0\.5 <= z <= 8\.5"):
        run(scene, **{"leader": "lawnmower"})
    stays = run(scene, leader="still", duration_s=5.0)
    assert stays.through_walls == 0 and "wall" not in stays.verdict
    track = stays.track
    track.pose[-1, 0, 0] = 1.2  # 0.2 m beyond the wall
    assert stays.through_walls == 1
    assert "drives through a wall of the tank in 1 of 2 runs" in stays.verdict
    # No field was traced: neither the sentence nor figures and tables say that one is believed.
    page = following_page(Following([stays]))
    assert "believes the formula, as is true here" in stays.verdict
    assert "formula, true here" in page and "traced field" not in page


def test_missions_that_cannot_be(tmp_path: Path) -> None:
    table = tmp_path / "way.csv"
    table.write_text("time_s,x_m,y_m,z_m\n1,0,0,0\n0,1,0,0\n")
    for values, says in (
        ({"leader": "table"}, "needs a table"),
        ({"leader": "table", "leader_table": str(table)}, "times rise"),
        ({"task": "dock", "dock_m": 7.0}, "dock_m is less"),
        ({"law": "fuzzy"}, "law"),
    ):
        with pytest.raises(SceneError, match=says):
            KNOWN.with_values({f"follower.mission.{k}": v for k, v in values.items()})


@pytest.mark.parametrize(
    "water", [{"base": "pure"}, {"chlorophyll_mg_per_m3": 0.5, "absorption_per_m": 0.05}]
)
@pytest.mark.parametrize(
    "asked, where", [({"believes": "clear"}, "believes"), ({"turbid_factor": 3.0}, "turbid_factor")]
)
def test_water_that_is_not_one_number_says_which_numbers_would_be(water, asked, where) -> None:
    """What is asked for, in which water, why not, and the numbers that the scene could state instead."""
    plain = {"water.absorption_per_m": 0.0, "water.scattering_per_m": 0.0}
    case_one = KNOWN.with_values(plain | {f"water.{k}": v for k, v in water.items()})
    with pytest.raises(SceneError) as found:
        with_belief(case_one.with_values({f"follower.mission.{k}": v for k, v in asked.items()}), "")
    error, at = found.value, np.array([525.0])
    assert error.where == f"follower.mission.{where}" and next(iter(water)) in error.found
    assert "scattering_per_m" in error.rule
    a, b = (f(case_one.water, at)[0] for f in (absorption_per_m, scattering_per_m))
    assert f'base = "none", absorption_per_m = {a:.3g}, scattering_per_m = {b:.3g}' in error.remedy
    assert ("or believe" in error.remedy) == (where == "believes")


@pytest.mark.usefixtures("undrawn")
def test_a_page_and_its_data(tmp_path: Path) -> None:
    scene = KNOWN.with_values({"follower.mission.duration_s": 2.0, "follower.mission.dark_from_s": 1.0})
    scene = scene.with_values({"follower.mission.dark_for_s": 0.4})
    found = follow({"<a>": scene, "b": scene}, ["exact"], runs=2, photons=0)
    html = following_page(found)
    assert "&lt;a&gt;" in html and html.count("<svg") == 2 * 2 and "Asked for 6.5 m" in html
    data = found.as_data()["cases"][0]
    assert data["metrics"]["standoff"]["by_run"] == found.cases[0].runs["standoff"].tolist()
    assert found.cases[0].dataset()["pose"].sizes == {"time_s": 11, "run": 2, "coordinate": 6}
    assert "standoff" in found.as_text() and "±" in found.as_text()
    single = OverRuns.of(np.array([1.0, np.nan]))
    assert single.runs == 1 and np.isnan(single.error)


@pytest.mark.usefixtures("undrawn")
def test_runs_over_parameters_continue_where_they_stopped(tmp_path: Path) -> None:
    """As every sweep: one chunk gone is one case done again, and the store is what it was."""
    scene = KNOWN.with_values({"follower.mission.duration_s": 1.0})
    axes = [parse_axis("water.scattering_per_m=0.05,0.1", ""), parse_axis("follower.mission.law=pid,lqr", "")]
    store = tmp_path / "runs.zarr"
    _, done = run_follow_sweep(scene, axes, store, runs=2, photons=0)
    assert done.cases_done == 4 and done.failed == 0
    before = as_data(open_store(store, QUANTITY))
    (store / "standoff" / "1.0").unlink()
    _, again = run_follow_sweep(scene, axes, store, runs=2, photons=0)
    assert again.cases_done == 1 and again.cases_before == 3
    assert as_data(open_store(store, QUANTITY)) == before and verify(store).complete
    html = follow_sweep_page(open_store(store, QUANTITY))
    assert "4 of 4 cases" in html and "lqr" in html
    assert re.search(
        r"Asked for 6.5 m: standoff from [\d.]+ ± [\d.]+ m \(scattering per m 0.\d+, law \w+\) to ", html
    )
    assert html.count("<svg") == 2 * 2 and "All that was measured" in html
    assert cli.main(["show", str(store), "-o", str(tmp_path / "shown")]) == 0
    assert (tmp_path / "shown" / "index.html").read_text(encoding="utf-8") == html
    alone = follow({"": scene.with_values({"water.scattering_per_m": 0.1})}, runs=2, photons=0)
    assert before["standoff"][1][0] == alone.cases[0].spreads["standoff"].mean


def test_a_store_is_of_one_way_of_the_leader(tmp_path: Path) -> None:
    """A table that is changed is another sweep; the light of the formula is not said to be traced."""
    way, store = tmp_path / "way.csv", tmp_path / "runs.zarr"
    way.write_text("time_s,x_m,y_m,z_m\n0,0,0,0\n10,0.1,0,0\n", encoding="utf-8")
    told = {"duration_s": 1.0, "leader": "table", "leader_table": str(way)}
    scene = KNOWN.with_values({f"follower.mission.{name}": value for name, value in told.items()})
    axes = [parse_axis("follower.mission.law=pid,lqr", "")]
    run_follow_sweep(scene, axes, store, runs=1, photons=0)
    assert "direct light" in open_store(store, QUANTITY).attrs["source"]
    _, again = run_follow_sweep(scene, axes, store, runs=1, photons=0)
    assert again.cases_done == 0
    way.write_text("time_s,x_m,y_m,z_m\n0,0,0,0\n10,0.2,0,0\n", encoding="utf-8")
    with pytest.raises(OutputError, match="another"):
        run_follow_sweep(scene, axes, store, runs=1, photons=0)


def test_a_case_that_cannot_be_is_recorded(tmp_path: Path) -> None:
    scene = KNOWN.with_values({"follower.mission.duration_s": 1.0, "follower.mission.task": "dock"})
    axes = [parse_axis("follower.mission.dock_m=1.5,9", "")]
    _, done = run_follow_sweep(scene, axes, tmp_path / "runs.zarr", runs=1, photons=0)
    assert done.failed == 1
    assert "dock_m is less" in str(open_store(tmp_path / "runs.zarr", QUANTITY).message.values[1])


def test_a_machine_that_cannot_compute_says_nothing_of_a_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next time it is done; a place that cannot be written ends the runs at once."""
    scene, store = KNOWN.with_values({"follower.mission.duration_s": 1.0}), tmp_path / "runs.zarr"
    axes = [parse_axis("follower.mission.law=pid,lqr", "")]

    def failing(error: Exception) -> None:
        def failed(*_: object, **__: object) -> None:
            raise error

        monkeypatch.setattr(sweep, "follow", failed)

    failing(BackendError("no card"))
    _, first = run_follow_sweep(scene, axes, store, runs=1, photons=0)
    assert (first.failed, first.again) == (2, 2) and not verify(store).complete
    failing(OutputError("no room"))
    with pytest.raises(OutputError, match="no room"):
        run_follow_sweep(scene, axes, store, runs=1, photons=0)
    monkeypatch.undo()
    _, done = run_follow_sweep(scene, axes, store, runs=1, photons=0)
    assert (done.cases_done, done.failed) == (2, 0) and verify(store).complete


@pytest.mark.slow
def test_show_draws_runs_over_parameters_and_export_says_what_does(tmp_path, capsys):
    store = tmp_path / "runs.zarr"
    scene = KNOWN.with_values({"follower.mission.duration_s": 4.0})
    run_follow_sweep(scene, [parse_axis("follower.x_m=0.1,0.2", "vary")], store, runs=1, photons=0)
    assert cli.main(["show", str(store), "-o", str(tmp_path / "drawn")]) == 0
    assert (tmp_path / "drawn" / "standoff.png").stat().st_size > 1000
    assert cli.main(["export", str(store), "--exr", str(tmp_path / "exr")]) == 2
    assert (
        "runs of a follower; rule: images are of maps; remedy: `lightfield show` draws"
        in capsys.readouterr().err
    )
