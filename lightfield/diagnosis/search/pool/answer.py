"""Which of the sets that pass is the answer: named effects before curves, and none that noise made."""

from __future__ import annotations

from collections.abc import Iterator

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.pool.evidence import Weighing, dearer_apart
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.pool.rivals import seek_rivals
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.effects.local import FAMILY as UNKNOWN

#: Cost by which a curve has to be better than named effects in its place. Chosen on a third of the sets of
#: `benchmarks.many_effects`: where the beam's was cheaper by less, forms of the beam were hidden, in 4 of 4;
#: of 54 lamps that are no Gaussian, and were named by it, it was cheaper by 6.9 at least. By the same margin
#: any set takes the place of another that passes: of sets ahead by one to five most were no better.
NAMED_FIRST = 5.0


def named(candidate: Candidate) -> bool:
    """Is it a named effect, not a curve?"""
    return not candidate.effect.is_free_form


def the_answer(pool: Pool, found: FittedSet, alpha: float) -> FittedSet:
    """What was found, or a set of the pool that is the better answer, fitted with all its derivatives; its
    rivals are sought then.

    Parameters
    ----------
    found : FittedSet
        A set that passes the test.
    alpha : float
        Level of the test.
    """
    for sets in (_named_first, _cheaper_by_what_is_left, _within_their_ranges):
        for node in sets(pool, found):
            exact = pool.exact(node)
            if pool.ground.test(exact.fit).passes(alpha):
                for candidate in exact.explanation:
                    seek_rivals(pool, exact, candidate)
                found = exact
                break
    return found


def _named_first(pool: Pool, found: FittedSet) -> Iterator[FittedSet]:
    """Sets with fewer curves that cost little more; those with fewest first, of these the cheapest.

    A curve follows whatever named effects it contains, and the noise besides. Where it is cheaper all the
    same, they are one of two ways to see it. Several in its place have one price, as it has. A local unknown
    is no name.
    """
    curves, limit = _curves(found), pool.cost(found) + NAMED_FIRST
    near: list[tuple[int, float, FittedSet]] = []
    for node in pool.nodes.values():
        fewer = _curves(node)
        unknown = any(c.effect.family == UNKNOWN and c.key not in found.key for c in node.explanation)
        if (
            fewer < curves
            and not unknown
            and (cost := pool.cost(node)) <= limit + dearer_apart(pool.ground, node, found)
        ):
            near.append((len(fewer), cost, node))
    for *_, node in sorted(near, key=lambda one: one[:2]):
        yield node


def _cheaper_by_what_is_left(pool: Pool, found: FittedSet) -> Iterator[FittedSet]:
    """Sets that cost less by more than names are worth, at the scale of noise by which gaps are told.

    Sets are sought at the pure error, which a rich model may take for too small: effects are then added that
    describe noise.
    """
    weighing = Weighing.of(pool, found)
    for node in sorted(pool.nodes.values(), key=weighing.above):
        if weighing.above(node) > -NAMED_FIRST:
            break
        yield node


def _within_their_ranges(pool: Pool, found: FittedSet) -> Iterator[FittedSet]:
    """Where an effect is as large as is plausible at most, sets that cost little more without one that is,
    cheapest first: of effects that do alike one with a number less can be that, and that alone, cheaper."""
    if not found.at_edge:
        return
    curves, limit = _curves(found), pool.cost(found) + NAMED_FIRST
    for node in sorted(pool.nodes.values(), key=pool.cost):
        if pool.cost(node) > limit:
            break
        if not node.at_edge and _curves(node) <= curves:
            yield node


def _curves(node: FittedSet) -> set[tuple[str, str]]:
    return {c.key for c in node.explanation if not named(c)}
