"""Readings without their gross outliers, judged by the errors that they state."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.robust import outliers, rich_basis, scattered
from lightfield.diagnosis.adequacy.subspace import orthonormal
from lightfield.diagnosis.adequacy.templates import bank, whitened_unknowns
from lightfield.diagnosis.problem.noise import WHITENED_WHOLE, Budget, Noise
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.quoted import errors_stated, smooth_stderr
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.fitting.least_squares import Fit

#: Rounds of leaving out outliers and fitting anew. Chosen.
_OUTLIER_ROUNDS = 3
#: What lies within so many standard errors of a fit that was made without it is no outlier. Chosen: of 175
#: readings one lies farther by chance in four tables of ten.
_MET = 3.0
#: Stays of fewer readings, in the mean of those of several, have gains that are next to these readings' own
#: errors: a wild one hides behind its stay's. Chosen.
_IN_A_STAY = 4


class Kept(NamedTuple):
    """Readings without outliers, and the basis beside which they were judged, where that is the fit's.

    `place` is the error by the places that are stated to be off, a part of what the readings are whitened by;
    none where no errors are stated.
    """

    problem: Problem
    whiten: Whitener
    fit: Fit
    budget: Budget
    place: Array
    basis: Array | None = None

    @property
    def rich(self) -> Array:
        if self.basis is None:
            return beside_stays(self.problem, self.whiten, self.fit, self.budget)
        return self.basis


def rich_of(problem: Problem, whiten: Whitener, fit: Fit, with_time: bool = True) -> Array:
    unknowns = whitened_unknowns(problem, whiten, rich=True)
    return rich_basis(fit, bank(problem, fit, whiten), unknowns, with_time)


def beside_stays(
    problem: Problem, whiten: Whitener, fit: Fit, budget: Budget, with_time: bool = True
) -> Array:
    """The basis of the rich model and of the gains that stays are stated to have, shape (n, k): beside it the
    readings' own errors are judged."""
    rich, layout = rich_of(problem, whiten, fit, with_time), problem.layout
    if not budget.gain_stated or layout.size > WHITENED_WHOLE:
        return rich
    noise = replace(whiten.noise, layout=layout, prediction=fit.prediction, budget=budget)
    stay, gain = noise.stays
    labels, count = np.unique(stay[stay >= 0], return_counts=True)
    labels, count = labels[count > 1], count[count > 1]
    if not len(labels) or count.mean() < _IN_A_STAY:
        return rich
    return orthonormal(np.hstack([rich, whiten((problem.keep * gain)[:, None] * (stay[:, None] == labels))]))


def plain_of(problem: Problem, quoted: Array, prediction: Array, more: Array | float = 0.0) -> Whitener:
    """Whitening by the smoothed quoted errors, and more of one's own, alone."""
    layout, zero = problem.layout, np.zeros(problem.layout.size)
    sigma = smooth_stderr(quoted, np.clip(prediction, 0, None), layout.channel)
    return Whitener(Noise(layout, np.hypot(sigma, more), prediction, Budget(0.0, 0.0, 0.0), zero).alone)


def without_outliers(
    problem: Problem,
    quoted: Array,
    explanation: Explanation,
    fit: Fit,
    usable: Array,
    by_effects: bool,
    budget: Budget,
    more: Array | float = 0.0,
) -> Kept:
    problem = replace(problem, keep=usable)
    place = np.zeros_like(usable, float)
    if errors_stated(quoted):  # else all errors are told by the scatter
        place = budget.position_m * budget.position_slope(problem.forward, fit.values)
    more = np.hypot(more, place)
    whiten = plain_of(problem, quoted, fit.prediction, more)
    fit = problem.fit(explanation, whiten, [fit.u])
    basis = None
    for _ in range(_OUTLIER_ROUNDS):
        basis = beside_stays(problem, whiten, fit, budget) if by_effects else orthonormal(fit.jacobian)
        bad = outliers(fit.residual, basis, problem.keep)
        if not bad.any():
            break
        every = (usable > 0) & ((problem.keep == 0) | bad)
        left_out = scattered(every, problem.value - fit.prediction, problem.layout)
        problem = replace(problem, keep=usable * ~left_out)
        fit = problem.fit(explanation, whiten, [fit.u])
        whiten, basis = plain_of(problem, quoted, fit.prediction, more), None
    # A rich model that slips lead astray misses their neighbours too: what the fit itself meets is no slip.
    met = (usable > 0) & (problem.keep == 0)
    if met.any():
        met &= np.abs(problem.value - fit.prediction) < _MET * whiten.noise.sigma
    if met.any():
        problem, basis = replace(problem, keep=np.where(met, usable, problem.keep)), None
        fit = problem.fit(explanation, whiten, [fit.u])
    return Kept(problem, whiten, fit, budget, place, basis if by_effects else None)


def beside_base(problem: Problem, quoted: Array, by_effects: bool, budget: Budget) -> Kept:
    """Outliers judged beside the base model, and what effects would make of it (`by_effects`) or alone."""
    first = plain_of(problem, quoted, np.clip(problem.value, 0, None))
    base = problem.fit((), first, [problem.model().start])
    return without_outliers(problem, quoted, (), base, problem.keep, by_effects, budget)
