"""What the readings are like, before any test: the base model, or what one or two effects describe them best.

Not yet a finding. It says where the readings lie without their noise, and in what water the diffuse light
must be traced to say more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from lightfield.diagnosis.adequacy.score_tests import AdequacyTest
from lightfield.diagnosis.adequacy.templates import whitened_unknowns
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.own_errors import from_valleys, objective, on_sample, under_own_errors
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet
from lightfield.diagnosis.search.small_sets import fit_pairs, fit_singles
from lightfield.fitting.least_squares import Fit

#: Effects that describe the readings worse than the best one by this factor in chi-square will not do, even
#: by light of few photons. Chosen; with half and twice campaigns in scattering water have the same verdicts.
_FAR_FROM_BEST = 4.0
#: A description by effects is used when it lowers the sum of squares by this factor. Chosen: by chance one of
#: 25 effects does so in one table in 16 of 100 readings; with a tenth or a fifth of it that are half and
#: twice as large ten campaigns have the same verdicts.
_WORTH = 1.1
#: A model misses the readings when the nominal p of one of its tests is below this. Chosen: below what some
#: 25 tests make by chance in one table of a hundred; the description is not yet a finding.
_MISSED = 1e-4
#: Pairs are sought beside so many of the best singles. Chosen: time; half and twice alike in ten campaigns.
_SINGLES = 4


@dataclass(frozen=True)
class Description:
    """One or two effects that bring the model to the readings, if the base is not there.

    Parameters
    ----------
    known : tuple of FittedSet
        All fits that were made.
    to_trace_per_m : float, optional
        Water whose diffuse light must be traced to say more.
    """

    explanation: Explanation
    fit: Fit
    known: tuple[FittedSet, ...] = ()
    to_trace_per_m: float | None = None


def _judged(problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener) -> tuple[Whitener, Fit]:
    """A single effect under its own errors; of many readings by a sample."""
    some, there, own = on_sample(problem, explanation, fit, whiten)
    diffuse = explanation[0].effect.diffuse
    return from_valleys(some, explanation, there, own) if diffuse else (own, there)


def describe(
    problem: Problem, whiten: Whitener, base: Fit, errors_stated: bool, known_before: Sequence[FittedSet]
) -> Description:
    """Description of readings that the base model was fitted to.

    Parameters
    ----------
    whiten : Whitener
        By the errors of the readings alone.
    known_before : sequence of FittedSet
        Fits to begin from.
    """
    n = int(problem.keep.sum())
    few = np.random.default_rng(0).standard_normal((problem.layout.size, 2))

    def test_under(problem: Problem, whiten: Whitener) -> AdequacyTest:
        noise = few[: problem.layout.size]
        return AdequacyTest(problem, whiten, whitened_unknowns(problem, whiten), lambda: noise, errors_stated)

    def misses(test: AdequacyTest, fit: Fit) -> bool:
        return min(test(fit).tests.values()) < _MISSED

    test = test_under(problem, whiten)
    at_base = test(base)
    if min(at_base.tests.values()) > _MISSED:
        return Description((), base)
    known = fit_singles(problem, test, base, at_base, known_before)
    if not known:
        return Description((), base)
    known.sort(key=lambda one: one.fit.chi2)
    ranked = [ScoredSet(one.explanation, one.fit, one.fit.chi2) for one in known]
    # Light of few photons has large errors: which effect is the best shows only under its own.
    near = [one for one in known if one.fit.chi2 < _FAR_FROM_BEST * known[0].fit.chi2]
    judged = [_judged(problem, one.explanation, one.fit, whiten) for one in near]
    i = min(range(len(near)), key=lambda k: objective(judged[k]))
    best, (own, fit) = near[i], judged[i]
    missing = problem.forward.light.to_trace([fit.values])
    poor = misses(test, best.fit)
    if poor and best.is_diffuse:  # for its few photons? Of many readings a sample tells.
        some = problem if problem.sample is None else problem.sample[1]
        poor = misses(test_under(some, own), fit)
    if poor:
        # When dense water is the best so far, the question is only whether a pair in clear water does better.
        first = ranked[: 1 if missing else _SINGLES]
        pairs = fit_pairs(problem, test, base, at_base, first, thorough=not missing)
        best = min([best, *pairs], key=lambda one: one.fit.chi2 / chdtri(n - len(one.fit.u), 0.5))
        some, there, own = on_sample(problem, best.explanation, best.fit, whiten)
        own_fit = under_own_errors(some, best.explanation, there, own)[1]
        asked = problem.forward.light.to_trace([own_fit.values])
        missing = asked and (missing or asked)  # what one effect asks for is known better
        known += pairs
    known[: len(near)] = [FittedSet(one.explanation, f) for one, (_, f) in zip(near, judged, strict=True)]
    used = best if best.fit.chi2 * _WORTH < base.chi2 else FittedSet((), base)
    return Description(used.explanation, used.fit, tuple(known), missing)
