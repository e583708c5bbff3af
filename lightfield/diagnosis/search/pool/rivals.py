"""The best set without one of the effects: what an effect is worth is what all others cannot do together."""

from __future__ import annotations

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.linear_pairs import Pair, linear_pairs
from lightfield.diagnosis.search.pool.curve_of_forms import try_curves
from lightfield.diagnosis.search.pool.equivalences import try_beside, try_declared
from lightfield.diagnosis.search.pool.fitted_sets import Admits, Pool, begin_at, joins
from lightfield.diagnosis.search.pool.moves import fit_additions, forward, polish
from lightfield.diagnosis.search.pool.quick import with_effect
from lightfield.diagnosis.search.set_of_effects import FittedSet

#: Sets of a level that are added to and fitted, levels, and levels without a gain. Chosen, as all here: the
#: smallest that mended what was called certain wrongly.
_BEAM, _FITS, _LEVELS, _PATIENCE = 3, 7, 2, 2
#: Pairs that are fitted in place of the effect. Chosen, as above.
_PAIRS = 3
#: Rounds of drops and swaps after that, and swaps in each: what became superfluous goes. Chosen, as above.
_ROUNDS, _SWAPS, _REACH = 2, 5, 6.0
#: Cost above the best at which a second effect more, and then drops and swaps, are still tried. Chosen: a
#: rival has to come down to ten.
_FAR, _NEAR = 1000.0, 200.0


def seek_rivals(pool: Pool, best: FittedSet, candidate: Candidate) -> None:
    """Fit sets that may do as well without one of the effects."""

    def without(other: Candidate) -> bool:
        return other.name != candidate.name

    rest = [c for c in best.explanation if c is not candidate]
    if pool.affordable(rest):
        dropped = pool.finished(pool.drop(best, candidate))
        # Far from the best what they cost need not be known to the end.
        fit_additions(pool, [dropped], _FITS, without)
        if _far(pool, best, without) < _FAR:
            forward(pool, dropped, _BEAM, _FITS, without, _LEVELS, _PATIENCE)
        for _, pair in _pairs(pool, dropped, without)[:_PAIRS]:
            whole, begin = dropped.explanation, begin_at(dropped)
            for score, amplitudes in pair:
                one = score.template
                whole = (*whole, one.candidate)
                begin = with_effect(begin, one.candidate, amplitudes, one.shape, one.columns)
            if pool.affordable(whole):
                pool.fit(whole, [begin])
    try_declared(pool, best, candidate)
    try_beside(pool, best, candidate)
    try_curves(pool, best, [candidate.name])
    if _far(pool, best, without) < _NEAR:
        polish(pool, without, _ROUNDS, _SWAPS, _REACH)


def _far(pool: Pool, best: FittedSet, allowed: Admits) -> float:
    """Cost of the best set of allowed effects above that of the best."""
    return pool.cost(pool.best(allowed)) - pool.cost(best)


def _pairs(pool: Pool, node: FittedSet, allowed: Admits) -> list[Pair]:
    """Pairs of named effects that together lower chi-square most."""
    usable = [
        score
        for score in pool.scores(node)[0]
        if score.testable and allowed(c := score.template.candidate) and joins(c, node)
        if not c.effect.is_free_form
    ]
    return linear_pairs(usable, node.fit.residual)
