"""Poses and frames.

A pose is (x, y, z, yaw, pitch, roll), m and rad, in the tank's frame: lamp at the origin, z along the tank's
axis, x horizontal, y up. At rest the follower looks along -z. Seen from the follower, positive angles turn
it to
starboard, lift its nose, and lower its starboard side: these are the vehicle's Euler angles (Fossen 2021,
section 2.2, ZYX).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from lightfield.arrays import Array
from lightfield.scene import Follower, Lamp
from lightfield.scene.lamp.frame import axis_at
from lightfield.studies.follower.elements import Elements

POSE = ("x", "y", "z", "yaw", "pitch", "roll")
Frame = Literal["vehicle", "ros"]
#: Rows: axes of a frame in the tank's coordinates. Vehicle: forward, starboard, down. ROS (REP 103): forward,
#: left, up; forward looks along -z, at the lamp.
AXES: dict[Frame, Array] = {
    "vehicle": np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    "ros": np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
}
#: Variance, m2 or rad2, of a coordinate that is not known at all (chosen; messages have no infinity).
UNKNOWN_VARIANCE = 1e9
#: Step of derivatives, m and rad.
_STEP = 1e-5


def pose_of(f: Follower) -> Array:
    """Pose that a scene gives, m and rad, shape (6,)."""
    return np.array([f.x_m, f.y_m, f.z_m, *np.radians([f.yaw_deg, f.pitch_deg, f.roll_deg])])


def poses_on_axis(lamp: Lamp, z_m: Array) -> Array:
    """Poses at rest where the beam's axis is at these distances, m and rad, shape (n, 6)."""
    poses = np.zeros((len(z_m), 6))
    poses[:, :3] = np.stack([*axis_at(lamp, z_m), z_m], axis=1)
    return poses


def in_degrees(pose: Array) -> Array:
    """Poses, m and degrees, shape as given (..., 6)."""
    return np.concatenate([pose[..., :3], np.degrees(pose[..., 3:])], axis=-1)


def with_units(names: Iterable[str]) -> list[str]:
    """Names of coordinates of a pose with the units that they are printed in."""
    return [f"{name}_m" if name in POSE[:3] else f"{name}_deg" for name in names]


def printed(sigma: Mapping[str, float]) -> dict[str, float]:
    """Standard deviations, given in m and rad, in m and degrees, by names with units."""
    values = [v if name in POSE[:3] else np.degrees(v) for name, v in sigma.items()]
    return dict(zip(with_units(sigma), map(float, values), strict=True))


def wrapped(angle_rad: Array) -> Array:
    """Angles, or errors of angles, as -pi to pi (excluded, included), rad: whole turns count as none."""
    return np.asarray(np.pi - (np.pi - angle_rad) % (2 * np.pi))


def rotations(angles: Array) -> Array:
    """Matrices that turn directions of the array's frame into the tank's, shape (..., 3, 3).

    Parameters
    ----------
    angles : array, shape (..., 3), rad
        Yaw, pitch and roll.
    """
    angles = np.asarray(angles, float)
    (cy, cp, cr), (sy, sp, sr) = ((v[..., 0], v[..., 1], v[..., 2]) for v in (np.cos(angles), np.sin(angles)))
    # Yaw about -y, then pitch about x, then roll about -z: forward is -z. Written out, for speed.
    found = np.empty((*angles.shape[:-1], 3, 3))
    found[..., 0, 0], found[..., 0, 1], found[..., 0, 2] = (
        cy * cr + sy * sp * sr,
        cy * sr - sy * sp * cr,
        -sy * cp,
    )
    found[..., 1, 0], found[..., 1, 1], found[..., 1, 2] = -cp * sr, cp * cr, -sp
    found[..., 2, 0], found[..., 2, 1], found[..., 2, 2] = (
        sy * cr - cy * sp * sr,
        sy * sr + cy * sp * cr,
        cy * cp,
    )
    return found


def placed(elements: Elements, poses: Array) -> tuple[Array, Array]:
    """Places and normals of the elements in the tank, m, shape (m, n, 3) each, at poses of shape (m, 6)."""
    turn = np.swapaxes(rotations(poses[:, 3:]), -1, -2)
    return elements.place_m @ turn + poses[:, None, :3], elements.normal @ turn


@dataclass(frozen=True)
class FramedPose:
    """A pose in another frame whose origin is the lamp.

    Parameters
    ----------
    position_m : array, shape (3,)
    rotation : array, shape (3, 3)
        Columns: the follower's axes of the same kind, in the frame.
    """

    position_m: Array
    rotation: Array

    @property
    def quaternion(self) -> Array:
        """(x, y, z, w), w >= 0, as ROS has it."""
        return np.asarray(Rotation.from_matrix(self.rotation).as_quat(canonical=True))


def in_frame(pose: Array, frame: Frame) -> FramedPose:
    """A pose, shape (6,), m and rad, in the frame of vehicles (forward, starboard, down) or of ROS (forward,
    left, up)."""
    axes = AXES[frame]
    return FramedPose(axes @ pose[:3], axes @ rotations(pose[3:]) @ axes.T)


def lamp_seen(pose: Array) -> FramedPose:
    """The lamp in the follower's own axes forward, left, up; its own: along the beam, left of it, up.

    What docking asks for: where the dock is, as the vehicle sees it.
    """
    body = rotations(pose[3:]) @ AXES["ros"].T  # columns: the follower's axes in the tank
    along_beam = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).T
    return FramedPose(-body.T @ pose[:3], body.T @ along_beam)


def covariance_of(
    seen: Callable[[Array], FramedPose], pose: Array, names: Sequence[str], covariance: Array
) -> Array:
    """Covariance of a framed pose, shape (6, 6): x, y, z, m, and turns about the frame's x, y, z axes, rad.

    That is the order and the meaning of geometry_msgs/PoseWithCovariance. What is not known at all gets
    `UNKNOWN_VARIANCE`.

    Parameters
    ----------
    seen : callable
        Pose to framed pose: `in_frame` with its frame, or `lamp_seen`.
    pose : array, shape (6,), m and rad
    names : sequence of str
        Coordinates of the pose that the covariance is of; the others are taken as exact, as roll in a round
        beam, which does not show it: a vehicle keeps or senses it by itself.
    covariance : array, shape (n, n), m and rad
        Infinite on its diagonal where nothing is known.
    """
    whole = np.zeros((len(POSE), len(POSE)))
    at = [POSE.index(name) for name in names]
    whole[np.ix_(at, at)] = np.where(np.isfinite(covariance), covariance, UNKNOWN_VARIANCE)
    here, slopes = seen(pose), np.empty((6, len(POSE)))
    for k, step in enumerate(_STEP * np.eye(len(POSE))):
        more, less = seen(pose + step), seen(pose - step)
        slopes[:3, k] = (more.position_m - less.position_m) / (2 * _STEP)
        turn = (more.rotation - less.rotation) @ here.rotation.T / (2 * _STEP)
        slopes[3:, k] = turn[2, 1], turn[0, 2], turn[1, 0]
    return np.asarray(slopes @ whole @ slopes.T)
