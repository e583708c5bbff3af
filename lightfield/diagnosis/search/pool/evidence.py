"""How sure each effect of the best set is: what the best set without it costs more.

The significance of an effect beside the others says nothing about other effects that could stand in for it;
the gap to the best set without it does.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np

from lightfield.diagnosis.adequacy.subspace import INDEPENDENT, beside, orthonormal
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.followed import is_of_the_search_alone
from lightfield.diagnosis.search.pool.beyond import needless_beyond
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.gains_or_water import ABSORPTION, water_may_do_it
from lightfield.diagnosis.search.pool.uneven_lamp import may_be_detail, of_an_uneven_lamp
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.beam_width import WIDTH
from lightfield.fitting.effects.free_form import BEAM_PROFILE

#: Gaps in cost to the best set without an effect: of named effects; with a curve that contains it too; and,
#: of named effects again, at equal weight for every parameter, with at most one effect more: a curve that
#: contains an effect always does as well where parsimony does not count. Chosen on 100 simulated sets,
#: scanned on others: 1 % of the names that are called certain are wrong. By so much as the last one effect
#: more may be ahead, too, of a name that is called the simplest: of 53 such names in campaigns 9 were wrong,
#: 6 of these and 11 of the right ones were beyond it.
NAMED_GAP, GAP, PLUS_GAP = 6.0, 3.0, 3.0
#: Where something stays unexplained the gaps must be this many times its chi-square, taken to be no less than
#: this for each reading. Chosen: factors below 5 gave wrong names.
_PARTIAL, _PARTIAL_FLOOR = 10.0, 0.05
#: Sets that cost no more than this above the best are accepted beside it. Derived: beyond, evidence against a
#: set is called very strong (Kass and Raftery 1995, doi:10.1080/01621459.1995.10476572). With half of it one
#: of ten campaigns is told other alternatives, with twice none.
FAMILY = 10.0
#: Where scattered light is known by the trace of the search alone its errors may pass for effects of
#: so many sigma. Chosen: beside an oval lamp off its place, in readings without noise, they made an apparent
#: source of 12.
_ROUGH_LIGHT = 15.0
#: Readings tell the scene's absorption from none by so many standard errors. Chosen: water whose scene is a
#: quarter off ends at none by chance in one of ten thousand.
_TELLS = 5.0
#: Variance over the stated one that is more than errors leave, beside a lamp whose detail may be missed.
#: Chosen: as `course._TOO_SMALL`; two kinked lamps of `benchmarks/lamps` left 2.0, with wrong names.
_LEAVES_MORE = 1.5
#: What stands in for gains of planes: an attenuation that changes along the tank.
_K_OF_Z = ("attenuation_profile",)


@dataclass(frozen=True)
class Evidence:
    """What is known of one effect of the best set.

    Parameters
    ----------
    sigma_to_remove : float
        By how much the others, refitted, are worse without it.
    gap, gap_named, gap_plus : float
        Cost of the best set without it above that of the best: of any, of those without a curve that
        contains it, of these with at most one effect more and parameters counted alike.
    rival : FittedSet
        The best set without it.
    alternatives : tuple of tuple of str
        What replaces it in accepted sets.
    without : FittedSet
        The best set less this effect.
    weight : float
        Share of exp(-cost/2) of all sets that holds it; counts parsimony as evidence, and decides nothing.
    beyond : tuple of str
        Effects at the end of their range: were they larger, this one would not be needed.
    other_lamp : bool
        A lamp of another shape would do what it and others of the set do.
    """

    candidate: Candidate
    level: Certainty
    sigma_to_remove: float
    gap: float
    gap_named: float
    gap_plus: float
    rival: FittedSet | None
    alternatives: tuple[tuple[str, ...], ...]
    without: FittedSet | None
    weight: float
    beyond: tuple[str, ...] = ()
    other_lamp: bool = False

    @property
    def is_claimed(self) -> bool:
        """Is it the answer, or the simplest one?"""
        return self.level.is_claimed

    def in_part(self, left: float) -> Evidence:
        """The same where the set holds something of which only the place is known.

        Parameters
        ----------
        left : float
            Chi-square that the set leaves beyond the stated errors, in the unit of the gaps.
        """
        sure = self.level == Certainty.CERTAIN and min(self.gap, self.gap_named) > _PARTIAL * left
        return replace(self, level=Certainty.PARTIAL if sure else Certainty.ONE_OF)

    def against(self, weighing: Weighing, rival: FittedSet) -> Evidence:
        """The same of a claimed effect where one more set does without it."""
        above, unpriced = weighing.above(rival), weighing.above_unpriced(rival)
        gap, named, plus = min(self.gap, above), min(self.gap_named, above), min(self.gap_plus, unpriced)
        instead = tuple(sorted(rival.names - weighing.best.names))
        near = above <= FAMILY and instead not in self.alternatives
        level = _weaker(self.level, _claim(gap, named, plus))
        return replace(
            self, level=level, gap=gap, gap_named=named, gap_plus=plus,
            rival=rival if above < self.gap else self.rival,
            alternatives=(*self.alternatives, instead) if near else self.alternatives,
        )  # fmt: skip


@dataclass(frozen=True)
class Weighing:
    """Costs of sets at the scale of noise that the best of them leaves.

    Parameters
    ----------
    best : FittedSet
        The answer: the set of least cost, or one of named effects that costs little more.
    phi : float
        Pure-error variance in units of the whitening, or what the answer or the set of least cost leaves,
        where that is more.
    """

    pool: Pool
    best: FittedSet
    phi: float

    @classmethod
    def of(cls, pool: Pool, best: FittedSet) -> Weighing:
        kept = int(pool.problem.keep.sum())
        left = (n.fit.chi2 / max(kept - len(n.fit.u), 1) for n in (best, pool.best()))
        return cls(pool, best, max(pool.ground.phi, min(left)))

    @property
    def leaves_more(self) -> bool:
        """Is more left than errors as they are stated leave?"""
        test = self.pool.ground.test
        return test.errors_stated and self.phi * test.scale > _LEAVES_MORE

    def above(self, node: FittedSet) -> float:
        """Cost above that of the best."""
        return self.cost(node) - self.cost(self.best)

    def cost(self, node: FittedSet) -> float:
        """Chi-square and price of a set; several effects of the best that a curve of it contains have one."""
        ground = self.pool.ground
        return ground.cost(node, self.phi) + dearer_apart(ground, self.best, node)

    def above_unpriced(self, node: FittedSet) -> float:
        """The same with every parameter at one: parsimony does not count."""
        return self._unpriced(node) - self._unpriced(self.best)

    def _unpriced(self, node: FittedSet) -> float:
        gone, worse = self.pool.ground.needless(node, self.phi)
        return (node.chi2 + worse) / self.phi + node.parameters - sum(len(c.parameters) for c in gone)

    def with_one_more(self, nodes: Iterable[FittedSet]) -> list[FittedSet]:
        """Those of some sets that have at most one effect more than the best."""
        return [n for n in nodes if len(n.explanation) <= len(self.best.explanation) + 1]

    def family(self, is_one: Callable[[FittedSet], bool] = lambda node: True) -> list[FittedSet]:
        """Accepted sets, best first: near the best, and none with an effect more than another.

        Parameters
        ----------
        is_one : callable
            Is a set other than the best accepted? One that is not bars none with an effect more.
        """
        out = [self.best]
        for node in sorted(self.pool.nodes.values(), key=self.above):
            if self.above(node) > FAMILY:
                break
            if not any(other.names <= node.names for other in out) and is_one(node):
                out.append(node)
        return out

    def weight(self, name: str) -> float:
        """Share of all sets' exp(-cost/2) that holds an effect."""
        nodes = list(self.pool.nodes.values())
        share = np.exp(-0.5 * np.array([max(self.above(n), 0.0) for n in nodes]))
        return float(share @ np.array([name in n.names for n in nodes]) / share.sum())


def dearer_apart(ground: Ground, apart: FittedSet, whole: FittedSet) -> float:
    """By how much more effects of a set cost each by itself than as one, beside a curve that contains them.

    Together they are what the curve is, one change of the readings, with as many parameters as they have. Not
    those of a beam: it has one form, and two of them together are a curve that has no name.
    """
    more = 0.0
    for curve in whole.explanation:
        if not curve.effect.is_free_form or curve.name == BEAM_PROFILE or curve.key in apart.key:
            continue
        parts = [c for c in apart.explanation if c.name in curve.effect.contains and c.key not in whole.key]
        if len(parts) > 1:
            more += sum(map(ground.price, parts)) - ground.price_of(sum(len(c.parameters) for c in parts))
    return more


def evidence(pool: Pool, best: FittedSet, adequate: bool) -> list[Evidence]:
    """What is known of every effect of the best set.

    Parameters
    ----------
    adequate : bool
        Beside the set nothing is missing.
    """
    weighing = Weighing.of(pool, best)
    beyond = needless_beyond(pool, best, NAMED_GAP) if adequate else {}
    return [_of(weighing, c, adequate, beyond.get(c.name, ())) for c in best.explanation]


def _of(weighing: Weighing, candidate: Candidate, adequate: bool, beyond: tuple[str, ...]) -> Evidence:
    pool, best, name = weighing.pool, weighing.best, candidate.name
    less = [n for n in pool.nodes.values() if not has(name, n)]
    named = [n for n in less if not contained(name, n)]
    gap, gap_named = _least(weighing.above(n) for n in less), _least(weighing.above(n) for n in named)
    gap_plus = _least(weighing.above_unpriced(n) for n in weighing.with_one_more(named))
    rest = pool.nodes.get(best.key - {candidate.key})
    sigma = np.sqrt(max(rest.fit.chi2 - best.fit.chi2, 0.0) / weighing.phi) if rest else float("nan")
    like_water = water_may_do_it(pool, best, candidate)
    other_lamp = adequate and may_be_another_lamp(pool, best, candidate)
    # Detail of a lamp that its finest curve misses, where as much is left.
    missed = weighing.leaves_more and may_be_detail(pool, best, candidate)
    if candidate.is_hardly_tested or like_water:  # that it fits says nothing: any would
        level = Certainty.ONE_OF
    elif not adequate:
        left = max(_left(weighing), _PARTIAL_FLOOR * float(pool.problem.keep.sum()))
        part = min(gap, gap_named) > _PARTIAL * left and not _strained(best)
        level = Certainty.PARTIAL if part else Certainty.ONE_OF
    elif beyond or missed or _at_edge(pool, best, candidate) or _only_contained(name, pool.best()):
        level = Certainty.ONE_OF
    else:
        rough = sigma < _ROUGH_LIGHT and is_of_the_search_alone(pool.problem, best.fit)
        most = Certainty.SIMPLEST if other_lamp or rough else Certainty.CERTAIN
        level = _weaker(_claim(gap, gap_named, gap_plus), most)
    return Evidence(
        candidate, level, float(sigma), gap, gap_named, gap_plus, min(less, key=weighing.above, default=None),
        _alternatives(weighing, name, (_K_OF_Z,) if like_water else ()), rest, weighing.weight(name),
        beyond, other_lamp,
    )  # fmt: skip


def may_be_another_lamp(pool: Pool, node: FittedSet, candidate: Candidate) -> bool:
    """Would a lamp of another shape do what an effect and others of its set do together?

    Two forms of a beam are terms of any shape: its curve, with more functions, does as well.
    """
    of_shape = len(_forms(pool, node, candidate, (BEAM_PROFILE,))) > 1
    of_lamp = candidate in of_an_uneven_lamp(node.explanation)
    return of_shape or of_lamp or may_be_detail(pool, node, candidate)


def _claim(gap: float, gap_named: float, gap_plus: float) -> Certainty:
    """How sure an effect is by its gaps, where nothing else speaks against it."""
    if not (gap_named > NAMED_GAP and gap > GAP):
        return Certainty.ONE_OF
    if gap_plus > PLUS_GAP:
        return Certainty.CERTAIN
    return Certainty.SIMPLEST if gap_plus > -PLUS_GAP else Certainty.ONE_OF


def _weaker(one: Certainty, other: Certainty) -> Certainty:
    """The less sure of two levels."""
    return max(one, other, key=list(Certainty).index)


def contained(name: str, node: FittedSet) -> bool:
    """Does a set hold a curve of which an effect is a special case?"""
    return any(name in c.effect.contains for c in node.explanation)


def has(name: str, node: FittedSet) -> bool:
    """Does a set hold an effect, or a curve that is a kind of it?"""
    return any(name == c.name or name in c.effect.kind_of for c in node.explanation)


def _only_contained(name: str, node: FittedSet) -> bool:
    """Does a set hold a curve that may be something else than the effect that is a special case of it?"""
    return contained(name, node) and not has(name, node)


def _least(costs: Iterable[float]) -> float:
    return min(costs, default=float("inf"))


def _left(weighing: Weighing) -> float:
    """Chi-square of the best set beyond the noise, in the unit of the gaps."""
    pool, fit = weighing.pool, weighing.best.fit
    spare = int(pool.problem.keep.sum()) - len(fit.u)
    return (fit.chi2 / pool.ground.phi - spare) * pool.ground.phi / weighing.phi


def _at_edge(pool: Pool, node: FittedSet, candidate: Candidate) -> bool:
    """Does an amplitude lie at an edge of what is plausible, or the beam or water that all effects act on?

    Or another form of the same curve: what two of them make together, one beyond its range, is that curve.
    """
    forms = _forms(pool, node, candidate)
    # The range of the width is chosen; where it lies at its end all sets are compared there. Where its error
    # reaches there it may be without end, and what is known of directions is what is found beside it.
    # A curve and the width make up for each other, and are one beam: of the curve it is asked as it is.
    held = {p.path for p in candidate.amplitudes if candidate.name == BEAM_PROFILE}
    open_ = candidate.effect.of_direction and width_reaches_its_end(pool, node, held)
    at_end = any(p.path in node.edges for c in forms for p in c.amplitudes)
    return at_end or open_ or WIDTH in node.bounded or absorbs_nothing(pool, node)


def width_reaches_its_end(pool: Pool, node: FittedSet, held: Collection[str] = ()) -> bool:
    """Does the beam's width, beside parameters that are held, lie within one of its errors of an end of its
    range?"""
    fit = node.fit
    if WIDTH not in fit.paths:
        return False
    i = fit.paths.index(WIDTH)
    parameter, u = fit.model.parameters[i], float(fit.u[i])
    sigma = float(np.sqrt(fit.covariance(pool.ground.phi, held)[i, i]))
    return min(u - parameter.low, parameter.high - u) < sigma


def absorbs_nothing(pool: Pool, node: FittedSet) -> bool:
    """Does the water absorb nothing, though by its scene it should, and the readings could tell?

    All effects of such a set may make up for what the water does.
    """
    if ABSORPTION not in node.bounded:
        return False
    fit = node.fit
    i = fit.paths.index(ABSORPTION)
    own = beside(orthonormal(fit.jacobian[:, ~fit.at_bound()], INDEPENDENT), fit.jacobian[:, i : i + 1])
    away = pool.problem.forward.scene.water.absorption_per_m - fit.values[ABSORPTION]
    return bool(away * np.linalg.norm(own) > _TELLS * np.sqrt(pool.ground.phi))


def _forms(
    pool: Pool, node: FittedSet, candidate: Candidate, curves: tuple[str, ...] | None = None
) -> list[Candidate]:
    """An effect, and others of its set that are special cases of the same curve, of some curves or any."""
    alike = {
        name
        for c in pool.problem.candidates
        if candidate.name in c.effect.contains and (curves is None or c.name in curves)
        for name in c.effect.contains
    }
    return [c for c in node.explanation if c is candidate or c.name in alike]


def _strained(node: FittedSet) -> bool:
    """Does an amplitude of any effect lie at a bound? Then a set that misses something bends to follow it."""
    return any(p.path in node.bounded for c in node.explanation for p in c.amplitudes)


def _alternatives(
    weighing: Weighing, name: str, known: tuple[tuple[str, ...], ...] = ()
) -> tuple[tuple[str, ...], ...]:
    """What other accepted sets, and sets of one effect more that do as well, hold in place of an effect;
    after what is known to do so."""
    best, out = weighing.best, list(known)
    near = [n for n in weighing.family() if not has(name, n)]
    others = [n for n in weighing.pool.nodes.values() if not has(name, n) and not contained(name, n)]
    plus = sorted(weighing.with_one_more(others), key=weighing.above_unpriced)
    near += [n for n in plus[:1] if weighing.above_unpriced(n) <= PLUS_GAP]
    for node in near:
        instead = tuple(sorted(node.names - best.names))
        if instead and not any(set(other) <= set(instead) for other in out):
            out.append(instead)
    return tuple(out)
