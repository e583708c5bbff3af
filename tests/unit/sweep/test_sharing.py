"""Which cases one trace serves: those whose light it tells to what their errors say."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import UsageError
from lightfield.scene import Scene
from lightfield.scene.water.coefficients import absorption_per_m, coefficients_in, scattering_per_m
from lightfield.sweep.axes import parse_axis
from lightfield.sweep.sweep_plan import SweepPlan, SweepSettings, make_plan

TANK = {"width_m": 2.0, "depth_m": 1.4, "length_m": 4.0, "wall_albedo": 0.8}


def planned(text: str, **parts: dict[str, object]) -> SweepPlan:
    detector = {"planes_m": [1.0, 2.5], "pixels": 8, "bands_nm": [[400, 420]]}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 12}, "detector": detector, **parts})
    return make_plan(scene, [parse_axis(text)], SweepSettings())


def test_a_lid_and_a_surface_are_two_traces_where_the_lid_reflects() -> None:
    """With black walls the lid is as good as a black surface."""
    for text in ("tank.surface=none,flat", "tank.surface_reflectance=0,1"):
        assert planned(text, tank=TANK).trace_of_case.tolist() in ([0, 1], [1, 0])
        assert planned(text, tank=TANK | {"wall_albedo": 0.0}).trace_of_case.tolist() == [0, 0]


def test_waters_share_a_trace_whose_molecules_are_as_many() -> None:
    """At 410 nm pure sea scatters by 0.005 per m, all of it by molecules; clear water by particles alone."""
    far = {"planes_m": [5.0, 10.0], "pixels": 8, "bands_nm": [[400, 420]]}
    assert len(planned("water.base=pure,petzold-clear", detector=far).traces) == 2
    assert len(planned("water.scattering_per_m=0,0.1", water={"base": "pure"}, detector=far).traces) == 2
    green = far | {"bands_nm": [[540, 560]]}
    assert len(planned("water.scattering_per_m=0.1,0.15", water={"base": "pure"}, detector=green).traces) == 1


def test_light_between_bright_walls_is_told_of_clear_water_by_a_trace_of_its_own() -> None:
    """It flies many times as far as to the farthest plane: weights of waters spread with all of it."""
    text = "water.scattering_per_m=0.05,0.55"
    assert len(planned(text, tank=TANK | {"wall_albedo": 0.9}).traces) == 2
    assert len(planned(text, tank=TANK | {"wall_albedo": 0.0}).traces) == 1


def test_names_are_taken_as_a_scene_takes_them() -> None:
    axis = planned("water.base=jerlov-1c,pure").cases.axes[0]
    assert axis.values["water.base"] == ("jerlov-1C", "pure")


def test_lists_and_tables_are_for_plan_files() -> None:
    with pytest.raises(UsageError, match=r"plan file.*\[\[vary\]\]"):
        parse_axis("detector.planes_m=[1,2],[2,3]")


def test_a_slab_of_unstated_place_follows_the_tank_in_every_case() -> None:
    plan = planned("tank.length_m=3.2,4,20", tank=TANK, water={"layer_absorption_per_m": 0.3})
    stated = [plan.cases.build(n).water.layer_centre_m for n in range(3)]
    traced = [plan.cases.build(n, validate=False).water.layer_centre_m for n in range(3)]
    np.testing.assert_allclose(traced, stated)
    assert len(set(stated)) == 3


def test_molecules_of_pure_water_are_counted_as_such_by_any_trace() -> None:
    """By a trace of particles alone, too: what they scatter hardly reaches the readings of a beam."""
    water = Scene.from_dict({"water": {"base": "pure"}}).water
    at = np.array([410.0])
    a, b = (v(water, at) for v in (absorption_per_m, scattering_per_m))
    attenuated, counted = coefficients_in(water, at, 0.0)
    np.testing.assert_allclose(attenuated + counted, a + b)
    assert (counted < 0.2 * b).all()
