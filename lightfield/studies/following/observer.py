"""What followers take their poses for: maximum likelihood on every reading, and a filter over them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import chi2

from lightfield.arrays import Array, Mask
from lightfield.studies.follower.array_light import LAMP_TILTS, ArrayModel, Space
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.estimation.pose import DOUBTFUL, IN_A_ROW, LOST_SIGMA, Estimator
from lightfield.studies.follower.estimation.tracking import Filter
from lightfield.studies.follower.frames import POSE, wrapped
from lightfield.studies.follower.information import LEAST_INFORMATION
from lightfield.studies.follower.pose_search import (
    FEW_STEPS,
    Beforehand,
    WithUnknowns,
    box_of,
    find_minima,
    gain_first,
)
from lightfield.studies.follower.rival_poses import NEAR_SIGMA

#: Steps of the search from where the filter expects the pose, and from anywhere: three from a tenth of a
#: second before are as good as six (scatter of the estimates the same to 1 %).
_STEPS, _STEPS_FROM_AFAR = FEW_STEPS, 60


class Observer:
    """Poses of `count` followers that believe the same, updated with a reading of each.

    What they do not know exactly beside the pose they learn on the way, or seek in every reading anew.

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
        unknown: Mapping[str, float],
        count: int,
        *,
        learns: bool,
    ) -> None:
        sought = [name for name in unknown if name not in LAMP_TILTS]
        self.light = WithUnknowns(model, tuple(names), gain_first(sought))
        self.noise, self.box = noise, box_of(space)
        self._free = max(len(model.elements) - len(names), 1)
        self._sigmas = np.minimum([float(unknown[name]) for name in self.light.unknowns], _FREE)
        # A lamp that points elsewhere and a follower that stands elsewhere are alike but for second orders,
        # of which a filter would learn what is not so (Julier and Uhlmann 2001, ICRA, 4238).
        self._tilts = {name: float(sigma) for name, sigma in unknown.items() if name in LAMP_TILTS}
        self._learns = learns
        considered = len(model.elements) + len(self._tilts)
        known = self._sigmas.tolist() if learns else ()
        self.filter = Filter(names, count, known, considered, patience=_PATIENCE)
        self._calm = Calm(count)
        self._starts = Estimator(model, noise, self.light.names, {}, space).starts()
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
        anew = self.filter.sees_nothing_familiar
        count, k = len(readings), len(self._sigmas)
        believed = np.zeros((count, k)), np.tile(np.diag(self._sigmas**2), (count, 1, 1))
        mean, covariance = self.filter.beside(anew) if self._learns else believed
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        poses, unknown, misfit = self._nearest(readings, variance, mean, root, anew)
        scatter, common, certain = self._scatter(
            *self._where(poses, unknown, mean, anew, seconds), variance, readings
        )
        measured, n = poses[:, self.filter.at], len(self.filter.at)
        if self._learns:
            # As the reading tells alone: what was known beforehand drew the unknowns, and the pose with them.
            drawn = np.swapaxes(root, 1, 2) @ root @ (unknown - mean)[..., None]
            measured = np.concatenate([measured, unknown], axis=1) + (scatter[:, :, n:] @ drawn)[..., 0]
        else:
            scatter, common = scatter[:, :n, :n], common[:, :n]
        # Unlike elements are in the scatter of single readings; what the lamp's direction makes is beside it.
        turned = common[:, :, len(self.light.model.elements) :]
        scatter = scatter + turned @ np.swapaxes(turned, 1, 2)
        # Readings that fit badly are worse than their noise says, by the root of chi2 over its degrees of
        # freedom (Birge 1932, Phys. Rev. 40, 207). Else a filter that believes a wrong light refuses all.
        leeway = np.maximum(1.0, misfit / self._free)
        _, self.used = self.filter.correct(measured, scatter, self.lit & certain, leeway, common)
        if self._learns:
            self._calm.follow(self.filter.poses, seconds)
        unlikely = self.lit & (chi2.sf(misfit, self._free) < DOUBTFUL)
        self._unlikely = np.where(unlikely, self._unlikely + 1, 0)
        self.doubtful = self._unlikely >= IN_A_ROW

    def _nearest(
        self, readings: Array, variance: Array, mean: Array, root: Array, anew: Mask
    ) -> tuple[Array, Array, Array]:
        """Poses, unknowns and chi-square of readings, from what is expected, or from anywhere."""
        poses, misfit, free = self.filter.poses, np.zeros(len(readings)), self._free
        unknown = mean.copy()
        expected = np.clip(poses, *self.box)
        familiar, strange = np.flatnonzero(self.lit & ~anew), np.flatnonzero(self.lit & anew)
        for which, more, steps in ((familiar, 0, _STEPS), (strange, len(self._starts), _STEPS_FROM_AFAR)):
            if not len(which):
                continue
            others = np.broadcast_to(self._starts[:more], (len(which), more, len(POSE)))
            each = np.concatenate([expected[which, None], others], axis=1)
            of = np.repeat(which, 1 + more)
            found = find_minima(
                self.light.model, readings[of], variance[of], self.light.names, each.reshape(-1, len(POSE)),
                nuisances=Beforehand(self.light.unknowns, mean[of], root[of]), box=self.box, most_steps=steps,
            )  # fmt: skip
            far = found.chi2.reshape(len(which), 1 + more)
            # What was expected is given up only for what explains the readings better by five sigma.
            least = far.min(axis=1)
            stays = self.filter.known[which] & (
                far[:, 0] <= least + NEAR_SIGMA**2 * np.maximum(1.0, least / free)
            )
            best = np.where(stays, 0, far.argmin(axis=1)) + (1 + more) * np.arange(len(which))
            poses[which], unknown[which], misfit[which] = (
                found.poses[best],
                found.unknown[best],
                found.chi2[best],
            )
        return poses, unknown, misfit

    def _where(
        self, poses: Array, unknown: Array, mean: Array, anew: Mask, seconds: float
    ) -> tuple[Array, Array]:
        """Poses and unknowns at which is asked how well a reading tells.

        At the found ones what noise draws nearer weighs more, and a follower takes itself to be too near; at
        those that a filter expects it learns from its own errors what readings do not tell (Huang et al.
        2010, doi:10.1177/0278364909353640). So it is asked where a calmer follower would be.
        """
        if not self._learns:
            return poses, unknown
        self._calm.predict(seconds)
        self._calm.begin(anew, poses)
        return np.clip(self._calm.poses, *self.box), np.where(anew[:, None], unknown, mean)

    def _scatter(
        self, poses: Array, unknown: Array, variance: Array, readings: Array
    ) -> tuple[Array, Array, Mask]:
        """Covariances of poses and unknowns by single readings, shape (count, n + k, n + k).

        Of these, what elements that are unlike, and the lamp's direction, make of them, shape
        (count, n + k, n_elements + n_tilts); and which are finite, shape (count,).
        """
        read, by = self.light.read(poses, unknown)
        slopes = self.light.slopes(poses, unknown, read, by) / np.sqrt(variance)[:, :, None]
        information = np.swapaxes(slopes, 1, 2) @ slopes
        # Where they are learned a hint is enough to part those that act alike, as a and b in straight light.
        told = (_HINT if self._learns else 1.0) * self._sigmas**-2.0
        information += np.diag(np.concatenate([np.zeros(len(self.light.names)), told]))
        own = np.einsum("sii->si", information)
        scale = 1 / np.sqrt(np.maximum(own, LEAST_INFORMATION))
        scaled = information * scale[:, :, None] * scale[:, None, :]
        certain = (own[:, : len(self.light.names)] > LEAST_INFORMATION).all(axis=1) & (
            np.linalg.cond(scaled) < 1 / _CERTAIN
        )
        found = np.tile(np.eye(len(scale[0])), (len(poses), 1, 1))
        if certain.any():
            found[certain] = np.linalg.inv(scaled[certain]) * (scale[:, :, None] * scale[:, None, :])[certain]
        # Of the variance: more of it than there is would leave the filter less than nothing. Where the lamp
        # points elsewhere a reading is by far not what a pose reads.
        unlike = np.eye(read.shape[1]) * (self.noise.mismatch * np.maximum(readings, 0.0))[:, None, :]
        turned = self.light.model.by_nuisances(poses, list(self._tilts)) * list(self._tilts.values())
        turned *= self.light.gains(unknown)[:, None, None]
        constants = np.concatenate([unlike, turned], axis=2) / np.sqrt(variance)[:, :, None]
        return found, found @ np.swapaxes(slopes, 1, 2) @ constants, certain


class Calm:
    """Poses of `count` followers without the noise of their last readings: a fading memory of place and speed
    (Brookner 1998, doi:10.1002/0471224197, section 1.2.6: critically damped).

    Attributes
    ----------
    poses : array, shape (count, 6), m and rad
    """

    def __init__(self, count: int) -> None:
        self.poses = np.zeros((count, len(POSE)))
        self._rates = np.zeros((count, len(POSE)))

    def begin(self, anew: Mask, poses: Array) -> None:
        """Forget some, which are at these poses."""
        self.poses[anew], self._rates[anew] = poses[anew], 0.0

    def predict(self, seconds: float) -> None:
        """Move on."""
        self.poses = self.poses + seconds * self._rates

    def follow(self, poses: Array, seconds: float) -> None:
        """Take up where the filter puts them, this long after the last."""
        if not seconds:
            return
        kept = np.exp(-seconds / _CALM_S)
        apart = poses - self.poses
        apart[:, 3:] = wrapped(apart[:, 3:])
        self.poses = self.poses + (1 - kept**2) * apart
        self.poses[:, 3:] = wrapped(self.poses[:, 3:])
        self._rates = self._rates + (1 - kept) ** 2 / seconds * apart


#: Seconds of that memory. Measured, unlike elements and a gain known to 5 %, 45 s: without it (half way
#: between what is found and what is expected) distances are 0.10 to 0.27 m too short, two to three of their
#: errors; with 0.5 s 0.03 to 0.10 m too long, with 1 s 0.02 to 0.05, with 2 s 0.01 to 0.03; with 10 s the
#: memory lags behind and some lose their way.
_CALM_S = 2.0
#: After so many readings in a row that its filter did not use a follower looks anew: it steers by them.
#: Measured, 960 runs at 5 Hz: with 2 one lost its way, with 5 fourteen did.
_PATIENCE = 2
#: Part of what is known of the unknowns beforehand that every reading is taken to tell (chosen: a thousand
#: readings do not add a prior to it).
_HINT = 1e-4
#: Standard deviation, as a logarithm, of a gain that is not known: a factor of e^10.
_FREE = 10.0
#: Smallest ratio of eigenvalues of an information of unit diagonal that is not rounding.
_CERTAIN = 1e-10
