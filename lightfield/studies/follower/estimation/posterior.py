"""How far from its estimate may a pose be? All that a reading leaves open, where errors are not small.

A flat array that looks straight at its lamp hardly tells yaw from sway: poses far from the best one, and
between the minima, read nearly the same, which slopes at the best do not show. The mean square distance from
it is taken over all poses of the space by importance sampling (Kloek and van Dijk 1978,
doi:10.2307/1913641), from Student's t about the minima, and once more about what was found where few of the
draws count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array, Mask
from lightfield.decompositions import eigen
from lightfield.studies.follower.array_light import LAMP_TILTS, ArrayModel
from lightfield.studies.follower.frames import POSE, wrapped
from lightfield.studies.follower.information import LEAST_INFORMATION
from lightfield.studies.follower.pose_search import LONGEST_STEP, WithUnknowns, gain_first

#: Draws of a round, and rounds at most; so many that count alike are enough: errors to some 7 %. Chosen.
_DRAWS, _ROUNDS, _ENOUGH = 600, 3, 100.0
#: Of fewer that count alike the errors would be found too small; those by slopes are told, of all minima.
_FEWEST = 20.0
#: Degrees of freedom of the draws, and their width over the errors by slopes: tails wider than those of what
#: is drawn from (Geweke 1989, doi:10.2307/1913710). Chosen: effective draws were the most.
_FREEDOM, _WIDER = 5.0, 1.5
#: Least eigenvalue of a correlation to draw with: what few draws have found has directions without width.
_LEAST = 1e-6
#: Steps of the search for what is not known besides the pose: it is nearly linear in the logarithm.
_STEPS = 3
#: Where the error is this part of that of a pose that may be anywhere in the space, the reading told nothing.
_NOTHING = 0.9
#: Rolls farther than this from the best are another answer, and listed as one: an oval beam looks the same
#: upside down, and a vehicle knows which way is up.
_UPRIGHT_RAD = 0.5 * np.pi
_UNIFORM_VARIANCE = 1 / 12


class _Normal(NamedTuple):
    """One of the places that draws are made about: its middle, shape (n,), a root of its covariance, shape
    (n, n), and what part of the draws."""

    middle: Array
    root: Array
    part: float


@dataclass(frozen=True)
class Reading:
    """What an array read, and what is believed of it.

    Parameters
    ----------
    values, variance : array, shape (n_elements,)
    names : sequence of str
        Coordinates that are sought, n of them.
    nuisances : mapping of str to float
        What is not known besides, by its standard deviation beforehand.
    box : (low, high)
        Poses, shape (6,), that are as probable as each other; others are not.
    """

    model: ArrayModel
    values: Array
    variance: Array
    names: Sequence[str]
    nuisances: Mapping[str, float]
    box: tuple[Array, Array]

    @property
    def at(self) -> list[int]:
        return [POSE.index(name) for name in self.names]

    @property
    def _rolls(self) -> Mask:
        return np.array([name == "roll" for name in self.names])

    @property
    def room(self) -> Array:
        """Variances of a pose that may be anywhere, shape (n,)."""
        low, high = (end[self.at] for end in self.box)
        return np.asarray(_UNIFORM_VARIANCE * np.where(self._rolls, 2 * _UPRIGHT_RAD, high - low) ** 2)

    def spread_about(self, minima: Sequence[tuple[Array, float]], covariances: Sequence[Array]) -> Array:
        """Mean square distance of the pose from the first of some minima, shape (n, n), m and rad.

        Infinite on the diagonal, zero beside it, where nothing is known.

        Parameters
        ----------
        minima : sequence of (array, float)
            Poses, shape (6,), and how many sigma each is away from the best.
        covariances : sequence of array, shape (n, n)
            Of each by the slopes there; infinite where these tell nothing.
        """
        # A beam that turns is no exponential of how far: poses far off would be told wrongly.
        spread = None if self.nuisances.keys() & LAMP_TILTS else self._drawn(minima, covariances)
        if spread is None:
            spread = self._by_slopes(minima, covariances)
        lost = np.diag(spread) > _NOTHING**2 * self.room
        spread[lost, :] = spread[:, lost] = 0.0
        spread[lost, lost] = np.inf
        return spread

    def _drawn(self, minima: Sequence[tuple[Array, float]], covariances: Sequence[Array]) -> Array | None:
        """The same by draws, where enough of them count."""
        rng, best = np.random.default_rng(0), minima[0][0]
        parts = np.exp(-0.125 * np.array([sigma for _, sigma in minima]) ** 2)
        about = [
            _Normal(pose[self.at], self._wide_root(one), float(part))
            for (pose, _), one, part in zip(minima, covariances, parts / parts.sum(), strict=True)
        ]
        by = self._by_nuisances(np.array([pose for pose, _ in minima]))
        for _ in range(_ROUNDS):
            drawn, origin = _draws(about, rng)
            apart = self._apart(drawn, best)
            weight = self._log_likelihood(drawn, best, by[origin]) - _log_density(drawn, about)
            counts = self._is_inside(drawn) & self._is_upright(apart)
            weight = np.where(counts & np.isfinite(weight), weight, -np.inf)
            if not np.isfinite(weight).any():
                return None
            weight = np.exp(weight - weight.max())
            weight /= weight.sum()
            spread = (weight[:, None, None] * apart[:, :, None] * apart[:, None, :]).sum(axis=0)
            effective = 1 / (weight**2).sum()
            if effective >= _ENOUGH:
                break
            shift = weight @ apart
            found = self._wide_root(spread - np.outer(shift, shift))
            halved = [one._replace(part=0.5 * one.part) for one in about]
            about = [*halved, _Normal(best[self.at] + shift, found, 0.5)]
            by = np.concatenate([by, by[:1]])
        return np.asarray(spread) if effective >= _FEWEST else None

    def _wide_root(self, covariance: Array) -> Array:
        """Of a covariance to draw with: no coordinate wider than the space, no direction fixed."""
        inside = self._within(covariance)
        size = np.sqrt(np.maximum(np.diag(inside), np.finfo(float).eps * self.room))
        values, vectors = eigen(inside / np.outer(size, size))
        root = vectors * np.sqrt(np.maximum(values, _LEAST))
        return np.asarray(_WIDER * np.minimum(size, np.sqrt(self.room))[:, None] * root)

    def _within(self, covariance: Array) -> Array:
        """A covariance, or the space's where it is infinite."""
        told = np.isfinite(np.diag(covariance))
        return np.where(told[:, None] & told, covariance, np.diag(self.room))

    def _by_slopes(self, minima: Sequence[tuple[Array, float]], covariances: Sequence[Array]) -> Array:
        """The same as the minima have it, each as probable as it fits and as wide as slopes say."""
        apart = self._apart(np.array([pose for pose, _ in minima])[:, self.at], minima[0][0])
        parts = np.exp(-0.5 * np.array([sigma for _, sigma in minima]) ** 2) * self._is_upright(apart)
        wide = np.array([self._within(one) for one in covariances]) + apart[:, :, None] * apart[:, None, :]
        return np.asarray(np.einsum("m,mij->ij", parts / parts.sum(), wide))

    def _apart(self, drawn: Array, best: Array) -> Array:
        apart = drawn - best[self.at]
        return np.where(self._rolls, wrapped(apart), apart)

    def _is_upright(self, apart: Array) -> Mask:
        return np.asarray((~self._rolls | (np.abs(apart) <= _UPRIGHT_RAD)).all(axis=1))

    def _is_inside(self, drawn: Array) -> Mask:
        low, high = (end[self.at] for end in self.box)
        return np.asarray((self._rolls | (drawn >= low) & (drawn <= high)).all(axis=1))

    def _by_nuisances(self, poses: Array) -> Array:
        """Slopes of the logarithms of readings by what is not known, shape (m, n_elements, k)."""
        light = WithUnknowns(self.model, tuple(self.names), gain_first(self.nuisances))
        return light.read(poses, np.zeros((len(poses), len(self.nuisances))))[1]

    def _log_likelihood(self, drawn: Array, best: Array, by: Array) -> Array:
        """Of poses, but for a constant, over all that is not known besides, shape (s,).

        Parameters
        ----------
        by : array, shape (s, n_elements, k)
            As `_by_nuisances` gives them near each.
        """
        poses = np.tile(best, (len(drawn), 1))
        poses[:, self.at] = np.where(self._rolls, wrapped(drawn), drawn)
        believed = self.model.readings(np.clip(poses, *self.box))
        stated = np.array([float(self.nuisances[name]) ** -2.0 for name in gain_first(self.nuisances)])
        prior = np.maximum(stated, LEAST_INFORMATION)
        unknown = np.zeros((len(drawn), len(prior)))
        weight = 1 / self.variance
        for step in range(_STEPS + 1):
            read = believed * np.exp(np.einsum("snk,sk->sn", by, unknown))
            slopes = read[..., None] * by
            curved = np.einsum("sni,n,snj->sij", slopes, weight, slopes) + np.diag(prior)
            left = self.values - read
            if step < _STEPS:
                pull = np.einsum("sni,n,sn->si", slopes, weight, left) - prior * unknown
                move = np.linalg.solve(curved, pull[..., None])[..., 0]
                unknown += np.clip(move, -LONGEST_STEP, LONGEST_STEP)
        chi2 = (left**2 * weight).sum(axis=1) + (prior * unknown**2).sum(axis=1)
        return np.asarray(-0.5 * chi2 - 0.5 * np.linalg.slogdet(curved)[1])


def _draws(about: Sequence[_Normal], rng: np.random.Generator) -> tuple[Array, NDArray[np.int_]]:
    """Poses, shape (s, n), and about which of the middles each was drawn."""
    parts = np.array([one.part for one in about])
    origin = rng.choice(len(about), _DRAWS, p=parts / parts.sum())
    normal = rng.standard_normal((_DRAWS, len(about[0].middle)))
    tails = np.sqrt(_FREEDOM / rng.chisquare(_FREEDOM, _DRAWS))
    middles, roots = np.array([one.middle for one in about]), np.array([one.root for one in about])
    return middles[origin] + tails[:, None] * (roots[origin] @ normal[..., None])[..., 0], origin


def _log_density(drawn: Array, about: Sequence[_Normal]) -> Array:
    """Of the draws, but for a constant, shape (s,)."""
    found = []
    for one in about:
        far = np.linalg.solve(one.root, (drawn - one.middle).T)
        tail = 0.5 * (_FREEDOM + len(one.middle)) * np.log1p((far**2).sum(axis=0) / _FREEDOM)
        found.append(np.log(one.part) - tail - np.linalg.slogdet(one.root)[1])
    return np.asarray(np.logaddexp.reduce(found, axis=0))
