"""What the best set needs only because another effect of it may not leave its range.

Where an amplitude lies at the end of what is plausible, other effects bend to make up for the rest: they are
needed by the range, not by the readings. Fitted without that end, the set shows which of them it would do
without.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.pool.fitted_sets import Node, Pool, fitted_at
from lightfield.fitting.parameter import FitParameter

#: A range is drawn out by so many times its width, and what leaves it by less of chi-square than a gap that
#: parts two sets, in units of the noise, did not ask for it. Chosen.
_FARTHER, _ASKED = 10.0, 6.0


def _at_an_end(node: Node) -> set[str]:
    """Amplitudes, by path, that lie at an end of what is plausible; one that is off lies at none."""
    at = fitted_at(node)
    return {
        p.path
        for c in node.explanation
        for p, off in zip(c.amplitudes, c.neutral, strict=True)
        if p.path in node.bounded and at[p.path] != off
    }


def needless_beyond(pool: Pool, best: Node, gap: float) -> dict[str, tuple[str, ...]]:
    """Effects of the best set that it would do without, were others not held by their ranges.

    Parameters
    ----------
    best : Node
        As fitted to the end.
    gap : float
        Cost above which a set without an effect is out of the question.

    Returns
    -------
    dict
        By the names of effects: which others would have to leave their ranges.
    """
    ends = _at_an_end(best)
    if not ends or not pool.affordable(best.explanation):
        return {}
    wide = tuple(_drawn_out(c, ends) for c in best.explanation)
    fit = pool.problem.fit(wide, pool.ground.test.whiten, [best.fit.u])
    if (best.fit.chi2 - fit.chi2) / pool.ground.phi < _ASKED:
        return {}
    spare = max(int(pool.problem.keep.sum()) - len(fit.u), 1)
    phi = max(pool.ground.phi, fit.chi2 / spare)
    beyond = tuple(c.name for c in wide if any(p.path in ends for p in c.amplitudes))
    at = dict(zip(fit.paths, fit.u, strict=True))
    out: dict[str, tuple[str, ...]] = {}
    for candidate in wide:
        rest = tuple(c for c in wide if c is not candidate)
        paths = [p.path for p in pool.problem.model(rest).parameters]
        without = pool.problem.fit(rest, pool.ground.test.whiten, [np.array([at[path] for path in paths])])
        cost = (without.chi2 - fit.chi2) / phi - pool.ground.price(candidate)
        if cost <= gap and candidate.name not in beyond:
            out[candidate.name] = beyond
    return out


def _drawn_out(candidate: Candidate, ends: set[str]) -> Candidate:
    """An effect whose amplitudes may leave their ranges where they lie at an end, as far as a scene can."""
    amplitudes = tuple(_farther(p) if p.path in ends else p for p in candidate.amplitudes)
    return replace(candidate, amplitudes=amplitudes)


def _farther(own: FitParameter) -> FitParameter:
    room, (least, most) = _FARTHER * (own.high - own.low), own.limits
    return replace(own, low=max(own.low - room, least), high=min(own.high + room, most))
