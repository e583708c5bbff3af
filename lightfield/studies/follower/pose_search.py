"""Which pose do readings come from? Least squares from many starts at once.

    chi2 = sum (reading - gain mu(pose))^2 / variance + (ln gain / sigma_gain)^2

Levenberg's and Marquardt's search (Marquardt 1963, J. SIAM 11, 431), all starts side by side: the light of
all of
them is asked for in one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.studies.follower.array_light import MARGIN_M, ArrayModel, Space
from lightfield.studies.follower.frames import POSE

#: Damping at the start, and its change after a step that helps or does not (Marquardt 1963).
DAMPING, EASED, STIFFENED = 1e-3, 0.2, 8.0
#: A search ends when a step gains less than this of chi2, in sigma^2, or is as stiff as this.
LITTLE, STIFFEST = 1e-6, 1e10
MOST_STEPS = 60
#: Largest change of the logarithm of the gain in one step (chosen).
LONGEST_GAIN_STEP = 0.5
#: Least curvature of a coordinate, in the units of `information`: keeps dark starts from dividing by nothing.
TINY = 1e-30
#: Angles, rad, up to which the follower may be turned (chosen: 35 degrees, beyond it loses sight of the
#: lamp).
MOST_TURNED = 0.6


@dataclass(frozen=True)
class Minima:
    """Minima, one per start.

    Parameters
    ----------
    poses : array, shape (s, 6), m and rad
    gains : array, shape (s,)
    chi2 : array, shape (s,)
    """

    poses: Array
    gains: Array
    chi2: Array

    def best_first(self) -> Minima:
        """The same in the order of their chi2."""
        order = np.argsort(self.chi2, kind="stable")
        return Minima(self.poses[order], self.gains[order], self.chi2[order])


def box_of(space: Space) -> tuple[Array, Array]:
    """Lowest and highest pose, shape (6,) each, that a search may try in a formation space."""
    across = space.half_width_m + MARGIN_M
    turned = [MOST_TURNED, MOST_TURNED, np.pi]
    low = np.array([-across, -across, max(space.near_m - MARGIN_M, 0.5 * space.near_m), *(-np.array(turned))])
    high = np.array([across, across, space.far_m + MARGIN_M, *turned])
    return low, high


def starts_in(box: tuple[Array, Array], names: Sequence[str], count: int, seed: int) -> Array:
    """Poses spread over a box, those coordinates at zero that are not sought, shape (count, 6)."""
    low, high = box
    sought = np.isin(POSE, list(names))
    return np.where(sought, np.random.default_rng(seed).uniform(low, high, (count, len(POSE))), 0.0)


def find_minima(
    model: ArrayModel,
    readings: Array,
    variance: Array,
    names: Sequence[str],
    starts: Array,
    *,
    gain_sigma: float = 0.0,
    box: tuple[Array, Array] | None = None,
    most_steps: int = MOST_STEPS,
) -> Minima:
    """Poses that explain readings, from every start, in their order.

    Parameters
    ----------
    readings, variance : array, shape (n_elements,), or of every start, (s, n_elements)
    names : sequence of str
        Coordinates that are sought.
    starts : array, shape (s, 6), m and rad
    gain_sigma : float
        Standard deviation of the logarithm of the gain beforehand; 0: known, infinite: free.
    box : (low, high), optional
        Poses, shape (6,), to stay between.
    """
    at = [POSE.index(name) for name in names]
    wide = len(starts), len(model.elements)
    readings, weight = (np.broadcast_to(v, wide) for v in (readings, 1 / np.sqrt(variance)))
    prior = 1 / gain_sigma if gain_sigma > 0 else 0.0
    frees_gain = gain_sigma > 0
    poses, gain = np.array(starts, float), np.zeros(len(starts))

    def residual(poses: Array, gain: Array, of: Array) -> tuple[Array, Array]:
        read = model.readings(poses) * np.exp(gain)[:, None]
        return np.concatenate([(readings[of] - read) * weight[of], -prior * gain[:, None]], axis=1), read

    going = np.ones(len(poses), bool)
    r, read = residual(poses, gain, going)
    chi2, damping = (r**2).sum(axis=1), np.full(len(poses), DAMPING)
    slopes = np.zeros((len(poses), wide[1] + 1, len(at) + frees_gain))
    stale = going.copy()
    for _ in range(most_steps):
        fresh = going & stale
        if fresh.any():
            by_pose = model.by_pose(poses[fresh], names) * np.exp(gain[fresh])[:, None, None]
            slopes[fresh, :-1, : len(at)] = by_pose * weight[fresh][:, :, None]
            if frees_gain:
                slopes[fresh, :-1, -1], slopes[fresh, -1, -1] = read[fresh] * weight[fresh], prior
        j = slopes[going]
        if box is not None:
            # At an end that it is drawn beyond, a coordinate is held: all else is best given that.
            drawn, at_now = np.einsum("sni,sn->si", j, r[going])[:, : len(at)], poses[going][:, at]
            out = (at_now <= box[0][at]) & (drawn < 0) | (at_now >= box[1][at]) & (drawn > 0)
            j[:, :, : len(at)] *= ~out[:, None, :]
        curvature = np.swapaxes(j, 1, 2) @ j
        diagonal = np.maximum(np.einsum("sii->si", curvature), TINY)
        damped = curvature + np.einsum("s,si,ij->sij", damping[going], diagonal, np.eye(diagonal.shape[1]))
        # Scaled to a unit diagonal: coordinates differ by orders of magnitude.
        scale = 1 / np.sqrt(diagonal)
        right = np.einsum("sni,sn->si", j, r[going]) * scale
        step = (
            scale * np.linalg.solve(damped * scale[:, :, None] * scale[:, None, :], right[..., None])[..., 0]
        )
        tried, tried_gain = poses[going].copy(), gain[going].copy()
        tried[:, at] += step[:, : len(at)]
        if frees_gain:
            tried_gain += np.clip(step[:, -1], -LONGEST_GAIN_STEP, LONGEST_GAIN_STEP)
        if box is not None:
            tried = np.clip(tried, *box)
        new_r, new_read = residual(tried, tried_gain, going)
        new = (new_r**2).sum(axis=1)
        index = np.flatnonzero(going)
        better = new < chi2[index]
        gained = chi2[index] - new
        up = index[better]
        poses[up], gain[up] = tried[better], tried_gain[better]
        r[up], read[up], chi2[up] = new_r[better], new_read[better], new[better]
        stale[:] = False
        stale[up] = True
        damping[index] = np.where(better, damping[index] * EASED, damping[index] * STIFFENED)
        ended = (better & (gained < LITTLE * np.maximum(1.0, new))) | (damping[index] > STIFFEST)
        going[index[ended]] = False
        if not going.any():
            break
    return Minima(poses, np.exp(gain), chi2)
