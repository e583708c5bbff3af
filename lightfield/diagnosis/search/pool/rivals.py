"""The best set without one of the effects: what an effect is worth is what all others cannot do together."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.subspace import TINY
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.pool.curve_of_forms import try_curves
from lightfield.diagnosis.search.pool.equivalences import try_beside, try_declared
from lightfield.diagnosis.search.pool.fitted_sets import Allowed, Node, Pool, begin_at, joins, with_effect
from lightfield.diagnosis.search.pool.moves import fit_additions, forward, polish

#: Sets of a level that are added to and fitted, levels, and levels without a gain. Chosen, as all here: the
#: smallest that mended what was called certain wrongly.
_BEAM, _FITS, _LEVELS, _PATIENCE = 3, 7, 2, 2
#: Pairs that are fitted in place of the effect.
_PAIRS = 3
#: Rounds of drops and swaps after that, and swaps in each: what became superfluous goes.
_ROUNDS, _SWAPS, _REACH = 2, 5, 6.0
#: Cost above the best at which a second effect more, and then drops and swaps, are still tried. Chosen: a
#: rival has to come down to ten.
_FAR, _NEAR = 1000.0, 200.0
#: Keeps the normal equations of two templates that are one solvable.
_RIDGE = 1e-7

_Begun = tuple[Candidate, tuple[float, ...], Array, Array]


def seek_rivals(pool: Pool, best: Node, candidate: Candidate) -> None:
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
        for pair in _pairs(pool, dropped, without):
            whole = (*dropped.explanation, *(c for c, *_ in pair))
            begin = begin_at(dropped)
            for one, shape, amplitudes, columns in pair:
                begin = with_effect(begin, one, amplitudes, shape, columns)
            if pool.affordable(whole):
                pool.fit(whole, [begin])
    try_declared(pool, best, candidate)
    try_beside(pool, best, candidate)
    try_curves(pool, best, candidate)
    if _far(pool, best, without) < _NEAR:
        polish(pool, without, _ROUNDS, _SWAPS, _REACH)


def _far(pool: Pool, best: Node, allowed: Allowed) -> float:
    """Cost of the best set of allowed effects above that of the best."""
    return pool.cost(pool.best(allowed)) - pool.cost(best)


def _pairs(pool: Pool, node: Node, allowed: Allowed) -> list[tuple[_Begun, _Begun]]:
    """Pairs of named effects that together lower chi-square most, by least squares on their templates."""
    usable = [
        score
        for score in pool.scores(node)[0]
        if score.testable and allowed(c := score.template.candidate) and joins(c, node)
        if not c.effect.is_free_form
    ]
    if len(usable) < 2:
        return []
    columns = np.hstack([s.direction for s in usable])
    gram = columns.T @ columns + _RIDGE * np.eye(columns.shape[1])
    drawn = columns.T @ node.fit.residual
    ends = np.cumsum([s.direction.shape[1] for s in usable]).tolist()
    rows = [np.arange(e - s.direction.shape[1], e) for s, e in zip(usable, ends, strict=True)]
    found: dict[frozenset[tuple[str, str]], tuple[float, tuple[_Begun, _Begun]]] = {}
    for i, one in enumerate(usable):
        for j, two in enumerate(usable[:i]):
            first, second = one.template.candidate, two.template.candidate
            if not first.effect.combines_with(second.effect):
                continue
            at = np.r_[rows[i], rows[j]]
            weights = np.linalg.solve(gram[np.ix_(at, at)], drawn[at])
            q = len(rows[i])
            sizes = one.to_amplitude @ weights[:q], two.to_amplitude @ weights[q:]
            if any(c.one_sided and a[0] < TINY for c, a in zip((first, second), sizes, strict=True)):
                continue
            gain, key = float(weights @ drawn[at]), frozenset((first.key, second.key))
            if key not in found or gain > found[key][0]:
                a, b = one.template, two.template
                pair = (first, a.shape, sizes[0], a.columns), (second, b.shape, sizes[1], b.columns)
                found[key] = (gain, pair)
    best = sorted(found.values(), key=lambda f: -f[0])
    return [pair for _, pair in best[:_PAIRS]]
