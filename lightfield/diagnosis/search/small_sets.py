"""Search of the smallest sets of effects beside which nothing is missing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.score_tests import Adequacy, AdequacyTest, Score
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.followed import can_follow, scatters
from lightfield.diagnosis.search.linear_pairs import linear_pairs
from lightfield.diagnosis.search.own_errors import on_sample
from lightfield.diagnosis.search.profile_likelihood import LOWER, ROUGH_STEPS, lowest, profiled, restarted
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet, bic
from lightfield.fitting.least_squares import Fit

#: Explanations worse than the best by more than this in BIC are out of the question: their weight is 4e-6.
#: Kass and Raftery (1995, doi:10.1080/01621459.1995.10476572) call 10 "very strong".
FAR_BEHIND = 25.0
#: How many pairs are begun, of those that look best at the base model and beside a single effect, of so many
#: single effects; how many explanations are tested, and how many singles however far behind. Chosen: time
#: against thoroughness.
_PAIRS_FROM_BASE, _PAIRS_FROM_SINGLES, _SINGLES_EXTENDED, _TESTED, SINGLES_TESTED = 8, 16, 7, 14, 3
#: Steps after which a pair shows what it is worth, anew and when it was fitted before under other errors; how
#: many are then fitted to the end, and how many when that will do. Chosen: time against thoroughness; on half
#: and twice of the first no answer hangs (test_cascade.py).
_ROUGH, _FEW, _FINISHED, _QUICK = 5, 2, 14, 3
#: So many of the explanations by diffuse light are refitted under errors of their own. Chosen: time alone.
_REFITTED = 8
#: So many of the best pairs are begun again at other shapes; of so many answers the shapes are profiled.
#: Chosen: time against thoroughness.
_RESTARTED, _PROFILED = 5, 3
#: Part of its range within which a score may start an amplitude, alone and in a pair, where it is surer; off
#: a one-sided zero, where nothing has a slope, by half of the typical size if within a tenth of it. Chosen.
_ALONE, _IN_A_PAIR, _NEAR_ZERO, _OFF_ZERO = 0.3, 0.5, 0.1, 0.5
#: Of the grid of a shape so many are fitted to the end. Chosen: time against thoroughness.
_SHAPES_FINISHED = 2


def clipped(candidate: Candidate, amplitudes: Array, part: float) -> list[float]:
    """Amplitudes from a score, kept within a part of the bounds and off a one-sided zero."""
    out = []
    for parameter, typical, amplitude in zip(
        candidate.amplitudes, candidate.typical, amplitudes, strict=True
    ):
        low = parameter.start + part * (parameter.low - parameter.start)
        high = parameter.start + part * (parameter.high - parameter.start)
        value = float(np.clip(parameter.start + amplitude, low, high))
        if parameter.start <= parameter.low and value <= parameter.low + _NEAR_ZERO * typical:
            value = parameter.low + _OFF_ZERO * typical
        out.append(value)
    return out


def _start(
    base: Array, scores: Iterable[tuple[Score, Array]], order: Explanation, part: float = _ALONE
) -> Array:
    by_key = {score.key: (score, amplitude) for score, amplitude in scores}
    pieces = [base]
    for candidate in order:
        score, amplitude = by_key[candidate.key]
        pieces.append(np.array([*clipped(candidate, amplitude, part), *score.template.shape]))
    return np.concatenate(pieces)


class UnderOwnErrors(Protocol):
    """Judges explanations by diffuse light under the errors of their own response."""

    def promise(self, fit: Fit) -> float:
        """Chi-square and growth of the log determinant where the fit lies now."""

    def hopeless(self, fit: Fit, best: Fit) -> bool:
        """Do many readings put it far behind the best fit even with its own errors, as a sample shows?"""

    def refit(self, explanation: Explanation, fit: Fit) -> tuple[AdequacyTest, Fit, float]:
        """Test, fit, and growth of the log determinant."""


def _key(explanation: Explanation) -> frozenset[tuple[str, str]]:
    return frozenset(c.key for c in explanation)


def _determined(problem: Problem, explanation: Explanation) -> bool:
    """Are there at least as many readings as parameters?"""
    return problem.keep.sum() >= len(problem.base) + sum(len(c.parameters) for c in explanation)


def fit_singles(
    problem: Problem, test: AdequacyTest, base: Fit, at_base: Adequacy, known: Sequence[FittedSet] = ()
) -> list[FittedSet]:
    """Every testable form added alone, from the score's start at each shape and from a typical size.

    Parameters
    ----------
    known : sequence of FittedSet
        Fits under other errors, to begin from instead.
    """
    before = {one.key: one.fit.u for one in known}
    starts: dict[tuple[str, str], list[Array]] = {}
    forms: dict[tuple[str, str], Candidate] = {}
    for score, amplitude in zip(at_base.scores, at_base.amplitudes, strict=True):
        candidate = score.template.candidate
        if not score.testable or not _determined(problem, (candidate,)):
            continue
        forms[candidate.key] = candidate
        first = starts.setdefault(candidate.key, [])
        first.append(_start(base.u, [(score, amplitude)], (candidate,)))
    begun: list[tuple[Explanation, list[Array]]] = []
    for key, candidate in forms.items():
        chosen = starts[key]
        if (done := before.get(_key((candidate,)))) is not None:
            chosen = [done]
        elif len(chosen) > 1:
            # A few steps from every grid point of the shape, then all the way from the best.
            rough = [problem.rough((candidate,), test.whiten, s, max_steps=ROUGH_STEPS) for s in chosen]
            best = sorted(rough, key=lambda f: f.chi2)[:_SHAPES_FINISHED]
            chosen = [f.u for f in best]
        else:
            chosen = [*chosen, problem.default_start(base.u, (candidate,))]
        begun.append(((candidate,), chosen))
    fits = problem.fit_all(begun, test.whiten)
    return [FittedSet(explanation, fit) for (explanation, _), fit in zip(begun, fits, strict=True)]


def _extensions(
    problem: Problem, single: ScoredSet, test: AdequacyTest
) -> list[tuple[float, Explanation, Array]]:
    """Pairs that contain a fitted single effect, with the chi-square the score promises."""
    known = single.adequacy
    scores, amplitudes = (known.scores, known.amplitudes) if known else test.score(single.fit)
    found: dict[tuple[str, str], tuple[float, Explanation, Array]] = {}
    (held,) = single.explanation
    for score, amplitude in zip(scores, amplitudes, strict=True):
        candidate = score.template.candidate
        if not score.testable or not candidate.effect.combines_with(held.effect):
            continue
        if candidate.one_sided and amplitude[0] <= 0:
            continue
        if not _determined(problem, (held, candidate)):
            continue
        gain = float(np.linalg.norm(score.direction.T @ single.fit.residual) ** 2)
        pair = (held, candidate)
        start = _start(single.fit.u, [(score, amplitude)], (candidate,), part=_IN_A_PAIR)
        promise = single.fit.chi2 - gain
        if candidate.key not in found or promise < found[candidate.key][0]:
            found[candidate.key] = (promise, pair, start)
    return list(found.values())


def _pairs_at_base(problem: Problem, base: Fit, at: Adequacy) -> list[tuple[float, Explanation, Array]]:
    """All pairs, the best first, with the chi-square that they promise."""
    found: list[tuple[float, Explanation, Array]] = []
    for gain, pair in linear_pairs([score for score in at.scores if score.testable], base.residual):
        both = tuple(score.template.candidate for score, _ in pair)
        if _determined(problem, both):
            found.append((base.chi2 - gain, both, _start(base.u, pair, both, part=_IN_A_PAIR)))
    return found


def _tested(tried: list[ScoredSet], at_least: int) -> list[ScoredSet]:
    """Tests in the order of BIC until the rest is far behind."""
    ranked = sorted(tried, key=lambda t: t.bic)
    out = []
    for i, one in enumerate(ranked):
        near = one.bic - ranked[0].bic < FAR_BEHIND or i < at_least
        tested = near and i < _TESTED and one.test is not None
        out.append(replace(one, adequacy=one.test(one.fit)) if tested and one.test else one)
    return out


def _ranked(
    problem: Problem, test: AdequacyTest, fits: list[FittedSet], own: UnderOwnErrors
) -> list[ScoredSet]:
    """Fits with BIC, those by diffuse light under their own errors; one variance scale for all."""
    lowest = min((one.fit for one in fits), key=lambda f: f.chi2)
    diffuse = [one for one in fits if one.is_diffuse and not own.hopeless(one.fit, lowest)]
    if len(diffuse) > _REFITTED:
        diffuse = sorted(diffuse, key=lambda one: own.promise(one.fit))[:_REFITTED]
    made: list[tuple[Explanation, Fit, AdequacyTest, float]] = []
    for one in fits:
        if any(one is other for other in diffuse):
            mine, refit, growth = own.refit(one.explanation, one.fit)
            made.append((one.explanation, refit, mine, growth))
        else:
            made.append((one.explanation, one.fit, test, 0.0))
    best = min(made, key=lambda m: m[1].chi2 + m[3])
    n, phi = int(problem.keep.sum()), best[2](best[1]).phi
    return [ScoredSet(e, f, bic(f, e, phi, n) + growth, None, mine) for e, f, mine, growth in made]


def searched(
    problem: Problem, test: AdequacyTest, fits: list[FittedSet], own: UnderOwnErrors, at_least: int = 1
) -> list[ScoredSet]:
    """Sets of effects, best first, the near ones tested, and so many however far behind."""
    return _tested(_ranked(problem, test, fits, own), at_least) if fits else []


def fit_pairs(
    problem: Problem,
    test: AdequacyTest,
    base: Fit,
    at_base: Adequacy,
    singles: list[ScoredSet],
    known: Sequence[FittedSet] = (),
    thorough: bool = True,
) -> list[FittedSet]:
    """Promising pairs, refitted: extensions of the best singles, and the best linear pairs at the base.

    Parameters
    ----------
    known : sequence of FittedSet
        Fits under other errors, to begin from instead.
    thorough : bool
        False: only those that are the best at first sight are fitted to the end, from one place each.
    """
    extended: list[tuple[float, Explanation, Array]] = []
    for single in singles[:_SINGLES_EXTENDED]:
        extended += _extensions(problem, single, single.test or test)
    chosen: dict[frozenset[tuple[str, str]], list[tuple[Explanation, Array]]] = {}
    for ranked, limit in (
        (sorted(extended, key=lambda c: c[0]), _PAIRS_FROM_SINGLES),
        (_pairs_at_base(problem, base, at_base), _PAIRS_FROM_BASE),
    ):
        new = 0
        for _, pair, start in ranked:
            key = _key(pair)
            if key not in chosen:
                if new == limit:
                    continue
                new += 1
            if len(chosen.setdefault(key, [])) < 2:
                chosen[key].append((pair, start))
    before = {one.key: (one.explanation, one.fit.u) for one in known}
    begun: list[FittedSet] = []
    for key, starts in chosen.items():
        steps, starts = (_FEW, [before[key]]) if key in before else (_ROUGH, starts)
        rough = [FittedSet(pair, problem.rough(pair, test.whiten, u, max_steps=steps)) for pair, u in starts]
        begun.append(min(rough, key=lambda one: one.fit.chi2))
    begun.sort(key=lambda one: one.fit.chi2)
    most = _FINISHED if thorough else _QUICK
    ends = problem.fit_all([(one.explanation, [one.fit.u]) for one in begun[:most]], test.whiten)
    finished = [FittedSet(one.explanation, fit) for one, fit in zip(begun, ends, strict=False)]
    finished.sort(key=lambda one: one.fit.chi2)
    for i, one in enumerate(finished[: _RESTARTED if thorough else 0]):
        if one.key not in before:
            again = restarted(problem, one.explanation, one.fit, test.whiten)
            finished[i] = FittedSet(one.explanation, again)
    return finished


def accepted(tried: list[ScoredSet], alpha: float) -> list[ScoredSet]:
    """Accepted explanations, best first; of several forms of the same effects only the best.

    Explanations with an amplitude at a bound count only when there is no other.
    """
    out: dict[tuple[str, ...], ScoredSet] = {}
    for one in sorted(tried, key=lambda t: t.bic):
        if one.accepted(alpha):
            out.setdefault(one.names, one)
    inside = [one for one in out.values() if not one.at_edge]
    return inside or list(out.values())


def at_lowest_minima(problem: Problem, found: list[ScoredSet]) -> list[ScoredSet]:
    """Accepted explanations at the lowest minimum over their shapes, the first ones with profiled errors.

    Of many readings the minima of what scatters are told apart by a sample: its light is traced anew where
    the fit lies, and its errors are profiled there.
    """
    out = []
    for i, one in enumerate(found):
        if i < _PROFILED and one.test is not None and one.adequacy is not None:
            phi, whiten = one.scale, one.test.whiten
            followed = problem.sample is not None and can_follow(problem) and scatters(problem, one.fit)
            if followed and isinstance(whiten, Whitener):
                fit, errors = _lowest_of_sample(problem, one, whiten, phi), one.errors
            else:
                fit, errors = profiled(problem, one.explanation, one.fit, whiten, phi)
            gain = (one.fit.chi2 - fit.chi2) / phi
            tested = one.test(fit) if gain > 0 else one.adequacy
            one = replace(one, fit=fit, errors=errors, bic=one.bic - gain, adequacy=tested)
        out.append(one)
    return sorted(out, key=lambda t: t.bic)


def _lowest_of_sample(problem: Problem, one: ScoredSet, whiten: Whitener, phi: float) -> Fit:
    """The fit, or a better one where a sample has a lower minimum over the shapes."""
    some, there, own = on_sample(problem, one.explanation, one.fit, whiten)
    other = lowest(some, one.explanation, there, own)
    if other is there:
        return one.fit
    every = problem.fit(one.explanation, whiten, [other.u])
    return every if every.chi2 < one.fit.chi2 - LOWER * phi else one.fit
