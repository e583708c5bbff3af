"""Without readings the render of the scene takes their place, in every scene that can be rendered."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.explorer.experiment import MOST_BANDS
from lightfield.explorer.places import SIDE
from lightfield.explorer.session import Session
from lightfield.formula.closed_form import direct_field
from lightfield.scene import Scene


def begun(**more: object) -> Session:
    known = {
        "lamp": {"hwhm_deg": 6.0},
        "water": {"absorption_per_m": 0.1},
        "detector": {"planes_m": [2.0, 4.0]},
    }
    for part, values in more.items():
        known[part] = {**known.get(part, {}), **values}
    session = Session(Scene.from_dict(known), diffuse=None)
    session.begin()
    return session


def is_the_scene(session: Session) -> bool:
    """Is what is shown at first the scene, and its own render?"""
    values = session.evaluator.values(session.now)
    shown = session.experiment.forward.scenes.at(values)
    return shown == session.scene and session.evaluation().numbers["error_percent"] == pytest.approx(
        0, abs=1e-6
    )


@pytest.mark.parametrize("path", ["offset_x_m", "offset_y_m", "tilt_x_deg", "tilt_y_deg"])
def test_a_lamp_may_be_off_in_one_coordinate(path: str) -> None:
    """The other is shown beside it, and is none."""
    session = begun(lamp={path: 0.1})
    values = {name: p["value"] for name, p in session.state_data()["parameters"].items()}
    assert values.pop(f"lamp.{path}") == 0.1
    assert [v for name, v in values.items() if path[:4] in name] == [0.0]
    assert is_the_scene(session)


def test_what_is_shown_is_the_scene_where_a_fit_would_start_elsewhere() -> None:
    """A layer takes most of the far light: from its fall alone absorption looks far larger."""
    session = begun(water={"layer_absorption_per_m": 4.0, "layer_centre_m": 3.0})
    start = next(p.start for p in session.experiment.problem.base if "absorption" in p.path)
    assert start > 0.3 and is_the_scene(session)


def test_each_band_has_maps() -> None:
    """At its middle, in water that takes its light: red falls off faster than green."""
    bands = [[490, 505], [510, 530], [640, 660]]
    session = begun(water={"base": "pure", "absorption_per_m": 0.0}, detector={"bands_nm": bands})
    assert session.experiment_data()["wavelengths_nm"] == pytest.approx([497.5, 520, 650])
    assert is_the_scene(session)
    x, y = session.experiment.places.x_m, session.experiment.places.y_m
    for channel, wavelength in enumerate((497.5, 520.0, 650.0)):
        session.plane, session.channel = 1, channel
        light = direct_field(session.scene, *np.meshgrid(x, y), 4.0, wavelength)
        assert session.evaluation().arrays["map_render"] == pytest.approx(session.experiment.gain * light)


def test_of_many_bands_some_are_shown() -> None:
    bands = [[low, low + 10] for low in range(400, 650, 10)]
    shown = begun(detector={"bands_nm": bands}).experiment_data()["wavelengths_nm"]
    assert len(shown) == MOST_BANDS and shown[0] == 405 and shown[-1] == 645


def test_a_lamp_may_be_nearer_to_the_surface_than_to_the_floor() -> None:
    tank = {"width_m": 2.0, "depth_m": 1.2, "lamp_depth_m": 0.3, "length_m": 6.0}
    session = begun(tank=tank)
    assert is_the_scene(session) and session.experiment.readings.y_m.max() <= 0.3
    empty = np.isnan(session.evaluation().arrays["map_render"])
    assert (empty == (session.experiment.places.y_m > 0.3)[:, None] & np.ones(SIDE, bool)).all()
