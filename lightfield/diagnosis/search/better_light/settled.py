"""The last fits of explanations by scattered light, with light that is followed without photons.

A search compares many explanations by one trace, which is reweighed to each. Its noise is frozen into the
light and its derivatives, and where the problem is ill-conditioned, as scattering is beside width and
absorption, it moves fits by many of their errors. So what the search ends with is fitted once more with light
that is known without photons, times a smooth ratio traced at the very water and lamp that was found; again
there, until nothing moves (`settling`). The ratio's error is one of the readings, and so of what is fitted.
Noise and outliers, judged beside the light of the search, are judged again beside the better one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.problem.candidates import go_together
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.better_light.acceptance import accepted_of
from lightfield.diagnosis.search.better_light.settling import Judge, Settled, settle
from lightfield.diagnosis.search.cascade import SearchResult, far_beyond, level_at
from lightfield.diagnosis.search.followed import can_follow, scatters
from lightfield.diagnosis.search.own_errors import under_own_errors, with_response_error
from lightfield.diagnosis.search.pool.answer import named
from lightfield.diagnosis.search.pool.any_number import Data
from lightfield.diagnosis.search.pool.evidence import GAP, Weighing
from lightfield.diagnosis.search.pool.fitted_sets import begin_at
from lightfield.diagnosis.search.preparation import Prepared, judged, prepare_about
from lightfield.diagnosis.search.profile_likelihood import restarted
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet
from lightfield.fitting.least_squares import Fit

#: So many explanations are settled. Chosen.
_SETTLED = 3
#: Where nothing was accepted, so many that came nearest are settled. Chosen: time alone.
_TRIED_ANEW = 1
#: The effect by which clear water scatters, and the gap in cost below which it is tried in place of another.
#: Chosen: settled it cost 21 less, once, than the search had known, and 46 less another time.
_IN_PLACE, _WITHIN = "scattering", 60.0


def settled(
    data: Data,
    prepared: Prepared,
    finding: SearchResult,
    rng: np.random.Generator,
    alpha: float = ALPHA,
    progress: Callable[[str], None] = lambda stage: None,
    seed: int = 0,
) -> tuple[Prepared, SearchResult]:
    """What was found, with explanations by scattered light settled, or, where nothing is missing, the base
    model of a scene that scatters; all as it was where there are none.

    Parameters
    ----------
    data : Data
        With every usable reading.
    alpha : float
        Level of the test of the base model.
    seed : int
        Of the traces.

    Returns
    -------
    Prepared
        With the light of the best explanation, and noise and outliers as judged beside better light.
    SearchResult
        Explanations that do not pass with the better light are accepted no longer, unless what is missing is
        within the tolerance; of what nothing explained, such that do are.
    """
    problem = prepared.problem
    if not can_follow(problem):
        return prepared, finding
    judge = _judge(data, finding)
    if finding.size == 0:
        return _base(prepared, finding, rng, alpha, progress, seed, judge)
    finding = _with_scattering_instead(prepared, finding, seed)
    most = _SETTLED if finding.accepted else _TRIED_ANEW
    chosen = [t for t in finding.contenders if t.test is not None and scatters(problem, t.fit)][:most]
    if not chosen:
        return prepared, finding
    if finding.size in (2, None) and not finding.beyond_two:
        simpler = _simpler(problem, chosen[0])
        finding = replace(finding, accepted=[*finding.accepted, *simpler], tried=[*finding.tried, *simpler])
        chosen += simpler
    done: list[tuple[ScoredSet, Settled]] = []
    for tried in chosen:
        progress(f"the scattered light of {' and '.join(tried.names)}")
        assert tried.test is not None and isinstance(tried.test.whiten, Whitener)
        anew = bool(done) and judge is not None
        whiten = finding.level.bench.whiten if anew else tried.test.whiten
        one = settle(problem, tried.explanation, tried.fit, whiten, seed, None if anew else judge)
        done.append((tried, one))
        if tried.test is not finding.level.bench.test:
            tried.test.whiten.forget()  # of its own errors, which are others now
        if one.noise is not None:
            prepared, finding = _judged_anew(one.noise, finding, rng)
            problem = replace(problem, keep=prepared.problem.keep)
    if judge is not None:
        done += _others(prepared, finding, chosen)
    found = accepted_of(prepared, finding, done, rng)
    tolerance = prepared.noise.budget.tolerance
    if found[1].size is not None or not finding.accepted or finding.level.tolerance >= tolerance:
        return found
    known = [level for level in finding.levels if level.tolerance == tolerance]
    tolerant = known[0] if known else level_at(prepared, tolerance, rng)
    levels = finding.levels if known else [*finding.levels, tolerant]
    within = replace(finding, level=tolerant, levels=levels)
    if tolerant.adequacy.passes(alpha):
        return prepared, replace(within, size=0, accepted=[], weights=[])
    return accepted_of(prepared, within, done, rng)


def is_nearly_explained(prepared: Prepared, finding: SearchResult) -> bool:
    """Do one or two effects by scattered light miss the readings by no more than its trace may be wrong?

    Settled they may explain them. Before more effects are sought: of many readings those would describe what
    the search's light has wrong.
    """
    problem = prepared.problem
    near = [t for t in finding.contenders if t.test is not None and scatters(problem, t.fit)][:_TRIED_ANEW]
    return can_follow(problem) and any(not far_beyond(problem, finding.level, t.fit) for t in near)


def _judge(data: Data, finding: SearchResult) -> Judge | None:
    """How noise and outliers are judged beside better light; None where that brings nothing.

    Beside any number of effects they were judged in light that is followed: in two tables with three and four
    0.819 and 0.861 times the stated variance, judged again 0.817 and 0.863. Of many readings the same: 10,125
    at b = 0.1 per m have 1.006, judged again, for 2 s of 21, 1.013; 3120 at b = 0.7, with errors of 2.5 %,
    0.991 and 0.996.
    """
    if finding.beyond_two or data.problem.sample is not None:
        return None

    def judge(problem: Problem, explanation: Explanation, fit: Fit) -> Prepared:
        every = replace(problem, keep=data.problem.keep)
        return prepare_about(every, data.quoted, data.budget, explanation, fit)

    return judge


def _judged_anew(
    noise: Prepared, finding: SearchResult, rng: np.random.Generator
) -> tuple[Prepared, SearchResult]:
    """A finding whose base model is judged under another noise, beside the errors of its own light."""
    own = with_response_error(noise.problem, noise.noise, finding.level.base)
    prepared = replace(noise, noise=own)
    levels = [level_at(prepared, level.tolerance, rng) for level in finding.levels]
    level = levels[finding.levels.index(finding.level)]
    return prepared, replace(finding, level=level, levels=levels, n=int(prepared.problem.keep.sum()))


def _others(
    prepared: Prepared, finding: SearchResult, chosen: list[ScoredSet]
) -> list[tuple[ScoredSet, Settled]]:
    """What was tested but not settled, under the noise that was judged anew: all is compared under one."""
    problem, known = prepared.problem, {id(t.explanation) for t in chosen}
    out = []
    for tried in (*finding.accepted, *finding.tried):
        if tried.adequacy is not None and id(tried.explanation) not in known:
            known.add(id(tried.explanation))
            found = under_own_errors(problem, tried.explanation, tried.fit, finding.level.bench.whiten)
            out.append((tried, Settled(problem, *found)))
    return out


def _base(
    prepared: Prepared,
    finding: SearchResult,
    rng: np.random.Generator,
    alpha: float,
    progress: Callable[[str], None],
    seed: int,
    judge: Judge | None,
) -> tuple[Prepared, SearchResult]:
    """The base model of a scene that scatters as it states, where nothing is missing.

    Its width and absorption, and what the readings say of the stated scattering, rest on the same light.
    Where it passes no more, the search with the trace of its own has the last word.
    """
    level = finding.level
    if not scatters(prepared.problem, level.base):
        return prepared, finding
    progress("the scattered light of the scene")
    one = settle(prepared.problem, (), level.base, level.bench.whiten, seed, judge)
    about, found = (prepared, finding) if one.noise is None else _judged_anew(one.noise, finding, rng)
    there, level = replace(about, problem=one.problem), found.level
    test = judged(there, one.whiten, rng)
    adequacy = test(one.fit)
    if not adequacy.passes(alpha):
        return prepared, finding
    now = replace(
        level, bench=replace(level.bench, whiten=one.whiten, test=test), base=one.fit, adequacy=adequacy
    )
    levels = [now if other is level else other for other in found.levels]
    return there, replace(found, level=now, levels=levels)


def _with_scattering_instead(prepared: Prepared, finding: SearchResult, seed: int) -> SearchResult:
    """The finding, where no effect is certain in whose place scattering does as well once it is settled; and
    the set with scattering that costs less than the answer, if there is one.

    A search that ends without scattering has compared sets with it by a trace of other water, by which they
    may cost tens more. Of the answer what is claimed is tried: scattering may do for the rest as well.
    """
    many, problem, best = finding.many, prepared.problem, finding.best
    if many is None or best is None or scatters(problem, best.fit) or problem.sample is not None:
        return finding
    node, whiten, pool = many.pool.nodes.get(many.best.key), finding.whiten, many.pool
    more = next((c for c in pool.problem.candidates if c.name == _IN_PLACE), None)
    same = node is not None and node.key == frozenset(c.key for c in best.explanation)
    if node is None or more is None or not same or not isinstance(whiten, Whitener):
        return finding
    weighing, known = Weighing.of(pool, node), list(many.evidence)
    claimed, cheaper = [e.candidate for e in known if e.is_claimed], list[FittedSet]()
    for k, one in enumerate(known):
        kept = [c for c in claimed if c is not one.candidate]
        is_near = one.level == Certainty.CERTAIN and named(one.candidate) and one.gap_named < _WITHIN
        if not (is_near and go_together((*kept, more))):
            continue
        rival = pool.finished(pool.fit((*kept, more), [begin_at(node)]))
        if not scatters(problem, rival.fit):
            continue  # clear water: the set less the effect, which the search knows
        new = settle(problem, rival.explanation, rival.fit, whiten, seed)
        fit = restarted(new.problem, rival.explanation, new.fit, new.whiten)
        growth = new.whiten.log_determinant - whiten.log_determinant
        there = FittedSet(rival.explanation, replace(fit, chi2=fit.chi2 + growth))
        known[k] = one.against(weighing, there)
        if weighing.above(there) < -GAP:
            cheaper.append(there)
    least = min(cheaper, key=weighing.above, default=None)
    return replace(finding, many=replace(many, evidence=known), cheaper=least)


def _simpler(problem: Problem, pair: ScoredSet) -> list[ScoredSet]:
    """The one of two effects that scatters, by itself: the other may describe what the trace of the search
    has wrong."""
    out: list[ScoredSet] = []
    if len(pair.explanation) < 2:
        return out
    for alone in pair.explanation:
        kept = {*(p.path for p in problem.base), *(p.path for p in alone.parameters)}
        start = np.array([u for path, u in zip(pair.fit.paths, pair.fit.u, strict=True) if path in kept])
        assert pair.test is not None
        fit = problem.fit((alone,), pair.test.whiten, [start])
        if scatters(problem, fit):
            out.append(ScoredSet((alone,), fit, np.inf, None, pair.test))
    return out[:1]
