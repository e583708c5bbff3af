"""Where to measure next so that two explanations part (T-optimal design, Atkinson and Fedorov 1975,
doi:10.1093/biomet/62.1.57; linear in the rival's parameters)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.search.told_apart import SAME_CLASS_SIGMA, separation
from lightfield.diagnosis.verdict.next_measurement import Asks, NextMeasurement
from lightfield.diagnosis.verdict.parts import PlaceToRead
from lightfield.fitting.curves import PLANES
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit, Whiten
from lightfield.readings.columns import LINE_DECIMALS
from lightfield.scene import Tank

#: Part of the photons that the trace at possible places is worth. Chosen: time against precision.
ROUGH = 0.25
#: Relative error that no number of repeats at one place will beat. Chosen: about what a stay at a distance
#: repeats to (`setup.PLANE_GAIN_PERCENT`), where nothing is stated (`in_stays`).
FLOOR = 0.0025
#: Spots that are advised, and readings at each. Chosen.
_SPOTS, REPEATS = 3, 4
#: Two spots closer than this part of the largest distance are one. Chosen.
_APART = 0.04
#: Possible places: how many across on a line, and in a plane, and along; from and to which part of the
#: distances that were read; how far to the sides at least, as a part of the largest distance; and up and
#: down, as a part of that. Chosen.
_ACROSS, _IN_PLANE, _ALONG, _NEAREST, _FARTHEST, _LEAST_ACROSS, _UP = 17, 9, 12, 0.6, 1.15, 0.1, 0.6
#: Within a tank: parts of its half width and of its length, and metres from floor and top. Chosen.
_WITHIN_SIDES, _WITHIN_END, _FROM_FLOOR_M = 0.97, 0.98, 0.03
#: Added to the diagonal of an information matrix, relative and alone, so that it can be solved. Derived:
#: rounding of doubles, with room.
_RIDGE, _RIDGE_ALONE = 1e-9, 1e-12


@dataclass(frozen=True)
class PossiblePlaces:
    """Possible readings, each an array of shape (n,), and of several bands the wavelength of that which they
    are of."""

    x_m: Array
    y_m: Array
    z_m: Array
    air: Array
    at_nm: float | None = None


@dataclass(frozen=True)
class Advice:
    """Best places for extra readings, and the separation before and after, in sigma."""

    places: PossiblePlaces
    repeats: int
    now_sigma: float
    predicted_sigma: float


def possible_places(problem: Problem, tank: Tank | None) -> PossiblePlaces:
    """A grid over both sides of the axis, somewhat beyond the present layout, inside the tank if any.

    Where the lamp is too close to floor or top for that, the places that were read.
    """
    lay = problem.layout
    least = _LEAST_ACROSS * float(lay.z_m.max())
    across = max(float(np.abs(lay.x_m).max()), float(np.abs(lay.y_m).max()), least)
    x, y = np.linspace(-across, across, _ACROSS), np.array([0.0])
    if lay.varies("y_m"):
        x, y = np.linspace(-across, across, _IN_PLANE), _UP * across * np.array([-1.0, 0.0, 1.0])
    z = np.linspace(_NEAREST * float(lay.z_m.min()), _FARTHEST * float(lay.z_m.max()), _ALONG)
    media = np.unique(lay.air.astype(float))
    gx, gy, gz, air = (a.ravel() for a in np.meshgrid(x, y, z, media, indexing="ij"))
    inside = np.ones(len(gx), bool)
    if tank is not None:
        (_, side), (floor, top), (_, end) = tank.box_m
        inside = (np.abs(gx) < _WITHIN_SIDES * side) & (gz < _WITHIN_END * end)
        inside &= (gy > floor + _FROM_FLOOR_M) & (gy < top - _FROM_FLOOR_M)
    if not inside.any():
        read = np.unique(np.stack([lay.x_m, lay.y_m, lay.z_m, lay.air], axis=1), axis=0)
        rx, ry, rz, dry = read[:: 1 + len(read) // len(gx)].T
        return PossiblePlaces(rx, ry, rz, dry, _judged_nm(problem))
    return PossiblePlaces(gx[inside], gy[inside], gz[inside], air[inside], _judged_nm(problem))


def _judged_nm(problem: Problem) -> float | None:
    """Of several bands that of the first reading, as `SceneForward.at` has it."""
    if problem.layout.one_channel:
        return None
    return float(problem.forward.readings.wavelength_nm[0])


@dataclass(frozen=True)
class Way:
    """One explanation is true and another is fitted: what readings at n possible places would show.

    Parameters
    ----------
    now : float
        Squared separation with the readings at hand.
    difference : array, shape (n,)
        Between the readings under the truth and their nearest imitation, in errors of the mean of the
        repeats.
    slopes : array, shape (n, n_parameters)
        Of the imitation in its parameters, in the same unit.
    information : array, shape (n_parameters, n_parameters)
        What the readings at hand say about them.
    """

    now: float
    difference: Array
    slopes: Array
    information: Array

    @property
    def gains(self) -> Array:
        """Growth of the squared separation by readings at each place, shape (n,)."""
        leverage = np.einsum("ij,ij->i", self.slopes, np.linalg.solve(self.information, self.slopes.T).T)
        return np.asarray(self.difference**2 / (1 + leverage))

    def taken(self, i: int) -> Way:
        """The same once the readings at place i are taken, to which the imitation gives way."""
        slope = self.slopes[i]
        moved = np.linalg.solve(self.information, slope)
        moved *= self.difference[i] / (1 + slope @ moved)
        return Way(
            self.now + float(self.gains[i]),
            self.difference - self.slopes @ moved,
            self.slopes,
            self.information + np.outer(slope, slope),
        )


def error_of_mean(noise: Array, prediction: Array, own: Array) -> Array:
    """Standard error of the mean of the repeats at a place.

    Parameters
    ----------
    noise : array, shape (n,)
        Of one reading.
    prediction, own : array, shape (n,)
        Reading, and the error of what it is compared with: no number of repeats beats that.
    """
    return np.asarray(np.sqrt(noise**2 / REPEATS + (FLOOR * prediction) ** 2 + own**2))


def best_places(ways: Sequence[Way], places: PossiblePlaces) -> Advice:
    """Up to three spots, chosen one after the other, that best part two explanations whichever is true."""
    now = float(np.sqrt(min(way.now for way in ways)))
    chosen: list[int] = []
    for _ in range(_SPOTS):
        worst = np.min([way.now + way.gains for way in ways], axis=0)
        for i in chosen:
            away = (places.x_m - places.x_m[i]) ** 2 + (places.y_m - places.y_m[i]) ** 2
            away += (places.z_m - places.z_m[i]) ** 2
            worst[away < (_APART * places.z_m.max()) ** 2] = 0.0
        if chosen and worst.max() <= 0:
            break
        chosen.append(int(worst.argmax()))
        ways = [way.taken(chosen[-1]) for way in ways]
    index = np.array(chosen)
    spots = PossiblePlaces(
        places.x_m[index], places.y_m[index], places.z_m[index], places.air[index], places.at_nm
    )
    return Advice(spots, REPEATS, now, float(np.sqrt(min(way.now for way in ways))))


def _way(
    problem: Problem,
    whiten: Whiten,
    truth: Fit,
    rival: ScoredSet,
    there: SceneForward,
    sigma: Callable[[Array], Array],
    stays: tuple[Budget, PossiblePlaces],
    phi: float,
) -> Way:
    away = separation(problem, whiten, truth, rival, phi)
    imitation = away.fit
    under_truth = there.predict(truth.values)
    under_rival = there.predict(imitation.values)
    # What both explanations share of the response's error is one error, not two.
    own = np.maximum(*(own_error(there, values) for values in (truth.values, imitation.values)))
    own = np.hypot(own, of_place(stays[0], there, truth.values))
    slopes = replace(imitation.model, forward=there).jacobian(imitation.u, under_rival)
    information = imitation.jacobian.T @ imitation.jacobian
    information += np.diag(_RIDGE * np.diag(information) + _RIDGE_ALONE)
    # The truth is known to its own errors only; where they move it, the imitation follows.
    follows = np.linalg.solve(information, imitation.jacobian.T @ truth.jacobian)
    moves = replace(truth.model, forward=there).jacobian(truth.u, under_truth) - slopes @ follows
    known = np.nan_to_num(truth.covariance(phi))
    own = np.sqrt(own**2 + np.einsum("ij,jk,ik->i", moves, known, moves).clip(0))
    error = error_of_mean(sigma(under_truth), under_truth, own)
    difference = (under_truth - under_rival) / error
    if any(path.startswith(PLANES) for path in (*truth.paths, *imitation.paths)):
        # A distance that was not read has a gain of its own: what is read there tells nothing of the others.
        mine, other = (np.round(z, LINE_DECIMALS) for z in (there.readings.z_m, problem.layout.z_m))
        read = np.isin(mine, other)
        difference = np.where(read, difference, 0.0)
    way = Way(away.separation_sigma**2, difference, slopes / error[:, None], information / phi)
    return in_stays(way, *stays, under_truth / error)


def own_error(there: SceneForward, values: Mapping[str, float]) -> Array:
    """Error that scattered and reflected light will give to readings once they are taken, shape (n,).

    Parameters
    ----------
    there : SceneForward
        Traced with a part `ROUGH` of the photons; readings that were taken are traced with all.
    """
    modes, smooth = there.errors(values)
    return np.asarray(np.hypot(np.sqrt(ROUGH) * np.linalg.norm(modes, axis=1), smooth))


def of_place(budget: Budget, there: SceneForward, values: Mapping[str, float]) -> Array:
    """Error of the readings at each place by where the stage stands, which repeats share, shape (n,)."""
    return np.asarray(budget.position_m * budget.position_slope(there, values))


def in_stays(way: Way, budget: Budget, places: PossiblePlaces, relative: Array) -> Way:
    """The same where readings at one distance share the gain of a stay, if the budget states its error.

    Parameters
    ----------
    relative : array, shape (n,)
        Reading at each place over its error.
    """
    if not (budget.gain_stated and budget.plane_gain > 0):
        return way
    at = np.stack([places.z_m, places.air], axis=1)
    stay = np.unique(at, axis=0, return_inverse=True)[1].ravel()
    of_each = (stay[:, None] == np.arange(stay.max() + 1)) * (budget.plane_gain * relative)[:, None]
    known = np.pad(way.information, (0, of_each.shape[1]))
    known[len(way.information) :, len(way.information) :] = np.eye(of_each.shape[1])
    return replace(way, slopes=np.hstack([way.slopes, of_each]), information=known)


def where_next(
    prepared: Prepared, finding: SearchResult, forward: SceneForward, one: ScoredSet, two: ScoredSet
) -> NextMeasurement:
    """Where to measure next so that two explanations part; another kind of measurement where no place helps.

    Parameters
    ----------
    forward : SceneForward
        Of the readings; it predicts others, too.
    """
    problem, level = prepared.problem, finding.level
    places = possible_places(problem, forward.scene.tank)
    last = float(np.nanmax(problem.layout.time_s)) if problem.layout.has_time else np.nan
    n = len(places.x_m)
    there = forward.at(
        ROUGH,
        x_m=places.x_m,
        y_m=places.y_m,
        z_m=places.z_m,
        medium=np.where(places.air > 0, "air", "water"),
        time_s=np.full(n, last),
    )
    sigma = error_curve(prepared.noise, level.bench.phi * level.phi)
    pairs = ((one, two), (two, one))
    stays = prepared.noise.budget, places
    ways = [_way(problem, finding.whiten, a.fit, b, there, sigma, stays, level.phi) for a, b in pairs]
    best = best_places(ways, places)
    readings = [
        PlaceToRead(
            x_m=float(x), y_m=float(y), z_m=float(z), medium="air" if a else "water", repeats=best.repeats
        )
        for x, y, z, a in zip(best.places.x_m, best.places.y_m, best.places.z_m, best.places.air, strict=True)
    ]
    alike = best.predicted_sigma < SAME_CLASS_SIGMA
    in_one = [
        c.effect
        for a, b in pairs
        for c in a.explanation
        if c.name not in b.names and not any(c.name in other.effect.kind_of for other in b.explanation)
    ]  # what a curve of the other is there with is in both
    return NextMeasurement(
        asks=Asks.OTHER_KIND if alike else Asks.PART,
        between=[list(one.names), list(two.names)],
        readings=[] if alike else readings,
        wavelength_nm=None if alike else places.at_nm,
        time_s=last if np.isfinite(last) else None,
        separation_now_sigma=best.now_sigma,
        separation_predicted_sigma=best.predicted_sigma,
        laboratory={effect.name: effect.laboratory for effect in in_one} if alike else {},
    )


def error_curve(noise: Noise, scale: float) -> Callable[[Array], Array]:
    """Standard error of a reading from its prediction, interpolated over the readings at hand.

    Parameters
    ----------
    scale : float
        Variance over the stated one, of what is its own.
    """
    order = np.argsort(noise.prediction)
    # Bands share a part of it, and every repeat has its own.
    level, common = noise.prediction[order], (noise.layout.common * noise.prediction)[order]
    sigma = np.hypot(np.sqrt(scale) * noise.sigma[order], common)

    def curve(prediction: Array) -> Array:
        # Beyond the brightest reading the error is taken to grow in proportion.
        beyond = np.maximum(prediction / level[-1], 1.0)
        return np.asarray(np.interp(prediction, level, sigma) * beyond)

    return curve
