"""What a follower takes its pose for whose model of the light is wrong.

    p0 = argmin over p of  sum (mu(truth) - G E_formula(p))^2 / variance              (bias: p0 - truth)
    spread of the estimates  A^-1 B A^-1,   B = J^T W J,   A = B - sum of residuals times second derivatives

p0 is what the maximum likelihood estimate tends to, and the spread is the misspecified Cramer-Rao bound
(Vuong 1986, Caltech working paper 652; Fortunati et al. 2017, IEEE Signal Process. Mag. 34, 142,
doi:10.1109/MSP.2017.2738017).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.studies.follower.array_light import STEP, ArrayModel
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.information import inverse
from lightfield.studies.follower.pose_search import find_minima

#: A curvature of chi-square, in units of that along each coordinate, is none where it is smaller: rounding.
_LEVEL = 1e-6
#: A search that ended on a saddle goes on from so far aside, m or rad, and to the other side where chi-square
#: is lower there by this part.
_ASIDE, _AS_GOOD = 0.1, 1e-6
#: Curvatures that differ by less than this part are one; decimals to which parts of a direction are.
_ALIKE, _SAME_PART = 1e-3, 6


@dataclass(frozen=True)
class Belief:
    """What a follower takes its pose for.

    Parameters
    ----------
    pose, believed : array, shape (6,), m and rad
    covariance : array, shape (n, n), m and rad
        Spread of the estimates by noise about `believed`, of the coordinates that are sought;
        infinite on its diagonal, and zero beside it, where the readings tell nothing.
    trace_sigma : array, shape (n,), m and rad
        Standard error of the bias by the trace's photons, in the readings and in what was fitted to them.
    misfit : float
        Sum of the squared residuals that noise did not make, over the degrees of freedom.
    """

    pose: Array
    believed: Array
    covariance: Array
    trace_sigma: Array
    misfit: float

    @property
    def bias(self) -> Array:
        """Believed less true pose, m and rad, shape (6,)."""
        return np.asarray(self.believed - self.pose)


def belief(
    truth: ArrayModel,
    formula: ArrayModel,
    pose: Array,
    names: Sequence[str],
    noise: SensorNoise,
    gain_sigma: float = 0.0,
    parts: Sequence[tuple[ArrayModel, ArrayModel]] = (),
) -> Belief:
    """Bias and spread of the pose from the wrong model, at one pose.

    Parameters
    ----------
    truth, formula : ArrayModel
        The readings, and what explains them.
    pose : array, shape (6,), m and rad
    names : sequence of str
        Coordinates that are sought; the rest is known.
    gain_sigma : float
        Of the formula's gain beforehand; infinite: only relative readings count.
    parts : sequence of (ArrayModel, ArrayModel)
        The same two without one of the batches of the trace, for each in turn, see `without_a_batch`.
    """
    readings = truth.readings(pose[None])[0]
    variance = noise.variance(readings)
    unknown = {"gain": gain_sigma} if gain_sigma > 0 else {}
    found, k = find_minima(formula, readings, variance, names, pose[None], nuisances=unknown), 0
    cost = _Cost(formula, readings, 1 / variance, tuple(names), gain_sigma)
    downhill = cost.downhill(found.poses[0], float(found.gains[0]))
    if downhill is not None:
        # By symmetry the search stayed on a saddle: an array that is turned to a side does better.
        aside = np.zeros((2, len(POSE)))
        aside[:, cost.at] = np.outer([_ASIDE, -_ASIDE], downhill)
        found = find_minima(formula, readings, variance, names, found.poses[0] + aside, nuisances=unknown)
        k = int(found.chi2[1] < (1 - _AS_GOOD) * found.chi2[0])
    best, gain = found.poses[k], float(found.gains[k])
    covariance, lever = cost.spread(best, gain)
    trace = np.zeros(len(names))
    if parts:
        # What photons do to the readings, and to what is believed of them, moves the belief as noise would;
        # of a jackknife, without one batch in turn (Efron 1982, section 2).
        expected = formula.readings(best[None])[0]
        moved = [
            lever
            @ (true.readings(pose[None])[0] - readings - gain * (other.readings(best[None])[0] - expected))
            for true, other in parts
        ]
        trace = np.sqrt(len(parts) - 1) * np.std(moved, axis=0)
    free = len(readings) - len(names) - (gain_sigma > 0)
    return Belief(pose, best, covariance, trace, float(found.chi2[k]) / max(free, 1))


@dataclass(frozen=True)
class _Cost:
    """Chi-square of the formula's readings about a pose and a gain, and its derivatives.

    Parameters
    ----------
    names : tuple of str
        Coordinates of the pose that are sought; the logarithm of the gain is, where its `prior` is not 0.
    """

    model: ArrayModel
    readings: Array
    weight: Array
    names: tuple[str, ...]
    prior: float

    @property
    def at(self) -> list[int]:
        """Which coordinates of a pose are sought."""
        return [POSE.index(name) for name in self.names]

    def spread(self, pose: Array, gain: float) -> tuple[Array, Array]:
        """A^-1 B A^-1 of the pose, and A^-1 J^T W.

        Infinite of what readings of so few elements do not tell at all.
        """
        count = len(self.names)
        slopes, _ = self._slopes_and_gradient(pose[None], np.array([gain]))
        b = np.einsum("nk,n,nl->kl", slopes[0], self.weight, slopes[0])
        if self.prior > 0:
            b[-1, -1] += self.prior**-2.0
        back = np.linalg.pinv(self._bend(pose, gain), hermitian=True)
        lever = back @ (slopes[0] * self.weight[:, None]).T
        spread = (back @ b @ back)[:count, :count]
        untold = ~np.isfinite(np.diag(inverse(b)))[:count]
        spread[untold, :] = spread[:, untold] = 0.0
        spread[untold, untold] = np.inf
        return spread, lever[:count]

    def downhill(self, pose: Array, gain: float) -> Array | None:
        """Direction of the coordinates that are sought in which chi-square falls to both sides, if any."""
        bend, count = self._bend(pose, gain), len(self.names)
        scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(bend)), TINY))
        square, directions = np.linalg.eigh(bend * np.outer(scale, scale))
        if square[0] > -_LEVEL:
            return None
        # About a round beam two directions are one: of these the one that is most of the first coordinate.
        alike = directions[:, square < (1 - _ALIKE) * square[0]]
        most = int(np.argmax(np.round((alike[:count] ** 2).sum(axis=1), _SAME_PART)))
        found = (alike @ alike[most] * scale)[:count]
        return np.asarray(found / found[np.argmax(np.abs(found))])

    def _bend(self, pose: Array, gain: float) -> Array:
        """A: half the second derivatives of chi-square."""
        count = len(self.names)
        size = count + (self.prior > 0)
        poses, gains = np.tile(pose, (2 * size, 1)), np.full(2 * size, gain)
        # The gradient is itself a difference with `STEP`: its own step is larger, so that rounding stays
        # small.
        step = 10 * STEP
        for k in range(size):
            for row, sign in ((k, 1), (size + k, -1)):
                if k < count:
                    poses[row, self.at[k]] += sign * step
                else:
                    gains[row] *= np.exp(sign * step)
        _, gradients = self._slopes_and_gradient(poses, gains)
        a = (gradients[:size] - gradients[size:]) / (2 * step)
        return np.asarray(0.5 * (a + a.T))

    def _slopes_and_gradient(self, poses: Array, gains: Array) -> tuple[Array, Array]:
        """Slopes of the readings, (s, n_elements, k), and half the gradient of chi-square, (s, k)."""
        read = gains[:, None] * self.model.readings(poses)
        slopes = gains[:, None, None] * self.model.by_pose(poses, self.names)
        if self.prior > 0:
            slopes = np.concatenate([slopes, read[:, :, None]], axis=2)
        gradient = -np.einsum("snk,n,sn->sk", slopes, self.weight, self.readings - read)
        if self.prior > 0:
            gradient[:, -1] += np.log(gains) * self.prior**-2.0
        return slopes, gradient
