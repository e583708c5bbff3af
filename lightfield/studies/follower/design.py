"""Arrays compared and designed: where to put so many elements, and where to let them face.

The criterion is A: the sum of the variances of the pose in units of the task (1 cm across, 10 cm along, 1
degree),
from one reading, averaged over the poses of the task. The search exchanges one element after the other for
the best of all
candidates (Fedorov 1972, Theory of Optimal Experiments, section 3; Cook and Nachtsheim 1980, Technometrics
22, 315): with
g the whitened derivatives of a candidate's reading, and C the covariance without the element that goes,

    trace W C'  =  trace W C  -  g^T C W C g / (1 + g^T C g)                 (Sherman and Morrison 1950)

so that all candidates cost one product. Then the candidates close in on the best.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import SceneError, UsageError
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import ArrayModel, Light, Space, light_of, pose_names
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.elements import Elements, elements_of
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.information import TASK_UNITS, doubt_in_words, jackknife, nuisances_of
from lightfield.studies.follower.survey import array_of

Task = Literal["formation", "docking"]
#: Distances of a task as parts of the formation space, sideways places, m, and yaws, degrees. Docking ends
#: near the lamp, on its axis (chosen: the prototype's twelve poses; the last part of a way home).
TASKS: dict[str, tuple[Sequence[float], Sequence[float], Sequence[float]]] = {
    "formation": ((0.0, 0.5, 1.0), (0.0, 0.3), (0.0, 8.0)),
    "docking": ((0.0, 0.1, 0.25), (0.0, 0.1), (0.0, 4.0)),
}
#: Places along a side of the box, and tilts in either direction, of the first candidates.
SIDE, TILTS = 7, 5
#: How often the candidates close in, by half a step each time (chosen: steps of 1 cm and 2 degrees remain).
ROUNDS = 3
#: Random beginnings of the exchange, and its sweeps at most.
RESTARTS, MOST_SWEEPS = 12, 30
#: An exchange must better the criterion by this part of it.
LEAST_GAIN = 1e-6
#: Information of everything, in units of the task, that keeps an array with too few elements from dividing
#: by zero.
RIDGE = 1e-9
#: Distance by which an array may break the smallest spacing, m: rounding.
ROUNDING_M = 1e-9


def task_poses(space: Space, task: Task = "formation") -> Array:
    """Poses of a task in a formation space, m and rad, shape (n, 6)."""
    parts, sideways, yaws = TASKS[task]
    length = space.far_m - space.near_m
    poses = [
        (x, 0.0, space.near_m + part * length, np.radians(yaw), 0.0, 0.0)
        for part in parts
        for x in sideways
        for yaw in yaws
    ]
    return np.array(poses)


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
        in the
        middle that faces forward.
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
        return np.diag([RIDGE] * len(self.names) + [max(v, RIDGE) for v in known])

    def criterion(self, whitened: Array) -> float:
        """A of the elements together."""
        return float(self._traces(self.covariances(whitened)).mean())

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
        known = ", ".join(
            f"{n} {1e3 * s:.3g} mm" if n in POSE[:3] else f"{n} {np.degrees(s):.3g} deg"
            for n, s in self.sigma.items()
        )
        doubt = f"A {self.criterion:8.3g}{doubt_in_words(self.doubt, '+-')}"
        return f"{self.name:<32} {len(self.elements):>3} elements  {doubt}  rms {known}"


def judged_array(name: str, elements: Elements, setting: ArraySetting) -> JudgedArray:
    """An array at the poses of a task."""
    covariances = setting.covariances(setting.whitened(elements))
    squares = np.einsum("pkk->pk", covariances)[:, : len(setting.names)].mean(axis=0)
    sigma = {n: float(TASK_UNITS[n] * np.sqrt(v)) for n, v in zip(setting.names, squares, strict=True)}
    parts = [one.criterion(one.whitened(elements)) for one in setting.leave_one_out]
    doubt = jackknife(float(squares.sum()), parts)
    return JudgedArray(name, elements, float(squares.sum()), sigma, doubt)


@dataclass(frozen=True)
class Arrays:
    """Arrays in the same light and task, best first."""

    scene: Scene
    arrays: list[JudgedArray]
    task: str
    traced: bool

    def as_data(self) -> dict[str, Any]:
        return {"task": self.task, "arrays": [one.as_data() for one in self.arrays]}

    def as_text(self) -> str:
        head = f"task: {self.task}; A: mean sum of variances in units of 1 cm across, 10 cm along, 1 degree"
        return "\n".join([head, *(one.as_text() for one in self.arrays)])


def setting_of(
    scene: Scene, space: Space, reach: Elements, task: Task, *, photons: float, seed: int
) -> ArraySetting:
    """Light, noise and what is unknown as a scene says; light as far as elements may reach."""
    light = light_of(scene, space, reach, photons=photons, seed=seed)
    return ArraySetting(
        light, task_poses(space, task), pose_names(scene), SensorNoise.of_scene(scene), nuisances_of(scene)
    )


def compare_arrays(
    scene: Scene,
    others: Mapping[str, Scene],
    space: Space | None = None,
    task: Task = "formation",
    *,
    photons: float = 1e7,
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
    space = Space.of_scene(scene) if space is None else space
    widest = max(arrays.values(), key=lambda elements: elements.reach_m)
    setting = setting_of(scene, space, widest, task, photons=photons, seed=seed)
    found = sorted(
        (judged_array(name, one, setting) for name, one in arrays.items()), key=lambda one: one.criterion
    )
    return Arrays(scene, found, task, bool(photons))


def candidate_arrays(x: Array, y: Array, tilts_deg: Array) -> Elements:
    """All places with all tilts: normals (tan tx, tan ty, -1), normalised."""
    px, py, tx, ty = (
        v.ravel() for v in np.meshgrid(x, y, *(2 * [np.tan(np.radians(tilts_deg))]), indexing="ij")
    )
    normal = np.stack([tx, ty, -np.ones_like(tx)], axis=1)
    place = np.stack([px, py, np.zeros_like(px)], axis=1)
    return Elements(place, normal / np.linalg.norm(normal, axis=1, keepdims=True))


@dataclass(frozen=True)
class Mounting:
    """Where elements may be put.

    Parameters
    ----------
    box_m : float, m
        Side of the square that they lie in.
    tilt_max_deg : float
        In x and in y.
    spacing_m : float, m
        Smallest distance of two elements; 0: they may stand at one place.
    """

    box_m: float
    tilt_max_deg: float = 40.0
    spacing_m: float = 0.025


def optimise_array(
    scene: Scene,
    elements: int,
    room: Mounting,
    *,
    task: Task = "formation",
    space: Space | None = None,
    photons: float = 1e7,
    seed: int = 0,
) -> Arrays:
    """The best places and tilts of so many elements in a square, beside the scene's own array.

    Parameters
    ----------
    scene : Scene
        Its light, noise and array, which the best is compared with.
    elements : int
        At least as many as a pose has coordinates: fewer readings leave some of it open, wherever they are.
    room : Mounting

    Raises
    ------
    SceneError
        So many elements do not fit.
    UsageError
        So few cannot know a pose.
    """
    space = Space.of_scene(scene) if space is None else space
    half = 0.5 * room.box_m
    corner = Elements(np.array([[half, half, 0.0]]), np.array([[0.0, 0.0, -1.0]]))
    own = elements_of(array_of(scene))
    reach = max((corner, own), key=lambda one: one.reach_m)
    setting = setting_of(scene, space, reach, task, photons=photons, seed=seed)
    if elements < len(setting.names):
        raise UsageError(
            "too few elements to know a pose",
            where="elements",
            found=elements,
            rule=f"at least {len(setting.names)}, one for each of {', '.join(setting.names)}",
        )
    best = designed(setting, elements, room, seed)
    arrays = [
        judged_array("the best found", best, setting),
        judged_array(scene.name or "this array", own, setting),
    ]
    return Arrays(scene, sorted(arrays, key=lambda one: one.criterion), task, bool(photons))


def designed(setting: ArraySetting, elements: int, room: Mounting, seed: int = 0) -> Elements:
    """The best array that exchanges and ever closer candidates find."""
    tilt_max_deg, spacing_m = room.tilt_max_deg, room.spacing_m
    half, tilts = 0.5 * room.box_m, np.linspace(-tilt_max_deg, tilt_max_deg, TILTS if tilt_max_deg else 1)
    side = np.linspace(-half, half, SIDE)
    everything = candidate_arrays(side, side, tilts)
    whitened, rng = setting.whitened(everything), np.random.default_rng(seed)
    found = [
        _exchange(setting, everything, whitened, _begin(everything, elements, spacing_m, rng), spacing_m)
        for _ in range(RESTARTS)
    ]
    _, chosen = min(found, key=lambda one: one[0])
    best = _picked(everything, chosen)
    step, turn = side[1] - side[0], tilts[1] - tilts[0] if len(tilts) > 1 else 0.0
    for _ in range(ROUNDS):
        step, turn = 0.5 * step, 0.5 * turn
        near = _around(best, step, turn, half, tilt_max_deg)
        start = list(range(len(best)))  # the present elements come first
        _, chosen = _exchange(setting, near, setting.whitened(near), start, spacing_m)
        best = _picked(near, chosen)
    return best


def _picked(elements: Elements, chosen: Sequence[int]) -> Elements:
    return Elements(elements.place_m[list(chosen)], elements.normal[list(chosen)])


def _around(best: Elements, step_m: float, turn_deg: float, half_m: float, tilt_deg: float) -> Elements:
    """The elements, and each moved and turned by a step in every direction, within box and tilts."""
    parts = [best]
    for place, normal in zip(best.place_m, best.normal, strict=True):
        tx, ty = np.degrees(np.arctan(normal[:2] / -normal[2]))
        for a in {-turn_deg, 0.0, turn_deg}:
            for b in {-turn_deg, 0.0, turn_deg}:
                tilted = np.tan(np.radians(np.clip([tx + a, ty + b], -tilt_deg, tilt_deg)))
                facing = np.array([*tilted, -1.0]) / np.hypot(1.0, np.hypot(*tilted))
                for move in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
                    at = np.clip(place[:2] + step_m * np.array(move), -half_m, half_m)
                    parts.append(Elements(np.array([[*at, 0.0]]), facing[None]))
    return Elements(np.concatenate([p.place_m for p in parts]), np.concatenate([p.normal for p in parts]))


def _begin(among: Elements, count: int, spacing_m: float, rng: np.random.Generator) -> list[int]:
    chosen: list[int] = []
    for k in rng.permutation(len(among)):
        apart = np.linalg.norm(among.place_m[chosen] - among.place_m[k], axis=1)
        if np.min(apart, initial=np.inf) >= spacing_m - ROUNDING_M:
            chosen.append(int(k))
            if len(chosen) == count:
                return chosen
    raise SceneError(
        f"{count} elements do not fit",
        where="array",
        found=f"room for about {len(chosen)}",
        rule=f"{spacing_m:g} m between two of them, on a grid of {SIDE} x {SIDE} places",
        remedy="fewer elements, a larger box, or a smaller spacing",
    )


def _exchange(
    setting: ArraySetting, among: Elements, whitened: Array, begin: Sequence[int], spacing_m: float
) -> tuple[float, list[int]]:
    """Exchanges until none helps: A, and which candidates are left."""
    chosen = list(begin)
    best = setting.criterion(whitened[:, chosen])
    for _ in range(MOST_SWEEPS):
        before = best
        for k in range(len(chosen)):
            rest = chosen[:k] + chosen[k + 1 :]
            values = setting.exchanged(whitened, whitened[:, rest])
            if rest:
                apart = np.linalg.norm(among.place_m[:, None] - among.place_m[rest][None], axis=2).min(axis=1)
                values = np.where(apart >= spacing_m - ROUNDING_M, values, np.inf)
            other = int(values.argmin())
            if values[other] < best * (1 - LEAST_GAIN):
                chosen[k], best = other, float(values[other])
        if best > before * (1 - LEAST_GAIN):
            break
    return best, chosen
