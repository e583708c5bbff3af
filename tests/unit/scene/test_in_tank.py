"""Planes are clipped to the tank, cells outside know nothing, and what cannot be is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lightfield.errors import SceneError
from lightfield.experiments.layouts import LAYOUTS, scan
from lightfield.render.response.grid import Grid, scene_grid
from lightfield.scene import Scene

AROUND = np.random.default_rng(0)


def scene_of(tank: dict[str, Any] | None = None, **detector: Any) -> Scene:
    return Scene.from_dict({"tank": tank, "detector": {"planes_m": [0.5], **detector}})


@pytest.mark.parametrize(
    ("tank", "size"),
    [
        (None, (2.0, 2.0)),
        ({}, (2.0, 2.0)),
        ({"width_m": 1.0, "depth_m": 0.8}, (1.0, 0.8)),
        ({"width_m": 0.5, "depth_m": 0.8}, (0.5, 0.5)),
        ({"width_m": 3.0, "depth_m": 1.0, "lamp_depth_m": 0.3}, (2.0, 1.4)),
        ({"width_m": 0.5, "depth_m": 4.0, "lamp_depth_m": 0.1}, (0.5, 0.5)),
    ],
)
def test_planes_are_clipped_to_the_tank(tank: dict[str, Any] | None, size: tuple[float, float]) -> None:
    scene = scene_of(tank)
    grid = scene_grid(scene)
    assert scene.plane_size_m == pytest.approx(size)
    assert (len(grid.x_m) * grid.pitch_x_m, len(grid.y_m) * grid.pitch_y_m) == pytest.approx(size)
    assert scene.parameters()["detector.width_m"].value == pytest.approx(size[0])


sizes = st.floats(0.05, 20.0)


@given(sizes, sizes, st.floats(0.01, 0.99), st.integers(1, 70))
def test_cells_that_know_are_in_the_tank_and_the_axis_is_one(
    width: float, depth: float, share: float, pixels: int
) -> None:
    """For any tank and lamp; and all default planes have one shape, so that tanks can share a store."""
    scene = scene_of({"width_m": width, "depth_m": depth, "lamp_depth_m": share * depth}, pixels=pixels)
    grid, top = scene_grid(scene), share * depth
    known = np.isfinite(grid.in_water(np.zeros(grid.shape)))[0]
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    reach_x, reach_y = np.abs(x[known]) + grid.pitch_x_m / 2, grid.pitch_y_m / 2
    assert reach_x.max() <= width / 2 + 1e-6
    assert y[known].max() + reach_y <= top + 1e-6
    assert y[known].min() - reach_y >= top - depth - 1e-6
    radius = np.hypot(x, y)
    assert known[radius <= radius.min() * (1 + 1e-6)].all()
    assert grid.shape == (1, pixels, pixels)


def test_cells_around_positions_are_means_over_their_part_in_the_tank() -> None:
    """A cell of 10 cm about a place on the wall has half of its area, and got half of the light."""
    scene = scene_of({"width_m": 1.0}, positions_m=[[0.5, 0.0, 1.0]])
    grid = scene_grid(scene)
    np.testing.assert_allclose(grid.in_water(np.array([[3.0], [4.0]])), [[6.0], [8.0]], rtol=1e-6)
    assert Grid(np.ones(1), np.zeros(1), np.zeros(1), 1.0, 1.0).in_water(np.ones(1)) == 1


@pytest.mark.parametrize(
    ("tank", "detector", "words"),
    [
        ({"width_m": 1.0}, {"width_m": 1.1}, ["detector.width_m = 1.1", "width_m = 1", "at most 1"]),
        ({}, {"width_m": 4.0}, ["detector.width_m = 4", "width_m = 3.66 (its default)"]),
        ({"lamp_depth_m": 0.4}, {"height_m": 1.0}, ["detector.height_m = 1", "y = 0.4", "at most 0.8"]),
        ({"length_m": 0.9}, {}, ["planes_m = 0.5", "length_m = 0.9", "behind_lamp_m = 0.5 (its default)"]),
        ({"width_m": 1.0}, {"positions_m": [[0.6, 0, 1]]}, ["[0.6, 0.0, 1.0]", "-0.5 <= x <= 0.5"]),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_with_its_reason(
    tank: dict[str, Any], detector: dict[str, Any], words: list[str]
) -> None:
    with pytest.raises(SceneError) as error:
        scene_of(tank, **detector)
    assert [word for word in words if word not in str(error.value)] == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[tank]\nlength_m = 3", ["detector.planes_m = 4.5", "give detector.planes_m", "default, [4.5, 5.5"]),
        ("[tank]\nlamp_depth_m = 3", ["lamp_depth_m = 3", "depth_m = 2.44 (its default)"]),
        ("[tank]\nlength_m = 0.4", ["behind_lamp_m = 0.5", "length_m = 0.4", "behind_lamp_m is its default"]),
        ("[tank]\n[lamp]\noffset_x_m = 2", ["lamp.offset_x_m = 2", "width_m = 3.66 (its default)"]),
        ("[tank]\ndepth_m = 1\n[lamp]\nradius_m = 0.6", ["lamp.radius_m = 0.6", "outside the tank"]),
    ],
)
def test_errors_name_the_default_that_they_meet(text: str, words: list[str]) -> None:
    with pytest.raises(SceneError) as error:
        Scene.from_toml(text)
    assert [word for word in words if word not in str(error.value)] == []


@pytest.mark.parametrize("validate", [True, False])
def test_lamp_is_at_half_the_depth_unless_it_is_said_where(validate: bool) -> None:
    scene = Scene.from_toml("[tank]\ndepth_m = 0.8")
    assert scene.get("tank.lamp_depth_m") == 0.4
    deeper = scene.with_values({"tank.depth_m": 1.6}, validate=validate)
    assert deeper.get("tank.lamp_depth_m") == 0.8
    said = Scene.from_toml("[tank]\ndepth_m = 0.8\nlamp_depth_m = 0.3")
    assert said.with_values({"tank.depth_m": 1.6}, validate=validate).get("tank.lamp_depth_m") == 0.3
    assert Scene.from_toml(scene.to_toml()) == scene
    assert "lamp_depth_m" not in scene.to_toml()


def test_single_positions_need_no_planes() -> None:
    """The default planes, to 8.5 m, are not there where positions are."""
    scene = Scene.from_toml("[tank]\nlength_m = 2\n[detector]\npositions_m = [[0, 0, 1.2]]")
    assert scene_grid(scene).z_m == pytest.approx([1.2])


def test_lamps_are_moved_inside_the_tank_only() -> None:
    """The range that a fit or a sweep may use is what the tank leaves."""
    known = Scene.from_toml("[tank]\nwidth_m = 0.5\ndepth_m = 0.4\nlamp_depth_m = 0.1").parameters()
    ends = [known[f"lamp.offset_{axis}_m"] for axis in "xy"]
    assert [(p.low, p.high) for p in ends] == [(-0.25, 0.25), (pytest.approx(-0.3), 0.1)]
    assert Scene().parameters()["lamp.offset_x_m"].high == 10.0


def test_a_plane_of_unstated_width_is_the_scene_of_one_of_that_width() -> None:
    assert Scene().digest() == Scene.from_toml("[detector]\nwidth_m = 2.0").digest()
    small = Scene.from_toml("[tank]\nwidth_m = 1.0")
    assert small.digest() == small.with_values({"detector.width_m": 1.0}).digest()


@pytest.mark.parametrize("kind", LAYOUTS)
def test_made_readings_stay_in_the_tank(kind: str) -> None:
    """And off its walls."""
    scene = scene_of({"width_m": 1.0, "depth_m": 0.6, "lamp_depth_m": 0.15}, planes_m=[0.5, 1.0])
    readings = scan(scene, kind, "plane", AROUND)
    assert np.abs(readings.x_m).max() < 0.5
    assert readings.y_m.max() < 0.15
    assert readings.y_m.min() > -0.45


def test_a_scene_says_itself_in_a_line() -> None:
    """As a notebook shows it; all of it is hundreds of lines."""
    scene = Scene.from_toml('name = "a pool"\n[tank]\nlength_m = 20.0\n')
    assert repr(scene) == "<Scene: a pool; in a tank>"
    assert repr(Scene()) == "<Scene: without a name; open water>"


def test_a_slab_that_is_stated_nowhere_is_in_the_tank() -> None:
    """In one that ends before the default of 6.5 m half way; it follows the tank, and stays unsaid."""
    long = Scene.from_toml(
        "[tank]\nlength_m = 12\n[water]\nlayer_absorption_per_m = 0.1\n[detector]\nplanes_m = [1.0]"
    )
    short = long.with_values({"tank.length_m": 4.5})
    assert (long.water.layer_centre_m, short.water.layer_centre_m) == (6.5, 2.0)
    assert "layer_centre_m" not in short.to_toml() and Scene.from_toml(short.to_toml()) == short
    assert short.with_values({"tank.length_m": 12.0}) == long
    assert short.with_values({"water.layer_centre_m": 1.0}).water.layer_centre_m == 1.0


def test_a_surface_that_sends_nothing_back_is_refused() -> None:
    """In its place stood a lid as bright as the walls."""
    with pytest.raises(SceneError, match="sends nothing back"):
        scene_of({"surface": "flat", "surface_reflectance": 0.0})
    lid = scene_of({"surface": "flat"}).with_values({"tank.surface_reflectance": 0.0})
    assert lid.tank is not None and lid.tank.surface == "none"


def test_no_face_reflects_more_than_all() -> None:
    """A trace for fits takes its walls as much darker as the brightest face is brighter: of what it reflects,
    not of what is stated."""
    tank = scene_of({"wall_albedo": 0.6, "floor_over_walls": 1.2, "end_over_walls": 100.0}).tank
    assert tank is not None
    assert (tank.floor_share, tank.end_share) == (1.2, pytest.approx(1 / 0.6))
    assert tank.brightest_over_walls == tank.end_share
    dark = scene_of({"wall_albedo": 0.6, "floor_over_walls": 0.0, "end_over_walls": 0.5}).tank
    assert dark is not None and dark.brightest_over_walls == 1.0


PAINTED = {"panes": "all", "pane_reflectance": 0.0}


def test_panes_are_bare_unless_it_is_said_otherwise() -> None:
    plain, bare, covered = (scene_of(said).tank for said in ({}, {"panes": "sides"}, PAINTED))
    assert plain is not None and bare is not None and covered is not None
    assert [tank.pane_reflectance for tank in (plain, bare, covered)] == [0.0, 1.0, 0.0]
    assert [tank.bare_panes for tank in (plain, bare, covered)] == [0.0, 1.0, 1.0]
    assert (bare.panes_at, covered.panes_at) == ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    with pytest.raises(SceneError, match="only panes have a reflectance"):
        scene_of({"panes": "none", "pane_reflectance": 0.5})


def test_panes_and_their_reflectance_change_together() -> None:
    glass = scene_of({}).with_values({"tank.panes": "all"})
    assert glass.pane_reflectance == 1.0 and glass.reflects and not scene_of({}).reflects
    assert glass.tank is not None and glass.tank.panes_at == (1.0, 1.0, 1.0)
    assert scene_of({}).with_values({"tank.pane_reflectance": 0.5}) == scene_of({"pane_reflectance": 0.5})
    assert scene_of({"pane_reflectance": 0.5}).tank.panes == "all"
    half = glass.with_values({"tank.pane_reflectance": 0.5}).with_values({"tank.panes": "sides"})
    assert half.pane_reflectance == 0.5
    assert half.with_values({"tank.panes": "none"}).pane_reflectance == 0.0
    assert Scene.from_toml(half.to_toml()) == half
    assert scene_of(PAINTED).digest() != scene_of({}).digest() == scene_of({"panes": "none"}).digest()


def test_no_distance_is_kept_beyond_the_end_of_the_tank() -> None:
    """A follower that was to keep 40 m in a tank of 10 m ran, and lost its way in each of four runs."""
    tank = {"length_m": 10.0, "behind_lamp_m": 0.5}
    asked = {"tank": tank, "follower": {"z_m": 4.0, "mission": {"standoff_m": 40.0}}}
    with pytest.raises(SceneError, match=r"standoff_m.* = 40.0; rule: nothing is outside the tank, z <= 9.5"):
        Scene.from_dict(asked)
    asked["follower"] = {"z_m": 4.0, "mission": {"standoff_m": 9.0}}
    assert Scene.from_dict(asked).follower_here.mission.standoff_m == 9.0
