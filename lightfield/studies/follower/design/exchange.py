"""Arrays designed: where to put so many elements, and where to let them face, by exchanges.

The search exchanges one element after the other for the best of all candidates (Fedorov 1972, Theory of
Optimal Experiments, section 3; Cook and Nachtsheim 1980, Technometrics 22, 315): with g the whitened
derivatives of a candidate's reading, and C the covariance without the element that goes,

    trace W C'  =  trace W C  -  g^T C W C g / (1 + g^T C g)                 (Sherman and Morrison 1950)

so that all candidates cost one product (`compared.ArraySetting.exchanged`). Then the candidates close in on
the best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import SceneError, UsageError
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.studies.defaults import SPACING_M, TASK, TILT_MAX_DEG
from lightfield.studies.follower.array_light import Space
from lightfield.studies.follower.design.compared import Arrays, ArraySetting, Task, judged_array, setting_of
from lightfield.studies.follower.elements import Elements, elements_of
from lightfield.studies.follower.survey import array_of

#: Name of the array that is found.
BEST = "the best found"
#: Places along a side of the box, and tilts in either direction, of the first candidates.
_SIDE, _TILTS = 7, 5
#: How often the candidates close in, by half a step each time (chosen: steps of 1 cm and 2 degrees remain).
_ROUNDS = 3
#: Random beginnings of the exchange, and its sweeps at most.
_RESTARTS, _MOST_SWEEPS = 12, 30
#: An exchange must better the criterion by this part of it.
_LEAST_GAIN = 1e-6
#: Distance by which an array may break the smallest spacing, m: rounding.
_ROUNDING_M = 1e-9


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
    tilt_max_deg: float = TILT_MAX_DEG
    spacing_m: float = SPACING_M


def optimise_array(
    scene: Scene,
    elements: int,
    room: Mounting,
    *,
    task: Task = TASK,
    space: Space,
    photons: float = FIELD_PHOTONS,
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
            remedy=f"ask for {len(setting.names)} or more",
        )
    best = designed(setting, elements, room, seed)
    arrays = [
        judged_array(BEST, best, setting),
        judged_array(scene.name or "this array", own, setting),
    ]
    return Arrays(scene, sorted(arrays, key=lambda one: one.criterion), task, bool(photons))


def designed(setting: ArraySetting, elements: int, room: Mounting, seed: int = 0) -> Elements:
    """The best array that exchanges and ever closer candidates find."""
    tilt_max_deg, spacing_m = room.tilt_max_deg, room.spacing_m
    half, tilts = 0.5 * room.box_m, np.linspace(-tilt_max_deg, tilt_max_deg, _TILTS if tilt_max_deg else 1)
    side = np.linspace(-half, half, _SIDE)
    everything = candidate_arrays(side, side, tilts)
    whitened, rng = setting.whitened(everything), np.random.default_rng(seed)
    found = [
        _exchange(setting, everything, whitened, _begin(everything, elements, spacing_m, rng), spacing_m)
        for _ in range(_RESTARTS)
    ]
    _, chosen = min(found, key=lambda one: one[0])
    best = _picked(everything, chosen)
    step, turn = side[1] - side[0], tilts[1] - tilts[0] if len(tilts) > 1 else 0.0
    for _ in range(_ROUNDS):
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
        if np.min(apart, initial=np.inf) >= spacing_m - _ROUNDING_M:
            chosen.append(int(k))
            if len(chosen) == count:
                return chosen
    raise SceneError(
        f"{count} elements do not fit",
        where="array",
        found=f"room for about {len(chosen)}",
        rule=f"{spacing_m:g} m between two of them, on at most {_SIDE} x {_SIDE} places",
        remedy="fewer elements" if count > _SIDE**2 else "fewer elements, a larger box, or a smaller spacing",
    )


def _exchange(
    setting: ArraySetting, among: Elements, whitened: Array, begin: Sequence[int], spacing_m: float
) -> tuple[float, list[int]]:
    """Exchanges until none helps: A, and which candidates are left."""
    chosen = list(begin)
    best = setting.criterion(whitened[:, chosen])
    for _ in range(_MOST_SWEEPS):
        before = best
        for k in range(len(chosen)):
            rest = chosen[:k] + chosen[k + 1 :]
            values = setting.exchanged(whitened, whitened[:, rest])
            if rest:
                apart = np.linalg.norm(among.place_m[:, None] - among.place_m[rest][None], axis=2).min(axis=1)
                values = np.where(apart >= spacing_m - _ROUNDING_M, values, np.inf)
            other = int(values.argmin())
            if values[other] < best * (1 - _LEAST_GAIN):
                chosen[k], best = other, float(values[other])
        if best > before * (1 - _LEAST_GAIN):
            break
    return best, chosen
