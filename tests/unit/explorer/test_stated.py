"""What a scene states of its effects is switched as a whole and never lost, whatever readings tell of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lightfield.explorer import protocol
from lightfield.explorer.documents import scene_toml
from lightfield.explorer.session import Session
from lightfield.fitting.forward import SceneForward
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings

TILT = "beam_tilt:tilt"


def scene(**lamp: float) -> Scene:
    return Scene.from_dict(
        {
            "lamp": {"hwhm_deg": 6.0, **lamp},
            "water": {"absorption_per_m": 0.1},
            "detector": {"planes_m": [2.0, 3.0, 4.0]},
        }
    )


def beside_the_axis(stated: Scene, time_s: np.ndarray | None = None) -> Readings:
    """On lines along x at y = 0.1 m, with an error of 0.3 %."""
    z, x = (v.ravel() for v in np.meshgrid([2.0, 3.0, 4.0], np.linspace(-0.4, 0.6, 11), indexing="ij"))
    table = Readings.from_arrays(value=1 + 0 * z, x_m=x, y_m=0.1 + 0 * x, z_m=z, time_s=time_s)
    light = SceneForward(stated, table, full=1.0).predict({})
    noise = np.random.default_rng(1).standard_normal(len(z))
    return replace(table, value=light * (1 + 0.003 * noise), stderr=0.003 * light)


def begun(stated: Scene, readings: Readings | None) -> Session:
    session = Session(stated, readings, diffuse=None)
    session.begin()
    return session


def test_a_coordinate_that_the_readings_do_not_tell_is_switched_with_the_other() -> None:
    """Lines along x do not tell a tilt in y from gain and absorption; off the axis it acts on both."""
    stated = scene(tilt_x_deg=3.0, tilt_y_deg=4.0)
    readings = beside_the_axis(stated)
    session = begun(stated, readings)
    report = fit_readings(readings, stated, diffuse=None)
    found, by_hand = session.now.values, report.estimates["water.absorption_per_m"]
    assert found["water.absorption_per_m"] == pytest.approx(by_hand.value, abs=0.1 * by_hand.stderr)
    assert session.evaluation().numbers["chi2"] == pytest.approx(report.statistics.chi2, rel=0.01)
    shown = session.state_data()["parameters"]
    assert shown["lamp.tilt_y_deg"]["fixed"] and not shown["lamp.tilt_x_deg"]["fixed"]
    for on, tilts in ((False, (0.0, 0.0)), (True, (pytest.approx(3.0, abs=0.05), 4.0))):
        session.act(protocol.Switch(id=1, do="switch", effect=TILT, on=on))
        lamp = Scene.from_toml(scene_toml(session)).lamp
        assert (lamp.tilt_x_deg, lamp.tilt_y_deg) == tilts
    assert session.evaluation().numbers["dof"] == len(readings) - 4


def test_the_coordinate_that_is_stated_may_be_the_one_that_is_not_told() -> None:
    session = begun(scene(tilt_y_deg=4.0), beside_the_axis(scene(tilt_y_deg=4.0)))
    assert session.now.effects == (TILT,)
    assert session.now.values["lamp.tilt_x_deg"] == 0.0 and session.now.values["lamp.tilt_y_deg"] == 4.0
    assert session.now.values["water.absorption_per_m"] == pytest.approx(0.1, abs=0.01)


def test_an_effect_that_cannot_be_switched_stays_as_stated() -> None:
    """Readings on the axis alone tell no tilt at all."""
    stated, z = scene(tilt_x_deg=3.0, tilt_y_deg=-1.0), np.linspace(2.0, 4.0, 12)
    light = direct_field(stated, 0 * z, 0 * z, z)
    session = begun(stated, Readings.from_arrays(value=light, stderr=0.003 * light, z_m=z))
    assert session.now.effects == () and "beam_tilt" in session.experiment.untestable
    lamp = Scene.from_toml(scene_toml(session)).lamp
    assert (lamp.tilt_x_deg, lamp.tilt_y_deg) == (3.0, -1.0)


def test_of_two_forms_that_are_both_stated_one_is_switched_and_brings_the_other() -> None:
    """A lamp that drifts and warms up: the table has each by itself."""
    stated = scene(drift_per_hour=0.2, warmup_fraction=0.3, warmup_time_s=600.0)
    readings = beside_the_axis(stated, time_s=np.random.default_rng(2).permutation(33) * 100.0)
    session = begun(stated, readings)
    assert session.now.effects == ("lamp_drift:warm-up",)
    lamp = Scene.from_toml(scene_toml(session)).lamp
    assert (lamp.drift_per_hour, lamp.warmup_fraction, lamp.warmup_time_s) == (0.2, 0.3, 600.0)
    assert session.now.values["water.absorption_per_m"] == pytest.approx(0.1, abs=0.01)


def test_an_accepted_explanation_stands_beside_the_scenes_own_effects() -> None:
    """The diagnosis took them for granted: without them it explains nothing."""
    stated = scene(tilt_x_deg=3.0, tilt_y_deg=4.0)
    session = begun(stated, beside_the_axis(stated))
    session.verdict = {"explanations": [{"keys": ["background:constant"], "values": {}}]}
    session.act(protocol.At(id=1, do="accept", at=0))
    assert session.now.effects == (TILT, "background:constant")
    assert session.evaluation().numbers["chi2"] < 1.5 * len(session.experiment.readings)


def test_another_trace_of_the_scene_keeps_the_model_on_its_render() -> None:
    """Without readings its gain is that of the render, which is scaled anew."""
    session = begun(
        Scene.from_dict({"detector": {"planes_m": [2.0]}, "water": {"absorption_per_m": 0.1}}), None
    )
    session.history.keep("first")
    gain, name = session.experiment.gain, session.experiment.forward.gains.names[0]
    brighter = session.history.brighter([name], 2.0)
    assert [s.values[name] for s in (brighter.now, brighter.snapshots["first"])] == [2 * gain, 2 * gain]
    assert session.now.values[name] == gain
    session.experiment = replace(session.experiment, gain=2 * gain)  # as if the last one had been so
    session.trace_at(0.2)
    assert session.now.values[name] == pytest.approx(0.5 * gain)
