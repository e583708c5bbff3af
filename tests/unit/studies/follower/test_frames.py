"""Where the elements of a turned follower are, and how vehicles and ROS say it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield.formula.closed_form import direct_field
from lightfield.scene import Detector, Follower, Scene, Tank
from lightfield.scene.follower import Mission
from lightfield.scene.in_tank import follower_in
from lightfield.studies.follower.elements import Elements
from lightfield.studies.follower.frames import (
    UNKNOWN_VARIANCE,
    covariance_of,
    in_frame,
    lamp_seen,
    placed,
    pose_of,
    poses_on_axis,
    rotations,
)

FORWARD, STARBOARD = np.array([0, 0, -1.0]), np.array([1.0, 0, 0])


@pytest.mark.parametrize(
    ("angles", "axis", "goes_to"),
    [
        ((0.1, 0, 0), FORWARD, [np.sin(0.1), 0, -np.cos(0.1)]),  # yaw: towards +x
        ((0, 0.1, 0), FORWARD, [0, np.sin(0.1), -np.cos(0.1)]),  # pitch: up
        ((0, 0, 0.1), STARBOARD, [np.cos(0.1), -np.sin(0.1), 0]),  # roll: starboard down
    ],
)
def test_positive_angles(angles: tuple[float, float, float], axis: np.ndarray, goes_to: list[float]) -> None:
    np.testing.assert_allclose(rotations(np.array(angles)) @ axis, goes_to, atol=1e-15)


def test_a_beam_is_brightest_on_its_axis_from_where_its_light_seems_to_come() -> None:
    """Tilted by 6 degrees about a point 2 m behind its window: the angle from the axis is 0 there alone."""
    turned = {"hwhm_deg": 2.0, "tilt_x_deg": 6.0, "tilt_y_deg": -3.0}
    lamp = {**turned, "offset_x_m": 0.1, "apparent_distance_m": 2.0}
    scene = Scene.from_dict({"lamp": lamp})
    x, y, z = poses_on_axis(scene.lamp, np.array([3.0]))[0, :3]
    assert (x, y) == pytest.approx((0.1 + 5.0 * np.tan(np.radians(6)), -5.0 * np.tan(np.radians(3))))
    ray = np.array([x - 0.1, y, z + 2.0])
    on_axis = 1 / (ray @ ray) * ray[2] / np.linalg.norm(ray)
    assert direct_field(scene, x, y, z) == pytest.approx(on_axis, rel=1e-9)


def test_elements_are_turned_about_the_middle_and_moved() -> None:
    one = Elements(np.array([[0.0, 0.0, -0.5]]), np.array([[0.0, 0.0, -1.0]]))
    place, normal = placed(one, np.array([[1.0, 2.0, 3.0, np.pi / 2, 0.0, 0.0]]))
    np.testing.assert_allclose(place[0], [[1.5, 2.0, 3.0]], atol=1e-15)
    np.testing.assert_allclose(normal[0], [[1.0, 0.0, 0.0]], atol=1e-15)


def test_vehicle_frame_is_that_of_fossen() -> None:
    """Forward, starboard, down; Euler angles ZYX, from SciPy's own rotations."""
    pose = np.array([0.3, -0.2, 6.5, 0.2, -0.1, 0.3])
    found = in_frame(pose, "vehicle")
    np.testing.assert_allclose(found.position_m, [-6.5, 0.3, 0.2])
    np.testing.assert_allclose(found.rotation, Rotation.from_euler("ZYX", pose[3:]).as_matrix(), atol=1e-14)


def test_ros_frame_is_forward_left_up() -> None:
    """REP 103: the same turn, seen with y and z reversed; the quaternion is SciPy's."""
    pose = np.array([0.3, -0.2, 6.5, 2.8, -0.4, 1.9])
    found = in_frame(pose, "ros")
    expected = Rotation.from_euler("ZYX", pose[3:] * [-1, -1, 1])
    np.testing.assert_allclose(found.position_m, [-6.5, -0.3, -0.2])
    np.testing.assert_allclose(found.rotation, expected.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(found.quaternion, expected.as_quat(canonical=True), atol=1e-14)


def test_quaternions_of_half_turns() -> None:
    for k in range(3):
        pose = np.zeros(6)
        pose[3 + k] = np.pi
        q = in_frame(pose, "ros").quaternion
        np.testing.assert_allclose(np.abs(q), np.eye(4)[[2, 1, 0][k]], atol=1e-8)


def test_a_scene_without_a_follower_has_one_on_the_axis() -> None:
    np.testing.assert_allclose(pose_of(follower_in(None, None, Detector())), [0, 0, 6.5, 0, 0, 0])
    short = Tank(length_m=5.0, behind_lamp_m=1.0)
    np.testing.assert_allclose(pose_of(follower_in(None, short, Detector())), [0, 0, 2.0, 0, 0, 0])
    np.testing.assert_allclose(pose_of(Follower(yaw_deg=90.0))[3], np.pi / 2)


def test_distances_that_nobody_stated_are_those_of_the_scene() -> None:
    """A lamp of which planes of 0.5 to 2 m are known: "asked for 6.5 m" was said there."""
    near = Detector(planes_m=(0.5, 1.0, 2.0))
    usual = follower_in(None, None, Detector())
    assert (usual.z_m, usual.mission.standoff_m) == (6.5, 6.5)
    unsaid = follower_in(None, None, near)
    assert (unsaid.z_m, unsaid.mission.standoff_m) == (1.25, 1.25)
    beside = follower_in(Follower(z_m=1.6), None, near)
    assert (beside.z_m, beside.mission.standoff_m) == (1.6, 1.6)
    stated = follower_in(Follower(z_m=1.6, mission=Mission(standoff_m=6.0)), None, near)
    assert stated.mission.standoff_m == 6.0


def test_the_lamp_seen_is_the_inverse_of_the_pose() -> None:
    """The follower in the lamp's frame (along the beam, left of it, up) is the lamp's own inverse."""
    pose = np.array([0.3, -0.2, 6.5, 0.2, -0.1, 0.3])
    seen = lamp_seen(pose)
    back = -seen.rotation.T @ seen.position_m
    np.testing.assert_allclose(back, [6.5, 0.3, -0.2], atol=1e-12)
    np.testing.assert_allclose(lamp_seen(np.array([0, 0, 5.0, 0, 0, 0])).position_m, [5, 0, 0], atol=1e-12)
    assert np.linalg.det(seen.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("seen", [lamp_seen, lambda pose: in_frame(pose, "ros")])
def test_covariances_are_those_of_framed_poses(seen) -> None:
    """A thousand poses by chance: their places and small turns scatter as the covariance says."""
    pose, names = np.array([0.3, -0.2, 6.5, 0.2, -0.1, 0.0]), ("x", "y", "z", "yaw", "pitch")
    sigma = np.array([0.01, 0.02, 0.05, 0.01, 0.015])
    correlation = np.eye(5)
    correlation[0, 3] = correlation[3, 0] = -0.8
    given = correlation * np.outer(sigma, sigma)
    stated = covariance_of(seen, pose, (*names, "roll"), np.pad(given, (0, 1)))
    here, rng, rows = seen(pose), np.random.default_rng(1), []
    for change in rng.multivariate_normal(np.zeros(5), given, 4000):
        there = seen(pose + np.append(change, 0.0))
        turn = Rotation.from_matrix(there.rotation @ here.rotation.T).as_rotvec()
        rows.append([*(there.position_m - here.position_m), *turn])
    found = np.cov(np.array(rows).T)
    size = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    np.testing.assert_allclose(found / size, stated / size, atol=0.08)


def test_what_is_not_known_is_large_and_finite() -> None:
    one = covariance_of(
        lamp_seen, np.array([0, 0, 5.0, 0, 0, 0]), ("x", "y", "z"), np.diag([1e-4, 1e-4, np.inf])
    )
    assert np.isfinite(one).all() and one[0, 0] == pytest.approx(UNKNOWN_VARIANCE)
    assert one[3, 3] == 0  # roll is taken as exact where nothing is said of it
