"""Fits by scattered light with light that is followed without photons, times a smooth ratio that is traced
where a fit lies; again there, until nothing moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.decompositions import eigen
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.followed import PHOTONS, ratio_at, scatters, with_light
from lightfield.diagnosis.search.own_errors import on_sample, under_own_errors
from lightfield.diagnosis.search.preparation import Prepared, whitening
from lightfield.diagnosis.search.profile_likelihood import restarted
from lightfield.fitting.least_squares import LOOSE, Fit
from lightfield.render.diffuse.ratio import Ratio
from lightfield.scene import Scene

#: Traces of an explanation at most. Chosen: most take two or three.
_ROUNDS = 4
#: Photons of one trace at most. Chosen: as `diagnose.MOST_FRESH_PHOTONS`.
_MOST_PHOTONS = 1.2e7
#: A fit is settled when no parameter will move by this part of its error, and photons widen no error by this
#: one. Of a move the next is some so much at most: 0.02 to 0.2 of moves by 2.8 to 33 errors, in the waters of
#: benchmarks/scattering_fits, with what the photons' noise moves.
_MOVED, _WIDENED, _NEXT = 0.2, 0.2, 0.2
#: Better light that moves a fit by more than so many errors may move its valleys: other shapes are tried.
#: Chosen; on half and twice no test of settled light hangs.
_FAR = 3.0
#: Traces are pooled that were made within so many errors of where the fit has come to. Chosen; on half and
#: twice no test of settled light hangs.
_NEAR = 1.5
#: Traces of a ratio have seeds of their own, so many of each diagnosis. Chosen: no trace has another's.
_SEED, _OF_EACH = 7000, 100
#: Part of what the readings say of the photons' noise that is taken to be theirs at most: the widening
#: divides by what is left. Derived: shared errors are known but for a part (`noise._LEFT_OUT_OF_MANY`).
_ALL_PHOTONS = 1 - 1e-4


@dataclass(frozen=True)
class Settled:
    """An explanation fitted with light traced where it lies; the noise, where that was judged there too."""

    problem: Problem
    whiten: Whitener
    fit: Fit
    noise: Prepared | None = None


#: Noise and outliers beside a fit in its own light.
Judge = Callable[[Problem, Explanation, Fit], Prepared]
#: Where a fit lay, and what was traced there; a trace where a fit lies, of so many photons, with its number.
_Trace = tuple[Array, Scene, Ratio]
_Tracer = Callable[[Fit, float, int], _Trace]


def settle(
    problem: Problem,
    explanation: Explanation,
    fit: Fit,
    whiten: Whitener,
    seed: int = 0,
    judge: Judge | None = None,
) -> Settled:
    """Trace where a fit lies, fit again, until it moves no more; of many readings where a sample leads, and
    from there to all of them.

    Parameters
    ----------
    problem : Problem
        That can be followed (`following.can_follow`), as what was fitted can (`following.scatters`).
    seed : int
        Of the traces.
    judge : callable, optional
        Judges noise and outliers beside every fit on the way; by default they are as in `whiten`. Not of many
        readings.
    """
    light = problem.forward.light

    def trace(at: Fit, photons: float, number: int) -> _Trace:
        return at.u, *ratio_at(light, at.values, photons, _SEED + _OF_EACH * seed + number)

    traced = [trace(fit, PHOTONS, 0)]
    problem = _in_light(problem, traced)  # of whose nodes a sample has the light too
    some, there, own = on_sample(problem, explanation, fit, whiten)
    many = some is not problem
    begun = Settled(some, own, there)
    now, traced = _until_still(begun, explanation, trace, traced, PHOTONS, of_many=many, judge=judge)
    if many:
        every = _in_light(problem, traced)
        there = every.fit(explanation, whiten, [now.fit.u], max_steps=0)
        photons = traced[-1][2].photons
        begun = Settled(every, whiten, there)
        now, _ = _until_still(begun, explanation, trace, traced, photons, _ROUNDS, many)
    return now


def _in_light(problem: Problem, traced: list[_Trace]) -> Problem:
    return with_light(problem, [(scene, ratio) for _, scene, ratio in traced])


def _until_still(
    now: Settled,
    explanation: Explanation,
    trace: _Tracer,
    traced: list[_Trace],
    photons: float,
    first: int = 0,
    of_many: bool = False,
    judge: Judge | None = None,
) -> tuple[Settled, list[_Trace]]:
    """The same of the readings of a problem, from what was traced before."""
    for k in range(_ROUNDS):
        if k > 0:
            new = trace(now.fit, photons, first + k)
            traced = [t for t in traced if now.fit.away_from(t[0]) < _NEAR] + [new]
        own = _in_light(now.problem, traced)
        before = now.fit.u
        # Many readings are fitted from where a sample has led, and that leads on: errors are known nearly.
        rounds = 1 if of_many and (k > 0 or first > 0) else 2
        whiten, fit = under_own_errors(own, explanation, now.fit, now.whiten, rounds)
        if k == 0 and fit.away_from(before) > _FAR:
            fit = restarted(own, explanation, fit, whiten)
            whiten, fit = under_own_errors(own, explanation, fit, whiten, rounds=1)
        now = Settled(own, whiten, fit)
        if judge is not None:
            now = _under_its_noise(now, explanation, judge)
        own, fit = now.problem, now.fit
        widened = _widened(now)
        if _NEXT * fit.away_from(before) < _MOVED and widened < _WIDENED:
            break
        if not scatters(own, fit):
            break  # clear water has no light to trace
        photons = _enough(sum(ratio.photons for _, _, ratio in traced), widened, photons)
    return now, traced


def _under_its_noise(now: Settled, explanation: Explanation, judge: Judge) -> Settled:
    noise = judge(now.problem, explanation, now.fit)
    begun = whitening(noise, now.whiten.tolerance)
    whiten, fit = under_own_errors(noise.problem, explanation, now.fit, begun, rounds=1)
    return Settled(noise.problem, whiten, fit, noise)


def _enough(traced: float, widened: float, last: float) -> float:
    """Photons of the next trace: alone they would widen no error too much, and at least as many as the last.

    So many have widened an error so much; its variance has a part that falls as 1 / photons.
    """
    wanted = traced * ((1 + widened) ** 2 - 1) / ((1 + _WIDENED) ** 2 - 1)
    return min(max(wanted, last), _MOST_PHOTONS)


def _widened(now: Settled) -> float:
    """By which part the photons' noise widens the errors of a fit, at most.

    Without it the covariance C is C - P P^T, whose inverse is that of C and, whitened by C, one matrix as
    small as P has columns, or readings (Woodbury 1950).
    """
    slopes, modes = now.fit.jacobian, now.whiten.noise.photon_modes
    norm = np.linalg.norm(slopes, axis=0)
    with_photons = np.diag(now.fit.covariance())
    free = (norm > 0) & np.isfinite(with_photons)
    unit = slopes[:, free] / norm[free]
    information = unit.T @ unit
    if modes is not None and modes.size:
        white = now.whiten(modes)
        if white.shape[1] < len(white):
            known, directions = eigen(white.T @ white)
            seen = directions.T @ (white.T @ unit)
        else:  # more photons' modes than readings: the same from the other side
            known, directions = eigen(white @ white.T)
            seen = np.sqrt(np.maximum(known, 0.0))[:, None] * (directions.T @ unit)
        information += seen.T @ (seen / (1 - np.minimum(known, _ALL_PHOTONS))[:, None])
    without = np.diag(np.linalg.pinv(information, rcond=LOOSE, hermitian=True)) / norm[free] ** 2
    return float(np.max(np.sqrt(with_photons[free] / without) - 1, initial=0.0))
