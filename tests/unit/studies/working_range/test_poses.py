"""The array of a scene that has none."""

from __future__ import annotations

from lightfield.scene import Scene
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.working_range.poses import ARRAY, array_for
from lightfield.studies.working_range.study import working_range
from lightfield.studies.working_range.text import as_text

PLANES = {"planes_m": [0.5, 1.0, 2.0], "width_m": 0.4}


def test_it_is_the_usual_one_where_that_fits() -> None:
    tank = {"width_m": 3.66, "depth_m": 2.44, "length_m": 12.0}
    assert array_for(Scene.from_dict({"tank": tank})) == array_for(Scene()) == ARRAY


def test_in_an_aquarium_it_is_smaller() -> None:
    """0.3 m from the axis to floor and top, where the usual one reaches 0.33 m: `range` was refused there."""
    small = Scene.from_dict({"tank": {"width_m": 1.0, "depth_m": 0.6, "length_m": 2.5}, "detector": PLANES})
    assert elements_of(ARRAY).reach_m > 0.3
    assert 0.1 < elements_of(array_for(small)).reach_m <= 0.151
    assert array_for(small).count == ARRAY.count


def test_the_scenes_own_stays_as_it_is() -> None:
    own = Scene.from_dict({"array": {"count": [3, 3], "size_m": 0.2}})
    assert array_for(own) == own.array


def test_what_is_other_than_asked_is_said() -> None:
    """A tank that ends nearer than is asked, and is too narrow for the array of scenes that have none."""
    tank = {"width_m": 1.0, "depth_m": 1.0, "length_m": 3.0, "behind_lamp_m": 0.3}
    short = Scene.from_dict({"lamp": {"hwhm_deg": 5.0}, "tank": tank, "detector": {"planes_m": [0.8, 2.0]}})
    said = as_text(working_range(short, None, to_m=4.0))
    assert "Asked from 0.8 to 2.65 m, 0.05 m before the end of the tank." in said
    assert "(not 0.4: so that it fits this tank)" in said
    said = as_text(working_range(short.model_copy(update={"tank": None}), None, to_m=4.0))
    assert "Asked from 0.8 to 4 m." in said and "so that it fits" not in said
