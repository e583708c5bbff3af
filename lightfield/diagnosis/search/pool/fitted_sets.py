"""Sets of effects, each fitted once and remembered with what it costs.

The cost of a set S is chi2(S)/phi plus a price for every effect in it. The price of d parameters is the
chi-square that an absent effect saves by chance once in a hundred verdicts: d times the quantile of F with d
and nu degrees of freedom at alpha/p, where p effects can be tested (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import special

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.adequacy.score_tests import AdequacyTest, Score
from lightfield.diagnosis.problem.candidates import Candidate, go_together
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.search.pool.quick import Begin, finished_fit, quick_fit, with_effect
from lightfield.diagnosis.search.set_of_effects import FittedSet, SetKey
from lightfield.fitting.least_squares import Fit

Admits = Callable[[Candidate], bool]

#: Steps of a fit at most, and what it may leave of chi-square. Chosen: far less than a price.
_STEPS, _LEFT = 20, 0.05
#: Steps from each of several shapes before the best is fitted to the end; so many shapes are tried. Chosen:
#: from one alone the width of a halo is lost.
_FEW, _SHAPES = 4, 2
#: Sets that cost no more than this above the best are fitted to the end at once; of others the cost is rough.
#: Chosen; with half and twice ten campaigns have the same verdicts.
_NEAR = 50.0
#: A fit that begins elsewhere counts where chi-square is lower by so much, in units of the noise. Chosen.
_ELSEWHERE = 1.0
#: Predictions of scattered or reflected light that all fits together may take: some milliseconds each,
#: between walls up to 30. Chosen: two minutes at most.
_MOST_DIFFUSE = 4000


@dataclass(frozen=True)
class Ground:
    """What sets are judged on: readings, whitening, and the scale of the noise.

    Parameters
    ----------
    test : AdequacyTest
        Its problem holds every candidate.
    phi, nu : float, int
        Pure-error variance in units of the whitening, and its degrees of freedom.
    """

    test: AdequacyTest
    phi: float
    nu: float

    @property
    def problem(self) -> Problem:
        return self.test.problem

    @cached_property
    def level(self) -> float:
        """Level at which one effect is added."""
        return ALPHA / max(len({c.name for c in self.problem.candidates}), 1)

    @cached_property
    def _prices(self) -> dict[int, float]:
        return {}

    @cached_property
    def price_of_removal(self) -> float:
        """Chi-square, in units of phi, that leaving out an effect which the scene states has to save.

        Of one that is there with s sigma, leaving it out saves 2 s z - s^2 by noise z, and more than c most
        often where s^2 = c: with the probability of z above the root of c.
        """
        stated = len({c.name for c in self.problem.candidates if c.is_stated})
        return float(special.ndtri(1 - ALPHA / max(stated, 1)) ** 2)

    def cost(self, node: FittedSet, phi: float) -> float:
        """Chi-square in units of phi, plus the price of every effect."""
        gone, worse = self.needless(node, phi)
        left_out = {c.key for c in gone}
        prices = (self.price_of_removal if c.key in left_out else self.price(c) for c in node.explanation)
        return (node.chi2 + worse) / phi + sum(prices)

    def needless(self, node: FittedSet, phi: float) -> tuple[Explanation, float]:
        """Effects of a set that the scene states and the readings do as well without, and how much larger
        chi-square is then: left out they take no parameters, and are the cheaper for it."""

        def saved(some: Explanation) -> float:
            prices = sum(self.price(c) - self.price_of_removal for c in some)
            return prices - node.worse_without(some) / phi if some else 0.0

        single = [(c,) for c in node.explanation if c.is_stated]
        if not single:
            return (), 0.0
        gone = max(((), *single, tuple(c for (c,) in single if saved((c,)) > 0)), key=saved)
        return gone, node.worse_without(gone) if gone else 0.0

    def price(self, candidate: Candidate) -> float:
        """Chi-square, in units of phi, that an effect has to save."""
        return self.price_of(len(candidate.parameters))

    def price_of(self, d: int) -> float:
        """Chi-square, in units of phi, that one effect of so many parameters has to save."""
        if d not in self._prices:
            self._prices[d] = d * float(special.fdtri(d, self.nu, 1 - self.level))
        return self._prices[d]


@dataclass(frozen=True)
class Start:
    """Where a fit with one effect more begins."""

    gain: float
    shape: tuple[float, ...]
    amplitudes: Array
    columns: Array


@dataclass(frozen=True)
class Promise:
    """What a set with one effect more would cost, were the model linear.

    Parameters
    ----------
    starts : tuple of Start
        At the shapes that promise most, best first.
    """

    cost: float
    node: FittedSet
    candidate: Candidate
    starts: tuple[Start, ...]

    @property
    def key(self) -> SetKey:
        return self.node.key | {self.candidate.key}


@dataclass
class Pool:
    """Sets that were fitted on one ground.

    Parameters
    ----------
    nodes : dict
        By what they hold.
    fits, diffuse : int
        Fits so far, and predictions of scattered or reflected light that they took.
    progress : callable
        Told of the best set whenever one was fitted.
    """

    ground: Ground
    nodes: dict[SetKey, FittedSet] = field(default_factory=dict)
    fits: int = 0
    diffuse: int = 0
    most_diffuse: int = _MOST_DIFFUSE
    _scores: dict[SetKey, tuple[tuple[Score, ...], tuple[Array, ...]]] = field(default_factory=dict)
    _promises: dict[SetKey, list[Promise]] = field(default_factory=dict)
    _finished: set[SetKey] = field(default_factory=set)
    _dropped: dict[tuple[SetKey, SetKey], Fit] = field(default_factory=dict)
    _lowest: float = float("inf")
    progress: Callable[[FittedSet], None] = lambda best: None

    @property
    def problem(self) -> Problem:
        return self.ground.problem

    def cost(self, node: FittedSet) -> float:
        """Chi-square in units of the noise, plus the price of every effect."""
        return self.ground.cost(node, self.ground.phi)

    def best(self, allowed: Admits | None = None) -> FittedSet:
        """The set of least cost, of allowed effects."""
        nodes = self.nodes.values()
        return min((n for n in nodes if allowed is None or all(map(allowed, n.explanation))), key=self.cost)

    def fit(
        self, explanation: Iterable[Candidate], begins: Sequence[Begin], promised: float = np.inf
    ) -> FittedSet:
        """The set as fitted from the best of several places, or as it is remembered.

        Parameters
        ----------
        promised : float
            What it would cost, were the model linear: what may be near is fitted to the end, also where it
            was once left far away.
        """
        whole = self.in_order(explanation)
        if (known := self.nodes.get(frozenset(c.key for c in whole))) is not None:
            if known.key in self._finished or not self._is_near(promised):
                return known
            begins = [*begins, Begin(known.fit.by_path)]
        fits = [self._quick(whole, begin, _FEW if len(begins) > 1 else _STEPS) for begin in begins]
        fit = min(fits, key=lambda f: f.chi2)
        if len(begins) > 1:
            fit = self._quick(whole, Begin(fit.by_path), _STEPS)
        self.fits += 1
        node = self._remember(FittedSet(whole, fit))
        near = self._is_near(min(self.cost(node), promised))
        done = self.finished(node) if near or not node.is_diffuse else node
        self.progress(self.best())
        return done

    def in_order(self, explanation: Iterable[Candidate]) -> Explanation:
        """Effects in the order of the table, in which a set is kept."""
        return tuple(sorted(explanation, key=self.problem.candidates.index))

    def _is_near(self, cost: float) -> bool:
        """Is a set of that cost not far from the best?"""
        return cost < self._lowest + _NEAR

    def _quick(self, explanation: Explanation, begin: Begin, steps: int) -> Fit:
        near = (self._lowest + _NEAR - sum(map(self.ground.price, explanation))) * self.ground.phi
        fit = quick_fit(self.problem, explanation, self.ground.test.whiten, begin, steps, _LEFT, near)
        self._spend(explanation, fit)
        return fit

    def _spend(self, explanation: Explanation, fit: Fit) -> None:
        if any(c.effect.diffuse for c in explanation):
            self.diffuse += fit.evaluations

    def _remember(self, node: FittedSet) -> FittedSet:
        self.nodes[node.key] = node
        if (cost := self.cost(node)) < self._lowest:
            self._lowest = cost
        return node

    def finished(self, node: FittedSet) -> FittedSet:
        """The set as fitted to the end, with slopes of its own."""
        if node.key not in self._finished:
            whiten = self.ground.test.whiten
            begin = Begin(node.fit.by_path)
            fit = finished_fit(self.problem, node.explanation, whiten, begin, _STEPS, _LEFT)
            self._spend(node.explanation, fit)
            self._finished.add(node.key)
            self._scores.pop(node.key, None)
            self._promises.pop(node.key, None)
            return self._remember(FittedSet(node.explanation, fit))
        return self.nodes[node.key]

    def as_unstated(self, allowed: Admits) -> FittedSet:
        """The set with all that the scene states, of allowed effects, from where it is switched off."""
        stated: list[Candidate] = []
        for c in self.problem.candidates:
            others = [*stated, c]
            if c.is_stated and allowed(c) and c.name not in {s.name for s in stated} and go_together(others):
                stated = others
        off = {p.path: n for c in stated for p, n in zip(c.amplitudes, c.neutral, strict=True)}
        if not self.affordable(stated):
            return self.nodes[frozenset()]
        return self.finished(self.fit(stated, [Begin(off)]))

    def anew(self, explanation: Iterable[Candidate]) -> None:
        """Fit a set from typical sizes of its effects, beside the scene's own values and those of the base
        model, and keep that where it is better."""
        problem, base = self.problem, self.nodes[frozenset()].fit.u
        whole = self.in_order(explanation)
        paths = [p.path for p in problem.model(whole).parameters]
        stated = np.array([p.start for p in problem.base])
        starts = [problem.default_start(u, whole) for u in (stated, base)]
        begins = [Begin(dict(zip(paths, start, strict=True))) for start in starts]
        self.also_from(whole, begins)

    def also_from(self, whole: Iterable[Candidate], begins: Iterable[Begin]) -> None:
        """Fit a set from some places too: what is remembered of it, unless one of these is better."""
        self.offered(self.made(whole, begins))

    def made(self, explanation: Iterable[Candidate], begins: Iterable[Begin]) -> FittedSet:
        """A set as fitted from the best of several places, of which nothing is remembered."""
        whole = self.in_order(explanation)
        return FittedSet(whole, min((self._quick(whole, b, _STEPS) for b in begins), key=lambda f: f.chi2))

    def offered(self, made: FittedSet) -> None:
        """Remember a set, unless what is remembered of it is better."""
        known = self.nodes.get(made.key)
        if known is None or self.is_lower(made.fit, known.fit):
            self._finished.discard(made.key)
            self._scores.pop(made.key, None)
            self._promises.pop(made.key, None)
            self._remember(made)

    def exact(self, node: FittedSet) -> FittedSet:
        """The set with all derivatives its own, also by scattered and reflected light."""
        whiten = self.ground.test.whiten
        return self._remember(
            FittedSet(node.explanation, self.problem.fit(node.explanation, whiten, [node.fit.u]))
        )

    def is_lower(self, fit: Fit, before: Fit) -> bool:
        """Is a fit of a set better than another one of it, by more than where a fit ends?"""
        return fit.chi2 < before.chi2 - _ELSEWHERE * self.ground.phi

    def affordable(self, candidates: Iterable[Candidate]) -> bool:
        """May a set still be fitted? Scattered and reflected light takes its time."""
        whole = tuple(candidates)
        wanted = len(self.problem.base) + sum(len(c.parameters) for c in whole)
        if wanted >= self.problem.keep.sum():
            return False
        return self.diffuse < self.most_diffuse or not any(c.effect.diffuse for c in whole)

    def most_effects(self, reach: float) -> int:
        """Of a set that might be the best, did it leave nothing but noise, or as little as any does.

        Parameters
        ----------
        reach : float
            Cost that it may have above the best then: larger sets take more of the noise.
        """
        spare = float(self.problem.keep.sum()) - len(self.problem.base)
        least = min(spare, min(node.chi2 for node in self.nodes.values()) / self.ground.phi)
        each = min(map(self.ground.price, self.problem.candidates), default=1.0)
        return max(int((self._lowest + reach - least) / each), 1)

    def scores(self, node: FittedSet) -> tuple[tuple[Score, ...], tuple[Array, ...]]:
        """Score tests of every effect that the set lacks."""
        if node.key not in self._scores:
            test = self.ground.test
            if node.is_diffuse:
                near = self.problem.forward.holding(node.fit.values)
                test = test.on(replace(self.problem, forward=near))
            self._scores[node.key] = test.score(node.fit, at_any_time=True)
        return self._scores[node.key]

    def promises(self, node: FittedSet) -> list[Promise]:
        """What every effect that the set lacks would save, were the model linear."""
        if node.key in self._promises:
            return self._promises[node.key]
        found: dict[tuple[str, str], tuple[Candidate, list[Start]]] = {}
        for score, amplitudes in zip(*self.scores(node), strict=True):
            candidate = score.template.candidate
            if not score.testable or not joins(candidate, node):
                continue
            gain = float(np.linalg.norm(score.direction.T @ node.fit.residual) ** 2)
            if candidate.one_sided and amplitudes[0] <= 0:
                gain = 0.0
            starts = found.setdefault(candidate.key, (candidate, []))[1]
            starts.append(Start(gain, score.template.shape, amplitudes, score.template.columns))
        mine, phi = self.cost(node), self.ground.phi
        out = []
        for candidate, starts in found.values():
            starts.sort(key=lambda s: -s.gain)
            cost = mine - starts[0].gain / phi + self.ground.price(candidate)
            out.append(Promise(cost, node, candidate, tuple(starts[:_SHAPES])))
        self._promises[node.key] = out
        return out

    def add(self, promise: Promise) -> FittedSet:
        """The set with one effect more."""
        known, candidate = begin_at(promise.node), promise.candidate
        begins = [with_effect(known, candidate, s.amplitudes, s.shape, s.columns) for s in promise.starts]
        return self.fit((*promise.node.explanation, candidate), begins)

    def drop(self, node: FittedSet, candidate: Candidate) -> FittedSet:
        """The set without one of its effects.

        What was fitted before may lie in another valley, in which the effect counts for more than it does:
        where the model promises less, it is fitted from here too.
        """
        rest = tuple(c for c in node.explanation if c is not candidate)
        promised = self.promised_without(node, candidate)
        known = self.fit(rest, [begin_at(node)], promised)
        promises_less = self._is_near(promised) and self.cost(known) > promised + _ELSEWHERE
        tried = self._dropped.get(way := (node.key, known.key))
        if promises_less and (tried is None or self.is_lower(node.fit, tried)):
            self._dropped[way] = node.fit
            self.also_from(known.explanation, [begin_at(node)])
        return self.nodes[known.key]

    def promised_without(self, node: FittedSet, candidate: Candidate) -> float:
        """What a set would cost without one of its effects, were the model linear."""
        more = node.worse_at((candidate,), [p.start for p in candidate.amplitudes])
        return self.cost(node) + more / self.ground.phi - self.ground.price(candidate)


def joins(candidate: Candidate, node: FittedSet) -> bool:
    """Can an effect be added to a set?"""
    return all(candidate.effect.combines_with(c.effect) for c in node.explanation)


def begin_at(node: FittedSet) -> Begin:
    """Where a set lies, with its slopes."""
    return Begin(node.fit.by_path, dict(zip(node.fit.paths, node.fit.jacobian.T, strict=True)))
