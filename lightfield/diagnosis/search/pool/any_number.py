"""Any number of effects: a pool of refitted sets, noise judged again at every new best one, rivals without
each effect, and how sure each effect is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.score_tests import Adequacy
from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.followed import can_follow, following, scatters
from lightfield.diagnosis.search.pool import looks
from lightfield.diagnosis.search.pool.answer import named, the_answer
from lightfield.diagnosis.search.pool.evidence import Evidence, evidence
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.preparation import Bench, Prepared, bench, prepare_about
from lightfield.diagnosis.search.search_progress import Progress
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.least_squares import Fit, Whiten

#: Rounds of noise and search, and of rivals that turn out better. Chosen: noise settles in two.
_ROUNDS, _RIVAL_ROUNDS = 4, 3
#: Traces where a best set lies have seeds of their own. Chosen: no trace has another's.
_SEED = 6000
#: Sets are compared in light traced within so many errors of where the best lies, for the tolerance too after
#: so many rounds at most. Chosen: in light of other water they hold effects that describe what it has wrong.
_NEAR, _ROUNDS_WITHIN = 1.0, 3
#: A set that scatters leads the traces where it costs no more than this above the best, which does not.
#: Measured, with b = 0.12 per m and two fifths of the light scattered: in light of clear water the true set
#: was 27 dearer than the best, and the first of those that scatter 78; in light traced there it was the best.
_REACH = 100.0
#: Chi-square over that of the noise from which on a set misses the readings by far. Chosen: what lacks one of
#: several effects leaves more; with half and twice ten campaigns have the same verdicts.
FAR = 2.0
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

    def prepared_about(self, found: FittedSet) -> Prepared:
        """Noise and outliers, judged about a set."""
        return prepare_about(self.problem, self.quoted, self.budget, found.explanation, found.fit)


#: Does a search end with its first sets? Told the noise, their pool, what was known before, and the best.
Ends = Callable[[Prepared, Pool, FittedSet, FittedSet], bool]


def never(*_: object) -> bool:
    """Not with its first sets."""
    return False


def ground_about(
    prepared: Prepared, tolerance: float, rng: np.random.Generator, found: FittedSet
) -> tuple[Bench, Ground]:
    """Whitening, and the scale of the noise beside the best set, which was fitted under another one."""
    made = bench(prepared, tolerance, rng)
    here = prepared.problem.fit(found.explanation, made.whiten, [found.fit.u], max_steps=0)
    adequacy = made.test(here)
    return made, Ground(made.test, adequacy.phi, adequacy.nu)


class _Asked(NamedTuple):
    """Level of the test, random numbers of its bootstrap, and who is told of the best set."""

    alpha: float
    rng: np.random.Generator
    progress: Progress

    def on_ground(
        self,
        data: Data,
        prepared: Prepared,
        best: FittedSet,
        tolerance: float,
        led: _Led | None = None,
    ) -> _Standing:
        """A search that begins: a pool that holds the base model, what was the best set so far, and what led
        the traces."""
        made, ground = ground_about(prepared, tolerance, self.rng, best)
        pool, start = Pool(ground), Begin(best.fit.by_path)
        # Width and absorption of a large set may lie where the base model alone has another minimum.
        pool.finished(pool.fit((), [start, Begin({})]))
        same = pool.finished(pool.fit(best.explanation, [start]))
        if led is not None:
            known = led.found
            led = _Led(pool.finished(pool.fit(known.explanation, [Begin(known.fit.by_path)])), led.at)
        pool.progress = lambda node: self.progress.tried(1, ground.problem, node.explanation, node.fit)
        return _Standing(self, data, prepared, tolerance, made, pool, same, led)


class _Led(NamedTuple):
    """A set that scatters and is not the best, and its coordinates where the light is traced, shape
    (n_parameters,)."""

    found: FittedSet
    at: Array


@dataclass(frozen=True)
class _Standing:
    """Where a search stands.

    Parameters
    ----------
    data : Data
        In the light of the best set, as far as that is traced.
    prepared : Prepared
        Noise and outliers as judged about it.
    tolerance : float
        Smooth relative misfit within which sets are tested.
    bench, pool : Bench, Pool
        Tests and sets on the ground of all that; the pool grows.
    best : FittedSet
        Of the pool.
    led : _Led, optional
        What the light is traced for, where that is no light of the best set.
    """

    asked: _Asked
    data: Data
    prepared: Prepared
    tolerance: float
    bench: Bench
    pool: Pool
    best: FittedSet
    led: _Led | None = None

    @cached_property
    def adequacy(self) -> Adequacy:
        """Of the best set."""
        return self.bench.test(self.best.fit)

    @property
    def passes(self) -> bool:
        """Is nothing missing beside the best set?"""
        return self.adequacy.passes(self.asked.alpha)

    @property
    def may_pass_within(self) -> bool:
        """Is something missing, and a tolerance stated?"""
        return not self.passes and self.data.budget.tolerance > 0

    def after(self, *some: Callable[[Pool, FittedSet], FittedSet]) -> _Standing:
        """The same with the best set after some looks at the pool."""
        best = self.best
        for look in some:
            best = look(self.pool, best)
        return self if best is self.best else replace(self, best=best)

    @property
    def misses_by_far(self) -> bool:
        """Does the best set leave far more than noise?"""
        spare = self.prepared.problem.keep.sum() - len(self.best.fit.u)
        return bool(self.best.fit.chi2 > FAR * self.pool.ground.phi * spare)

    def after_wider_look(self) -> _Standing:
        """The same, if nothing is missing; else after another look."""
        return self if self.passes else self.after(looks.wider)

    @property
    def lead(self) -> FittedSet | None:
        """The best named set that scatters, where that pays and the best of all is near and does not.

        In light that was traced in clear water it may cost more than sets that imitate it.
        """
        pool, nodes = self.pool, self.pool.nodes
        if self.data.can_follow(self.best.fit):
            return None

        def pays(node: FittedSet) -> bool:
            less = (nodes.get(node.key - {c.key}) for c in node.explanation if c.effect.diffuse)
            return all(other is None or pool.cost(node) < pool.cost(other) for other in less)

        most = pool.cost(self.best) + _REACH
        diffuse = (n for n in nodes.values() if n.is_diffuse and all(map(named, n.explanation)))
        near = sorted((n for n in diffuse if pool.cost(n) < most), key=pool.cost)
        return next((n for n in near if pays(n) and self.data.can_follow(n.fit)), None)

    def followed(self, seed: int) -> _Standing:
        """The same in light traced where the best set lies, or what leads, with noise and outliers as judged
        there; the pool is that of before."""
        data, best, keep = self.data, self.best, self.prepared.problem.keep
        lead, led = self.lead, self.led
        if lead is None:
            data, best = _followed(data, best, self.bench.whiten, keep, seed)
            led = None
        elif led is None or led.found.key != lead.key or lead.fit.away_from(led.at) > _NEAR:
            data, lead = _followed(data, lead, self.bench.whiten, keep, seed)
            led = _Led(lead, lead.fit.u)
        else:
            led = _Led(lead, led.at)
        return replace(self, data=data, prepared=data.prepared_about(best), best=best, led=led)

    def on_ground(self, tolerance: float) -> _Standing:
        """Begun once more, in the light and the noise as they are now."""
        now = self.asked.on_ground(self.data, self.prepared, self.best, tolerance, self.led)
        return now if now.led is None else now.after(looks.beyond(now.led.found))

    def is_elsewhere(self, before: FittedSet) -> bool:
        """Does the best set scatter light that was traced for another, or far from where it lies?"""
        fit = self.best.fit
        if not self.data.can_follow(fit):
            return False
        return self.best.key != before.key or fit.away_from(fit.model.at(before.fit.by_path)) > _NEAR

    def told(self, certainty: Sequence[Evidence]) -> Many:
        """What is told of it."""
        known = self.prepared, self.bench, self.tolerance, self.pool, self.best
        return Many(*known, self.adequacy, self.passes, certainty)


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
    asked = _Asked(alpha, rng, progress)
    if data.problem.sample is not None:
        return _of_sample(asked, data, begun)
    keep, known = begun.problem.keep, FittedSet(begun.explanation, begun.reference)
    data, found = _followed(data, known, Whitener(begun.noise), keep, _SEED)
    prepared = replace(begun, problem=replace(data.problem, keep=keep))
    now = asked.on_ground(data, prepared, found, 0.0).after(looks.first)
    if ends(now.prepared, now.pool, now.pool.nodes[known.key], now.best):
        return replace(now.told(()), adequate=False, at_first_sight=True)
    now = _in_its_noise(now)
    if now.may_pass_within:
        now = _within_tolerance(now)
    return _answered(now)


def _in_its_noise(now: _Standing) -> _Standing:
    """The set that is the best in the light and the noise about itself, or the last one before rounds end."""
    for k in range(_ROUNDS):
        before, now = now.best, now.followed(_SEED + (1 + k) * _TRACES).on_ground(0.0)
        now = now.after(looks.again, looks.afresh)
        if now.best.key != before.key or now.is_elsewhere(before):
            continue
        if now.may_pass_within and now.misses_by_far:
            return now  # the wider look is within the tolerance
        now = now.after_wider_look()
        if now.may_pass_within:
            break
        now = now.after(looks.beside_rivals)
        if now.best.key == before.key:
            break
    return now.after_wider_look()


def _within_tolerance(there: _Standing) -> _Standing:
    """The best set within the tolerance, in light traced where it lies, or in that of the last round."""
    for k in range(_ROUNDS_WITHIN):
        now = there.on_ground(there.data.budget.tolerance).after(looks.again).after_wider_look()
        if not now.is_elsewhere(there.best):
            break
        there = now.followed(_SEED + (1 + _ROUNDS + k) * _TRACES)
    return now


def _answered(now: _Standing) -> Many:
    """The best set once no rival is better, or the answer among those that pass; how sure its effects are."""
    for _ in range(_RIVAL_ROUNDS):
        other = now.after(looks.beside_rivals)
        if other is now:
            break
        now = other.after(looks.around)
    now = now.after(looks.to_the_end)
    if now.passes:
        now = now.after(lambda pool, best: the_answer(pool, best, now.asked.alpha))
    return now.told(evidence(now.pool, now.best, now.passes))


def _of_sample(asked: _Asked, data: Data, begun: Prepared) -> Many:
    """What a sample of many readings finds, fitted to all of them and tested on them."""
    assert data.problem.sample is not None
    rows, some = data.problem.sample
    part = replace(data, problem=some, quoted=data.quoted[rows], whole=data.problem)
    known, u = begun.explanation, [begun.reference.u]
    first = FittedSet(known, some.fit(known, Whitener(begun.noise.subset(rows)), u, max_steps=0))
    found = search_many(part, part.prepared_about(first), *asked)
    best, size = found.best, data.problem.layout.size
    asked.progress(f"{len(best.explanation)} effects fitted to all {size} readings")
    data = data.following(best.fit, _SEED + (1 + _ROUNDS + _ROUNDS_WITHIN) * _TRACES)
    fit = data.problem.fit(best.explanation, Whitener(begun.noise), [best.fit.u])
    node = FittedSet(best.explanation, fit)
    now = asked.on_ground(data, data.prepared_about(node), node, found.tolerance)
    return now.told(evidence(found.pool, best, now.passes))


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
