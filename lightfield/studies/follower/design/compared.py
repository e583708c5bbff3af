"""Arrays compared: what each knows of the pose in the light, noise and task of one scene.

The criterion is A: the sum of the variances of the pose in units of the task (1 cm across, 10 cm along, 1
degree), from one reading, averaged over the poses of the task.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from lightfield.arrays import Array
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.scene.lamp.lamp import Lamp
from lightfield.studies.defaults import TASK
from lightfield.studies.follower.array_light import (
    ArrayModel,
    Light,
    Space,
    light_of,
    pose_names,
    refuse_walls,
)
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.elements import Elements, elements_of
from lightfield.studies.follower.frames import poses_on_axis
from lightfield.studies.follower.information import (
    TASK_UNITS,
    is_told,
    jackknife,
    noise_of_slopes,
    nuisances_of,
    sigma_in_words,
    with_doubt_in_words,
    without_noise,
)
from lightfield.studies.follower.survey import array_of

Task = Literal["formation", "docking"]
#: Distances of a task as parts of the formation space, places beside the beam's axis, m (no farther than half
#: the space is wide), and yaws, degrees. Docking ends near the lamp, on its axis (chosen: the prototype's
#: twelve poses; the last part of a way home).
_TASKS: dict[str, tuple[Sequence[float], Sequence[float], Sequence[float]]] = {
    "formation": ((0.0, 0.5, 1.0), (0.0, 0.3), (0.0, 8.0)),
    "docking": ((0.0, 0.1, 0.25), (0.0, 0.1), (0.0, 4.0)),
}
#: Information of everything, in units of the task, that keeps an array with too few elements from dividing
#: by zero.
_RIDGE = 1e-9
#: An array that is better by A is told to be worse in a coordinate from this ratio of its errors on (chosen).
_WORSE = 1.05


def task_poses(space: Space, lamp: Lamp, task: Task = TASK) -> Array:
    """Poses of a task in a formation space, on the axis of the beam and aside, m and rad, shape (n, 6)."""
    parts, sideways, yaws = _TASKS[task]
    axis = poses_on_axis(lamp, space.near_m + np.array(parts) * (space.far_m - space.near_m))
    aside = [min(x, space.half_width_m) for x in sideways]
    turned = [np.array([x, 0, 0, np.radians(yaw), 0, 0]) for x in aside for yaw in yaws]
    return np.array([at + one for at in axis for one in turned])


@dataclass(frozen=True)
class ArraySetting:
    """What arrays are compared in.

    Parameters
    ----------
    light : Light
    poses : array, shape (n_poses, 6), m and rad
    names : tuple of str
    noise : SensorNoise
    nuisances : mapping of str to float
    """

    light: Light
    poses: Array
    names: tuple[str, ...]
    noise: SensorNoise
    nuisances: Mapping[str, float]

    @cached_property
    def leave_one_out(self) -> list[ArraySetting]:
        """The same in the light of the trace without one of its batches, for each in turn."""
        return [replace(self, light=light) for light in self.light.leave_one_out()]

    def whitened(self, elements: Elements) -> Array:
        """Derivatives over noise of every element alone, in units of the task, shape (n_poses, n, k).

        The noise is that of the same electronics for all arrays: its brightest reading, that of an element
        in the middle that faces forward.
        """
        model = ArrayModel(self.light, elements)
        forward = ArrayModel(self.light, Elements(np.zeros((1, 3)), np.array([[0.0, 0.0, -1.0]])))
        wanted = [*self.names, *self.nuisances]
        units = np.array([TASK_UNITS.get(name, 1.0) for name in wanted])
        rows = []
        for pose in self.poses:
            top = forward.readings(pose[None])[0]
            readings, error = model.with_errors(pose)
            variance = self.noise.variance(readings, brightest=top) + error**2
            rows.append(model.slopes(pose, wanted) * units / np.sqrt(variance)[:, None])
        return np.stack(rows)

    @property
    def prior(self) -> Array:
        """Information before any reading, shape (k, k)."""
        known = [float(s) ** -2.0 for s in self.nuisances.values()]
        return np.diag([_RIDGE] * len(self.names) + [max(v, _RIDGE) for v in known])

    def criterion(self, whitened: Array) -> float:
        """A of the elements together."""
        return self.mean_trace(self.covariances(whitened))

    def mean_trace(self, covariances: Array) -> float:
        """A of the poses' covariances, shape (n_poses, k, k)."""
        return float(self._traces(covariances).mean())

    def covariances(self, whitened: Array) -> Array:
        """Shape (n_poses, k, k)."""
        return np.linalg.inv(np.swapaxes(whitened, 1, 2) @ whitened + self.prior)

    def _traces(self, covariances: Array) -> Array:
        return np.asarray(np.einsum("pkk->pk", covariances)[:, : len(self.names)].sum(axis=1))

    def exchanged(self, whitened: Array, rest: Array) -> Array:
        """A of the rest with each candidate in turn, shape (n_candidates,)."""
        c = self.covariances(rest)
        cg = whitened @ c  # [n_poses, n_candidates, k]
        gain = (cg[:, :, : len(self.names)] ** 2).sum(axis=2) / (1 + np.einsum("pnk,pnk->pn", cg, whitened))
        return np.asarray((self._traces(c)[:, None] - gain).mean(axis=0))


@dataclass(frozen=True)
class JudgedArray:
    """An array in a task: A, root mean square bounds over its poses, m and rad, and the relative error of A
    by the noise of the trace (see `information.with_doubt`)."""

    name: str
    elements: Elements
    criterion: float
    sigma: dict[str, float]
    doubt: float

    def as_data(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "elements": len(self.elements),
            "A": self.criterion,
            "A_relative_error_of_trace": self.doubt,
            "rms_m_rad": self.sigma,
            "places_m": self.elements.place_m.tolist(),
            "normals": self.elements.normal.tolist(),
        }

    def as_text(self) -> str:
        known = ", ".join(sigma_in_words(name, sigma) for name, sigma in self.sigma.items())
        return f"{self.name:<32} {len(self.elements):>3} elements  A {self.told_criterion:>8}  rms {known}"

    @property
    def is_told(self) -> bool:
        """Is every coordinate known at all?"""
        return all(is_told(name, sigma) for name, sigma in self.sigma.items())

    @property
    def told_criterion(self) -> str:
        """A with its error; unknown where a coordinate is."""
        return "unknown" if not self.is_told else with_doubt_in_words(self.criterion, self.doubt)


def judged_array(name: str, elements: Elements, setting: ArraySetting) -> JudgedArray:
    """An array at the poses of a task."""
    whole = setting.whitened(elements)
    covariances, parts = setting.covariances(whole), setting.leave_one_out
    others = []
    if parts:
        each = [one.whitened(elements) for one in parts]
        noise = noise_of_slopes(whole, each)
        covariances, more = without_noise(covariances, noise), noise * len(parts) / (len(parts) - 1)
        others = [setting.mean_trace(without_noise(setting.covariances(one), more)) for one in each]
    squares = np.einsum("pkk->pk", covariances)[:, : len(setting.names)].mean(axis=0)
    sigma = {n: float(TASK_UNITS[n] * np.sqrt(v)) for n, v in zip(setting.names, squares, strict=True)}
    doubt = jackknife(float(squares.sum()), others)
    return JudgedArray(name, elements, float(squares.sum()), sigma, doubt)


@dataclass(frozen=True)
class Arrays:
    """Arrays in the same light and task, best first."""

    scene: Scene
    arrays: list[JudgedArray]
    task: str
    traced: bool

    @property
    def verdict(self) -> str:
        """One sentence: the best beside the worst, and what it knows worse all the same."""
        best, worst = self.arrays[0], self.arrays[-1]
        about = f"{len(best.elements)} elements ({best.name}) know the pose"
        if not worst.is_told:
            return f"{about} best; of the {len(worst.elements)} of {worst.name} some of it is unknown"
        times = (worst.criterion / best.criterion) ** 0.5
        told = f"{about} {times:.2g} times as well as the {len(worst.elements)} of {worst.name}"
        less = [
            f"{sigma_in_words(name, sigma)} against {_amount(name, worst.sigma[name])}"
            for name, sigma in best.sigma.items()
            if sigma > _WORSE * worst.sigma[name]
        ]
        return f"{told} by A, yet some of it worse: {', '.join(less)}" if less else told

    def as_data(self) -> dict[str, Any]:
        return {"task": self.task, "arrays": [one.as_data() for one in self.arrays]}

    def as_text(self) -> str:
        head = f"task: {self.task}; A: mean sum of variances in units of 1 cm across, 10 cm along, 1 degree"
        return "\n".join([head, *(one.as_text() for one in self.arrays)])


def _amount(name: str, sigma: float) -> str:
    """A standard deviation without its coordinate."""
    return sigma_in_words(name, sigma).removeprefix(f"{name} ")


def setting_of(
    scene: Scene, space: Space, reach: Elements, task: Task, *, photons: float, seed: int
) -> ArraySetting:
    """Light, noise and what is unknown as a scene says; light as far as elements may reach.

    Raises
    ------
    RenderError
        At a pose of the task elements would stand in a wall.
    """
    poses = task_poses(space, scene.lamp, task)
    aside = float(np.abs(poses[:, :2]).max())
    refuse_walls(scene, replace(space, half_width_m=aside), reach)
    wide = replace(space, half_width_m=max(space.half_width_m, aside))
    light = light_of(scene, wide, reach, photons=photons, seed=seed)
    return ArraySetting(light, poses, pose_names(scene), SensorNoise.of_scene(scene), nuisances_of(scene))


def compare_arrays(
    scene: Scene,
    others: Mapping[str, Scene],
    space: Space,
    task: Task = TASK,
    *,
    photons: float = FIELD_PHOTONS,
    seed: int = 0,
) -> Arrays:
    """Arrays of several scenes in the light, noise and task of the first.

    Parameters
    ----------
    others : mapping of str to Scene
        Only their arrays count.

    Raises
    ------
    SceneError
        A scene without an array.
    """
    arrays = {scene.name or "this array": elements_of(array_of(scene))}
    for name, other in others.items():
        arrays[name] = elements_of(array_of(other))
    widest = max(arrays.values(), key=lambda elements: elements.reach_m)
    setting = setting_of(scene, space, widest, task, photons=photons, seed=seed)
    found = sorted(
        (judged_array(name, one, setting) for name, one in arrays.items()), key=lambda one: one.criterion
    )
    return Arrays(scene, found, task, bool(photons))
