"""Which pose do readings come from? Least squares from many starts at once.

    chi2 = sum (reading - mu(pose) exp(sum_k u_k d_k(pose)))^2 / variance + sum_k (u_k / sigma_k)^2

u_k is what is not known exactly, the gain and the water, and d_k what it does to the logarithm of a reading,
1 for that of the gain: light fades by an exponential, so that this holds far from what is believed.

Levenberg's and Marquardt's search (Marquardt 1963, J. SIAM 11, 431), all starts side by side: the light of
all of them is asked for in one call.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.studies.follower.array_light import DARK, LAMP_TILTS, MARGIN_M, ArrayModel, Space
from lightfield.studies.follower.frames import POSE, wrapped

#: Damping at the start, and its change after a step that helps or does not (Marquardt 1963).
_DAMPING, _EASED, _STIFFENED = 1e-3, 0.2, 8.0
#: A search ends when a step gains less than this of chi2, in sigma^2, or is as stiff as this.
_LITTLE, _STIFFEST = 1e-6, 1e10
_MOST_STEPS = 60
#: Largest change in one step of the logarithm of the gain, or of what else is not known (chosen).
LONGEST_STEP = 0.5
#: A search of so few steps begins near its end: slopes by the pose in the water that is believed in lead it.
#: Where it ends the readings say (chosen).
FEW_STEPS = 3
#: Least curvature of a coordinate, in the units of `information`: keeps dark starts from dividing by nothing.
_LEAST_CURVATURE = 1e-30
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
    unknown : array, shape (s, k)
        What was sought besides, the gain first.
    """

    poses: Array
    gains: Array
    chi2: Array
    unknown: Array

    def best_first(self) -> Minima:
        """The same in the order of their chi2."""
        order = np.argsort(self.chi2, kind="stable")
        return Minima(self.poses[order], self.gains[order], self.chi2[order], self.unknown[order])


@dataclass(frozen=True)
class Beforehand:
    """What is known of gain, water and lamp before a reading.

    Parameters
    ----------
    names : tuple of str
        The gain first; see `ArrayModel.slopes`.
    mean, root : array, shape (k,) and (k, k), or of every start, (s, k) and (s, k, k)
        root^T root is the inverse of their covariance.
    """

    names: tuple[str, ...]
    mean: Array
    root: Array

    @classmethod
    def of(cls, sigmas: Mapping[str, float]) -> Beforehand:
        """About what is believed, each by itself.

        Not of the lamp's direction: a lamp and a follower that turn about it together read the same, so that
        it is best left where it is believed, and its light is no exponential of how far it turns.
        """
        names = gain_first(name for name in sigmas if name not in LAMP_TILTS)
        root = np.diag(np.array([float(sigmas[name]) for name in names]) ** -1.0)
        return cls(names, np.zeros(len(names)), root)


def gain_first(names: Iterable[str]) -> tuple[str, ...]:
    """Names of what is not known, in the order in which `WithUnknowns` has them."""
    return tuple(sorted(names, key=lambda name: name != "gain"))


@dataclass(frozen=True)
class WithUnknowns:
    """Readings where gain, water or lamp are not as a model believes.

    Parameters
    ----------
    model : ArrayModel
    names : tuple of str
        Coordinates of the pose that are sought, n of them.
    unknowns : tuple of str
        What else is, k of them, the gain first; see `ArrayModel.slopes`.
    """

    model: ArrayModel
    names: tuple[str, ...]
    unknowns: tuple[str, ...]

    @property
    def _gain(self) -> int:
        return int("gain" in self.unknowns)

    def gains(self, unknown: Array) -> Array:
        """Shape (s,), of unknowns of shape (s, k)."""
        return np.asarray(np.exp(unknown[:, : self._gain].sum(axis=1)))

    def read(self, poses: Array, unknown: Array) -> tuple[Array, Array]:
        """Readings, shape (s, n_elements), and slopes of their logarithms, (s, n_elements, k)."""
        believed = self.model.readings(poses)
        by = of_logarithms(self.model.by_nuisances(poses, self.unknowns[self._gain :]), believed)
        by = np.concatenate([np.ones((*believed.shape, self._gain)), by], axis=2)
        return believed * np.exp(np.einsum("snk,sk->sn", by, unknown)), by

    def slopes(self, poses: Array, unknown: Array, read: Array, by: Array, led: bool = False) -> Array:
        """Of the readings by pose and unknowns, shape (s, n_elements, n + k), from what `read` answers.

        Parameters
        ----------
        led : bool
            Those by the pose are wanted to lead a search alone: as they are in what is believed.
        """
        others = self.unknowns[self._gain :]
        believed, far = read * np.exp(-np.einsum("snk,sk->sn", by, unknown)), unknown[:, self._gain :]
        own = of_logarithms(self.model.by_pose(poses, self.names), believed)
        if others and not led:
            bent = np.einsum("snki,sk->sni", self.model.by_both(poses, self.names, others), far)
            along = np.einsum("snk,sk->sn", by[..., self._gain :], far)
            own += of_logarithms(bent, believed) - along[..., None] * own
        return np.asarray(read[..., None] * np.concatenate([own, by], axis=2))


def box_of(space: Space) -> tuple[Array, Array]:
    """Lowest and highest pose, shape (6,) each, that a search may try in a formation space."""
    across = space.half_width_m + MARGIN_M
    turned = [MOST_TURNED, MOST_TURNED, np.pi]
    low = np.array([-across, -across, max(space.near_m - MARGIN_M, 0.5 * space.near_m), *(-np.array(turned))])
    high = np.array([across, across, space.far_m + MARGIN_M, *turned])
    return low, high


def starts_in(
    box: tuple[Array, Array], names: Sequence[str], count: int, seed: int, roll_rad: float = 0.0
) -> Array:
    """Poses spread over a box, what is not sought of them at zero, or the known roll, shape (count, 6)."""
    low, high = box
    sought, known = np.isin(POSE, list(names)), roll_rad * (np.array(POSE) == "roll")
    return np.where(sought, np.random.default_rng(seed).uniform(low, high, (count, len(POSE))), known)


def find_minima(
    model: ArrayModel,
    readings: Array,
    variance: Array,
    names: Sequence[str],
    starts: Array,
    *,
    nuisances: Mapping[str, float] | Beforehand | None = None,
    box: tuple[Array, Array] | None = None,
    most_steps: int = _MOST_STEPS,
) -> Minima:
    """Poses that explain readings, from every start, in their order.

    Parameters
    ----------
    readings, variance : array, shape (n_elements,), or of every start, (s, n_elements)
    names : sequence of str
        Coordinates that are sought.
    starts : array, shape (s, 6), m and rad
    nuisances : mapping of str to float, or Beforehand, optional
        What is sought besides, by its standard deviation beforehand (infinite: free), see
        `ArrayModel.slopes`; or what is known of it.
    box : (low, high), optional
        Poses, shape (6,), to stay between.
    """
    at = [POSE.index(name) for name in names]
    wide = len(starts), len(model.elements)
    readings, weight = (np.broadcast_to(v, wide) for v in (readings, 1 / np.sqrt(variance)))
    beside = nuisances if isinstance(nuisances, Beforehand) else Beforehand.of(nuisances or {})
    light, count = WithUnknowns(model, tuple(names), beside.names), len(beside.names)
    mean = np.broadcast_to(beside.mean, (len(starts), count))
    root = np.broadcast_to(beside.root, (len(starts), count, count))
    poses, unknown = np.array(starts, float), np.array(mean)

    def residual(poses: Array, unknown: Array, of: Array) -> tuple[Array, Array, Array]:
        """Of readings and nuisances; the light, and its logarithm's slopes by the nuisances."""
        read, by = light.read(poses, unknown)
        off = np.einsum("skl,sl->sk", root[of], unknown - mean[of])
        return np.concatenate([(readings[of] - read) * weight[of], -off], axis=1), read, by

    going = np.ones(len(poses), bool)
    r, read, by = residual(poses, unknown, going)
    chi2, damping = (r**2).sum(axis=1), np.full(len(poses), _DAMPING)
    slopes = np.zeros((len(poses), wide[1] + count, len(at) + count))
    slopes[:, wide[1] :, len(at) :] = root
    stale, few = going.copy(), most_steps <= FEW_STEPS
    for _ in range(most_steps):
        fresh = going & stale
        if fresh.any():
            every = light.slopes(poses[fresh], unknown[fresh], read[fresh], by[fresh], led=few)
            slopes[fresh, : wide[1]] = every * weight[fresh][:, :, None]
        j = slopes[going]
        if box is not None:
            # At an end that it is drawn beyond, a coordinate is held: all else is best given that.
            drawn, at_now = np.einsum("sni,sn->si", j, r[going])[:, : len(at)], poses[going][:, at]
            out = (at_now <= box[0][at]) & (drawn < 0) | (at_now >= box[1][at]) & (drawn > 0)
            j[:, :, : len(at)] *= ~out[:, None, :]
        step = _damped_step(j, r[going], damping[going])
        tried = poses[going].copy()
        tried[:, at] += step[:, : len(at)]
        tried[:, POSE.index("roll")] = wrapped(tried[:, POSE.index("roll")])
        tried_unknown = unknown[going] + np.clip(step[:, len(at) :], -LONGEST_STEP, LONGEST_STEP)
        if box is not None:
            tried = np.clip(tried, *box)
        new_r, new_read, new_by = residual(tried, tried_unknown, going)
        new, index = (new_r**2).sum(axis=1), np.flatnonzero(going)
        gained = chi2[index] - new
        better = gained > 0
        up = index[better]
        poses[up], unknown[up] = tried[better], tried_unknown[better]
        r[up], chi2[up] = new_r[better], new[better]
        read[up], by[up] = new_read[better], new_by[better]
        stale[:] = False
        stale[up] = True
        damping[index] *= np.where(better, _EASED, _STIFFENED)
        ended = (better & (gained < _LITTLE * np.maximum(1.0, new))) | (damping[index] > _STIFFEST)
        going[index[ended]] = False
        if not going.any():
            break
    return Minima(poses, light.gains(unknown), chi2, unknown)


def _damped_step(slopes: Array, residual: Array, damping: Array) -> Array:
    """Steps of all starts, shape (s, k), by slopes and residuals, (s, m, k) and (s, m)."""
    curvature = np.swapaxes(slopes, 1, 2) @ slopes
    diagonal = np.maximum(np.einsum("sii->si", curvature), _LEAST_CURVATURE)
    damped = curvature + np.einsum("s,si,ij->sij", damping, diagonal, np.eye(diagonal.shape[1]))
    # Scaled to a unit diagonal: coordinates differ by orders of magnitude.
    scale = 1 / np.sqrt(diagonal)
    right = np.einsum("sni,sn->si", slopes, residual) * scale
    solved = np.linalg.solve(damped * scale[:, :, None] * scale[:, None, :], right[..., None])
    return np.asarray(scale * solved[..., 0])


def of_logarithms(slopes: Array, readings: Array) -> Array:
    """Derivatives, (s, n, ...), of the logarithms of readings, (s, n); zero where an element is dark."""
    lit = readings > DARK * readings.max(axis=1, keepdims=True)
    readings, lit = (v.reshape(*v.shape, *[1] * (slopes.ndim - 2)) for v in (readings, lit))
    return np.divide(slopes, readings, out=np.zeros_like(slopes), where=lit)
