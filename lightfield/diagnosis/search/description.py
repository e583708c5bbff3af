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
from lightfield.diagnosis.search.small_sets import Fitted, Tried, fit_pairs, fit_singles
from lightfield.fitting.least_squares import Fit

#: Effects that describe the readings worse than the best one by this factor in chi-square will not do.
FAR_FROM_BEST = 4.0
#: A description by effects is used when it lowers the sum of squares by this factor.
_WORTH = 1.1
#: A model misses the readings when the nominal p of one of its tests is below this. Chosen: below what some
#: 25 tests make by chance in one table of a hundred; the description is not yet a finding.
_MISSED = 1e-4
#: Pairs are sought beside so many of the best single effects.
_SINGLES = 4


@dataclass(frozen=True)
class Description:
    """One or two effects that bring the model to the readings, if the base is not there.

    Parameters
    ----------
    known : tuple of (explanation, fit)
        All fits that were made.
    to_trace_per_m : float, optional
        Water whose diffuse light must be traced to say more.
    """

    explanation: Explanation
    fit: Fit
    known: tuple[Fitted, ...] = ()
    to_trace_per_m: float | None = None


def _judged(problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener) -> tuple[Whitener, Fit]:
    """A single effect under its own errors; of many readings by a sample."""
    some, there, own = on_sample(problem, explanation, fit, whiten)
    diffuse = explanation[0].effect.diffuse
    return from_valleys(some, explanation, there, own) if diffuse else (own, there)


def describe(
    problem: Problem, whiten: Whitener, base: Fit, errors_stated: bool, known_before: Sequence[Fitted]
) -> Description:
    """Description of readings that the base model was fitted to.

    Parameters
    ----------
    whiten : Whitener
        By the errors of the readings alone.
    known_before : sequence of (explanation, fit)
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
    known.sort(key=lambda s: s[1].chi2)
    ranked = [Tried(e, f, f.chi2) for e, f in known]
    # Light of few photons has large errors: which effect is the best shows only under its own.
    near = [(e, f) for e, f in known if f.chi2 < FAR_FROM_BEST * known[0][1].chi2]
    judged = [_judged(problem, e, f, whiten) for e, f in near]
    i = min(range(len(near)), key=lambda k: objective(judged[k]))
    best, (own, fit) = near[i], judged[i]
    missing = problem.forward.light.to_trace([fit.values])
    poor = misses(test, best[1])
    if poor and best[0][0].effect.diffuse:  # for its few photons? Of many readings a sample tells.
        some = problem if problem.sample is None else problem.sample[1]
        poor = misses(test_under(some, own), fit)
    if poor:
        # When dense water is the best so far, the question is only whether a pair in clear water does better.
        first = ranked[: 1 if missing else _SINGLES]
        pairs = fit_pairs(problem, test, base, at_base, first, thorough=not missing)
        best = min([best, *pairs], key=lambda p: p[1].chi2 / chdtri(n - len(p[1].u), 0.5))
        some, there, own = on_sample(problem, *best, whiten)
        asked = problem.forward.light.to_trace([under_own_errors(some, best[0], there, own)[1].values])
        missing = asked and (missing or asked)  # what one effect asks for is known better
        known += pairs
    known[: len(near)] = [(e, f) for (e, _), (_, f) in zip(near, judged, strict=True)]
    explanation, fit = best if best[1].chi2 * _WORTH < base.chi2 else ((), base)
    return Description(explanation, fit, tuple(known), missing)
