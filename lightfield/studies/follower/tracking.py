"""A sequence of poses, smoothed by what a vehicle can do: a Kalman filter of places, angles and their rates.

    state  (p, v),   p' = p + v dt,   v' = v + white acceleration       (Bar-Shalom et al. 2001, section 6.2)

Only the noise of single readings is averaged away. What gain, water and lamp leave unknown is the same in
every
reading, and is added afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from lightfield.arrays import Array
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.pose import Estimate, Estimator

#: Density of the white acceleration, (m/s^2)^2/Hz and (rad/s^2)^2/Hz: within a second a small vehicle's speed
#: changes by about 0.2 m/s and its rates of turn by 10 degrees/s (chosen).
AGILITY = np.array([0.2, 0.2, 0.2, *np.radians([10.0, 10.0, 10.0])]) ** 2
#: Standard deviation of rates that nothing is known of, m/s and rad/s (chosen).
RATE_SIGMA = np.array([0.5, 0.5, 0.5, *np.radians([20.0, 20.0, 20.0])])
#: A reading that is less probable than this, as the filter expects it, is not used (chosen).
GATE = 1e-4
#: After so many readings in a row that it did not use, the filter begins anew (chosen).
MOST_REFUSED = 5


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
    estimate : Estimate
    """

    time_s: float
    pose: Array
    rate: Array
    covariance: Array
    total: Array
    innovation: float
    used: bool
    estimate: Estimate


@dataclass
class Tracker:
    """`update` with one reading after the other, off line and on line alike.

    Parameters
    ----------
    estimator : Estimator
    """

    estimator: Estimator
    _state: Array | None = field(default=None, repr=False)
    _covariance: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    _time_s: float = field(default=0.0, repr=False)
    _refused: int = field(default=0, repr=False)
    _common: Array | float = field(default=0.0, repr=False)

    def update(self, readings: Array, time_s: float) -> Tracked:
        """The state after a reading; times must rise."""
        at = [POSE.index(name) for name in self.estimator.names]
        n = len(at)
        expected = self._predict(time_s, at) if self._state is not None else None
        found = self.estimator.estimate(readings, expected)
        innovation, used = np.nan, False
        if found.noise_only is not None and np.isfinite(found.noise_only.covariance).all():
            measured, noise = found.pose[at], found.noise_only.covariance
            if self._state is None or self._refused >= MOST_REFUSED:
                self._state = np.concatenate([measured, np.zeros(n)])
                self._covariance = np.zeros((2 * n, 2 * n))
                self._covariance[:n, :n] = noise
                self._covariance[n:, n:] = np.diag(RATE_SIGMA[at] ** 2)
                used = True
            else:
                innovation, used = self._correct(measured, noise)
            self._refused = 0 if used else self._refused + 1
        self._time_s = time_s
        return self._tracked(time_s, at, found, innovation, used)

    def _predict(self, time_s: float, at: list[int]) -> Array:
        """Moves the state on; gives the pose that it comes to."""
        assert self._state is not None
        n, dt = len(at), time_s - self._time_s
        move = np.eye(2 * n)
        move[:n, n:] = dt * np.eye(n)
        agility = np.diag(AGILITY[at])
        grown = np.block([[agility * dt**3 / 3, agility * dt**2 / 2], [agility * dt**2 / 2, agility * dt]])
        self._state = move @ self._state
        self._covariance = move @ self._covariance @ move.T + grown
        pose = np.zeros(len(POSE))
        pose[at] = self._state[:n]
        return pose

    def _correct(self, measured: Array, noise: Array) -> tuple[float, bool]:
        assert self._state is not None
        n = len(measured)
        apart = measured - self._state[:n]
        spread = self._covariance[:n, :n] + noise
        innovation = float(apart @ np.linalg.solve(spread, apart))
        if chi2.sf(innovation, n) < GATE:
            return innovation, False
        gain = np.linalg.solve(spread, self._covariance[:n]).T
        self._state = self._state + gain @ apart
        # Joseph's form keeps it positive.
        rest = np.eye(2 * n)
        rest[:, :n] -= gain
        self._covariance = rest @ self._covariance @ rest.T + gain @ noise @ gain.T
        return innovation, True

    def _tracked(
        self, time_s: float, at: list[int], found: Estimate, innovation: float, used: bool
    ) -> Tracked:
        n = len(at)
        pose, rate = np.full(len(POSE), np.nan), np.full(len(POSE), np.nan)
        covariance = np.full((n, n), np.nan)
        if self._state is not None:
            pose, rate = np.zeros(len(POSE)), np.zeros(len(POSE))
            pose[at], rate[at] = self._state[:n], self._state[n:]
            covariance = self._covariance[:n, :n].copy()
        if found.total is not None and found.noise_only is not None and used:
            self._common = found.total.covariance - found.noise_only.covariance
        return Tracked(time_s, pose, rate, covariance, covariance + self._common, innovation, used, found)
