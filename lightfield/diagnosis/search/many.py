"""Where no one or two effects explain the readings, any number of them; and how sure every effect is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.score_tests import Adequacy, AdequacyTest
from lightfield.diagnosis.problem.problem import MANY
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.cascade import Level, SearchResult, level_for, with_base
from lightfield.diagnosis.search.pool.answer import NAMED_FIRST
from lightfield.diagnosis.search.pool.any_number import (
    FAR,
    Data,
    Ends,
    Many,
    ground_about,
    never,
    search_many,
)
from lightfield.diagnosis.search.pool.evidence import Weighing, evidence
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.pool.rivals import seek_rivals
from lightfield.diagnosis.search.preparation import Bench, Prepared
from lightfield.diagnosis.search.search_progress import Progress
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet, SetKey, weights

#: Accepted sets that are tested and told, and sets that came near them. Chosen: words and time alone.
_ACCEPTED, _NEAR = 8, 12
#: Sets whose chi-square differs by less, in units of the noise, fit as well. Chosen: one standard error.
_AS_GOOD = 1.0


def beyond_two(
    data: Data,
    prepared: Prepared,
    finding: SearchResult,
    alpha: float,
    seed: int,
    progress: Progress,
    ends: Ends = never,
) -> tuple[Prepared, SearchResult]:
    """What any number of effects explain, and noise and outliers as judged about them.

    Parameters
    ----------
    finding : SearchResult
        That no one or two effects explain the readings, or none that is believed.
    seed : int
        Of the bootstrap.
    ends : callable
        Does the search end with its first sets? Of many readings it is not asked.
    """
    many = search_many(data, prepared, alpha, np.random.default_rng(seed), progress, ends)
    bench, base = many.bench, many.pool.nodes[frozenset()].fit
    level = Level(many.tolerance, bench, base, bench.test(base))
    weighing = Weighing.of(many.pool, many.best)
    best = replace(_tried(weighing, many.best, bench), adequacy=many.adequacy)
    near = sorted(many.pool.nodes.values(), key=weighing.cost)[:_NEAR]
    others = (_tried(weighing, n, bench) for n in near if n is not many.best and n.explanation)
    kept = int(many.prepared.problem.keep.sum())
    found = replace(
        finding, level=level, levels=[*finding.levels, level], tried=[best, *others], n=kept, many=many,
        size=None, accepted=[], weights=[],
    )  # fmt: skip
    if not (many.adequate and many.best.explanation):
        return many.prepared, found
    accepted = [best, *_family(many, weighing, alpha)]
    return many.prepared, replace(
        found, size=len(many.best.explanation), accepted=accepted, weights=weights(accepted)
    )


def _tried(weighing: Weighing, node: FittedSet, bench: Bench) -> ScoredSet:
    return ScoredSet(node.explanation, node.fit, weighing.cost(node), None, bench.test)


def _family(many: Many, weighing: Weighing, alpha: float) -> list[ScoredSet]:
    """Other sets that are accepted beside the best, best first."""
    out: dict[SetKey, ScoredSet] = {}

    def passes(node: FittedSet) -> bool:
        tested = replace(_tried(weighing, node, many.bench), adequacy=many.bench.test(node.fit))
        out[node.key] = tested
        return tested.accepted(alpha)

    return [out[node.key] for node in weighing.family(passes)[1 : _ACCEPTED + 1]]


def misses_by_far(tolerance: float) -> Ends:
    """A search ends whose best first set misses the readings by far more than noise and tolerance."""

    def ends(prepared: Prepared, pool: Pool, known: FittedSet, found: FittedSet) -> bool:
        made, ground = ground_about(prepared, tolerance, np.random.default_rng(0), found)
        problem = prepared.problem
        residual = made.whiten(problem.keep * (problem.value - found.fit.prediction))
        return float(residual @ residual) > FAR * ground.phi * (problem.keep.sum() - len(found.fit.u))

    return ends


def leaves(part: float) -> Ends:
    """A search ends whose best first set leaves more than a part of what is left beside what was known."""

    def ends(prepared: Prepared, pool: Pool, known: FittedSet, found: FittedSet) -> bool:
        kept = float(prepared.problem.keep.sum())
        now, before = (node.fit.chi2 / (kept - len(node.fit.u)) for node in (found, known))
        return now > part * before

    return ends


def in_pool(finding: SearchResult) -> FittedSet | None:
    """The best set in its pool; None where none was sought, and of many readings, where fits take long."""
    many, best = finding.many, finding.best
    if many is None or best is None or many.pool.problem.layout.size > MANY:
        return None
    node = many.pool.nodes.get(many.best.key)
    return node if node is not None and {c.key for c in best.explanation} == node.key else None


def levelled(data: Data, prepared: Prepared, finding: SearchResult) -> SearchResult:
    """A finding of one or two effects with how sure each of them is.

    Sets that hold none of them are sought as for any number of effects, on the ground on which the finding
    was judged.
    """
    best = finding.best
    if best is None or finding.many is not None or best.test is None or best.adequacy is None:
        return finding
    problem = replace(data.problem, keep=prepared.problem.keep)
    test, adequacy = best.test.on(problem), best.adequacy
    if problem.sample is not None and isinstance(test.whiten, Whitener):
        rows, problem = problem.sample
        test = AdequacyTest(problem, test.whiten.of(rows), {}, _never_tested, test.errors_stated)
    pool = Pool(Ground(test, adequacy.phi, adequacy.nu))
    own = {c.key: c for c in problem.candidates}
    explanation = tuple(own.get(c.key, c) for c in best.explanation)
    if not all(c in problem.candidates for c in explanation):
        return finding
    start = Begin(best.fit.by_path)
    pool.finished(pool.fit((), [start]))
    node = pool.finished(pool.fit(explanation, [start]))
    for other in finding.accepted[1:]:
        pool.fit(other.explanation, [Begin(other.fit.by_path)])
    for candidate in node.explanation:
        seek_rivals(pool, node, candidate)
    node = pool.nodes[node.key]
    found = evidence(pool, node, adequate=True)
    level = finding.level
    many = Many(prepared, level.bench, level.tolerance, pool, node, adequacy, True, found, sought=False)
    finding = replace(finding, many=many)
    return finding if data.problem.sample is not None else _beside(finding, pool, node, best.test)


def is_overtaken(finding: SearchResult) -> bool:
    """Do one or two effects pass the test, though a set among their rivals costs less by more than names are
    worth? Most often a curve, which is not sought where a name passes."""
    many = finding.many
    if many is None or many.sought or finding.best is None:
        return False
    return Weighing.of(many.pool, many.best).above(many.pool.best()) < -NAMED_FIRST


def _never_tested() -> Array:
    raise AssertionError("a sample ranks, and tests nothing")


def _beside(finding: SearchResult, pool: Pool, best: FittedSet, test: AdequacyTest) -> SearchResult:
    """The finding with other named sets that pass the test and cost little more; and with those of as many
    effects that fit as well, whatever the test says of the rest.

    A test by the least of many probabilities may pass one of two sets that are alike, and fail the other by
    little: that parts nothing.
    """
    known = [frozenset(t.names) for t in finding.accepted]
    weighing, alpha = Weighing.of(pool, best), level_for(finding.level)
    limit = best.fit.chi2 + _AS_GOOD * pool.ground.phi
    tested: dict[SetKey, Adequacy] = {}

    def is_one(node: FittedSet) -> bool:
        if _has_curve(node) or any(names <= node.names for names in known):
            return False
        tested[node.key] = test(node.fit)
        alike = len(node.names) == len(best.names) and len(node.fit.u) <= len(best.fit.u)
        return tested[node.key].passes(alpha) or (alike and node.fit.chi2 <= limit)

    more = weighing.family(is_one)[1 : _ACCEPTED + 1]
    if not more:
        return finding
    first = finding.accepted[0]
    others = [
        ScoredSet(n.explanation, n.fit, first.bic + weighing.above(n), tested[n.key], test) for n in more
    ]
    accepted = [*finding.accepted, *others]  # what passes the test comes first
    return replace(finding, accepted=accepted, weights=with_base(accepted, finding.level, finding.n))


def _has_curve(node: FittedSet) -> bool:
    return any(c.effect.is_free_form for c in node.explanation)
