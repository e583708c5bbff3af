"""An optional ROS 2 node: readings of an array in, the pose of the lamp out, with its covariance.

    array/readings      std_msgs/Float32MultiArray               in: one reading per element, in their order
    lamp_pose           geometry_msgs/PoseWithCovarianceStamped  the lamp in array_link: forward, left, up
    detected_dock_pose  geometry_msgs/PoseStamped                the same, as opennav_docking takes it
    diagnostics         diagnostic_msgs/DiagnosticArray          found, does not fit, at the edge, light lost

Poses are published only where the readings fit the light. Roll about a round beam is not in it: the array is
taken to be level, and the turn of the lamp about its own axis is published as unknown. The array is at rest
in `array_link`; where that is on the vehicle is the business of its transforms. ROS is imported when a node
is made, never before.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import UsageError
from lightfield.studies.defaults import FRAME
from lightfield.studies.follower.estimation.pose import Estimator, PoseEstimate
from lightfield.studies.follower.frames import UNKNOWN_VARIANCE, FramedPose, covariance_of, lamp_seen

_NODE = "lightfield_pose"
#: Messages that wait at most.
_QUEUE = 10
#: Levels of diagnostic_msgs/DiagnosticStatus.
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"


@dataclass(frozen=True)
class LampPose:
    """What one sample of the array says.

    Parameters
    ----------
    lamp : FramedPose, optional
        The lamp in the array's own axes; None where the readings do not fit the light.
    covariance : array, shape (6, 6), optional
        In the order of geometry_msgs/PoseWithCovariance.
    """

    estimate: PoseEstimate
    lamp: FramedPose | None
    covariance: Array | None

    @property
    def is_determined(self) -> bool:
        """May a vehicle steer by it: is it the one pose that fits, and all of it known?"""
        known = self.covariance is not None and bool(np.isfinite(self.covariance).all())
        return known and not self.estimate.ambiguous

    @property
    def level(self) -> bytes:
        """Level of a diagnostic."""
        return ERROR if self.estimate.lost else OK if self.is_determined else WARN

    @property
    def words(self) -> str:
        """What a diagnostic says."""
        if self.lamp is None or self.is_determined:
            return self.estimate.status
        return "several poses fit" if self.estimate.ambiguous else "some of the pose is not known"


@dataclass
class Bridge:
    """From readings to what is published, without ROS: each sample begins where the last one was found, too.

    Parameters
    ----------
    gain : float
        Reading per unit of light, as the scene's array says.
    """

    estimator: Estimator
    gain: float = 1.0
    _last: Array | None = field(default=None, repr=False)

    def update(self, readings: Array) -> LampPose:
        """One sample.

        Parameters
        ----------
        readings : array, shape (n_elements,)
            NaN of an element that was not read.

        Raises
        ------
        UsageError
            Not one number per element, or none was read.
        """
        values, count = np.asarray(readings, float), len(self.estimator.model.elements)
        if values.shape != (count,) or np.isinf(values).any() or np.isnan(values).all():
            raise UsageError(
                "not the readings of this array", found=f"{np.isfinite(values).sum()} finite numbers",
                rule=f"{count} finite numbers, one per element, nan of an element that was not read",
            )  # fmt: skip
        estimate = self.estimator.estimate(values / self.gain, self._last)
        self._last = estimate.pose if estimate.fits else None
        if not estimate.fits or estimate.total is None:
            return LampPose(estimate, None, None)
        lamp, total = lamp_seen(estimate.pose), estimate.total
        spread = covariance_of(lamp_seen, estimate.pose, total.names, total.covariance)
        if "roll" not in total.names:  # nor is the turn of a round lamp about its own axis anything
            spread[3:, 3:] += UNKNOWN_VARIANCE * np.outer(lamp.rotation[:, 0], lamp.rotation[:, 0])
        return LampPose(estimate, lamp, spread)


def ros() -> dict[str, ModuleType]:
    """The parts of ROS 2 that a node needs.

    Raises
    ------
    UsageError
        There is no ROS 2 here.
    """
    names = ("rclpy", "rclpy.node", "std_msgs.msg", "geometry_msgs.msg", "diagnostic_msgs.msg")
    try:
        return {name: importlib.import_module(name) for name in names}
    except ImportError as error:
        raise UsageError(
            "ROS 2 is not here",
            found=str(error),
            rule="a ROS 2 installation for this Python, with std_msgs, geometry_msgs, diagnostic_msgs",
            remedy="source its setup file (for example /opt/ros/jazzy/setup.bash) and try again",
        ) from error


def make_node(bridge: Bridge, frame: str = FRAME) -> Any:
    """A node that listens to `array/readings`; `rclpy.init` has been called."""
    parts = ros()
    std, geometry, diagnostic = (parts[f"{name}_msgs.msg"] for name in ("std", "geometry", "diagnostic"))
    node = parts["rclpy.node"].Node(_NODE)
    poses = node.create_publisher(geometry.PoseWithCovarianceStamped, "lamp_pose", _QUEUE)
    docks = node.create_publisher(geometry.PoseStamped, "detected_dock_pose", _QUEUE)
    states = node.create_publisher(diagnostic.DiagnosticArray, "diagnostics", _QUEUE)

    def listen(message: Any) -> None:
        # Taken when it arrives: the message has no time of its own.
        stamp = node.get_clock().now().to_msg()
        try:
            answer = bridge.update(np.asarray(message.data, float))
        except UsageError as error:
            states.publish(_state(diagnostic, stamp, ERROR, str(error), {}))
            return
        if answer.lamp is not None and answer.covariance is not None:
            full, plain = geometry.PoseWithCovarianceStamped(), geometry.PoseStamped()
            full.header.stamp = plain.header.stamp = stamp
            full.header.frame_id = plain.header.frame_id = frame
            for pose in (full.pose.pose, plain.pose):
                _fill(pose, answer.lamp)
            full.pose.covariance = [float(v) for v in answer.covariance.ravel()]
            poses.publish(full)
            if answer.is_determined:  # it has no covariance that could say otherwise
                docks.publish(plain)
        one = answer.estimate
        facts = {
            "chi2": f"{one.chi2:.3g}",
            "probability": f"{one.probability:.3g}",
            "rivals": str(len(one.rivals)),
            "ambiguous": "yes" if one.ambiguous else "no",
        }
        states.publish(_state(diagnostic, stamp, answer.level, answer.words, facts))

    node.create_subscription(std.Float32MultiArray, "array/readings", listen, _QUEUE)
    return node


def spin(bridge: Bridge, frame: str = FRAME) -> None:
    """Spin a node until it is interrupted."""
    rclpy = ros()["rclpy"]
    rclpy.init()
    try:
        node = make_node(bridge, frame)
        rclpy.spin(node)
    finally:
        rclpy.try_shutdown()


def _fill(pose: Any, seen: FramedPose) -> None:
    pose.position.x, pose.position.y, pose.position.z = map(float, seen.position_m)
    q = map(float, seen.quaternion)
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = q


def _state(diagnostic: ModuleType, stamp: Any, level: bytes, words: str, facts: dict[str, str]) -> Any:
    status = diagnostic.DiagnosticStatus()
    status.level, status.name, status.message = level, _NODE, words
    for key, value in facts.items():
        pair = diagnostic.KeyValue()
        pair.key, pair.value = key, value
        status.values.append(pair)
    found = diagnostic.DiagnosticArray()
    found.header.stamp = stamp
    found.status.append(status)
    return found
