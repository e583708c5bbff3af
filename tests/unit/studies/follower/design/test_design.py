"""Arrays compared and designed: against plain matrix algebra, and against arrays that people build."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import RenderError, SceneError
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Space
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.design.compared import (
    Arrays,
    ArraySetting,
    JudgedArray,
    compare_arrays,
    judged_array,
    task_poses,
)
from lightfield.studies.follower.design.exchange import Mounting, candidate_arrays, designed, optimise_array
from lightfield.studies.follower.elements import grid, on_sphere
from lightfield.studies.follower.frames import POSE

SCENE = Scene.from_dict(
    {"lamp": {"hwhm_deg": 3.81}, "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.05}}
)
POSES = task_poses(Space(0.4, 4.5, 8.5), SCENE.lamp)
SETTING = ArraySetting(FormulaLight(SCENE), POSES, POSE[:5], SensorNoise(brightest=0.01), {"gain": 0.05})


def test_an_exchange_is_a_new_array() -> None:
    """The closed form of every exchange against the array made anew."""
    some = candidate_arrays(np.array([-0.2, 0.0, 0.2]), np.array([-0.2, 0.2]), np.array([-30.0, 0.0, 30.0]))
    whitened = SETTING.whitened(some)
    rest = [0, 11, 25, 38, 47, 53]
    quick = SETTING.exchanged(whitened, whitened[:, rest])
    slow = [SETTING.criterion(whitened[:, [*rest, k]]) for k in range(len(some))]
    np.testing.assert_allclose(quick, slow, rtol=1e-8)


def test_the_criterion_is_the_mean_of_bounds() -> None:
    """By plain inversion, with derivatives by one-sided differences of the formula."""
    elements, total = on_sphere(grid((5, 5), 0.4), 0.32), 0.0
    model = ArrayModel(FormulaLight(SCENE), elements)
    units = np.array([0.01, 0.01, 0.1, np.radians(1), np.radians(1), 1.0])
    for pose in POSES:
        base = model.readings(pose[None])[0]
        steps = pose + 1e-6 * np.eye(6)[:5]
        slopes = np.column_stack([(model.readings(steps) - base).T / 1e-6, base]) * units
        x, y, z, yaw, _, _ = pose
        facing = np.array([np.sin(yaw), 0.0, -np.cos(yaw)])
        r = np.sqrt(x * x + y * y + z * z)
        theta = np.degrees(np.arctan2(np.hypot(x, y), z))
        top = 0.5 ** ((theta / 3.81) ** 2) * np.exp(-0.1 * r) / r**2 * -(facing @ pose[:3]) / r
        whole = slopes.T @ slopes / (0.01 * top) ** 2
        whole[5, 5] += 0.05**-2
        total += np.trace(np.linalg.inv(whole)[:5, :5])
    assert judged_array("", elements, SETTING).criterion == pytest.approx(total / len(POSES), rel=1e-3)


def test_poses_of_a_task_are_about_the_beam_and_in_the_space() -> None:
    """Of a lamp 0.1 m aside that is turned by 5 degrees upwards; they stood about the tank's axis."""
    turned = SCENE.with_values({"lamp.tilt_y_deg": 5.0, "lamp.offset_x_m": 0.1})
    poses = task_poses(Space(0.2, 4.5, 8.5), turned.lamp, "formation")
    assert sorted(set(np.round(poses[:, 0], 6))) == [0.1, 0.3], "aside by 0.2 m at most"
    assert poses[:, 1] == pytest.approx(poses[:, 2] * np.tan(np.radians(5.0)))
    assert poses[:, 2].min() == 4.5 and poses[:, 2].max() == 8.5


def test_nobody_compares_arrays_in_a_wall() -> None:
    """An element would stand at 0.6 m in a tank 0.8 m wide."""
    tank = {"width_m": 0.8, "depth_m": 0.8, "length_m": 12.0, "lamp_depth_m": 0.4}
    more = {"tank": tank, "array": {"size_m": 0.2}}
    narrow = Scene.from_dict(SCENE.model_dump(exclude_unset=True) | more)
    with pytest.raises(RenderError, match="reaches into a wall"):
        optimise_array(narrow, 8, Mounting(0.6, 40.0, 0.025), space=Space(0.3, 4.5, 8.5), photons=0.0)
    room = Mounting(0.1, 40.0, 0.01)
    assert optimise_array(narrow, 8, room, space=Space(0.05, 4.5, 8.5), photons=0.0).arrays


def test_eight_elements_well_placed_beat_twenty_five() -> None:
    """And they keep their distance, their box and their tilts."""
    best = designed(SETTING, 8, Mounting(0.4, 40.0, 0.025))
    assert best.spacing_m >= 0.025 - 1e-9
    assert np.abs(best.place_m).max() <= 0.2 + 1e-12 and np.abs(best.tilts_deg).max() <= 40 + 1e-9
    hemisphere = judged_array("", on_sphere(grid((5, 5), 0.26), 0.19), SETTING).criterion
    assert 3 * judged_array("", best, SETTING).criterion < hemisphere
    # No other element in the place of any of them would do better by a part in a hundred, on a grid of its
    # own.
    other = candidate_arrays(np.linspace(-0.2, 0.2, 5), np.linspace(-0.2, 0.2, 5), np.linspace(-40, 40, 5))
    whitened, mine = SETTING.whitened(other), SETTING.whitened(best)
    now = SETTING.criterion(mine)
    for k in range(8):
        rest = [j for j in range(8) if j != k]
        apart = np.linalg.norm(other.place_m[:, None] - best.place_m[rest], axis=2).min(axis=1) >= 0.025
        assert SETTING.exchanged(whitened, mine[:, rest])[apart].min() > 0.97 * now


def test_more_than_fit_are_refused() -> None:
    with pytest.raises(SceneError, match="do not fit"):
        designed(SETTING, 20, Mounting(0.05, 0.0, 0.025))


def test_arrays_of_scenes_are_sorted() -> None:
    flat = SCENE.to_dict() | {"name": "flat", "array": {"size_m": 0.6}}
    round_ = SCENE.to_dict() | {"array": {"size_m": 0.26, "radius_m": 0.19}}
    scene, other = Scene.from_dict(flat), Scene.from_dict(round_)
    found = compare_arrays(scene, {"round": other}, Space.of_scene(scene), photons=0)
    assert [one.name for one in found.arrays] == ["round", "flat"]
    assert found.as_data()["arrays"][1]["elements"] == 25 and "flat" in found.as_text()


def test_of_an_array_that_leaves_a_coordinate_unknown_no_criterion_is_told() -> None:
    line = judged_array("pair", grid((2, 1), 0.1), SETTING).as_text()
    assert "A  unknown" in line and "yaw unknown" in line
    assert "unknown" not in judged_array("", on_sphere(grid((5, 5), 0.4), 0.32), SETTING).as_text()


@pytest.mark.parametrize(
    ("z_m", "says"),
    [(0.254, " by A, yet some of it worse: z 254 mm against 184 mm"), (0.186, ""), (0.15, "")],
)
def test_what_the_best_array_knows_worse_is_in_the_headline(z_m: float, says: str) -> None:
    """Better by the sum of the variances, and yet not along the beam; a hundredth is no difference."""
    sigmas = {"best": {"x": 0.02, "z": z_m, "yaw": 0.01}, "own": {"x": 0.05, "z": 0.184, "yaw": 0.05}}
    arrays = [
        JudgedArray(name, grid((2, 1), 0.1), criterion, sigma, 0.0)
        for (name, sigma), criterion in zip(sigmas.items(), (10.0, 40.0), strict=True)
    ]
    told = Arrays(SCENE, arrays, "formation", False).verdict
    assert told == f"2 elements (best) know the pose 2 times as well as the 2 of own{says}"
