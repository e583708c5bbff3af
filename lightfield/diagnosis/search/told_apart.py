"""How far apart explanations are with these readings, and how small an effect they would have shown.

D is the noise-free distance, in sigma, between the readings under one explanation and the nearest readings
that another can produce. No method names the right one of two with probability above Phi(D/2) without prior
knowledge.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from lightfield.arrays import TINY, Array
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.adequacy.score_tests import Adequacy, Score
from lightfield.diagnosis.adequacy.subspace import beside, orthonormal
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.fitting.least_squares import Fit, Whiten

#: What would have been seen would have been missed with this probability. Chosen, as is usual.
MISSED = 0.05
#: Tests that share the level: forms of effects and unknowns of a usual layout. Chosen, roughly: were they
#: half or twice as many, DETECTABLE_SIGMA, 5.2, would be 0.2 less or more (test_told_apart.py has 25).
_TESTS = 25
#: Projected size, in sigma, that is found with 95 % probability at the family-wise level. Derived.
DETECTABLE_SIGMA = float(-special.ndtri(ALPHA / (2 * _TESTS)) - special.ndtri(MISSED))
#: Explanations nearer than this belong to one class. Derived: the best method there is names the wrong one of
#: two in Phi(-D/2) = 7 of 100 cases.
SAME_CLASS_SIGMA = 3.0
#: Steps of the fit of an imitation, and what it may leave of chi-square. Chosen: a hundredth of a sigma.
_STEPS, _LEFT = 60, 1e-4
#: Of many readings a rival may be the nearest when its square distance is no more times the least of a
#: sample. Chosen: that of a seventh of the readings is known to a few per cent.
_AS_NEAR = 2.0
#: Shapes of an effect that stand for all of it together. Derived: the table's have no more.
_FEW_SHAPES = 4
#: Rivals by BIC whose distance is worked out. Chosen: time against thoroughness.
_RIVALS = 4


@dataclass(frozen=True)
class Rival:
    """Another explanation and its distance from the one that is claimed."""

    explanation: ScoredSet
    separation_sigma: float
    fit: Fit


def separation(
    problem: Problem, whiten: Whiten, truth: Fit, rival: ScoredSet, phi: float, left: float = _LEFT
) -> Rival:
    """Distance from the readings under `truth` to the nearest that the rival can produce.

    `left`: what a step of the imitation may leave of chi-square.
    """
    imitation = problem.fit(
        rival.explanation, whiten, [rival.fit.u], max_steps=_STEPS, value=truth.prediction, tolerance=left
    )
    return Rival(rival, float(np.sqrt(max(imitation.chi2, 0.0) / phi)), imitation)


def nearest_rival(
    problem: Problem, whiten: Whiten, best: ScoredSet, tried: list[ScoredSet], phi: float
) -> Rival | None:
    """The explanation of the same size by other effects that comes nearest to the best one."""
    others: dict[tuple[str, ...], ScoredSet] = {}
    for one in sorted(tried, key=lambda t: t.bic):
        if one.names != best.names and len(one.explanation) == len(best.explanation):
            others.setdefault(one.names, one)
    rivals = [
        separation(problem, whiten, best.fit, one, phi)
        for one in _nearest(problem, whiten, best.fit, list(others.values())[:_RIVALS])
    ]
    return min(rivals, key=lambda r: r.separation_sigma, default=None)


def _nearest(problem: Problem, whiten: Whiten, truth: Fit, rivals: list[ScoredSet]) -> list[ScoredSet]:
    """Those of the rivals that may be the nearest; of many readings as a sample has them."""
    if problem.sample is None or not isinstance(whiten, Whitener):
        return rivals
    rows, some = problem.sample
    seen, own = truth.prediction[rows], whiten.of(rows)
    away = [
        some.fit(one.explanation, own, [one.fit.u], max_steps=_STEPS, value=seen, tolerance=_LEFT).chi2
        for one in rivals
    ]
    return [one for one, chi2 in zip(rivals, away, strict=True) if chi2 <= _AS_NEAR * min(away)]


@dataclass(frozen=True)
class Limit:
    """Smallest size of an effect that these readings would have shown, in the parameter's own unit."""

    effect: str
    path: str
    value: float
    reachable: bool


def unseen_effects(
    scores: Iterable[Score], seen_by: Iterable[Score], absorbed: Hinders
) -> dict[str, tuple[Hindrance, ...]]:
    """Effects of some scores that none of others can show, and why.

    Parameters
    ----------
    absorbed : Hinders
        Of those that act, and are taken for what is free.
    """
    seen = {s.template.candidate.name for s in seen_by if s.testable}
    found: dict[str, Hinders] = {}
    for score in scores:
        name = score.template.candidate.name
        if name not in seen:
            found[name] = absorbed if score.acts else found.get(name, Hinders.NOTHING_THERE)
    return {name: (Hindrance(why),) for name, why in found.items()}


def of_what_is_stated(scores: Iterable[Score]) -> list[Score]:
    """Of each effect that the scene has, at the shape that it states."""
    first: dict[str, Score] = {}
    for score in scores:
        if score.template.candidate.is_stated:
            first.setdefault(score.template.candidate.name, score)
    return list(first.values())


def detection_limits(adequacy: Adequacy, scale: float) -> dict[str, Limit]:
    """Detection limit of every effect that is not in the fit, from its projected template.

    The size at which its own test alone falls below the level that the worst of all tests must reach, with
    a probability of 95 %: a t whose scale is estimated, off from nought by the size in its errors. Beside
    what the scene states, of another size too: a background that was found before, and stated since, has
    taken what it could of an effect.

    Parameters
    ----------
    scale : float
        Pure-error variance in units of the whitening.
    """
    stated = of_what_is_stated(adequacy.scores)
    out: dict[str, Limit] = {}
    for score in adequacy.scores:
        name = score.template.candidate.name
        if score.testable and name not in out:
            parameter = score.template.candidate.amplitudes[0]
            level = adequacy.critical_p / (1 if score.template.candidate.one_sided else 2)
            sigmas = special.nctdtrinc(adequacy.nu, MISSED, -special.stdtrit(adequacy.nu, level))
            others = [s.direction for s in stated if s.template.candidate.name != name]
            size = float(sigmas) * np.sqrt(scale) / max(_length_beside(score, others), TINY)
            room = max(parameter.high - parameter.start, parameter.start - parameter.low)
            at = min(size, room)
            toward = parameter.start + at if parameter.start + at <= parameter.high else parameter.start - at
            value = parameter.value(toward)
            if parameter.coordinate == "linear":
                value = abs(value - parameter.value(parameter.start))
            out[name] = Limit(name, parameter.path, float(value), bool(size <= room))
    return out


def _length_beside(score: Score, others: Sequence[Array]) -> float:
    """What one unit of an effect changes beside the fit and beside directions of other effects."""
    if not others:
        return score.length
    left = beside(orthonormal(np.hstack(others)), score.unit[:, None])
    return float(np.linalg.norm(left))


@dataclass(frozen=True)
class Isolability:
    """What a layout can detect and tell apart, at stated sizes of the effects.

    Parameters
    ----------
    names : tuple of str
    sizes : array, shape (k,)
        Size of each effect in the coordinate of its first amplitude.
    delta : array, shape (k,)
        Distance of each effect from the base model, in sigma.
    D : array, shape (k, k)
        D[j, k]: distance of effect j at its size from the nearest readings that effect k can produce.
    """

    names: tuple[str, ...]
    sizes: Array
    delta: Array
    D: Array

    def classes(self) -> list[tuple[str, ...]]:
        """Effects that a layout sees but cannot tell apart, in groups of at least two."""
        near = np.minimum(self.D, self.D.T) < SAME_CLASS_SIGMA
        seen = self.delta >= DETECTABLE_SIGMA
        groups: list[set[int]] = []
        for i in np.flatnonzero(seen):
            linked = {int(j) for j in np.flatnonzero(near[i] & seen)} | {int(i)}
            for group in [g for g in groups if g & linked]:
                groups.remove(group)
                linked |= group
            groups.append(linked)
        return [tuple(self.names[i] for i in sorted(g)) for g in groups if len(g) > 1]


def at_once(scores: Sequence[Score]) -> list[list[int]]:
    """Which templates of one effect stand together for what it can do, by their numbers.

    All, where there are few. Of many shapes, as a formula of the user's own has them, each alone: together
    they would do what no one of them does.
    """
    if all(len(score.template.candidate.grid) <= _FEW_SHAPES for score in scores):
        return [list(range(len(scores)))]
    return [[k] for k in range(len(scores))]


def isolability(scores: tuple[Score, ...], sizes: dict[str, float], phi: float) -> Isolability:
    """Linear isolability: an effect's distance from the span of each other effect's templates: of all its
    shapes, or of each one, see `at_once`.

    Parameters
    ----------
    scores : tuple of Score
        Projected templates at the base model.
    sizes : dict
        Size of each effect's first amplitude, in its coordinate.
    """
    first: dict[str, Score] = {}
    alike: dict[str, list[Score]] = {}
    for score in scores:
        if score.testable and score.template.candidate.name in sizes:
            first.setdefault(score.template.candidate.name, score)
            alike.setdefault(score.template.candidate.name, []).append(score)
    names = tuple(first)
    vectors = []
    for name in names:
        score = first[name]
        along = np.zeros(score.to_amplitude.shape[0])
        along[0] = sizes[name]
        vectors.append(score.direction @ np.linalg.pinv(score.to_amplitude) @ along / np.sqrt(phi))
    delta = np.array([np.linalg.norm(v) for v in vectors])
    D = np.zeros((len(names), len(names)))
    for k, name in enumerate(names):
        for n, some in enumerate(at_once(alike[name])):
            basis = orthonormal(np.hstack([alike[name][i].direction for i in some]))
            away = np.linalg.norm(beside(basis, np.column_stack(vectors)), axis=0)
            D[:, k] = away if n == 0 else np.minimum(D[:, k], away)
        D[k, k] = 0.0
    return Isolability(names, np.array([sizes[n] for n in names]), delta, D)
