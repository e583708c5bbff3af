"""How far from its estimate may a pose be? All that a reading leaves open, where errors are not small.

A flat array that looks straight at its lamp hardly tells yaw from sway: poses far from the best one, and
between the minima, read nearly the same, which slopes at the best do not show. The mean square distance from
it is taken over all poses of the space by importance sampling (Kloek and van Dijk 1978,
doi:10.2307/1913641): from Student's t about the minima, and again and again about the draw that counts most,
where the others fell short (Raftery and Bao 2010, Biometrics 66, 1162), until enough of all of them count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.decompositions import eigen
from lightfield.studies.follower.array_light import LAMP_TILTS, ArrayModel
from lightfield.studies.follower.frames import POSE, wrapped
from lightfield.studies.follower.information import LEAST_INFORMATION
from lightfield.studies.follower.pose_search import LONGEST_STEP, WithUnknowns, gain_first

#: Draws of the first round and of every other, and rounds at most. Chosen.
_FIRST, _DRAWS, _ROUNDS = 600, 300, 15
#: So many that count alike are enough. Measured, a flat array's errors against 80 000 draws: with 100 the
#: median is 3 to 6 % too small and one in twenty 28 to 42 %, with 500 about 1 % and 8 to 11 %.
_ENOUGH = 500.0
#: Draws next to that which counts most, which tell how wide the next ones are. Chosen.
_NEAREST = 200
#: Of fewer that count alike, of the first round and of all, the errors would be found too small; those by
#: slopes are told, of all minima. Measured: 80 readings of 25 flat elements had 5.7 to 225 in the first
#: round, three and four elements for five unknowns 1.0 and 1.8, which later rounds made seem many.
_FEWEST_FIRST, _FEWEST = 5.0, 20.0
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
    (n, n), and how many."""

    middle: Array
    root: Array
    draws: int


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
        new = [
            _Normal(pose[self.at], self._wide_root(one), max(round(_FIRST * part), 1))
            for (pose, _), one, part in zip(minima, covariances, parts / parts.sum(), strict=True)
        ]
        about: list[_Normal] = []
        drawn, chance = np.empty((0, len(self.at))), np.empty(0)
        for turn in range(_ROUNDS):
            for one in new:
                some = _draws(one, rng)
                drawn = np.concatenate([drawn, some])
                chance = np.concatenate([chance, self._log_chance(some, best, one.middle)])
            about += new
            weight = chance - _log_density(drawn, about)
            if not np.isfinite(weight).any():
                return None
            weight = np.exp(weight - weight.max())
            weight /= weight.sum()
            effective, apart = 1 / (weight**2).sum(), self._apart(drawn, best)
            if not turn and effective < _FEWEST_FIRST:
                return None
            if effective >= _ENOUGH:
                break
            new = [self._about_heaviest(drawn, apart, weight)]
        spread = (weight[:, None, None] * apart[:, :, None] * apart[:, None, :]).sum(axis=0)
        return np.asarray(spread) if effective >= _FEWEST else None

    def _about_heaviest(self, drawn: Array, apart: Array, weight: Array) -> _Normal:
        """Of draws, shape (s, n), the one that counts most, and those nearest to it."""
        top, shift = np.argmax(weight), weight @ apart
        overall = self._wide_root((weight[:, None] * (apart - shift)).T @ (apart - shift))
        far = (np.linalg.solve(overall, (apart - apart[top]).T) ** 2).sum(axis=0)
        near = np.argsort(far, kind="stable")[:_NEAREST]
        part, around = weight[near] + 1 / len(weight), apart[near] - apart[top]
        return _Normal(drawn[top], self._wide_root((part[:, None] * around).T @ around / part.sum()), _DRAWS)

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

    def _log_chance(self, drawn: Array, best: Array, middle: Array) -> Array:
        """Of poses drawn about a middle, but for a constant, shape (s,); none of what no pose can be."""
        found = self._log_likelihood(drawn, best, self._by_nuisances(self._poses(middle[None], best)))
        possible = self._is_inside(drawn) & self._is_upright(self._apart(drawn, best))
        return np.where(possible & np.isfinite(found), found, -np.inf)

    def _poses(self, drawn: Array, best: Array) -> Array:
        """What is not sought as in the best, shape (s, 6)."""
        poses = np.tile(best, (len(drawn), 1))
        poses[:, self.at] = np.where(self._rolls, wrapped(drawn), drawn)
        return np.clip(poses, *self.box)

    def _by_nuisances(self, pose: Array) -> Array:
        """Slopes of the logarithms of readings at a pose, (1, 6), by what is not known, (n_elements, k)."""
        light = WithUnknowns(self.model, tuple(self.names), gain_first(self.nuisances))
        return light.read(pose, np.zeros((1, len(self.nuisances))))[1][0]

    def _log_likelihood(self, drawn: Array, best: Array, by: Array) -> Array:
        """Of poses, but for a constant, over all that is not known besides, shape (s,).

        Parameters
        ----------
        by : array, shape (n_elements, k)
            As `_by_nuisances` gives them near all.
        """
        believed = self.model.readings(self._poses(drawn, best))
        stated = np.array([float(self.nuisances[name]) ** -2.0 for name in gain_first(self.nuisances)])
        prior = np.maximum(stated, LEAST_INFORMATION)
        unknown = np.zeros((len(drawn), len(prior)))
        weight = 1 / self.variance
        for step in range(_STEPS + 1):
            read = believed * np.exp(unknown @ by.T)
            slopes = read[..., None] * by
            curved = np.einsum("sni,n,snj->sij", slopes, weight, slopes) + np.diag(prior)
            left = self.values - read
            if step < _STEPS:
                pull = np.einsum("sni,n,sn->si", slopes, weight, left) - prior * unknown
                move = np.linalg.solve(curved, pull[..., None])[..., 0]
                unknown += np.clip(move, -LONGEST_STEP, LONGEST_STEP)
        chi2 = (left**2 * weight).sum(axis=1) + (prior * unknown**2).sum(axis=1)
        return np.asarray(-0.5 * chi2 - 0.5 * np.linalg.slogdet(curved)[1])


def _draws(one: _Normal, rng: np.random.Generator) -> Array:
    """Poses, shape (s, n)."""
    normal = rng.standard_normal((one.draws, len(one.middle)))
    tails = np.sqrt(_FREEDOM / rng.chisquare(_FREEDOM, one.draws))
    return np.asarray(one.middle + tails[:, None] * (normal @ one.root.T))


def _log_density(drawn: Array, about: Sequence[_Normal]) -> Array:
    """Of the draws, but for a constant, shape (s,)."""
    found = []
    for one in about:
        far = np.linalg.solve(one.root, (drawn - one.middle).T)
        tail = 0.5 * (_FREEDOM + len(one.middle)) * np.log1p((far**2).sum(axis=0) / _FREEDOM)
        found.append(np.log(one.draws) - tail - np.linalg.slogdet(one.root)[1])
    return np.asarray(np.logaddexp.reduce(found, axis=0))
