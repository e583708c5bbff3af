"""The plan of a sweep: what shares a trace is decided by physics, and every case is computed exactly once."""

from __future__ import annotations

from dataclasses import replace
from multiprocessing.spawn import get_preparation_data

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lightfield.errors import UsageError
from lightfield.render.response.response import Reference
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm, molecular_share
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.sweep import sweep_plan as plan_module
from lightfield.sweep.axes import Axis, parse_axis
from lightfield.sweep.cluster import _script_left_alone
from lightfield.sweep.estimate import as_text
from lightfield.sweep.sharing import MOST_SPREAD
from lightfield.sweep.sweep_plan import SweepPlan, SweepSettings, make_plan

SCENE = Scene.from_toml(
    """
    [water]
    absorption_per_m = 0.1
    scattering_per_m = 0.2
    [tank]
    [detector]
    planes_m = [2.0, 4.0]
    pixels = 8
    """
)


def planned(*ranges: str, scene: Scene = SCENE) -> SweepPlan:
    return make_plan(scene, [parse_axis(text) for text in ranges], SweepSettings())


@pytest.mark.parametrize(
    "text",
    [
        "water.absorption_per_m=0.01:1:10",
        "water.scattering_per_m=0:0.4:10",
        "tank.wall_albedo=0,0.9",
        "tank.surface_reflectance=0,0.5",
        "water.hardening_per_m=0,0.01",
        "water.chlorophyll_mg_per_m3=0,0.1,0.2",
        "lamp.temperature_k=2700,2900",
        "lamp.power_w=10,50",
    ],
)
def test_water_walls_and_spectrum_do_not_need_a_trace_of_their_own(text: str) -> None:
    """E = sum R b^n rho^m s^k exp(-c L): none of these changes the tally R of one reference water."""
    assert len(planned(text).traces) == 1


@pytest.mark.parametrize(
    "text",
    [
        "lamp.hwhm_deg=3,4,5",
        "water.phase.g=0.8,0.9,0.924", "tank.width_m=2,3,4", "detector.width_m=1,1.5,2",
     "detector.quantity=irradiance,radiance,scalar_irradiance", "water.gradient_per_m2=0,0.01,0.02"],
)  # fmt: skip
def test_beam_phase_function_geometry_and_receiver_need_one(text: str) -> None:
    assert len(planned(text).traces) == 3


def test_the_reference_is_clearest_in_absorption_and_most_turbid_in_scattering() -> None:
    plan = planned(
        "water.absorption_per_m=0.05:0.5:4", "water.scattering_per_m=0.1:0.3:3", "tank.wall_albedo=0,0.6"
    )
    (trace,) = plan.traces
    reference = trace.reference
    assert (reference.absorption_per_m, reference.scattering_per_m, reference.wall_albedo) == (0.05, 0.3, 0.6)


def test_waters_too_far_apart_in_scattering_do_not_share_a_trace() -> None:
    """The variance of the weights of reweighted scatterings is exp((b0 - b)^2 L / b0) - 1 (Poisson)."""
    plan = planned("water.scattering_per_m=0:3:31")
    assert len(plan.traces) > 1
    b = np.array(plan.cases.axes[0].values["water.scattering_per_m"])
    for trace in plan.traces:
        mine, b0 = b[plan.trace_of_case == trace.number], trace.reference.scattering_per_m
        assert mine.max() == b0
        if b0 > 0:
            assert (b0 - mine[mine > 0].min()) ** 2 * 4.0 / b0 <= MOST_SPREAD


def test_dense_water_between_walls_shares_a_trace_with_its_like_alone() -> None:
    """Most reflected light there scattered more often than a tally tells apart; black walls reflect none."""

    def most_apart(*ranges: str) -> float:
        plan = planned("water.scattering_per_m=1.5:2:21", *ranges)
        b = np.array(plan.cases.axes[0].values["water.scattering_per_m"])
        return max(
            t.reference.scattering_per_m / b[plan.trace_of_case == t.number].min() for t in plan.traces
        )

    assert most_apart("tank.wall_albedo=0.6") < 1.2
    assert most_apart("tank.wall_albedo=0") > 1.3


@given(st.lists(st.integers(1, 12), min_size=1, max_size=3), st.booleans())
def test_every_case_is_in_exactly_one_block_whatever_the_shape(sizes: list[int], transport: bool) -> None:
    paths = ["water.absorption_per_m", "lamp.hwhm_deg" if transport else "lamp.power_w", "tank.wall_albedo"]
    ranges = [
        f"{path}=0.1:0.5:{n}" if n > 1 else f"{path}=0.1" for path, n in zip(paths, sizes, strict=False)
    ]
    plan = planned(*ranges)
    together = np.concatenate([block.cases for block in plan.blocks])
    assert sorted(together) == list(range(plan.cases.count))
    for block in plan.blocks:
        assert set(block.traces) == set(plan.trace_of_case[block.cases])
        # A chunk of the store is the block: an index and a size along every dimension.
        assert len(block.cases) <= np.prod(plan.chunks)


def test_seeds_depend_on_the_trace_alone_and_not_on_what_else_is_in_the_sweep() -> None:
    few, many = planned("lamp.hwhm_deg=3,4"), planned("lamp.hwhm_deg=2,3,4,5")
    assert {t.seed for t in few.traces} < {t.seed for t in many.traces}
    assert len({t.seed for t in many.traces}) == 4


def test_an_impossible_case_is_known_beforehand_and_costs_no_trace() -> None:
    """A lamp 3 m down in a tank of 2.44 m depth."""
    plan = planned("tank.lamp_depth_m=0.5,1.22,3", "water.absorption_per_m=0.1,0.2")
    assert len(plan.traces) == 2
    assert sorted(plan.problems) == [4, 5]
    assert "lamp_depth_m must be less than depth_m" in plan.problems[4]


def test_every_reference_is_the_clearest_and_most_turbid_of_its_cases() -> None:
    """Case by case, also where water, walls and both at once are varied, and wavelengths matter."""
    pure = SCENE.with_values({"water.base": "pure", "detector.bands_nm": ((450.0, 460.0), (600.0, 650.0))})
    for ranges in (
        (
            "water.attenuation_per_m=0.1:1:5",
            "water.single_scattering_albedo=0,0.5,0.9",
            "tank.wall_albedo=0,0.3",
        ),
        ("tank.surface_reflectance=0,1", "lamp.hwhm_deg=3,4", "water.scattering_per_m=0:2:9"),
    ):
        plan = planned(*ranges, scene=pure)
        for trace in plan.traces:
            scenes = [plan.cases.build(int(n)) for n in np.flatnonzero(plan.trace_of_case == trace.number)]
            assert trace.cases == len(scenes)
            wavelengths = middles_nm(pure).ravel()
            a = min(absorption_per_m(scene.water, wavelengths).min() for scene in scenes)
            b = max(scattering_per_m(scene.water, wavelengths).max() for scene in scenes)
            albedo, surface = (max(scene.reflectances[i] for scene in scenes) for i in (0, 1))
            most = max(scenes, key=lambda scene: scattering_per_m(scene.water, wavelengths).max())
            assert trace.reference.molecular_share == molecular_share(most) > 0
            asked = replace(trace.reference, molecular_share=0.0)
            assert asked == Reference(a, b, albedo, surface)


def test_no_two_traces_share_a_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1000 traces two may draw the same: the later one takes the next that is free."""
    monkeypatch.setattr(plan_module, "_SEEDS", 50)
    seeds = [trace.seed for trace in planned("lamp.hwhm_deg=2:10:50").traces]
    assert sorted(seeds) == list(range(50))
    assert [trace.seed for trace in planned("lamp.hwhm_deg=2:10:50").traces] == seeds


def test_a_plan_looks_at_few_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """100,000 cases are planned in seconds: what costs a millisecond is not done for every step."""
    looked = {"key": 0, "scene": 0}
    key, changed = plan_module._key, Scene.with_values

    def counted_key(scene: Scene) -> str:
        looked["key"] += 1
        return key(scene)

    def counted_scene(self: Scene, values: dict[str, object], validate: bool = True) -> Scene:
        looked["scene"] += not validate
        return changed(self, values, validate)

    monkeypatch.setattr(plan_module, "_key", counted_key)
    monkeypatch.setattr(Scene, "with_values", counted_scene)
    planned("water.absorption_per_m=0.01:1:1000")
    assert looked["key"] <= 5 and looked["scene"] <= 1000 + 50
    looked.update(key=0, scene=0)
    planned("water.absorption_per_m=0.01:1:20", "tank.wall_albedo=0:0.5:50", "lamp.hwhm_deg=3,4")
    assert looked["key"] <= 12 and looked["scene"] <= 20 + 50 + 100
    looked.update(key=0, scene=0)
    plan = planned("lamp.hwhm_deg=2:10:1000")
    assert len({trace.seed for trace in plan.traces}) == 1000
    assert looked["key"] <= 5 and looked["scene"] <= 50


@pytest.mark.parametrize(
    "ranges",
    [
        ("lamp.hwhm_deg=3,4,5", "lamp.power_w=10,20", "water.phase.g=0.8,0.9"),
        ("tank.width_m=1.5,3,4", "tank.depth_m=1,2.44", "tank.wall_albedo=0,0.1"),
        ("detector.quantity=irradiance,radiance", "lamp.profile=gaussian,isotropic", "lamp.hwhm_deg=3,4"),
        ("tank.surface=none,flat", "tank.lamp_depth_m=0.5,1", "detector.width_m=0.4,0.8"),
    ],
)
def test_cases_share_a_trace_where_its_key_is_the_same(ranges: tuple[str, ...]) -> None:
    """The plan compares values of axes; the key of a trace is made of the whole scene."""
    plan = planned(*ranges)
    assert not plan.problems
    keys = [plan_module._key(plan.cases.build(n)) for n in range(plan.cases.count)]
    pairs = set(zip(keys, plan.trace_of_case.tolist(), strict=True))
    assert len(pairs) == len(set(keys)) == len(plan.traces)
    for trace in plan.traces:
        assert plan_module._key(trace.scene(plan.cases)) == keys[trace.first]


def test_every_albedo_and_reflectance_but_none_needs_a_trace_of_its_own() -> None:
    """A response tells two or three reflections apart, and light in a tank is reflected more often."""
    plan = planned("tank.wall_albedo=0,0.5,0.9", "tank.surface_reflectance=0,0.4,1", "lamp.power_w=10,20")
    wanted = {(rho, s) for rho in (0.5, 0.9) for s in (0.4, 1.0)}
    assert {(t.reference.wall_albedo, t.reference.surface_reflectance) for t in plan.traces} >= wanted
    for trace in plan.traces:
        for number in np.flatnonzero(plan.trace_of_case == trace.number):
            rho, s = plan.cases.build(int(number)).reflectances
            assert rho in (0.0, trace.reference.wall_albedo)
            assert s in (0.0, trace.reference.surface_reflectance)


def test_a_trace_has_the_same_seed_whatever_else_is_varied() -> None:
    alone = planned("lamp.hwhm_deg=3,4")
    plan = planned("lamp.hwhm_deg=3,4", f"tank.width_m={SCENE.get('tank.width_m')},3")
    assert {trace.seed for trace in alone.traces} < {trace.seed for trace in plan.traces}


def test_the_far_end_of_a_trace_is_that_of_its_own_planes() -> None:
    """Scattering that one trace serves near the lamp needs two far from it."""
    axis = Axis("planes", {"detector.planes_m": ((2.0, 3.0), (2.0, 30.0))})
    scattering = parse_axis("water.scattering_per_m=0.05,0.4")
    plan = make_plan(SCENE, [axis, scattering], SweepSettings())
    assert [trace.cases for trace in plan.traces] == [2, 1, 1]


def test_whether_a_number_matters_is_seen_wherever_it_stands() -> None:
    """The first steps of parameters that change together may be equal in the one that needs a trace."""
    axis = Axis("both", {"lamp.power_w": (10.0, 20.0, 30.0), "lamp.hwhm_deg": (3.0, 3.0, 4.0)})
    plan = make_plan(SCENE, [axis], SweepSettings())
    assert [trace.cases for trace in plan.traces] == [2, 1]


def test_maps_of_different_shapes_are_refused() -> None:
    with pytest.raises(UsageError, match="maps of different shapes"):
        planned("detector.pixels=8,16")


def test_listed_positions_are_refused() -> None:
    scene = SCENE.with_values({"detector.positions_m": ((0.0, 0.0, 2.0),)})
    with pytest.raises(UsageError, match="needs detector planes"):
        planned("water.absorption_per_m=0,1", scene=scene)


def test_the_plan_says_what_it_will_do() -> None:
    text = as_text(planned("water.scattering_per_m=0:0.3:5", "tank.wall_albedo=0,0.5"))
    for part in (
        "cases: 10 = water.scattering_per_m (5) x tank.wall_albedo (2)",
        "traces: 2",
        "memory",
        "store",
    ):
        assert part in text


def test_workers_do_not_run_the_script_that_began_them():
    """A script without a `__main__` guard is not run a second time; afterwards it is as it was."""
    before = get_preparation_data("worker")
    with _script_left_alone():
        within = get_preparation_data("worker")
    assert not {"init_main_from_name", "init_main_from_path"} & set(within)
    assert get_preparation_data("worker").keys() == before.keys()
