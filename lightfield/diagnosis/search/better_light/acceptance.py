"""What is accepted of a finding once some of its explanations were settled, and what is known of the effects.

All is compared under one noise: what was settled stands in its former place, at the price of the errors of
its own light, and is tested and ranked anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.better_light.settling import Settled
from lightfield.diagnosis.search.cascade import SearchResult, level_for, with_base
from lightfield.diagnosis.search.pool.answer import NAMED_FIRST, named
from lightfield.diagnosis.search.pool.evidence import Weighing, evidence
from lightfield.diagnosis.search.preparation import Prepared, judged
from lightfield.diagnosis.search.profile_likelihood import profiled
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet, bic, scale_of_errors

#: Part of the level down to which an explanation that fails it narrowly may be the right one: the tests scale
#: with noise that was judged beside other light. Chosen.
_NEARLY = 0.1


class _Anew(NamedTuple):
    """A set as it was settled and tested, in its light, and by how much the errors of that light are dearer
    than those of the finding."""

    prepared: Prepared
    tried: ScoredSet
    growth: float


def accepted_of(
    prepared: Prepared, finding: SearchResult, done: list[tuple[ScoredSet, Settled]], rng: np.random.Generator
) -> tuple[Prepared, SearchResult]:
    """What is accepted of a finding at its level, with what was settled in its place."""
    main, alpha = finding.level.bench.whiten, level_for(finding.level)
    anew: list[_Anew] = []
    for tried, one in done:
        whiten, fit, errors = one.whiten, one.fit, tried.errors
        if whiten.tolerance != main.tolerance:
            whiten = Whitener(whiten.noise, whiten.rho, main.phi, main.tolerance)
            fit = one.problem.fit(tried.explanation, whiten, [fit.u])
        there = replace(prepared, problem=one.problem)
        test = judged(there, whiten, rng)
        adequacy = test(fit)
        if adequacy.passes(alpha):
            scale = scale_of_errors(fit, adequacy, test)
            fit, errors = profiled(one.problem, tried.explanation, fit, whiten, scale, False)
            adequacy = test(fit)
        growth = whiten.log_determinant - main.log_determinant
        anew.append(
            _Anew(there, replace(tried, fit=fit, adequacy=adequacy, test=test, errors=errors), growth)
        )
    made = {id(t.explanation): (one.prepared, t) for one, t in zip(anew, _scored(finding, anew), strict=True)}

    def now(every: list[ScoredSet]) -> list[ScoredSet]:
        return [made[id(t.explanation)][1] if id(t.explanation) in made else t for t in every]

    passing = sorted((t for t in now(finding.contenders) if t.accepted(alpha)), key=lambda t: t.bic)
    passing = [t for t in passing if not t.at_edge] or passing
    if not (finding.accepted or finding.beyond_two):  # others were accepted at their price
        fewest = min((len(t.explanation) for t in passing), default=0)
        passing = [t for t in passing if len(t.explanation) == fewest]
    passing = _named_first(passing)
    if passing and not finding.beyond_two:
        passing += _nearly(now(finding.tried), passing[0], alpha)
    size = len(passing[0].explanation) if passing else None
    weights = with_base(passing, finding.level, finding.n) if passing else []
    best = next((p for p, t in made.values() if passing and t is passing[0]), prepared)
    after = replace(finding, size=size, accepted=passing, weights=weights, tried=now(finding.tried))
    return best, _with_evidence(after)


def _nearly(tried: list[ScoredSet], best: ScoredSet, alpha: float) -> list[ScoredSet]:
    """What misses the level narrowly, with no more effects, and costs less than the best that passes.

    A test that one passes by a hair and the other fails by one does not tell them apart.
    """
    near: dict[tuple[str, ...], ScoredSet] = {}
    for one in sorted(tried, key=lambda t: t.bic):
        narrowly = one.adequacy is not None and one.adequacy.passes(_NEARLY * alpha) and not one.at_edge
        no_more = len(one.explanation) <= len(best.explanation) and one.bic < best.bic
        if narrowly and no_more and not one.accepted(alpha):
            near.setdefault(one.names, one)
    return list(near.values())


def _named_first(passing: list[ScoredSet]) -> list[ScoredSet]:
    """Best first, but of sets that are hardly dearer that with fewest curves, as where they were found."""
    near = [t for t in passing if t.bic <= passing[0].bic + NAMED_FIRST]
    first = min(near, key=lambda t: (sum(not named(c) for c in t.explanation), t.bic), default=None)
    return sorted(passing, key=lambda t: t is not first)


def _scored(finding: SearchResult, anew: Sequence[_Anew]) -> list[ScoredSet]:
    """By what sets are ranked beside each other and those of the finding, which were not settled: by one
    variance for all, as others are (what one is judged to leave by chance would count as misfit of it)."""
    if finding.many is not None and finding.beyond_two:
        weighing = Weighing.of(finding.many.pool, finding.many.best)
        costs = [weighing.cost(FittedSet(one.tried.explanation, one.tried.fit)) for one in anew]
    else:
        best = min(anew, key=lambda one: one.tried.fit.chi2 + one.growth)
        assert best.tried.adequacy is not None
        phi, n = best.tried.adequacy.phi, finding.n
        costs = [bic(one.tried.fit, one.tried.explanation, phi, n) for one in anew]
    return [replace(one.tried, bic=cost + one.growth) for one, cost in zip(anew, costs, strict=True)]


def _with_evidence(finding: SearchResult) -> SearchResult:
    """The finding with what is known of the effects of its best set, where that is another one now.

    What no other set does without stays sure while the set that this was found of is accepted too.
    """
    many = finding.many
    if many is None or not (many.sought and finding.accepted):
        return finding
    keys = [frozenset(c.key for c in t.explanation) for t in finding.accepted]
    best = many.pool.nodes.get(keys[0])
    if best is None or (best.key == many.best.key and many.adequate):
        return finding
    stands = many.adequate and many.best.key in keys
    known = {e.candidate.key: e for e in many.evidence} if stands else {}
    own = [known.get(e.candidate.key, e) for e in evidence(many.pool, best, adequate=True)]
    return replace(finding, many=replace(many, evidence=own))
