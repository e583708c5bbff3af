"""Looks at a pool of sets: moves one after another, from what was the best set to what is the best then.

A search begins every fit where a smaller or a larger set lies. Where one effect stands for another (a faint
negative background for water that absorbs, say), all sets that grow from it may lie in a valley that none of
them leaves, the true one among them: so sets near the best are fitted anew too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from lightfield.diagnosis.problem.candidates import Candidate, go_together
from lightfield.diagnosis.problem.problem import Explanation
from lightfield.diagnosis.search.pool.answer import named
from lightfield.diagnosis.search.pool.backward import linear_backward
from lightfield.diagnosis.search.pool.curve_of_forms import try_curves
from lightfield.diagnosis.search.pool.fitted_sets import Admits, Pool
from lightfield.diagnosis.search.pool.moves import forward, polish, thin
from lightfield.diagnosis.search.pool.rivals import seek_rivals
from lightfield.diagnosis.search.set_of_effects import FittedSet

#: Beam and fits of the first levels of additions, of later ones, and of a wider look before giving up.
#: Chosen; with half and twice of the first two ten campaigns have the same verdicts.
_BEAM, _FITS, _BEAM_AGAIN, _FITS_AGAIN, _WIDE = 4, 14, 2, 6, 6
#: Levels of additions in which everything is asked first. Chosen: time alone.
_SMALL = 4
#: Cost above the best that larger sets may have if they leave nothing but noise, and smaller ones that are
#: still tried to mend. Chosen: time alone; the first is that of swaps, the second that of rivals.
_REACH, _NEAR = 8.0, 200.0
#: Fits of a linear elimination before giving up. Chosen: time alone; half and twice alike in ten campaigns.
_MORE = 6


def direct(candidate: Candidate) -> bool:
    """Is it a named effect that acts on direct light alone?"""
    return named(candidate) and not candidate.effect.diffuse


def by_scattering(candidate: Candidate) -> bool:
    """Is it a named effect of scattered or reflected light?"""
    return named(candidate) and candidate.effect.diffuse


def everything(candidate: Candidate) -> bool:
    """Named effects and curves."""
    return True


def first(pool: Pool, _: FittedSet) -> FittedSet:
    """From the base model, and from the scene without what it states: the best small set, named set, and of
    all."""
    base = pool.nodes[frozenset()]
    # Where scattered light or a curve is what is missing, names that act on direct light alone pile up in its
    # place, and all that is tried beside them takes its time. What scattering does is more than a step from
    # clear water promises.
    forward(pool, base, _BEAM_AGAIN, _FITS_AGAIN, everything, _SMALL, anyway=by_scattering)
    polish(pool, everything)
    # Scattered and reflected light takes its time: first without.
    for start in (base, pool.as_unstated(direct)):
        forward(pool, start, _BEAM, _FITS, direct, pool.most_effects(_REACH))
        _polish_near(pool, direct)
    with_curve_of_lamp(pool)
    best = forward(pool, pool.best(named), _BEAM_AGAIN, _FITS_AGAIN, named)
    linear_backward(pool, base, named)
    linear_backward(pool, best, named)
    _polish_near(pool, named)
    if not all(map(named, pool.problem.candidates)):
        _curves(pool)
    return pool.best()


def _polish_near(pool: Pool, allowed: Admits) -> None:
    """Drops and swaps around the best set of some effects, where that is not far from the best of all."""
    if pool.cost(pool.best(allowed)) < pool.cost(pool.best()) + _NEAR:
        polish(pool, allowed)


def with_curve_of_lamp(pool: Pool) -> FittedSet:
    """The best set; where a curve of the lamp does better than named forms of its beam, what it grows to.

    Of a lamp that no formula describes these stand for all that is missing, and few fits are left for light
    that is scattered or reflected once all sets about them were tried in it.
    """
    best = pool.best()
    try_curves(pool, best, best.names)
    if pool.best() is not best:
        polish(pool, lambda candidate: not candidate.effect.diffuse)
        polish(pool, everything)
    return pool.best()


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


def beyond(node: FittedSet) -> Callable[[Pool, FittedSet], FittedSet]:
    """A look at what more named effects make of a set that may not be the best."""

    def look(pool: Pool, _: FittedSet) -> FittedSet:
        forward(pool, node, _BEAM_AGAIN, _FITS_AGAIN, named)
        return pool.best()

    return look


def again(pool: Pool, _: FittedSet) -> FittedSet:
    """From what was the best under other errors."""
    polish(pool, everything)
    forward(pool, pool.best(), _BEAM_AGAIN, _FITS_AGAIN, everything)
    linear_backward(pool, pool.best(), named)
    return polish(pool, everything)


def afresh(pool: Pool, best: FittedSet) -> FittedSet:
    """Once sets around the best were fitted anew that have no curve and ask for no trace: from typical sizes
    of their effects in the water that the scene states."""
    for explanation in list(_around(pool, best)):
        if all(map(direct, explanation)) and pool.affordable(explanation):
            pool.anew(explanation)
    return best if pool.best() is best else polish(pool, everything)


def _around(pool: Pool, best: FittedSet) -> Iterator[Explanation]:
    """Sets of the pool that differ by one effect from the named ones of a set, and these with any other."""
    own = [c for c in best.explanation if named(c)]
    mine = {c.name for c in own}
    for node in pool.nodes.values():
        theirs = {c.name for c in node.explanation}
        if max(len(mine - theirs), len(theirs - mine)) <= 1:
            yield node.explanation
    for candidate in pool.problem.candidates:
        whole = (*own, candidate)
        if go_together(whole) and frozenset(c.key for c in whole) not in pool.nodes:
            yield whole


def wider(pool: Pool, best: FittedSet) -> FittedSet:
    """Another look before giving up."""
    forward(pool, pool.nodes[frozenset()], _WIDE, _FITS, named, patience=2)
    other = polish(pool, named)
    for node in {other.key: other, best.key: best}.values():
        linear_backward(pool, node, named, _MORE)
    polish(pool, named)
    return polish(pool, everything)


def beside_rivals(pool: Pool, best: FittedSet) -> FittedSet:
    """Beside the best sets without each of its effects: the first of those that is better, if one is."""
    for candidate in best.explanation:
        seek_rivals(pool, best, candidate)
        if pool.best() is not best:
            return pool.best()
    thin(pool)
    return pool.best()


def around(pool: Pool, _: FittedSet) -> FittedSet:
    """By single moves alone."""
    return polish(pool, everything)


def to_the_end(pool: Pool, best: FittedSet) -> FittedSet:
    """By derivatives of its own; where it lies lower by them, what it is without one of its effects too."""
    exact = pool.exact(best)
    if pool.is_lower(exact.fit, best.fit):
        for candidate in exact.explanation:
            if pool.affordable(c for c in exact.explanation if c is not candidate):
                pool.finished(pool.drop(exact, candidate))
        if pool.best() is not exact:
            return to_the_end(pool, pool.best())
    return exact
