"""Any number of effects: a pool of refitted sets, noise judged again at every new best one, rivals without
each effect, and how sure each effect is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.score_tests import Adequacy
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.followed import can_follow, following, scatters
from lightfield.diagnosis.search.pool.afresh import beside_fresh_fits
from lightfield.diagnosis.search.pool.answer import named, the_answer
from lightfield.diagnosis.search.pool.backward import linear_backward
from lightfield.diagnosis.search.pool.evidence import Evidence, evidence
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.moves import forward, polish, thin
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.pool.rivals import seek_rivals
from lightfield.diagnosis.search.preparation import Bench, Prepared, bench, prepare_about
from lightfield.diagnosis.search.search_progress import Progress
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.least_squares import Fit, Whiten

#: Beam and fits of the first levels of additions, of later ones, and of a wider look before giving up.
#: Chosen; with half and twice of the first two ten campaigns have the same verdicts.
_BEAM, _FITS, _BEAM_AGAIN, _FITS_AGAIN, _WIDE = 4, 14, 2, 6, 6
#: Fits of a linear elimination before giving up. Chosen: time alone; half and twice alike in ten campaigns.
_MORE = 6
#: Rounds of noise and search, and of rivals that turn out better. Chosen: noise settles in two.
_ROUNDS, _RIVAL_ROUNDS = 4, 3
#: Traces where a best set lies have seeds of their own. Chosen: no trace has another's.
_SEED = 6000
#: Sets are compared in light traced within so many errors of where the best lies, for the tolerance too after
#: so many rounds at most. Chosen: in light of other water they hold effects that describe what it has wrong.
_NEAR, _ROUNDS_WITHIN = 1.0, 3
#: Traces until one set stays where it was traced, at most. Measured: most take one or two.
_TRACES = 4


@dataclass(frozen=True)
class Many:
    """The best set of any number of effects.

    Parameters
    ----------
    prepared : Prepared
        Noise and outliers as judged about it.
    adequacy : Adequacy
        Of the best set.
    adequate : bool
        Nothing is missing beside it.
    sought : bool
        It was sought here; else it was found before, and only its rivals were.
    at_first_sight : bool
        The search ended with its first sets.
    """

    prepared: Prepared
    bench: Bench
    tolerance: float
    pool: Pool
    best: FittedSet
    base: FittedSet
    adequacy: Adequacy
    adequate: bool
    evidence: Sequence[Evidence]
    sought: bool = True
    at_first_sight: bool = False


@dataclass(frozen=True)
class Data:
    """Readings as they came, and what is stated of their errors.

    Parameters
    ----------
    problem : Problem
        With every usable reading, and every candidate.
    quoted : array, shape (n,)
        Standard errors of the table; NaN where unknown.
    whole : Problem, optional
        Of many readings, of which the problem is the sample.
    """

    problem: Problem
    quoted: Array
    budget: Budget
    whole: Problem | None = None

    def can_follow(self, fit: Fit) -> bool:
        """Does a fit scatter light that can be followed without photons?"""
        every = self.whole or self.problem
        return can_follow(every) and scatters(every, fit)

    def following(self, fit: Fit, seed: int) -> Data:
        """The same with scattered light traced where a fit lies, if it has some that can be followed."""
        every = self.whole or self.problem
        if not self.can_follow(fit):
            return self
        every = following(every, fit, seed)
        if self.whole is None:
            return replace(self, problem=every)
        assert every.sample is not None
        return replace(self, problem=every.sample[1], whole=every)


#: Does a search end with its first sets? Told the noise, their pool, what was known before, and the best.
Ends = Callable[[Prepared, Pool, FittedSet, FittedSet], bool]


def never(*_: object) -> bool:
    """Not with its first sets."""
    return False


def direct(candidate: Candidate) -> bool:
    """Is it a named effect that acts on direct light alone?"""
    return named(candidate) and not candidate.effect.diffuse


def everything(candidate: Candidate) -> bool:
    """Named effects and curves."""
    return True


def ground_about(
    prepared: Prepared, tolerance: float, rng: np.random.Generator, found: FittedSet
) -> tuple[Bench, Ground]:
    """Whitening, and the scale of the noise beside the best set, which was fitted under another one."""
    made = bench(prepared, tolerance, rng)
    here = prepared.problem.fit(found.explanation, made.whiten, [found.fit.u], max_steps=0)
    adequacy = made.test(here)
    return made, Ground(made.test, adequacy.phi, adequacy.nu)


def _pool(ground: Ground, best: FittedSet, progress: Progress) -> Pool:
    """A pool that holds the base model and what was the best set so far."""

    def told(node: FittedSet) -> None:
        progress.tried(1, ground.problem, node.explanation, node.fit)

    pool = Pool(ground)
    start = Begin(best.fit.by_path)
    # Width and absorption of a large set may lie where the base model alone has another minimum.
    pool.finished(pool.fit((), [start, Begin({})]))
    pool.finished(pool.fit(best.explanation, [start]))
    pool.progress = told
    return pool


def _first(pool: Pool) -> None:
    """The best named set, then the best of all."""
    base = pool.nodes[frozenset()]
    # Scattered and reflected light takes its time: first without.
    forward(pool, base, _BEAM, _FITS, direct)
    polish(pool, direct)
    best = forward(pool, pool.best(named), _BEAM_AGAIN, _FITS_AGAIN, named)
    linear_backward(pool, base, named)
    linear_backward(pool, best, named)
    polish(pool, named)
    if _has_curves(pool):
        _curves(pool)


def _has_curves(pool: Pool) -> bool:
    return not all(map(named, pool.problem.candidates))


def _curves(pool: Pool) -> None:
    """Sets with curves, and named ones that catch up with them."""
    forward(pool, pool.nodes[frozenset()], _BEAM_AGAIN, _FITS_AGAIN, everything)
    best = polish(pool, everything)
    if all(map(named, best.explanation)):
        return
    for candidate in best.explanation:
        if not named(candidate):
            best = pool.drop(best, candidate)
    forward(pool, best, _BEAM_AGAIN, _FITS_AGAIN, named, patience=2)
    polish(pool, named)
    polish(pool, everything)


def _wider(pool: Pool, best: FittedSet) -> None:
    """Another look before giving up."""
    forward(pool, pool.nodes[frozenset()], _WIDE, _FITS, named, patience=2)
    other = polish(pool, named)
    for node in {other.key: other, best.key: best}.values():
        linear_backward(pool, node, named, _MORE)
    polish(pool, named)
    polish(pool, everything)


def search_many(
    data: Data,
    begun: Prepared,
    alpha: float,
    rng: np.random.Generator,
    progress: Progress,
    ends: Ends = never,
) -> Many:
    """The best set, and how sure its effects are.

    Every question is asked with the noise alone, and once more with the tolerance where nothing passes. Of
    many readings a sample is searched, and what it finds is fitted to all of them.

    Parameters
    ----------
    begun : Prepared
        Noise to begin with, and what describes the readings best so far.
    ends : callable
        Of many readings it is not asked.
    """
    if data.problem.sample is not None:
        return _of_sample(data, begun, alpha, rng, progress)
    found = FittedSet(begun.explanation, begun.reference)
    data, found = _followed(data, found, Whitener(begun.noise), begun.problem.keep, _SEED)
    known = found.key
    prepared = replace(begun, problem=replace(data.problem, keep=begun.problem.keep))
    made, ground = ground_about(prepared, 0.0, rng, found)
    pool = _pool(ground, found, progress)
    _first(pool)
    found = pool.best()
    if ends(prepared, pool, pool.nodes[known], found):
        base, adequacy = pool.nodes[frozenset()], made.test(found.fit)
        return Many(prepared, made, 0.0, pool, found, base, adequacy, False, (), at_first_sight=True)
    for k in range(_ROUNDS):
        before = found
        seed = _SEED + (1 + k) * _TRACES
        data, found = _followed(data, found, made.whiten, prepared.problem.keep, seed)
        prepared = prepare_about(data.problem, data.quoted, data.budget, found.explanation, found.fit)
        made, ground = ground_about(prepared, 0.0, rng, found)
        pool = _pool(ground, found, progress)
        found = beside_fresh_fits(pool, _again(pool), everything)
        if found.key != before.key or _is_elsewhere(data, found, before):
            continue
        found, adequacy = _tested(pool, made, found, alpha)
        if not adequacy.passes(alpha) and data.budget.tolerance > 0:
            break
        found = _beside_rivals(pool, found)
        if found.key == before.key:
            break
    tolerance = 0.0
    found, adequacy = _tested(pool, made, found, alpha)
    if not adequacy.passes(alpha) and data.budget.tolerance > 0:
        tolerance = data.budget.tolerance
        for k in range(_ROUNDS_WITHIN):
            before = found
            made, ground = ground_about(prepared, tolerance, rng, found)
            pool = _pool(ground, found, progress)
            found, adequacy = _tested(pool, made, _again(pool), alpha)
            if not _is_elsewhere(data, found, before):
                break
            seed = _SEED + (1 + _ROUNDS + k) * _TRACES
            data, found = _followed(data, found, made.whiten, prepared.problem.keep, seed)
            prepared = prepare_about(data.problem, data.quoted, data.budget, found.explanation, found.fit)
    for _ in range(_RIVAL_ROUNDS):
        other = _beside_rivals(pool, found)
        if other is found:
            break
        found = polish(pool, everything)
    found = pool.exact(found)
    adequacy = made.test(found.fit)
    adequate = adequacy.passes(alpha)
    if adequate:
        found, adequacy = the_answer(pool, made, found, adequacy, alpha)
    base = pool.nodes[frozenset()]
    certainty = evidence(pool, found, adequate)
    return Many(prepared, made, tolerance, pool, found, base, adequacy, adequate, certainty)


def _of_sample(
    data: Data, begun: Prepared, alpha: float, rng: np.random.Generator, progress: Progress
) -> Many:
    """What a sample of many readings finds, fitted to all of them and tested on them."""
    assert data.problem.sample is not None
    rows, some = data.problem.sample
    part = replace(data, problem=some, quoted=data.quoted[rows], whole=data.problem)
    u = begun.reference.u
    first = some.fit(begun.explanation, Whitener(begun.noise.subset(rows)), [u], max_steps=0)
    there = prepare_about(some, part.quoted, data.budget, begun.explanation, first)
    found = search_many(part, there, alpha, rng, progress)
    progress(f"{len(found.best.explanation)} effects fitted to all {data.problem.layout.size} readings")
    best, whole = found.best, Whitener(begun.noise)
    data = data.following(best.fit, _SEED + (1 + _ROUNDS + _ROUNDS_WITHIN) * _TRACES)
    fit = data.problem.fit(best.explanation, whole, [best.fit.u])
    prepared = prepare_about(data.problem, data.quoted, data.budget, best.explanation, fit)
    node = FittedSet(best.explanation, fit)
    made, ground = ground_about(prepared, found.tolerance, rng, node)
    pool = _pool(ground, node, progress)
    node = pool.nodes[best.key]
    adequacy = made.test(node.fit)
    adequate = adequacy.passes(alpha)
    certainty = evidence(found.pool, best, adequate)
    base = pool.nodes[frozenset()]
    return Many(prepared, made, found.tolerance, pool, node, base, adequacy, adequate, certainty)


def _followed(data: Data, found: FittedSet, whiten: Whiten, keep: Array, seed: int) -> tuple[Data, FittedSet]:
    """Readings with scattered light traced where a set lies, and the set where it lies in it."""
    for k in range(_TRACES):
        if not data.can_follow(found.fit):
            break
        before, data = found, data.following(found.fit, seed + k)
        fit = replace(data.problem, keep=keep).fit(found.explanation, whiten, [found.fit.u])
        found = FittedSet(found.explanation, fit)
        if fit.away_from(before.fit.u) < _NEAR:
            break
    return data, found


def _is_elsewhere(data: Data, found: FittedSet, before: FittedSet) -> bool:
    """Does a set scatter light that was traced for another, or far from where it lies?"""
    if not data.can_follow(found.fit):
        return False
    if found.key != before.key:
        return True
    return found.fit.away_from(found.fit.model.at(before.fit.by_path)) > _NEAR


def _beside_rivals(pool: Pool, found: FittedSet) -> FittedSet:
    """The best set beside the best ones without each of its effects, or the first of those that is better."""
    for candidate in found.explanation:
        seek_rivals(pool, found, candidate)
        if pool.best() is not found:
            return pool.best()
    thin(pool)
    return pool.best()


def _again(pool: Pool) -> FittedSet:
    """The best set, from what was the best under other errors."""
    polish(pool, everything)
    forward(pool, pool.best(), _BEAM_AGAIN, _FITS_AGAIN, everything)
    linear_backward(pool, pool.best(), named)
    return polish(pool, everything)


def _tested(pool: Pool, made: Bench, found: FittedSet, alpha: float) -> tuple[FittedSet, Adequacy]:
    """The best set and its test, after another look where it fails."""
    adequacy = made.test(found.fit)
    if not adequacy.passes(alpha):
        _wider(pool, found)
        if pool.best() is not found:
            found = pool.best()
            adequacy = made.test(found.fit)
    return found, adequacy
