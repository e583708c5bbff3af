"""Where the elements of a turned follower are, and how vehicles and ROS say it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield.scene import Follower
from lightfield.studies.follower.elements import Elements
from lightfield.studies.follower.frames import in_frame, placed, pose_of, rotations

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
    np.testing.assert_allclose(pose_of(None), [0, 0, 6.5, 0, 0, 0])
    np.testing.assert_allclose(pose_of(Follower(yaw_deg=90.0))[3], np.pi / 2)
