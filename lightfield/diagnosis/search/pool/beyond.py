"""What the best set needs only because another effect of it may not leave its range.

Where an amplitude lies at the end of what is plausible, other effects bend to make up for the rest: they are
needed by the range, not by the readings. Fitted without that end, the set shows which of them it would do
without.
"""

from __future__ import annotations

from dataclasses import replace

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.least_squares import Fit, Whiten
from lightfield.fitting.parameter import FitParameter

#: A range is drawn out by so many times its width; and a set without an effect that gains less of chi-square
#: by it than a gap that parts two sets, in units of the noise, did not ask for it. Chosen.
_FARTHER, _ASKED = 10.0, 6.0


def at_ends(explanation: Explanation, fit: Fit) -> set[str]:
    """Amplitudes, by path, that lie at an end of what is plausible: neither off, nor of what may be none."""
    at, bounded = fit.by_path, FittedSet(explanation, fit).bounded
    return {
        p.path
        for c in explanation
        for p, off in zip(c.amplitudes, c.neutral, strict=True)
        if p.path in bounded and p.end_near(at[p.path]) != off and not p.is_answer(at[p.path])
    }


def without_ends(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whiten
) -> tuple[Explanation, Fit]:
    """The set with wider ranges of what lies at an end, and its fit, from where it lies within them."""
    ends = at_ends(explanation, fit)
    wide = tuple(_drawn_out(c, ends) for c in explanation)
    return wide, problem.fit(wide, whiten, [fit.u])


def needless_beyond(pool: Pool, best: FittedSet, gap: float) -> dict[str, tuple[str, ...]]:
    """Effects of the best set that it would do without, were others not held by their ranges.

    Parameters
    ----------
    best : FittedSet
        As fitted to the end.
    gap : float
        Cost above which a set without an effect is out of the question.

    Returns
    -------
    dict
        By the names of effects: which others would have to leave their ranges.
    """
    ends = at_ends(best.explanation, best.fit)
    if not ends or not pool.affordable(best.explanation):
        return {}
    wide, fit = without_ends(pool.problem, best.explanation, best.fit, pool.ground.test.whiten)
    spare = max(int(pool.problem.keep.sum()) - len(fit.u), 1)
    phi = max(pool.ground.phi, fit.chi2 / spare)
    beyond = tuple(c.name for c in wide if any(p.path in ends for p in c.amplitudes))
    out: dict[str, tuple[str, ...]] = {}
    for own, candidate in zip(best.explanation, wide, strict=True):
        if candidate.name in beyond:
            continue
        without = _chi2_without(pool, wide, candidate, fit)
        cost = (without - fit.chi2) / phi - pool.ground.price(candidate)
        if cost <= gap and _chi2_without(pool, best.explanation, own, best.fit) - without >= _ASKED * phi:
            out[candidate.name] = beyond
    return out


def _chi2_without(pool: Pool, explanation: Explanation, candidate: Candidate, fit: Fit) -> float:
    """Of a set of effects fitted without one of them, from where it lies with it."""
    rest = tuple(c for c in explanation if c is not candidate)
    start = pool.problem.model(rest).at(fit.by_path)
    return pool.problem.fit(rest, pool.ground.test.whiten, [start]).chi2


def _drawn_out(candidate: Candidate, ends: set[str]) -> Candidate:
    """An effect whose amplitudes may leave their ranges where they lie at an end, as far as a scene can."""
    amplitudes = tuple(_farther(p) if p.path in ends else p for p in candidate.amplitudes)
    return replace(candidate, amplitudes=amplitudes)


def _farther(own: FitParameter) -> FitParameter:
    room, (least, most) = _FARTHER * (own.high - own.low), own.limits
    return replace(own, low=max(own.low - room, least), high=min(own.high + room, most))
