"""What an array can tell of a pose at best: Fisher information and the Cramer-Rao bound.

    F = J^T Sigma^-1 J + prior,        Sigma = noise + errors of the field

J holds the derivatives of the readings by the pose and by what else is not known exactly (gain, water, the
lamp's direction); the bound on the pose is the Schur complement of F (Kay 1993, Fundamentals of Statistical
Signal Processing I, section 3). What the noise itself tells by its dependence on the pose is left out: 2 m^2
of the whole for a relative noise m. The bound is local: rivals far away are another question.

Noise of a trace is in the derivatives and looks like information, N on average, which its batches tell. It is
taken out to first order, C + C N C for C = F^-1, which is finite where noise is all (`with_doubt`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lightfield.arrays import Array, finite
from lightfield.decompositions import eigen
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import DARK, LAMP_TILTS, ArrayModel
from lightfield.studies.follower.array_noise import PERCENT, SensorNoise
from lightfield.studies.follower.frames import POSE, in_degrees, printed, with_units
from lightfield.wording import with_error

#: Errors that a task feels alike, m and rad: 1 cm across, 10 cm along the beam, 1 degree (chosen).
TASK_UNITS = dict(zip(POSE, (0.01, 0.01, 0.1, *np.radians([1.0, 1.0, 1.0])), strict=True))
#: Smallest eigenvalue of an information matrix of unit diagonal that is not rounding of its derivatives
#: (1e-6).
_LEAST_EIGENVALUE = 1e-11
#: Information of a coordinate that is none: known to 100 m, 100 rad, or a factor of e^100 (rounding leaves
#: more than 0).
LEAST_INFORMATION = 1e-4
#: Errors from which on nothing is known, m and rad: a place to 100 m (see above), and an angle as one that
#: may be any: 360 degrees over the root of 12.
NOTHING_M, NOTHING_RAD = 100.0, 2 * np.pi / 12**0.5
#: Least relative error of the trace that is told: none is as small (chosen).
_LEAST_DOUBT = 1e-3
#: Prior, by its standard deviation, of a coordinate that is not known at all.
UNKNOWN = np.inf


def nuisances_of(scene: Scene) -> dict[str, float]:
    """What a follower does not know exactly: standard deviations by name, see `ArrayModel.slopes`."""
    found = {}
    if scene.array is not None:
        found["gain"] = PERCENT * scene.array.gain_drift_percent
    if scene.follower is not None:
        water = PERCENT * scene.follower.water_known_percent
        found |= {"absorption": water, "scattering": water}
        tilt = float(np.radians(scene.follower.lamp_tilt_known_deg))
        found |= dict.fromkeys(LAMP_TILTS, tilt)
    return {name: sigma for name, sigma in found.items() if sigma > 0}


@dataclass(frozen=True)
class Bound:
    """Smallest covariance of an unbiased estimate.

    Parameters
    ----------
    pose : array, shape (6,), m and rad
        Where.
    names : tuple of str
        Coordinates of the pose that are sought.
    covariance : array, shape (n, n), m and rad
        Infinite on the diagonal, zero beside it, where nothing is known.
    nuisances : dict of str to float
        Standard deviations of what else was unknown, after the reading.
    readings : array, shape (n_elements,)
    doubt : dict of str to float
        Relative errors of the standard deviations, by the noise of the trace; see `with_doubt`.
    """

    pose: Array
    names: tuple[str, ...]
    covariance: Array
    nuisances: dict[str, float]
    readings: Array
    doubt: dict[str, float] = field(default_factory=dict)

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations, m and rad."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    def correlation(self, one: str, other: str) -> float:
        """Of two coordinates; NaN where one is not known at all."""
        i, j = self.names.index(one), self.names.index(other)
        c = self.covariance
        with np.errstate(invalid="ignore"):
            return float(c[i, j] / np.sqrt(c[i, i] * c[j, j])) if np.isfinite(c[i, i] * c[j, j]) else np.nan

    @property
    def criteria(self) -> dict[str, float]:
        """In units of the task: A, sum of the variances; D, n-th root of the volume; E, worst direction."""
        units = np.array([TASK_UNITS[name] for name in self.names])
        scaled = self.covariance / np.outer(units, units)
        if not np.isfinite(scaled).all():
            return dict.fromkeys("ADE", np.inf)
        values = np.maximum(np.linalg.eigvalsh(scaled), 0.0)
        return {
            "A": float(values.sum()),
            "D": float(np.prod(values) ** (1 / len(values))),
            "E": float(values[-1]),
        }

    def as_data(self) -> dict[str, Any]:
        shown = {name: finite(v) for name, v in printed(self.sigma).items()}
        return {
            "pose": dict(zip(with_units(POSE), in_degrees(self.pose).tolist(), strict=True)),
            "sigma": shown,
            "sigma_relative_error_of_trace": {name: finite(v) for name, v in self.doubt.items()},
            "nuisances": self.nuisances,
            "correlation_x_yaw": finite(self.correlation("x", "yaw")) if "yaw" in self.names else None,
            "criteria": {name: finite(value) for name, value in self.criteria.items()},
            "brightest": float(self.readings.max()),
        }

    def as_text(self) -> str:
        """One line."""
        x, y, z, yaw, pitch, _ = in_degrees(self.pose)
        known = ", ".join(
            sigma_in_words(name, value, self.doubt.get(name, 0.0)) for name, value in self.sigma.items()
        )
        return f"x {x:g}, y {y:g}, z {z:g} m, yaw {yaw:g}, pitch {pitch:g} deg: {known}"


def is_told(name: str, sigma: float) -> bool:
    """Is a coordinate known at all, if its standard deviation, m or rad, is this?"""
    return bool(sigma < (NOTHING_M if name in POSE[:3] else NOTHING_RAD))


def sigma_in_words(name: str, sigma: float, doubt: float = 0.0) -> str:
    """A coordinate with its standard deviation, m or rad, and the relative error that the trace leaves it."""
    if not is_told(name, sigma):
        return f"{name} unknown"
    unit, size = ("mm", 1e3 * sigma) if name in POSE[:3] else ("deg", float(np.degrees(sigma)))
    return f"{name} {with_doubt_in_words(size, doubt)} {unit}"


def bound(
    model: ArrayModel,
    pose: Array,
    names: Sequence[str],
    noise: SensorNoise,
    nuisances: Mapping[str, float] | None = None,
) -> Bound:
    """Cramer-Rao bound of one reading of an array.

    Parameters
    ----------
    model : ArrayModel
    pose : array, shape (6,), m and rad
    names : sequence of str
        Coordinates of the pose that are sought; the rest is known.
    noise : SensorNoise
    nuisances : mapping of str to float, optional
        What else is not known, by the standard deviation beforehand (`UNKNOWN`: nothing), see
        `ArrayModel.slopes`.
    """
    return bounds_together(model, np.asarray(pose)[None], names, noise, nuisances)[0]


def with_doubt_in_words(size: float, doubt: float) -> str:
    """A number in its unit, with what a relative error of the trace makes of it where anything was traced."""
    return with_error(size, max(doubt, _LEAST_DOUBT) * size, 1) if doubt else f"{size:.3g}"


def with_doubt(
    model: ArrayModel,
    parts: Sequence[ArrayModel],
    pose: Array,
    names: Sequence[str],
    noise: SensorNoise,
    nuisances: Mapping[str, float],
) -> Bound:
    """A bound without what noise of the trace looks like, and its error by that noise.

    Parameters
    ----------
    parts : sequence of ArrayModel
        The model without one of the batches of the trace, for each in turn; others as of `bound`.
    """
    whole, n, wanted = bound(model, pose, names, noise, nuisances), len(names), [*names, *nuisances]
    if not parts:
        return whole
    every, *each = (_weighed(one, pose, wanted, noise)[1] for one in (model, *parts))
    known = np.diag([0.0] * n + [float(s) ** -2.0 for s in nuisances.values()])
    looks_like = noise_of_slopes(every, each)
    covariance = without_noise(inverse(every.T @ every + known), looks_like)
    more = looks_like * len(parts) / (len(parts) - 1)
    others = [without_noise(inverse(one.T @ one + known), more) for one in each]
    sigma = np.sqrt(np.diag(covariance)).tolist()
    doubt = [jackknife(s, [float(np.sqrt(one[k, k])) for one in others]) for k, s in enumerate(sigma[:n])]
    return replace(
        whole,
        covariance=covariance[:n, :n],
        nuisances=dict(zip(nuisances, sigma[n:], strict=True)),
        doubt=dict(zip(names, doubt, strict=True)),
    )


def noise_of_slopes(whole: Array, parts: Sequence[Array]) -> Array:
    """What noise of slopes adds to their information on average, shape (..., k, k).

    Parameters
    ----------
    whole : array, shape (..., n, k)
        Slopes over the errors of readings.
    parts : sequence of array, of that shape
        Without one batch of the trace, each in turn (Efron 1982, section 3).
    """
    off = np.asarray(parts) - whole
    return np.asarray((1 - 1 / len(parts)) * np.einsum("s...ni,s...nj->...ij", off, off))


def without_noise(covariance: Array, noise: Array) -> Array:
    """A covariance of which so much information was noise, shape (..., k, k); infinite ones stay."""
    finite = np.where(np.isfinite(covariance), covariance, 0.0)
    return np.asarray(covariance + finite @ noise @ finite)


def jackknife(whole: float, parts: Sequence[float]) -> float:
    """Relative error of a number, bias included, from its values without one batch (Efron 1982, section 2).

    Parameters
    ----------
    whole : float
        With all batches.
    parts : sequence of float
        Empty: known exactly.
    """
    if not parts or not np.isfinite(whole):
        return 0.0
    ratios = np.asarray(parts) / whole
    if not np.isfinite(ratios).all():
        return 1.0
    return float((len(parts) - 1) * np.hypot(ratios.std() / np.sqrt(len(parts) - 1), ratios.mean() - 1))


def bounds_together(
    model: ArrayModel,
    poses: Array,
    names: Sequence[str],
    noise: SensorNoise,
    nuisances: Mapping[str, float] | None = None,
) -> list[Bound]:
    """Bounds of several readings in which the nuisances are the same, poses each of their own.

    Parameters
    ----------
    poses : array, shape (m, 6), m and rad
    """
    others = dict(nuisances or {})
    n, k = len(names), len(others)
    size = len(poses) * n + k
    whole = np.diag([0.0] * (size - k) + [float(s) ** -2.0 for s in others.values()])
    read = []
    for i, pose in enumerate(poses):
        readings, single = information(model, pose, [*names, *others], noise)
        at = np.r_[i * n : (i + 1) * n, size - k : size]
        whole[np.ix_(at, at)] += single
        read.append(readings)
    covariance = inverse(whole)
    spread = dict(zip(others, np.sqrt(np.diag(covariance)[size - k :]).tolist(), strict=True))
    return [
        Bound(pose, tuple(names), covariance[i * n : (i + 1) * n, i * n : (i + 1) * n], spread, read[i])
        for i, pose in enumerate(poses)
    ]


def bound_pair(
    model: ArrayModel, pose: Array, names: Sequence[str], noise: SensorNoise, nuisances: Mapping[str, float]
) -> tuple[Bound, Bound]:
    """What noise scatters of an estimate that seeks the nuisances, too; and the bound with these unknown.

    With H the information of the pose and of what is not known exactly, its prior included, and B what of it
    the readings would bring were their scatter the noise that is new in each, that scatter is H^-1 B H^-1:
    the prior, and the mismatch of the elements, are the same in all.
    """
    n = len(names)
    readings, weighed, part = _weighed(model, pose, [*names, *nuisances], noise)
    prior = np.diag([0.0] * n + [float(s) ** -2.0 for s in nuisances.values()])
    covariance = inverse(weighed.T @ weighed + prior)
    known = np.isfinite(np.diag(covariance))
    scatter = np.where(known[:, None] & known, covariance, 0.0)
    scatter = scatter @ (weighed.T * part) @ weighed @ scatter + np.diag(np.where(known, 0.0, np.inf))
    spread = dict(zip(nuisances, np.sqrt(np.diag(covariance)[n:]).tolist(), strict=True))
    alone = Bound(pose, tuple(names), scatter[:n, :n], {}, readings)
    return alone, Bound(pose, tuple(names), covariance[:n, :n], spread, readings)


def information(
    model: ArrayModel, pose: Array, names: Sequence[str], noise: SensorNoise
) -> tuple[Array, Array]:
    """Readings at a pose, and the Fisher information of `names`, shape (len(names), len(names))."""
    readings, weighed, _ = _weighed(model, pose, names, noise)
    return readings, weighed.T @ weighed


def _weighed(
    model: ArrayModel, pose: Array, names: Sequence[str], noise: SensorNoise
) -> tuple[Array, Array, Array]:
    """Readings at a pose; their slopes over their errors, 0 in the dark, shape (n, len(names)), and the part
    of the variance that is new in every reading, shape (n,)."""
    readings, error = model.with_errors(pose)
    slopes = model.slopes(pose, names)
    lit = readings > DARK * readings.max(initial=0.0)
    variance = np.where(lit, noise.variance(readings) + error**2, np.inf)
    lasting = (noise.mismatch * readings) ** 2 + error**2
    return readings, slopes / np.sqrt(variance)[:, None], 1 - lasting / variance


def inverse(information: Array) -> Array:
    """Covariance from information; infinite variance, and no covariance, of what is not known."""
    told = np.diag(information) > LEAST_INFORMATION
    size = np.sqrt(np.where(told, np.diag(information), 1.0))
    values, vectors = eigen(information * np.outer(told, told) / np.outer(size, size))
    known = values > _LEAST_EIGENVALUE
    covariance = (vectors[:, known] / values[known]) @ vectors[:, known].T / np.outer(size, size)
    # What has a part in a direction that the readings do not tell is itself unknown.
    lost = (vectors[:, ~known] ** 2).sum(axis=1) > _LEAST_EIGENVALUE
    covariance[lost, :] = covariance[:, lost] = 0.0
    covariance[lost, lost] = np.inf
    return covariance
