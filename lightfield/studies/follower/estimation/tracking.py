"""A sequence of poses, smoothed by what a vehicle can do: a Kalman filter of places, angles and their rates.

    state  (p, v),   p' = p + v dt,   v' = v + white acceleration       (Bar-Shalom et al. 2001, section 6.2)

Only the noise of single readings is averaged away. What gain, mismatch, water and lamp leave unknown, and
which of several poses it is, is nearly the same in every reading, and is added afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from lightfield.arrays import Array, Mask
from lightfield.decompositions import eigen
from lightfield.studies.follower.estimation.pose import Estimator, PoseEstimate
from lightfield.studies.follower.frames import POSE, wrapped

#: Density of the white acceleration, (m/s^2)^2/Hz and (rad/s^2)^2/Hz: within a second a small vehicle's speed
#: changes by about 0.2 m/s and its rates of turn by 10 degrees/s (chosen).
AGILITY = np.array([0.2, 0.2, 0.2, *np.radians([10.0, 10.0, 10.0])]) ** 2
#: Standard deviation of rates that nothing is known of, m/s and rad/s (chosen).
RATE_SIGMA = np.array([0.5, 0.5, 0.5, *np.radians([20.0, 20.0, 20.0])])
#: A reading that is less probable than this, as the filter expects it, is not used (chosen).
GATE = 1e-4
#: After so many readings in a row that it did not use, the filter begins anew (chosen).
MOST_REFUSED = 5
#: What does not average away is told as the mean of so many readings: each knows it roughly (chosen).
MEMORY = 10


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
    """States of several vehicles side by side: places, angles and their rates, and how well they are known.

    Parameters
    ----------
    names : sequence of str
        Coordinates of the pose that are followed, n of them.
    count : int
        Vehicles.

    Attributes
    ----------
    state, covariance : array, shape (count, 2 n) and (count, 2 n, 2 n)
    known : array of bool, shape (count,)
        A first reading has come.
    refused : array of int, shape (count,)
        Readings in a row that were not used.
    """

    def __init__(self, names: Sequence[str], count: int = 1) -> None:
        self.at = [POSE.index(name) for name in names]
        n = len(self.at)
        self.state, self.covariance = np.zeros((count, 2 * n)), np.zeros((count, 2 * n, 2 * n))
        self.known, self.refused = np.zeros(count, bool), np.zeros(count, int)

    @property
    def poses(self) -> Array:
        """Shape (count, 6), m and rad, angles from -pi to pi."""
        found = self._whole(self.state[:, : len(self.at)])
        found[:, 3:] = wrapped(found[:, 3:])
        return found

    @property
    def rates(self) -> Array:
        """Shape (count, 6), m/s and rad/s."""
        return self._whole(self.state[:, len(self.at) :])

    @property
    def sees_nothing_familiar(self) -> Mask:
        """Vehicles whose filter begins anew with the next reading, shape (count,)."""
        return ~self.known | (self.refused >= MOST_REFUSED)

    def predict(self, seconds: float) -> None:
        """Move the states on."""
        n = len(self.at)
        move = np.eye(2 * n)
        move[:n, n:] = seconds * np.eye(n)
        agility = np.diag(AGILITY[self.at])
        grown = np.block(
            [
                [agility * seconds**3 / 3, agility * seconds**2 / 2],
                [agility * seconds**2 / 2, agility * seconds],
            ]
        )
        self.state = self.state @ move.T
        self.covariance = move @ self.covariance @ move.T + grown

    def correct(
        self, measured: Array, noise: Array, found: Mask, leeway: Array | float = 1.0
    ) -> tuple[Array, Mask]:
        """Take up one pose each, shape (count, n), with covariances (count, n, n), where one was `found`.

        Parameters
        ----------
        leeway : array, shape (count,)
            Factor of the squared distance at which a pose is refused.

        Returns
        -------
        innovation : array, shape (count,)
            Squared distance from what was expected; NaN where nothing was.
        used : array of bool, shape (count,)
        """
        n = len(self.at)
        anew = found & self.sees_nothing_familiar
        innovation = np.full(len(found), np.nan)
        self.state[anew] = np.concatenate([measured, np.zeros_like(measured)], axis=1)[anew]
        self.covariance[anew] = 0.0
        self.covariance[anew, :n, :n] = noise[anew]
        self.covariance[anew, n:, n:] = np.diag(RATE_SIGMA[self.at] ** 2)
        tried = np.flatnonzero(found & self.known & ~anew)
        used = anew.copy()
        if len(tried):
            apart = measured[tried] - self.state[tried, :n]
            turns = [k for k, at in enumerate(self.at) if at >= 3]
            apart[:, turns] = wrapped(apart[:, turns])
            before, scatter = self.covariance[tried], noise[tried]
            spread = before[:, :n, :n] + scatter
            innovation[tried] = (apart * np.linalg.solve(spread, apart[..., None])[..., 0]).sum(axis=1)
            likely = chi2.sf(innovation[tried] / np.broadcast_to(leeway, len(found))[tried], n) >= GATE
            gain = np.swapaxes(np.linalg.solve(spread, before[:, :n]), 1, 2)
            # Joseph's form keeps it positive.
            rest = np.tile(np.eye(2 * n), (len(tried), 1, 1))
            rest[:, :, :n] -= gain
            after = rest @ before @ np.swapaxes(rest, 1, 2) + gain @ scatter @ np.swapaxes(gain, 1, 2)
            up = tried[likely]
            self.state[up] += (gain @ apart[..., None])[likely, :, 0]
            self.covariance[up] = after[likely]
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
                self._common = before + (common - before) / MEMORY
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
