"""The last fits of explanations by scattered light, with light that is followed without photons.

A search compares many explanations by one trace, which is reweighed to each. Its noise is frozen into the
light and its derivatives, and where the problem is ill-conditioned, as scattering is beside width and
absorption, it moves fits by many of their errors. So what the search ends with is fitted once more with light
that is known without photons, times a smooth ratio traced at the very water and lamp that was found; again
there, until nothing moves. The ratio's error is one of the readings, and so of what is fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.score_tests import ALPHA
from lightfield.diagnosis.problem.noise import Whitener
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.search.cascade import Finding, level_at, level_for, with_base
from lightfield.diagnosis.search.following import PHOTONS, can_follow, ratio_at, scatters, with_light
from lightfield.diagnosis.search.own_errors import on_sample, under_own_errors
from lightfield.diagnosis.search.pool.evidence import GAP, Weighing, evidence
from lightfield.diagnosis.search.pool.nodes import Node, begin_at
from lightfield.diagnosis.search.pool.search import named
from lightfield.diagnosis.search.preparation import Prepared, judged
from lightfield.diagnosis.search.profile import profiled, restarted
from lightfield.diagnosis.search.search import Tried, bic
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.light_source import LightSource
from lightfield.render.diffuse.ratio import Ratio
from lightfield.scene import Scene

#: So many explanations are settled, with so many traces each. Chosen: most take two or three.
_SETTLED, _ROUNDS = 3, 4
#: Where nothing was accepted, so many that came nearest are given another chance.
_TRIED_ANEW = 1
#: By what factor photons grow from one trace to the next, and where the ratio's own noise widens an error; no
#: trace has more.
_MORE, _MANY_MORE, _MOST_PHOTONS = 2.0, 3.0, 1.2e7
#: A fit is settled when no parameter will move by this part of its error, and photons widen no error by this
#: one. Of a move the next is some so much at most: 0.02 to 0.2 of moves by 2.8 to 33 errors, in the waters of
#: benchmarks/scattering_fits, with what the photons' noise moves.
_MOVED, _WIDENED, _NEXT = 0.2, 0.2, 0.2
#: Better light that moves a fit by more than so many errors may move its valleys: other shapes are tried.
_FAR = 3.0
#: Traces are pooled that were made within so many errors of where the fit has come to.
_NEAR = 1.5
#: Traces of a ratio have seeds of their own, so many of each diagnosis.
_SEED, _OF_EACH = 7000, 100
#: Part of what the readings say of the photons' noise that is taken to be theirs at most: the widening
#: divides by what is left, and what many readings share is known but for a part (`noise._LEFT_OUT_OF_MANY`).
_ALL_PHOTONS = 1 - 1e-4
#: The effect by which clear water scatters, and the gap in cost below which it is tried in place of another.
#: Chosen: settled it cost 21 less, once, than the search had known.
_SCATTERING, _WITHIN = "scattering", 30.0
#: Combinations of parameters with a smaller part of the information are left out of errors, as in `Fit`.
_SINGULAR = 1e-12


@dataclass(frozen=True)
class Settled:
    """An explanation fitted with light traced where it lies."""

    problem: Problem
    whiten: Whitener
    fit: Fit


#: Where a fit lay, and what was traced there.
_Trace = tuple[Array, Scene, Ratio]


def settled(
    prepared: Prepared,
    finding: Finding,
    rng: np.random.Generator,
    alpha: float = ALPHA,
    progress: Callable[[str], None] = lambda stage: None,
    seed: int = 0,
) -> tuple[Prepared, Finding]:
    """What was found, with explanations by scattered light settled, or, where nothing is missing, the base
    model of a scene that scatters; all as it was where there are none.

    Parameters
    ----------
    alpha : float
        Level of the test of the base model.
    seed : int
        Of the traces.

    Returns
    -------
    Prepared
        With the light of the best explanation.
    Finding
        Explanations that do not pass with the better light are accepted no longer, unless what is missing is
        within the tolerance; of what nothing explained, such that do are.
    """
    problem = prepared.problem
    if not can_follow(problem):
        return prepared, finding
    if finding.size == 0:
        return _base(prepared, finding, rng, alpha, progress, seed)
    finding = _beside_scattering(prepared, finding, seed)
    most = _SETTLED if finding.accepted else _TRIED_ANEW
    chosen = [t for t in finding.contenders if t.test is not None and scatters(problem, t.fit)][:most]
    if not chosen:
        return prepared, finding
    if finding.size == 2 and not finding.beyond_two:
        simpler = _simpler(problem, chosen[0])
        finding = replace(finding, accepted=[*finding.accepted, *simpler], tried=[*finding.tried, *simpler])
        chosen += simpler
    done: list[tuple[Tried, Settled]] = []
    for tried in chosen:
        progress(f"the scattered light of {' and '.join(tried.names)}")
        done.append((tried, _settled_from(problem, tried, seed)))
        test = tried.test
        if test and test is not finding.level.bench.test and isinstance(test.whiten, Whitener):
            test.whiten.forget()  # of its own errors, which are others now
    found = _accepted(prepared, finding, done, rng)
    tolerance = prepared.noise.budget.tolerance
    if found[1].size is not None or not finding.accepted or finding.level.tolerance >= tolerance:
        return found
    known = [level for level in finding.levels if level.tolerance == tolerance]
    tolerant = known[0] if known else level_at(prepared, tolerance, rng)
    levels = finding.levels if known else [*finding.levels, tolerant]
    within = replace(finding, level=tolerant, levels=levels)
    if tolerant.adequacy.passes(alpha):
        return prepared, replace(within, size=0, accepted=[], weights=[])
    return _accepted(prepared, within, done, rng)


def _base(
    prepared: Prepared,
    finding: Finding,
    rng: np.random.Generator,
    alpha: float,
    progress: Callable[[str], None],
    seed: int,
) -> tuple[Prepared, Finding]:
    """The base model of a scene that scatters as it states, where nothing is missing.

    Its width and absorption, and what the readings say of the stated scattering, rest on the same light.
    Where it passes no more, the search with the trace of its own has the last word.
    """
    level = finding.level
    tried = Tried((), level.base, bic(level.base, (), level.phi, finding.n), level.adequacy, level.bench.test)
    if not scatters(prepared.problem, tried.fit):
        return prepared, finding
    progress("the scattered light of the scene")
    one = _settled_from(prepared.problem, tried, seed)
    there = replace(prepared, problem=one.problem)
    test = judged(there, one.whiten, rng)
    adequacy = test(one.fit)
    if not adequacy.passes(alpha):
        return prepared, finding
    now = replace(
        level, bench=replace(level.bench, whiten=one.whiten, test=test), base=one.fit, adequacy=adequacy
    )
    levels = [now if other is level else other for other in finding.levels]
    return there, replace(finding, level=now, levels=levels)


def _accepted(
    prepared: Prepared, finding: Finding, done: list[tuple[Tried, Settled]], rng: np.random.Generator
) -> tuple[Prepared, Finding]:
    """What is accepted of a finding at its level, with what was settled in its place."""
    main, alpha = finding.level.bench.whiten, level_for(finding.level)
    made: dict[int, tuple[Prepared, Tried]] = {}
    for tried, one in done:
        whiten, fit, errors = one.whiten, one.fit, tried.errors
        if whiten.tolerance != main.tolerance:
            whiten = Whitener(whiten.noise, whiten.rho, main.phi, main.tolerance)
            fit = one.problem.fit(tried.explanation, whiten, [fit.u])
        there = replace(prepared, problem=one.problem)
        test = judged(there, whiten, rng)
        adequacy = test(fit)
        if adequacy.passes(alpha):
            fit, errors = profiled(one.problem, tried.explanation, fit, whiten, adequacy.phi, False)
            adequacy = test(fit)
        score = _score(finding, tried.explanation, fit, adequacy.phi)
        score += whiten.log_determinant - main.log_determinant
        new = replace(tried, fit=fit, bic=score, adequacy=adequacy, test=test, errors=errors)
        made[id(tried.explanation)] = there, new

    def now(every: list[Tried]) -> list[Tried]:
        return [made[id(t.explanation)][1] if id(t.explanation) in made else t for t in every]

    passing = sorted((t for t in now(finding.contenders) if t.accepted(alpha)), key=lambda t: t.bic)
    passing = [t for t in passing if not t.at_edge] or passing
    if not finding.beyond_two:  # any number of effects have their price
        fewest = min((len(t.explanation) for t in passing), default=0)
        passing = [t for t in passing if len(t.explanation) == fewest]
    passing = _named_first(passing)
    size = len(passing[0].explanation) if passing else None
    weights = with_base(passing, finding.level, finding.n) if passing else []
    best = next((p for p, t in made.values() if passing and t is passing[0]), prepared)
    after = replace(finding, size=size, accepted=passing, weights=weights, tried=now(finding.tried))
    return best, _with_evidence(after)


def _named_first(passing: list[Tried]) -> list[Tried]:
    """Best first, but of sets that are no further apart than a gap that with fewest curves."""
    near = [t for t in passing if t.bic < passing[0].bic + GAP]
    first = min(near, key=lambda t: (sum(not named(c) for c in t.explanation), t.bic), default=None)
    return sorted(passing, key=lambda t: t is not first)


def _score(finding: Finding, explanation: Explanation, fit: Fit, phi: float) -> float:
    """By what a set is ranked beside others of the finding, which were not settled: as they are."""
    if finding.many is None or not finding.beyond_two:
        return bic(fit, explanation, phi, finding.n)
    return finding.many.pool.cost(Node(explanation, fit))


def _with_evidence(finding: Finding) -> Finding:
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


def _beside_scattering(prepared: Prepared, finding: Finding, seed: int) -> Finding:
    """The finding, where no effect is certain in whose place scattering does as well once it is settled.

    A search that ends without scattering has compared sets with it by a trace of other water, by which they
    may cost tens more. Of the answer what is claimed is tried: scattering may do for the rest as well.
    """
    many, problem, best = finding.many, prepared.problem, finding.best
    if many is None or best is None or scatters(problem, best.fit) or problem.sample is not None:
        return finding
    node, whiten, pool = many.pool.nodes.get(many.best.key), finding.whiten, many.pool
    more = next((c for c in pool.problem.candidates if c.name == _SCATTERING), None)
    same = node is not None and node.key == frozenset(c.key for c in best.explanation)
    if node is None or more is None or not same or not isinstance(whiten, Whitener):
        return finding
    weighing, known = Weighing.of(pool, node), list(many.evidence)
    claimed = [e.candidate for e in known if e.is_claimed]
    for k, one in enumerate(known):
        kept = [c for c in claimed if c is not one.candidate]
        fits = all(more.effect.combines_with(c.effect) for c in kept)
        if not (fits and one.level == "certain" and named(one.candidate) and one.gap_named < _WITHIN):
            continue
        rival = pool.settled(pool.fit((*kept, more), [begin_at(node)]))
        if not scatters(problem, rival.fit):
            continue  # clear water: the set less the effect, which the search knows
        new = settle(problem, rival.explanation, rival.fit, whiten, seed)
        fit = restarted(new.problem, rival.explanation, new.fit, new.whiten)
        growth = new.whiten.log_determinant - whiten.log_determinant
        known[k] = one.against(weighing, Node(rival.explanation, replace(fit, chi2=fit.chi2 + growth)))
    return replace(finding, many=replace(many, evidence=known))


def _simpler(problem: Problem, pair: Tried) -> list[Tried]:
    """The one of two effects that scatters, by itself: the other may describe what the trace of the search
    has wrong."""
    out = []
    for alone in pair.explanation:
        kept = {*(p.path for p in problem.base), *(p.path for p in alone.parameters)}
        start = np.array([u for path, u in zip(pair.fit.paths, pair.fit.u, strict=True) if path in kept])
        assert pair.test is not None
        fit = problem.fit((alone,), pair.test.whiten, [start])
        if scatters(problem, fit):
            out.append(Tried((alone,), fit, np.inf, None, pair.test))
    return out[:1]


def _settled_from(problem: Problem, tried: Tried, seed: int) -> Settled:
    assert tried.test is not None and isinstance(tried.test.whiten, Whitener)
    return settle(problem, tried.explanation, tried.fit, tried.test.whiten, seed)


def settle(problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener, seed: int = 0) -> Settled:
    """Trace where a fit lies, fit again, until it moves no more; of many readings where a sample leads, and
    from there to all of them.

    Parameters
    ----------
    problem : Problem
        That can be followed (`following.can_follow`), as what was fitted can (`following.scatters`).
    seed : int
        Of the traces.
    """
    light = problem.forward.light
    traced = [_traced(light, fit, PHOTONS, seed, 0)]
    problem = _in_light(problem, traced)  # of whose nodes a sample has the light too
    some, there, own = on_sample(problem, explanation, fit, whiten)
    many = some is not problem
    now, traced = _settled(Settled(some, own, there), explanation, light, seed, traced, PHOTONS, of_many=many)
    if many:
        every = _in_light(problem, traced)
        there = every.fit(explanation, whiten, [now.fit.u], max_steps=0)
        photons = traced[-1][2].photons
        now, _ = _settled(
            Settled(every, whiten, there), explanation, light, seed, traced, photons, _ROUNDS, many
        )
    return now


def _traced(light: LightSource, fit: Fit, photons: float, seed: int, number: int) -> _Trace:
    return fit.u, *ratio_at(light, fit.values, photons, _SEED + _OF_EACH * seed + number)


def _in_light(problem: Problem, traced: list[_Trace]) -> Problem:
    return with_light(problem, [(scene, ratio) for _, scene, ratio in traced])


def _settled(
    now: Settled,
    explanation: Explanation,
    light: LightSource,
    seed: int,
    traced: list[_Trace],
    photons: float,
    first: int = 0,
    of_many: bool = False,
) -> tuple[Settled, list[_Trace]]:
    """The same of the readings of a problem, from what was traced before, for the places of `light`."""
    for k in range(_ROUNDS):
        if k > 0:
            new = _traced(light, now.fit, photons, seed, first + k)
            traced = [t for t in traced if now.fit.away_from(t[0]) < _NEAR] + [new]
        own = _in_light(now.problem, traced)
        before = now.fit.u
        # Many readings are fitted from where a sample has led, and that leads on: errors are known nearly.
        rounds = 1 if of_many and k > 0 else 2
        whiten, fit = under_own_errors(own, explanation, now.fit, now.whiten, rounds)
        if k == 0 and fit.away_from(before) > _FAR:
            fit = restarted(own, explanation, fit, whiten)
            whiten, fit = under_own_errors(own, explanation, fit, whiten, rounds=1)
        now = Settled(own, whiten, fit)
        widened = _widened(now)
        if _NEXT * fit.away_from(before) < _MOVED and widened < _WIDENED:
            break
        if not scatters(own, fit):
            break  # clear water has no light to trace
        photons = min(photons * (_MANY_MORE if widened > _WIDENED else _MORE), _MOST_PHOTONS)
    return now, traced


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
            known, directions = np.linalg.eigh(white.T @ white)
            seen = directions.T @ (white.T @ unit)
        else:  # more photons' modes than readings: the same from the other side
            known, directions = np.linalg.eigh(white @ white.T)
            seen = np.sqrt(np.maximum(known, 0.0))[:, None] * (directions.T @ unit)
        information += seen.T @ (seen / (1 - np.minimum(known, _ALL_PHOTONS))[:, None])
    without = np.diag(np.linalg.pinv(information, rcond=_SINGULAR, hermitian=True)) / norm[free] ** 2
    return float(np.max(np.sqrt(with_photons[free] / without) - 1, initial=0.0))
