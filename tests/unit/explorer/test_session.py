"""A session without a browser: what is shown is what `compare` says, and every step can be taken back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import analytic_readings
import numpy as np
import pytest
from dropped import dropped_file

from lightfield.arrays import jsonable
from lightfield.diagnosis.diagnose import diagnose
from lightfield.errors import FitError, LightfieldError, RenderError, UsageError
from lightfield.explorer import protocol
from lightfield.explorer.beside import EndedError
from lightfield.explorer.documents import open_session, residuals_csv, scene_toml, session_json
from lightfield.explorer.evaluation import missing_trace
from lightfield.explorer.experiment import explored
from lightfield.explorer.fits import Fits
from lightfield.explorer.jobs import climbed, verdict_data
from lightfield.explorer.places import SIDE
from lightfield.explorer.session import Session
from lightfield.fitting.forward import SceneForward
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.readings.table.write import dumps
from lightfield.render.diffuse.dense_water import REACH
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings

BACKGROUND = "background:constant"


def ask(session: Session, do: str, **more: object) -> None:
    session.act(protocol.read_request(json.dumps({"id": 1, "do": do, **more})))


def error(session: Session) -> float:
    found = session.evaluation().numbers["error_percent"]
    assert isinstance(found, float)
    return found


def test_the_first_numbers_are_those_of_compare(session: Session, given) -> None:
    report = fit_readings(*given, diffuse=None)
    numbers = session.evaluation().numbers
    assert numbers["error_percent"] == pytest.approx(report.statistics.error_percent, rel=1e-3)
    assert numbers["chi2"] == pytest.approx(report.statistics.chi2, rel=1e-3)
    assert numbers["dof"] == report.statistics.dof


def test_an_effect_that_is_switched_on_is_fitted_as_compare_fits_it(session: Session, given) -> None:
    before = error(session)
    ask(session, "switch", effect=BACKGROUND, on=True)
    report = fit_readings(*given, ["background"], diffuse=None)
    assert error(session) == pytest.approx(report.statistics.error_percent, rel=1e-3)
    assert error(session) < 0.7 * before
    fitted = session.state_data()["parameters"]["detector.background"]
    estimate = report.estimates["detector.background"]
    assert fitted["value"] == pytest.approx(estimate.value, rel=1e-2)
    # The noise is judged beside other models: from some 40 freedoms, to a tenth of its errors.
    assert fitted["stderr"] == pytest.approx(estimate.stderr, rel=0.25)
    assert [rung["at"] for rung in session.state_data()["ladder"]] == [0, 1]


def test_the_model_shown_is_the_formula(session: Session, given) -> None:
    """Without scattered light the prediction is the closed form, here evaluated by itself."""
    readings, believed = given
    values = session.evaluator.values(session.now)
    scene = believed.with_values({k: v for k, v in values.items() if k != "gain"})
    light = direct_field(scene, readings.x_m, readings.y_m, readings.z_m)
    assert np.allclose(session.evaluation().arrays["model"], values["gain"] * light, rtol=1e-6)


def test_a_dragged_value_acts_at_once_and_is_one_step_of_the_history(session: Session) -> None:
    best, steps = error(session), len(session.history.states)
    for value in (0.2, 0.25, 0.3):
        ask(session, "set", values={"water.absorption_per_m": value})
        assert error(session) > best
    ask(session, "set", values={"water.absorption_per_m": 0.35}, done=True)
    assert len(session.history.states) == steps + 1
    ask(session, "undo")
    assert error(session) == pytest.approx(best)
    ask(session, "redo")
    assert session.now.values["water.absorption_per_m"] == 0.35
    ask(session, "fit")
    assert error(session) == pytest.approx(best, rel=1e-3)


def test_snapshots_rungs_and_states_are_gone_back_to(session: Session) -> None:
    base = error(session)
    ask(session, "keep", name="as it was")
    ask(session, "switch", effect=BACKGROUND, on=True)
    better = error(session)
    ask(session, "restore", name="as it was")
    assert error(session) == pytest.approx(base)
    ask(session, "state", at=1)
    assert error(session) == pytest.approx(better)
    ask(session, "rung", at=0)
    assert error(session) == pytest.approx(base, rel=1e-3)
    with pytest.raises(UsageError, match="no such snapshot"):
        ask(session, "restore", name="another")


def test_the_survey_says_what_every_effect_would_bring(session: Session) -> None:
    while session.survey_next():
        pass
    errors = {e["name"]: e["error_percent"] for e in session.state_data()["effects"]}
    ask(session, "switch", effect=BACKGROUND, on=True)
    assert error(session) == pytest.approx(errors["background"], rel=1e-6)
    assert all(value <= 1.02 * errors["beam_tilt"] for value in errors.values())


def test_an_effect_that_cannot_be_added_says_beside_what(session: Session) -> None:
    """A curve contains the named forms of what it draws: its error with them is no number, and says why."""
    assert not any(e["not_with"] for e in session.state_data()["effects"])
    profile = next(e["key"] for e in session.state_data()["effects"] if e["name"] == "beam_profile")
    ask(session, "switch", effect=profile, on=True)
    barred = {e["name"]: e["not_with"] for e in session.state_data()["effects"]}
    assert barred["beam_shape"] == barred["beam_skirt"] == "beam_profile"
    assert barred["background"] is None and barred["beam_profile"] is None


@pytest.mark.parametrize(
    ("do", "more"),
    [
        ("set", {"values": {"water.scattering_per_m": 0.1}}),
        ("set", {"values": {"lamp.hwhm_deg": -3.0}}),
        ("set", {"values": {"lamp.hwhm_deg": 1e6}}),
        ("switch", {"effect": "witchcraft", "on": True}),
        ("switch", {"effect": "scattering:Henyey-Greenstein", "on": True}),
        ("accept", {"at": 0}),
        ("restore", {"name": "x"}),
        (
            "own",
            {
                "name": "rope",
                "stage": "path",
                "formula": "1 - depth*exp(",
                "parameters": [{"name": "depth", "low": 0, "high": 1, "neutral": 0}],
            },
        ),
    ],
)
def test_what_cannot_be_done_changes_nothing(session: Session, do: str, more: dict) -> None:
    before = session.now
    with pytest.raises(LightfieldError):
        ask(session, do, **more)
    assert session.now == before and np.isfinite(error(session))


def test_effects_that_exclude_each_other_are_refused(session: Session) -> None:
    ask(session, "switch", effect="beam_shape:super-Gaussian", on=True)
    curve = next(key for key in session.experiment.candidates if key.startswith("beam_profile"))
    with pytest.raises(FitError, match="cannot be switched on together"):
        ask(session, "switch", effect=curve, on=True)
    assert session.now.effects == ("beam_shape:super-Gaussian",)


def test_a_formula_of_ones_own_explains_what_it_was_made_with() -> None:
    readings, scene = analytic_readings.readings(
        seed=5, layout="fine", factor=lambda t: 1 + 0.2 * np.exp(-(((t.x_m - 0.3) / 0.1) ** 2))
    )
    session = Session(scene, readings, diffuse=None)
    session.begin()
    before = error(session)
    numbers = [
        {"name": "depth", "low": -0.9, "high": 0.9, "neutral": 0.0},
        {"name": "x0", "low": -0.5, "high": 0.5, "unit": "m"},
        {"name": "width", "low": 0.02, "high": 0.3, "unit": "m"},
    ]
    formula = "1 - depth*exp(-((x - x0)/width)**2)"
    ask(session, "own", name="rope", stage="path", formula=formula, parameters=numbers)
    assert error(session) < 0.5 * before
    assert session.now.values["effect.rope.depth"] == pytest.approx(-0.2, abs=0.02)
    assert session.now.values["effect.rope.x0"] == pytest.approx(0.3, abs=0.01)
    assert 'name = "rope"' in scene_toml(session)


def test_a_session_is_saved_and_goes_on(session: Session, tmp_path: Path) -> None:
    ask(session, "switch", effect=BACKGROUND, on=True)
    ask(session, "keep", name="with it")
    ask(session, "set", values={"water.absorption_per_m": 0.2}, done=True)
    file = tmp_path / "session.json"
    file.write_text(session_json(session), encoding="utf-8")
    again, history = open_session(file, diffuse=None)
    again.begin(history=history)
    assert again.now == session.now and again.history.snapshots.keys() == {"with it"}
    assert again.evaluation().numbers == session.evaluation().numbers
    ask(again, "undo")
    assert again.now.effects == (BACKGROUND,)


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"format": "lightfield session 1"}', "\x00"])
def test_what_is_no_session_is_one_clear_error(tmp_path: Path, text: str) -> None:
    file = tmp_path / "session.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match="not a session"):
        open_session(file)


def test_the_saved_scene_gives_the_model_and_the_table_its_residuals(session: Session, given) -> None:
    ask(session, "switch", effect=BACKGROUND, on=True)
    saved = Scene.from_toml(scene_toml(session))
    assert saved.detector.background == pytest.approx(session.now.values["detector.background"])
    rows = [line.split(",") for line in residuals_csv(session).splitlines()]
    table = {name: np.array([float(row[k]) for row in rows[1:]]) for k, name in enumerate(rows[0]) if k}
    assert np.allclose(
        table["value"] - table["model"], table["residual_sigma"] * table["sigma"], rtol=1e-5, atol=1e-9
    )
    assert np.allclose(table["value"], given[0].value, rtol=1e-8)


def test_other_readings_are_dropped_in_and_bad_ones_change_nothing(session: Session) -> None:
    other, _ = analytic_readings.readings(seed=9)
    ask(session, "switch", effect=BACKGROUND, on=True)
    before = session.now
    session.comparison = "<html>of the readings before</html>"
    with pytest.raises(LightfieldError, match="line 3"):
        session.drop([dropped_file("bad.csv", "z_m,value\n4.5,1\n5.5,bright\n")])
    assert session.now == before and session.readings is not other
    assert session.state_data()["compared"] and session.comparison is not None
    session.drop([dropped_file("good.csv", dumps(other))])
    assert session.now.effects == () and np.allclose(session.experiment.problem.value, other.value)
    assert not session.state_data()["compared"] and session.comparison is None


def test_a_session_whose_values_were_all_moved_at_once_can_be_opened(
    session: Session, tmp_path: Path
) -> None:
    """What is said of such a state would be longer than a session may say."""
    session.history.add(replace(session.now, did=", ".join(["water.absorption_per_m"] * 40) + " by hand"))
    file = tmp_path / "session.json"
    file.write_text(session_json(session), encoding="utf-8")
    _, history = open_session(file, None)
    assert history.now.values == session.now.values and history.now.did.startswith("water.absorption_per_m, ")


def test_without_readings_the_scene_itself_is_the_target() -> None:
    """With nothing that scatters the closed form is the whole light; less of a beam misses it."""
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1}, "detector": {"planes_m": [4.5, 6.5]}})
    session = Session(scene, diffuse=None)
    session.begin()
    assert error(session) == pytest.approx(0.0, abs=1e-6)
    ask(session, "set", values={"lamp.hwhm_deg": 3.0}, done=True)
    assert error(session) > 1
    ask(session, "fit")
    assert error(session) == pytest.approx(0.0, abs=1e-3)
    shown = session.evaluation().arrays
    assert shown["map_render"].shape == shown["map_formula"].shape
    assert np.allclose(shown["map_render"], shown["map_formula"])


def test_the_effects_of_a_scene_are_on_at_first_and_can_be_switched_off() -> None:
    readings, scene = analytic_readings.readings({"lamp.tilt_x_deg": 0.8}, seed=2)
    session = Session(scene.with_values({"lamp.tilt_x_deg": 0.8}), readings, diffuse=None)
    session.begin()
    assert session.now.effects == ("beam_tilt:tilt",)
    good = error(session)
    ask(session, "switch", effect="beam_tilt:tilt", on=False)
    assert error(session) > 2 * good
    assert explored(scene, readings, None).switched_on == ()


def test_each_wavelength_has_maps_with_its_own_gain() -> None:
    """Readings at two wavelengths, one read three times as bright."""
    one, scene = analytic_readings.readings(seed=6)
    half = np.arange(len(one)) % 2
    columns = {n: getattr(one, n) for n in ("x_m", "y_m", "z_m", "stderr", "time_s")}
    both = Readings.from_arrays(
        value=one.value * np.where(half, 3.0, 1.0), wavelength_nm=np.where(half, 540.0, 510.0), **columns
    )
    session = Session(scene, both, diffuse=None)
    session.begin()
    first = session.evaluation().arrays["map_render"]
    ask(session, "view", plane=session.plane, channel=1)
    second = session.evaluation().arrays["map_render"]
    assert np.median(second / first) == pytest.approx(3.0, rel=0.02)


def test_maps_are_empty_above_the_water(given) -> None:
    """Its surface is 0.4 m above the lamp; what is empty reaches the page."""
    tank = {"width_m": 3.0, "depth_m": 1.5, "lamp_depth_m": 0.4, "length_m": 10.0}
    session = Session(Scene.from_dict({**given[1].to_dict(), "tank": tank}), given[0], diffuse=None)
    session.begin()
    shown = session.evaluation().arrays
    above = np.tile(session.experiment.places.y_m[:, None] > 0.4, (1, SIDE))
    assert (np.isnan(shown["map_formula"]) == above).all() and (np.isnan(shown["map_render"]) == above).all()
    errors = session.evaluator.map_stderr(session.now, session.plane, session.channel)
    assert (np.isnan(errors) == above).all()
    sent = np.frombuffer(protocol.pack({}, {"map_render": shown["map_render"]})[-4 * SIDE**2 :], "<f4")
    assert (np.isnan(sent) == above.ravel()).all()


def test_water_that_the_trace_cannot_answer_for_asks_for_one_more_trace(given) -> None:
    """And that one answers: the page stops asking. Nothing is traced here."""
    readings, scene = given
    murky = {"water.scattering_per_m": 1.2}
    assert missing_trace(SceneForward(scene, readings), {"water.scattering_per_m": 0.2}) is None
    wanted = missing_trace(SceneForward(scene, readings), murky)
    assert wanted is not None and wanted >= 1.2 / REACH
    assert missing_trace(SceneForward(scene, readings, dense_per_m=wanted), murky) is None


def test_a_fit_says_how_far_it_is_and_can_be_ended(session: Session) -> None:
    """What is ended has changed nothing; asked again it is done."""
    before, heard = session.now, list[tuple[str, float | None]]()

    def end(stage: str, part: float | None = None) -> None:
        heard.append((stage, part))
        raise FitError("cancelled")

    session.fits, session.say = Fits(session.experiment), end
    with pytest.raises(FitError, match="cancelled"):
        ask(session, "switch", effect=BACKGROUND, on=True)
    assert session.now == before and heard == [("fitting gain, width and absorption", 0.0)]
    session.say = lambda stage, part=None: heard.append((stage, part))
    ask(session, "switch", effect=BACKGROUND, on=True)
    parts = [part for stage, part in heard if stage == "fitting background" and part is not None]
    assert session.now.effects == (BACKGROUND,)
    assert parts == sorted(parts) and parts[0] == 0 and 0.5 < parts[-1] < 1


def test_a_survey_ends_within_a_fit(session: Session) -> None:
    """At the tenth step of the first: of an effect with other shapes there would be hundreds."""
    steps = list[int]()

    def ends() -> None:
        steps.append(len(steps))
        if len(steps) == 10:
            raise EndedError("something else is asked for")

    session.fits._known.clear()
    with pytest.raises(EndedError):
        session.survey_next(ends)
    assert len(steps) == 10 and not session.survey


def test_a_survey_that_was_ended_is_still_to_be_done(session: Session, monkeypatch) -> None:
    """What cannot be fitted has no number, and is not tried again; an error that is none of a fit is told."""
    errors = EndedError("cancelled"), FitError("not here"), RenderError("no light")
    for kept, error in enumerate(errors):

        def fails(*given: object, error: Exception = error, **_: object) -> None:
            raise error

        monkeypatch.setattr(Fits, "of", fails)
        if isinstance(error, FitError):
            assert session.survey_next()
        else:
            with pytest.raises(type(error)):
                session.survey_next()
        assert len(session.survey) == kept and all(np.isnan(e) for e in session.survey.values())


@pytest.mark.usefixtures("undrawn")
def test_a_report_of_what_is_shown_needs_no_diagnosis(session: Session) -> None:
    """Readings: the page of a comparison by hand, with the ladder that was climbed."""
    ask(session, "switch", effect=BACKGROUND, on=True)
    rungs = [{"effects": [], **rung} for rung in session.state_data()["ladder"]]
    stages: list[str] = []
    scene = session.experiment.forward.scene
    html = climbed(
        scene,
        session.readings,
        session.now.effects,
        rungs,
        False,
        lambda stage, part=None: stages.append(stage),
    )
    assert "<svg" in html and "+ background: error" in html and "detector.background" in html
    assert f"{rungs[0]['error_percent']:.3g}" in html and stages[-1] == "drawing the report"


def test_what_a_verdict_says_of_each_effect_reaches_the_page(given) -> None:
    """Levels, rivals and next measurement, and an explanation that can be accepted with its values."""
    found = diagnose(given[0], given[1], diffuse=None)
    told = verdict_data(found.verdict)
    assert [one["name"] for one in told["found"]] == [
        name.replace("_", " ") for name in found.verdict.best_set
    ]
    assert all(one["level"] in ("certain", "simplest", "one of", "partial") for one in told["found"])
    assert json.loads(json.dumps(jsonable(told)))["headline"] == found.verdict.headline
    session = Session(given[1], given[0], diffuse=None, verdict=told)
    session.begin()
    before = error(session)
    ask(session, "accept", at=0)
    assert session.now.effects == tuple(told["explanations"][0]["keys"])
    assert error(session) < 0.7 * before
