"""Poses far from the true one that give nearly the same readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.studies.follower.array_light import ArrayModel
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.frames import POSE, in_degrees, wrapped
from lightfield.studies.follower.pose_search import Minima, find_minima, starts_in

#: Rivals are nearer than this many sigma (the word of a diagnosis: what noise alone can make alike).
NEAR_SIGMA = 5.0
#: Poses closer than this, m and rad, are the same minimum (chosen: three task units and more).
_APART = np.array([0.03, 0.03, 0.15, 0.05, 0.05, 0.05])
_STARTS = 40


@dataclass(frozen=True)
class RivalPose:
    """A pose, m and rad, shape (6,), the gain that goes with it, and how many sigma it is away."""

    pose: Array
    gain: float
    sigma: float

    def as_data(self) -> dict[str, Any]:
        return {
            "pose_m_deg": dict(zip(POSE, in_degrees(self.pose).tolist(), strict=True)),
            "gain": self.gain,
            "sigma": self.sigma,
        }

    def __str__(self) -> str:
        x, y, z, yaw, pitch, roll = in_degrees(self.pose)
        turned = f", roll {roll:.0f}" if abs(roll) >= 0.5 else ""
        return (
            f"x {x:.2f}, y {y:.2f}, z {z:.2f} m, yaw {yaw:.0f}, pitch {pitch:.0f}{turned} deg "
            f"with gain x {self.gain:.2f} is {self.sigma:.1f} sigma away"
        )


def rivals(
    model: ArrayModel,
    pose: Array,
    names: Sequence[str],
    noise: SensorNoise,
    box: tuple[Array, Array],
    *,
    nuisances: Mapping[str, float] | None = None,
    seed: int = 0,
) -> list[RivalPose]:
    """Other minima of the noise-free cost, nearest first, none closer to each other than `_APART`."""
    readings = model.readings(pose[None])[0]
    begin = starts_in(box, names, _STARTS, seed, float(pose[POSE.index("roll")]))
    found = find_minima(
        model, readings, noise.variance(readings), names, begin, nuisances=nuisances, box=box
    ).best_first()
    return others(found, pose)


def others(found: Minima, pose: Array, least: float = 0.0) -> list[RivalPose]:
    """Minima other than a pose, whose chi2 is at most `NEAR_SIGMA` squared above the least."""
    kept: list[RivalPose] = []
    for other, gain, chi2 in zip(found.poses, found.gains, found.chi2, strict=True):
        near = max(chi2 - least, 0.0) ** 0.5
        if near < NEAR_SIGMA and all(apart(other, p) for p in (pose, *(k.pose for k in kept))):
            kept.append(RivalPose(other, float(gain), near))
    return kept


def nearest_alike(found: Minima, last: Array | None, sigma: float) -> int:
    """Which of the minima, best first, to take: the best, or another that is as good within so many sigma and
    nearer to the last pose."""
    if last is None:
        return 0
    alike = [0]
    for k in np.flatnonzero(found.chi2 < found.chi2[0] + sigma**2).tolist():
        if all(apart(found.poses[k], found.poses[j]) for j in alike):
            alike.append(k)
    far = [(_difference(found.poses[k], last) / _APART) ** 2 for k in alike]
    return alike[int(np.argmin(np.sum(far, axis=1)))]


def distinct(poses: Array) -> Array:
    """The first of all poses that are the same minimum, shape (k, 6)."""
    kept: list[Array] = []
    for pose in poses:
        if all(apart(pose, other) for other in kept):
            kept.append(pose)
    return np.array(kept)


def apart(one: Array, other: Array) -> bool:
    """Whether two poses are different minima."""
    return bool((np.abs(_difference(one, other)) > _APART).any())


def _difference(one: Array, other: Array) -> Array:
    """Of two poses, m and rad; a whole turn is none."""
    return np.append((one - other)[:3], wrapped(one[3:] - other[3:]))
