"""What followers take their poses for: maximum likelihood on every reading, and a filter over them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from lightfield.arrays import Array, Mask
from lightfield.studies.follower.array_light import ArrayModel, Space
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.estimation.pose import DOUBTFUL, IN_A_ROW, LOST_SIGMA, Estimator
from lightfield.studies.follower.estimation.tracking import Filter
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.pose_search import box_of, find_minima
from lightfield.studies.follower.rival_poses import NEAR_SIGMA

#: Steps of the search from where the filter expects the pose, and from anywhere: three from a tenth of a
#: second before are as good as six (scatter of the estimates the same to 1 %).
STEPS, STEPS_FROM_AFAR = 3, 60


class Observer:
    """Poses of `count` followers that believe the same, updated with a reading of each.

    Attributes
    ----------
    lit, used, doubtful : array of bool, shape (count,)
        Of the last reading: there was light; the filter took it; three in a row do not fit the light.
    """

    def __init__(
        self,
        model: ArrayModel,
        noise: SensorNoise,
        names: Sequence[str],
        space: Space,
        gain_sigma: float,
        count: int,
    ) -> None:
        self.model, self.noise, self.names, self.gain_sigma = model, noise, tuple(names), gain_sigma
        self.box = box_of(space)
        self.filter = Filter(names, count)
        self._starts = Estimator(model, noise, self.names, {}, space).starts()
        self.lit: Mask = np.zeros(count, bool)
        self.used: Mask = self.lit
        self.doubtful: Mask = self.lit
        self._unlikely = np.zeros(count, int)

    def update(self, readings: Array, seconds: float) -> None:
        """Take up readings, shape (count, n_elements), this long after the last."""
        self.filter.predict(seconds)
        dark = float(np.sqrt(self.noise.variance(np.zeros(readings.shape[1]))).max())
        self.lit = readings.max(axis=1) > LOST_SIGMA * max(dark, np.finfo(float).tiny)
        variance = np.maximum(self.noise.variance(readings), np.finfo(float).tiny)
        poses, gains, misfit = self.filter.poses, np.ones(len(readings)), np.zeros(len(readings))
        familiar = np.flatnonzero(self.lit & ~self.filter.sees_nothing_familiar)
        strange = np.flatnonzero(self.lit & self.filter.sees_nothing_familiar)
        free = max(readings.shape[1] - len(self.names), 1)
        expected, unknown = (
            np.clip(poses, *self.box),
            {"gain": self.gain_sigma} if self.gain_sigma > 0 else {},
        )
        for which, more, steps in ((familiar, 0, STEPS), (strange, len(self._starts), STEPS_FROM_AFAR)):
            if not len(which):
                continue
            others = np.broadcast_to(self._starts[:more], (len(which), more, len(POSE)))
            each = np.concatenate([expected[which, None], others], axis=1)
            of = np.repeat(which, 1 + more)
            found = find_minima(
                self.model, readings[of], variance[of], self.names, each.reshape(-1, len(POSE)),
                nuisances=unknown, box=self.box, most_steps=steps,
            )  # fmt: skip
            far = found.chi2.reshape(len(which), 1 + more)
            # What was expected is given up only for what explains the readings better by five sigma.
            least = far.min(axis=1)
            stays = self.filter.known[which] & (
                far[:, 0] <= least + NEAR_SIGMA**2 * np.maximum(1.0, least / free)
            )
            best = np.where(stays, 0, far.argmin(axis=1)) + (1 + more) * np.arange(len(which))
            poses[which], gains[which], misfit[which] = found.poses[best], found.gains[best], found.chi2[best]
        scatter, certain = self._scatter(poses, gains, variance)
        # Readings that fit badly are worse than their noise says, by the root of chi2 over its degrees of
        # freedom (Birge 1932, Phys. Rev. 40, 207). Else a filter that believes a wrong light refuses all.
        leeway = np.maximum(1.0, misfit / free)
        _, self.used = self.filter.correct(poses[:, self.filter.at], scatter, self.lit & certain, leeway)
        unlikely = self.lit & (chi2.sf(misfit, free) < DOUBTFUL)
        self._unlikely = np.where(unlikely, self._unlikely + 1, 0)
        self.doubtful = self._unlikely >= IN_A_ROW

    def _scatter(self, poses: Array, gains: Array, variance: Array) -> tuple[Array, Mask]:
        """Covariances of single readings, shape (count, n, n), and which of them are finite."""
        slopes = gains[:, None, None] * self.model.by_pose(poses, self.names) / np.sqrt(variance)[:, :, None]
        if self.gain_sigma > 0:
            read = gains[:, None] * self.model.readings(poses) / np.sqrt(variance)
            slopes = np.concatenate([slopes, read[:, :, None]], axis=2)
        information = np.swapaxes(slopes, 1, 2) @ slopes
        if self.gain_sigma > 0:
            information[:, -1, -1] += self.gain_sigma**-2.0
        scale = 1 / np.sqrt(np.maximum(np.einsum("sii->si", information), np.finfo(float).tiny))
        scaled = information * scale[:, :, None] * scale[:, None, :]
        certain = np.linalg.cond(scaled) < 1 / CERTAIN
        found = np.tile(np.eye(len(scale[0])), (len(poses), 1, 1))
        if certain.any():
            found[certain] = np.linalg.inv(scaled[certain]) * (scale[:, :, None] * scale[:, None, :])[certain]
        n = len(self.names)
        return found[:, :n, :n], certain


#: Smallest ratio of eigenvalues of an information of unit diagonal that is not rounding.
CERTAIN = 1e-10
