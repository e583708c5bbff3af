"""The ROS node with a stand-in for ROS 2: what is published is where the lamp is, in REP 103's frames."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield import cli
from lightfield.errors import UsageError
from lightfield.robots.ros import ERROR, OK, WARN, Bridge, make_node, spin
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import FormulaLight, Space
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.follower.estimation.pose import Estimator

SCENE = {
    "lamp": {"hwhm_deg": 3.81},
    "water": {"absorption_per_m": 0.05},
    "array": {"count": [5, 5], "size_m": 0.26, "radius_m": 0.19},
    "follower": {"z_m": 6.5},
}
POSE = np.array([0.2, -0.1, 6.0, 0.1, -0.05, 0.0])


class Plain(SimpleNamespace):
    """A message: any field, made when it is asked for."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        made = [] if name in ("status", "values") else Plain()
        setattr(self, name, made)
        return made


class Node:
    """What a node is asked for here."""

    def __init__(self, name: str) -> None:
        self.name, self.sent, self.heard = name, {}, {}

    def create_publisher(self, kind: type, topic: str, queue: int) -> SimpleNamespace:
        self.sent[topic] = []
        return SimpleNamespace(publish=self.sent[topic].append)

    def create_subscription(self, kind: type, topic: str, callback: Any, queue: int) -> None:
        self.heard[topic] = callback

    def get_clock(self) -> SimpleNamespace:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: "now"))


@pytest.fixture
def stand_in(monkeypatch) -> SimpleNamespace:
    """Modules of the names of ROS 2; `spun` has the nodes that were spun."""
    spun: list[Node] = []
    calls: list[str] = []

    def spin(node: Node) -> None:
        spun.append(node)
        raise KeyboardInterrupt

    def kind(name: str) -> type:
        return type(name, (Plain,), {})

    start, end = (lambda: calls.append("init")), (lambda: calls.append("end"))
    states = ("DiagnosticArray", "DiagnosticStatus", "KeyValue")
    modules = {
        "rclpy": {"init": start, "spin": spin, "try_shutdown": end},
        "rclpy.node": {"Node": Node},
        "std_msgs": {}, "geometry_msgs": {}, "diagnostic_msgs": {},
        "std_msgs.msg": {"Float32MultiArray": kind("Float32MultiArray")},
        "geometry_msgs.msg": {name: kind(name) for name in ("PoseWithCovarianceStamped", "PoseStamped")},
        "diagnostic_msgs.msg": {name: kind(name) for name in states},
    }  # fmt: skip
    for name, parts in modules.items():
        module = ModuleType(name)
        vars(module).update(parts)
        monkeypatch.setitem(sys.modules, name, module)
    return SimpleNamespace(spun=spun, calls=calls)


def bridge() -> Bridge:
    scene = Scene.from_dict(SCENE)
    return Bridge(Estimator.of_scene(scene, FormulaLight(scene), Space()))


def readings(of: Bridge, pose: np.ndarray = POSE) -> np.ndarray:
    return of.estimator.model.readings(pose[None])[0]


def test_the_lamp_is_where_it_is(stand_in) -> None:
    """Positions by a turn of SciPy's: the follower's axes forward, left, up are yawed and pitched."""
    made = bridge()
    node = make_node(made)
    node.heard["array/readings"](SimpleNamespace(data=readings(made).tolist()))
    (full,), (dock,), (state,) = (node.sent[t] for t in ("lamp_pose", "detected_dock_pose", "diagnostics"))
    # To the follower, who looks along -z, the tank's x is to starboard.
    body = Rotation.from_euler("ZYX", POSE[3:] * [-1, -1, 1])
    lamp = body.inv().apply([POSE[2], POSE[0], -POSE[1]])  # forward, left, up, from the follower
    for pose in (full.pose.pose, dock.pose):
        found = [pose.position.x, pose.position.y, pose.position.z]
        assert found == pytest.approx(lamp.tolist(), abs=2e-3)
        q = [pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w]
        facing = Rotation.from_quat(q).apply([1.0, 0, 0])  # the beam: back to the follower, as it looks
        assert facing == pytest.approx(body.inv().apply([-1.0, 0, 0]).tolist(), abs=2e-3)
    assert full.header.frame_id == dock.header.frame_id == "array_link" and dock.header.stamp == "now"
    covariance = np.array(full.pose.covariance).reshape(6, 6)
    assert (
        np.allclose(covariance, covariance.T)
        and covariance[3:, 3:].trace() > 1e8 > covariance[:3, :3].trace()
    )
    assert np.all(np.linalg.eigvalsh(covariance) > 0)
    assert state.status[0].level == OK and state.status[0].message == "found"


def test_covariance_is_the_scatter_of_what_is_published() -> None:
    """Readings with the noise that the scene states, 60 times: spread of the lamp's place, axis by axis."""
    made = bridge()
    clean = readings(made)
    sigma = np.sqrt(made.estimator.noise.variance(clean))
    rng, places, stated = np.random.default_rng(4), [], None
    for _ in range(60):
        answer = made.update(clean + sigma * rng.standard_normal(len(clean)))
        if answer.lamp is not None:
            places.append(answer.lamp.position_m)
            stated = answer.covariance if stated is None else stated
    assert len(places) > 50 and stated is not None
    # Gain and water, known beforehand, do not scatter: along the beam the error stated is larger.
    spread, error = np.std(places, axis=0), np.sqrt(np.diag(stated)[:3])
    assert np.all(spread[1:] < 1.3 * error[1:]) and np.all(spread[1:] > 0.6 * error[1:])
    assert spread[0] < error[0]


def test_what_does_not_fit_is_not_published(stand_in) -> None:
    made = bridge()
    node = make_node(made)
    listen = node.heard["array/readings"]
    listen(SimpleNamespace(data=np.zeros(25)))
    listen(SimpleNamespace(data=readings(made) * (1 + 0.5 * (np.arange(25) % 2))))
    listen(SimpleNamespace(data=np.ones(7)))
    listen(SimpleNamespace(data=np.full(25, np.nan)))
    assert not node.sent["lamp_pose"] and not node.sent["detected_dock_pose"]
    levels = [one.status[0].level for one in node.sent["diagnostics"]]
    assert levels == [ERROR, WARN, ERROR, ERROR]
    assert node.sent["diagnostics"][0].status[0].message == "light lost"
    assert "25 finite numbers" in node.sent["diagnostics"][2].status[0].message
    listen(SimpleNamespace(data=readings(made)))
    assert len(node.sent["lamp_pose"]) == 1


@pytest.mark.parametrize("read", [1, 3])
def test_nobody_docks_by_a_pose_that_is_not_known(stand_in, read: int) -> None:
    """Of 25 elements few were read: it fits, with rivals and infinite errors, and was said to be found."""
    made = bridge()
    node = make_node(made)
    few = np.full(25, np.nan)
    few[:read] = readings(made)[:read]
    node.heard["array/readings"](SimpleNamespace(data=few))
    (state,) = node.sent["diagnostics"]
    assert len(node.sent["lamp_pose"]) == 1 and not node.sent["detected_dock_pose"]
    assert state.status[0].level == WARN and state.status[0].message != "found"
    node.heard["array/readings"](SimpleNamespace(data=readings(made)))
    assert len(node.sent["detected_dock_pose"]) == 1


def test_a_node_is_spun_until_it_is_interrupted(stand_in) -> None:
    with pytest.raises(KeyboardInterrupt):
        spin(bridge())
    assert stand_in.spun[0].name == "lightfield_pose" and stand_in.calls == ["init", "end"]


def test_without_ros_there_is_one_clear_error(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(UsageError, match="ROS 2 is not here"):
        make_node(bridge())
    (tmp_path / "scene.toml").write_text("[lamp]\nhwhm_deg = 3.81\n[water]\n[array]\n")
    assert cli.main(["ros", str(tmp_path / "scene.toml"), "--no-trace"]) == 2
    assert "ROS 2 is not here" in capsys.readouterr().err


def test_elements_are_those_of_the_scene() -> None:
    assert len(bridge().estimator.model.elements) == len(elements_of(Scene.from_dict(SCENE).array))
