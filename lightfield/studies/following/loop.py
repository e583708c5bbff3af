"""The closed loop: light, array, estimate, law, thrusters, vehicle, and light again.

All runs go side by side; they differ in their noise and in what the follower does not know exactly. The lamp
keeps its heading. Frames: `studies.follower.frames`; the vehicle moves in its own (north away from it is -z
of the tank).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.progress import tell
from lightfield.scene import Scene
from lightfield.scene.follower import Mission
from lightfield.studies.follower.array_light import Light, Space, pose_names
from lightfield.studies.follower.array_noise import PERCENT, SensorNoise
from lightfield.studies.follower.elements import Elements
from lightfield.studies.follower.frames import AXES, pose_of, rotations, wrapped
from lightfield.studies.follower.information import nuisances_of
from lightfield.studies.follower.survey import DOCKING, array_of
from lightfield.studies.following.control import Law, law_of
from lightfield.studies.following.leader import way_of
from lightfield.studies.following.observer import Observer
from lightfield.studies.following.truth_and_belief import Truth, belief_of, space_of_mission
from lightfield.studies.following.vehicle import STEERED, VEHICLES, Vehicle

#: Longest step of the vehicle, s (Fossen's simulators use the same).
_STEP_S = 0.02
#: A follower that docks goes on where it takes itself to be this near the axis, m, and its heading, rad, this
#: straight (half of what a dock takes, see `CONE`).
_READY_M, _READY_RAD = 0.05, np.radians(2.5)
#: A dock takes a vehicle so near its axis, m, so straight, rad, so slow, m/s (Eren 2015, thesis,
#: University of New Hampshire).
CONE = (DOCKING["x"], DOCKING["yaw"], 0.1)
#: Largest error, m, that a law is shown along an axis: none hurries (chosen: 0.2 m/s under PID).
_LONGEST_ERROR_M = 0.5
#: How far behind the dock's mouth a follower aims, m: it has docked when it is stopped there (chosen).
_THROUGH_M = 0.15
#: Axes of the pose in the order of `Vehicle`: places north, east, down; roll, pitch, yaw.
_NORTH = AXES["vehicle"]
_ANGLES = (5, 4, 3)


@dataclass(frozen=True)
class Track:
    """What happened, at every reading; n_t times, s runs.

    Parameters
    ----------
    time_s : array, shape (n_t,)
    leader_m : array, shape (n_t, 3)
        Place of the lamp.
    pose, estimate : array, shape (n_t, s, 6), m and rad
        From the lamp: true, and what the follower takes it for (NaN before it has seen light).
    speed : array, shape (n_t, s), m/s
        Past the lamp.
    sigma : array, shape (n_t, s, 6), m and rad
        What the filter says of its own error by noise; 0 where a coordinate is not sought.
    force : array, shape (n_t, s, 4), N and N m
        Surge, sway, heave, yaw.
    brightest : array, shape (n_t, s)
    lit, doubtful, inside : array of bool, shape (n_t, s)
        There is light; it does not fit what is believed; the vehicle is where the light is known.
    goal_m : array, shape (n_t, s)
        Distance to be kept.
    contact : array, shape (s, 4)
        At a dock: time, s, distance from its axis, m, turn, rad, speed, m/s; NaN: not reached.
    """

    time_s: Array
    leader_m: Array
    pose: Array
    estimate: Array
    speed: Array
    sigma: Array
    force: Array
    brightest: Array
    lit: Mask
    doubtful: Mask
    inside: Mask
    goal_m: Array
    contact: Array


def run_loop(scene: Scene, light: Light, elements: Elements, *, runs: int, seed: int = 0) -> Track:
    """Let followers run a scene's mission.

    Parameters
    ----------
    scene : Scene
        With an array.
    light : Light
        From which the light of the scene's water can be weighed.
    runs : int
        Side by side.
    """
    array, follower = array_of(scene), scene.follower_here
    mission, rng, noise = follower.mission, np.random.default_rng(seed), SensorNoise.of_scene(scene)
    truth = Truth.of(scene, light, elements, runs, rng)
    observer, space = _observer(scene, light, elements, runs), space_of_mission(scene)
    vehicle = VEHICLES[mission.vehicle]
    if mission.degrees_of_freedom == 4:
        vehicle = replace(vehicle, free=STEERED)
    pilot = _Pilot(mission, law_of(mission.law, vehicle), vehicle, runs)
    seconds = 1 / array.sample_hz
    steps = int(np.ceil(seconds / _STEP_S))
    way, count = way_of(mission), int(np.floor(mission.duration_s * array.sample_hz)) + 1
    state = _Moving.at(pose_of(follower), runs)
    kept: dict[str, list[Array]] = {one.name: [] for one in fields(Track)}
    contact = np.full((runs, 4), np.nan)
    going = np.ones(runs, bool)
    pose = pose_of(follower)[None].repeat(runs, axis=0)
    for k in range(count):
        time = k * seconds
        lamp = way(time)
        before, pose = pose, state.pose(lamp)
        speed = np.linalg.norm(pose[:, :3] - before[:, :3], axis=1) / seconds if k else np.zeros(runs)
        if mission.task == "dock":
            going &= ~_touched(mission, pose, speed, time, contact)
        clean = truth.readings(pose, _turbid(mission, time)) * (not _is_dark(mission, time))
        # The mismatch of the elements is drawn once, not with every reading.
        variance = noise.variance(clean) - (noise.mismatch * clean) ** 2
        observer.update(clean + np.sqrt(variance) * rng.standard_normal(clean.shape), seconds if k else 0.0)
        told = observer.filter
        force = pilot.force(told.poses, told.rates, seconds, observer.lit & told.known)
        now = {
            "time_s": np.array(time),
            "leader_m": lamp,
            "pose": pose,
            "estimate": np.where(told.known[:, None], told.poses, np.nan),
            "speed": speed,
            "sigma": told.sigmas,
            "force": force,
            "brightest": clean.max(axis=1),
            "lit": observer.lit,
            "doubtful": observer.doubtful,
            "inside": _inside(space, pose),
            "goal_m": pilot.goal.copy(),
        }
        for name, values in now.items():
            kept[name].append(values)
        current = _current(mission, time)
        for _ in range(steps):
            state.step(vehicle, force, current, seconds / steps, going)
        tell("", (k + 1) / count)
    kept["contact"] = list(contact)
    columns: dict[str, Any] = {name: np.array(values) for name, values in kept.items()}
    return Track(**columns)


def _observer(scene: Scene, light: Light, elements: Elements, runs: int) -> Observer:
    """What the followers of a mission take their poses for, by what they believe.

    Who believes the formula takes every reading by itself, as the follower of Eren (2015) did.
    """
    mission, learns = scene.follower_here.mission, scene.follower_here.mission.believes == "field"
    model, knows_gain = belief_of(mission.believes, light.in_water_of(scene), elements, mission.standoff_m)
    gain = PERCENT * array_of(scene).gain_drift_percent if knows_gain else np.inf
    unknown = nuisances_of(scene) if learns else {"gain": gain} if gain else {}
    held = ("pitch", "roll") if mission.degrees_of_freedom == 4 else ()
    names = [name for name in pose_names(scene) if name not in held]
    noise, space = SensorNoise.of_scene(scene), space_of_mission(scene)
    return Observer(model, noise, names, space, unknown, runs, learns=learns)


def _is_dark(mission: Mission, time_s: float) -> bool:
    return mission.dark_from_s <= time_s < mission.dark_from_s + mission.dark_for_s


def _turbid(mission: Mission, time_s: float) -> float:
    """How far the water is on its way from clear, 0, to turbid, 1."""
    return float(np.clip((time_s - mission.turbid_from_s) / mission.turbid_for_s, 0.0, 1.0))


@dataclass
class _Moving:
    """Places and velocities of the vehicles, in their own axes."""

    place: Array
    velocity: Array

    @classmethod
    def at(cls, pose: Array, runs: int) -> _Moving:
        place = np.concatenate([_NORTH @ pose[:3], pose[list(_ANGLES)]])
        return cls(np.tile(place, (runs, 1)), np.zeros((runs, 6)))

    def pose(self, lamp: Array) -> Array:
        """From a lamp, shape (runs, 6); a vehicle that has spun is turned as one that has not."""
        return np.concatenate([self.place[:, :3] @ _NORTH - lamp, wrapped(self.place[:, _ANGLES])], axis=1)

    def step(self, vehicle: Vehicle, force: Array, current: Array, seconds: float, going: Mask) -> None:
        full = np.zeros((len(force), 6))
        full[:, STEERED] = force
        place, velocity = vehicle.step(self.place, self.velocity, full, current, seconds)
        self.place = np.where(going[:, None], place, self.place)
        self.velocity = np.where(going[:, None], velocity, 0.0)


@dataclass
class _Pilot:
    """Where each follower should be, and the force that brings it there."""

    mission: Mission
    law: Law
    vehicle: Vehicle
    runs: int

    def __post_init__(self) -> None:
        self.goal = np.full(self.runs, self.mission.standoff_m)
        self.most = np.array(self.vehicle.thrust)[list(STEERED)]

    def force(self, pose: Array, rate: Array, seconds: float, lit: Mask) -> Array:
        """Shape (runs, 4)."""
        if self.mission.task == "dock":
            ahead = np.hypot(pose[:, 0], pose[:, 1]) < _READY_M
            ready = lit & ahead & (np.abs(pose[:, 3]) < _READY_RAD)
            nearer = self.goal - seconds * self.mission.approach_m_per_s
            self.goal = np.where(ready, np.maximum(nearer, self.mission.dock_m - _THROUGH_M), self.goal)
        goal = np.zeros((self.runs, 3))
        goal[:, 2] = self.goal
        # In the vehicle's axes: forward, starboard, down.
        turn = np.einsum("ij,skj->sik", _NORTH, rotations(pose[:, 3:]))
        error = np.einsum("sij,sj->si", turn, goal - pose[:, :3])
        error = np.clip(error, -_LONGEST_ERROR_M, _LONGEST_ERROR_M)
        speed = np.einsum("sij,sj->si", turn, rate[:, :3])
        error = np.concatenate([error, -pose[:, 3:4]], axis=1)
        velocity = np.concatenate([speed, rate[:, 3:4]], axis=1)
        # Without light nothing is known of the way: no more than what held against the current until then.
        blind = ~lit
        error[blind], velocity[blind] = 0.0, 0.0
        return np.clip(self.law.force(error, velocity, seconds, lit), -self.most, self.most)


def _current(mission: Mission, time_s: float) -> Array:
    if time_s < mission.current_from_s:
        return np.zeros(3)
    of_tank = [mission.current_x_m_per_s, mission.current_y_m_per_s, mission.current_z_m_per_s]
    return np.asarray(_NORTH @ np.array(of_tank))


def _inside(space: Space, pose: Array) -> Mask:
    x, y, z = pose[:, :3].T
    wide = (np.abs(x) <= space.half_width_m) & (np.abs(y) <= space.half_width_m)
    found: Mask = (wide & (z >= space.near_m)) & (z <= space.far_m)
    return found


def _touched(mission: Mission, pose: Array, speed: Array, time_s: float, contact: Array) -> Mask:
    """Which vehicles are at the dock's mouth; their first contact is noted."""
    there: Mask = pose[:, 2] <= mission.dock_m
    new = there & np.isnan(contact[:, 0])
    aside = np.hypot(pose[:, 0], pose[:, 1])
    contact[new] = np.stack([np.full(len(pose), time_s), aside, np.abs(pose[:, 3]), speed], axis=1)[new]
    return there
