"""Sets near the best, fitted anew from typical sizes of their effects in the water that the scene states.

A search begins every fit where a smaller or a larger set lies. Where one effect stands for another (a faint
negative background for water that absorbs, say), all sets that grow from it may lie in a valley that none of
them leaves, the true one among them.
"""

from __future__ import annotations

from collections.abc import Iterator

from lightfield.diagnosis.problem.candidates import Candidate, go_together
from lightfield.diagnosis.problem.problem import Explanation
from lightfield.diagnosis.search.pool.fitted_sets import Admits, Pool
from lightfield.diagnosis.search.pool.moves import polish
from lightfield.diagnosis.search.set_of_effects import FittedSet


def beside_fresh_fits(pool: Pool, found: FittedSet, allowed: Admits) -> FittedSet:
    """The best set, once those around it were fitted anew that have no curve and ask for no trace."""
    for explanation in list(_around(pool, found)):
        if all(_is_quick(c) and allowed(c) for c in explanation) and pool.affordable(explanation):
            pool.anew(explanation)
    return found if pool.best() is found else polish(pool, allowed)


def _around(pool: Pool, found: FittedSet) -> Iterator[Explanation]:
    """Sets of the pool that differ by one effect from the named ones of a set, and these with any other."""
    named = [c for c in found.explanation if not c.effect.is_free_form]
    mine = {c.name for c in named}
    for node in pool.nodes.values():
        theirs = {c.name for c in node.explanation}
        if max(len(mine - theirs), len(theirs - mine)) <= 1:
            yield node.explanation
    for candidate in pool.problem.candidates:
        whole = (*named, candidate)
        if go_together(whole) and frozenset(c.key for c in whole) not in pool.nodes:
            yield whole


def _is_quick(candidate: Candidate) -> bool:
    return not (candidate.effect.diffuse or candidate.effect.is_free_form)
