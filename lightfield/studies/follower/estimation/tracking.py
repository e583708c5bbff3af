"""A sequence of poses, smoothed by what a vehicle can do: a Kalman filter of places, angles and their rates.

    state  (p, v, u),   p' = p + v dt,   v' = v + white acceleration    (Bar-Shalom et al. 2001, section 6.2)

u is what else a vehicle may seek on its way, as gain and water; it wanders slowly about what is believed.
What is only considered, as unlike elements, is in how well all else is known.
`Tracker` seeks nothing beside the pose: only the noise of single readings is averaged away. What gain,
mismatch, water and lamp leave unknown, and which of several poses it is, is nearly the same in every reading,
and is added afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import chi2

from lightfield.arrays import Array, Mask
from lightfield.decompositions import eigen
from lightfield.studies.follower.estimation.pose import Estimator, PoseEstimate
from lightfield.studies.follower.frames import POSE, wrapped
from lightfield.studies.follower.information import NOTHING_M

#: Density of the white acceleration, (m/s^2)^2/Hz and (rad/s^2)^2/Hz: within a second a small vehicle's speed
#: changes by about 0.2 m/s and its rates of turn by 10 degrees/s (chosen).
_AGILITY = np.array([0.2, 0.2, 0.2, *np.radians([10.0, 10.0, 10.0])]) ** 2
#: Standard deviation of rates that nothing is known of, m/s and rad/s (chosen).
_RATE_SIGMA = np.array([0.5, 0.5, 0.5, *np.radians([20.0, 20.0, 20.0])])
#: A reading that is less probable than this, as the filter expects it, is not used (chosen).
_GATE = 1e-4
#: After so many readings in a row that it did not use, the filter begins anew (chosen).
_MOST_REFUSED = 5
#: What does not average away is told as the mean of so many readings: each knows it roughly (chosen).
_MEMORY = 10
#: Time, s, in which gain and water forget what they were (Gauss-Markov; chosen: a minute. Unlike elements are
#: no noise that a longer mean would take away).
_FORGOTTEN_S = 60.0


@dataclass(frozen=True)
class Tracked:
    """State of the filter after one reading.

    Parameters
    ----------
    time_s : float
    pose, rate : array, shape (6,), m, rad, and per second
    covariance : array, shape (n, n)
        Of the coordinates that are sought, by noise and motion.
    total : array, shape (n, n)
        With what is the same in every reading.
    innovation : float
        Squared distance of the reading from what was expected (n degrees of freedom); NaN for the first, and
        without light.
    used : bool
    estimate : PoseEstimate
    """

    time_s: float
    pose: Array
    rate: Array
    covariance: Array
    total: Array
    innovation: float
    used: bool
    estimate: PoseEstimate


class Filter:
    """States of several vehicles side by side: places, angles, their rates, and what else is not known.

    Parameters
    ----------
    names : sequence of str
        Coordinates of the pose that are followed, n of them.
    count : int
        Vehicles.
    beside : sequence of float
        Standard deviations, in the long run, of k unknowns that are followed too.
    considered : int
        Independent constants, e of them, that readings may be off by and that are not sought: how unlike the
        elements are. How well all else is known allows for them (Schmidt 1966, Adv. Control Syst. 3, 293).
    patience : int
        Readings in a row that are not used before it begins anew.

    Attributes
    ----------
    state, covariance : array, shape (count, 2 n + k) and (count, 2 n + k, 2 n + k)
    known : array of bool, shape (count,)
        A first reading has come.
    refused : array of int, shape (count,)
        Readings in a row that were not used.
    """

    def __init__(
        self,
        names: Sequence[str],
        count: int = 1,
        beside: Sequence[float] = (),
        considered: int = 0,
        *,
        patience: int = _MOST_REFUSED,
    ) -> None:
        self.at = [POSE.index(name) for name in names]
        n, self._beside = len(self.at), np.array(beside, float)
        size = 2 * n + len(self._beside)
        self._measured = [*range(n), *range(2 * n, size)]
        self.state, self.covariance = np.zeros((count, size)), np.zeros((count, size, size))
        self._shared = np.zeros((count, size, considered))  # covariance with what is considered
        self.known, self.refused = np.zeros(count, bool), np.zeros(count, int)
        self._patience = patience

    @property
    def poses(self) -> Array:
        """Shape (count, 6), m and rad, angles from -pi to pi."""
        found = self._whole(self.state[:, : len(self.at)])
        found[:, 3:] = wrapped(found[:, 3:])
        return found

    @property
    def rates(self) -> Array:
        """Shape (count, 6), m/s and rad/s."""
        return self._whole(self.state[:, len(self.at) : 2 * len(self.at)])

    @property
    def sigmas(self) -> Array:
        """Standard deviations of `poses`, shape (count, 6), m and rad; 0 of what is not sought."""
        return self._whole(np.sqrt(np.einsum("sii->si", self.covariance)[:, : len(self.at)]))

    def beside(self, anew: Mask) -> tuple[Array, Array]:
        """What is expected of the unknowns, shape (count, k) and (count, k, k); where `anew`, as believed."""
        at, believed = 2 * len(self.at), np.diag(self._beside**2)
        mean = np.where(anew[:, None], 0.0, self.state[:, at:])
        return mean, np.where(anew[:, None, None], believed, self.covariance[:, at:, at:])

    @property
    def sees_nothing_familiar(self) -> Mask:
        """Vehicles whose filter begins anew with the next reading, shape (count,)."""
        return ~self.known | (self.refused >= self._patience)

    def predict(self, seconds: float) -> None:
        """Move the states on."""
        n, kept = len(self.at), np.exp(-seconds / _FORGOTTEN_S)
        move = block_diag(np.eye(2 * n), kept * np.eye(len(self._beside)))
        move[:n, n : 2 * n] = seconds * np.eye(n)
        agility = np.diag(_AGILITY[self.at])
        grown = block_diag(
            np.kron([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]], agility),
            (1 - kept**2) * np.diag(self._beside**2),
        )
        self.state = self.state @ move.T
        self.covariance = move @ self.covariance @ move.T + grown
        self._shared = move @ self._shared

    def correct(
        self,
        measured: Array,
        noise: Array,
        found: Mask,
        leeway: Array | float = 1.0,
        common: Array | None = None,
    ) -> tuple[Array, Mask]:
        """Take up one pose each, and its unknowns, where one was `found`.

        Parameters
        ----------
        measured, noise : array, shape (count, n + k) and (count, n + k, n + k)
            As the reading alone tells, and covariances.
        leeway : array, shape (count,)
            Factor of the squared distance at which a pose is refused.
        common : array, shape (count, n + k, e), optional
            Of `noise`, what one standard deviation of each constant makes that is considered.

        Returns
        -------
        innovation : array, shape (count,)
            Squared distance from what was expected; NaN where nothing was.
        used : array of bool, shape (count,)
        """
        n, at = len(self.at), self._measured
        anew = found & self.sees_nothing_familiar
        innovation, used = np.full(len(found), np.nan), anew.copy()
        self.state[anew] = 0.0
        self.state[anew, :n] = measured[anew, :n]
        nothing = np.concatenate([np.full(n, NOTHING_M), _RATE_SIGMA[self.at], self._beside])
        self.covariance[anew], self._shared[anew] = np.diag(nothing**2), 0.0
        common = np.zeros_like(self._shared[:, at]) if common is None else common
        taken = np.flatnonzero(found & (self.known | anew))
        if len(taken):
            apart = measured[taken] - self.state[taken][:, at]
            turns = [k for k, one in enumerate(self.at) if one >= 3]
            apart[:, turns] = wrapped(apart[:, turns])
            before, scatter, shared = self.covariance[taken], noise[taken], self._shared[taken]
            by = np.swapaxes(common[taken], 1, 2)
            # Of what is known with what is measured.
            both = before[:, :, at] + shared @ by
            spread = (
                before[:, at][:, :, at] + scatter + shared[:, at] @ by + np.swapaxes(shared[:, at] @ by, 1, 2)
            )
            far = (apart * np.linalg.solve(spread, apart[..., None])[..., 0]).sum(axis=1)
            innovation[taken] = np.where(anew[taken], np.nan, far)
            likely = anew[taken] | (
                chi2.sf(far / np.broadcast_to(leeway, len(found))[taken], len(at)) >= _GATE
            )
            gain = np.swapaxes(np.linalg.solve(spread, np.swapaxes(both, 1, 2)), 1, 2)
            back = np.swapaxes(gain, 1, 2)
            # Joseph's form keeps it positive.
            rest = np.tile(np.eye(before.shape[1]), (len(taken), 1, 1))
            rest[:, :, at] -= gain
            mixed = rest @ shared @ by @ back
            after = rest @ before @ np.swapaxes(rest, 1, 2) + gain @ scatter @ back
            after -= mixed + np.swapaxes(mixed, 1, 2)
            up = taken[likely]
            self.state[up] += (gain @ apart[..., None])[likely, :, 0]
            self.covariance[up] = after[likely]
            self._shared[up] = (rest @ shared - gain @ common[taken])[likely]
            used[up] = True
        self.known |= used
        self.refused = np.where(used, 0, self.refused + 1)
        return innovation, used

    def _whole(self, part: Array) -> Array:
        found = np.zeros((len(part), len(POSE)))
        found[:, self.at] = part
        return found


@dataclass
class Tracker:
    """`update` with one reading after the other, off line and on line alike.

    Parameters
    ----------
    estimator : Estimator
    """

    estimator: Estimator
    _filter: Filter = field(init=False, repr=False)
    _time_s: float = field(default=0.0, repr=False)
    _common: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self._filter = Filter(self.estimator.names)

    def update(self, readings: Array, time_s: float) -> Tracked:
        """The state after a reading; times must rise."""
        one, n = self._filter, len(self._filter.at)
        expected = None
        if one.known[0]:
            one.predict(time_s - self._time_s)
            expected = one.poses[0]
        self._time_s = time_s
        found = self.estimator.estimate(readings, expected)
        innovation, used = np.nan, False
        if found.noise_only is not None and np.isfinite(found.noise_only.covariance).all():
            answer = one.correct(
                found.pose[None, one.at], found.noise_only.covariance[None], np.array([True])
            )
            innovation, used = float(answer[0][0]), bool(answer[1][0])
        else:
            one.refused += 1
        if found.total is not None and found.noise_only is not None and used:
            common = _beside(found.total.covariance, found.noise_only.covariance)
            before = self._common
            if before is None or not (np.isfinite(before).all() and np.isfinite(common).all()):
                self._common = common
            else:
                self._common = before + (common - before) / _MEMORY
        known = bool(one.known[0])
        pose, rate = (v[0] if known else np.full(len(POSE), np.nan) for v in (one.poses, one.rates))
        if known and "roll" not in self.estimator.names:
            pose[POSE.index("roll")] = self.estimator.roll_rad
        covariance = one.covariance[0, :n, :n].copy() if known else np.full((n, n), np.nan)
        total = covariance if self._common is None else covariance + self._common
        return Tracked(time_s, pose, rate, covariance, total, innovation, used, found)


def _beside(whole: Array, part: Array) -> Array:
    """What a covariance holds beside another, shape (n, n); no variance below 0, infinite ones kept."""
    known, size = np.isfinite(np.diag(whole)), np.sqrt(np.diag(whole))
    told = known[:, None] & known
    scale = np.where(told, np.outer(size, size), 1.0)
    values, vectors = eigen(np.where(told, whole - part, 0.0) / scale)
    rest = (vectors * np.maximum(values, 0.0)) @ vectors.T * scale
    return np.asarray(rest + np.diag(np.where(known, 0.0, np.inf)))
