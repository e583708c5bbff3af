"""The best set with a lamp that is followed more finely: what water and beam would be beside it.

How finely a curve follows the lamp is a choice, made by what functions save; and a named form of the beam may
pass where the lamp has another. What either leaves out is then in the values of what hangs together with the
lamp: how water scatters changes the beam, too.
"""

from __future__ import annotations

import numpy as np

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.many import in_pool
from lightfield.diagnosis.search.pool.curve_of_forms import laid_over
from lightfield.diagnosis.search.pool.evidence import Weighing
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet
from lightfield.diagnosis.verdict.best_set.averaged import averaged
from lightfield.fitting.beam_width import WIDTH
from lightfield.fitting.curves import PROFILE, field_of

#: Functions of a fine curve at least. Measured: beside scattering, in renders of lamps that are no Gaussian,
#: an absorption with a curve of four or a named form was 3 to 10 of its errors off, with seven 2 at most.
_FINE = 7
#: A second fit begins with the Gaussian under the curve so much wider: it may be a narrow or a wide one, and
#: a fit ends near where it begins. Chosen: the bundled dive lamp has two such ends, 3.1 and 4.3 degrees.
_WIDER = 1.3


def finer_lamp(finding: SearchResult) -> FittedSet | None:
    """The best set with a longer curve of its lamp, or with one in place of the beam's named forms where it
    scatters; None where it has neither, or the longest."""
    many, node = finding.many, in_pool(finding)
    curve = None if many is None or node is None else _finer(many.pool, node)
    if many is None or node is None or curve is None:
        return None
    pool, whiten = many.pool, many.bench.whiten
    others = (c for c in node.explanation if c.name != curve.name and c.name not in curve.effect.contains)
    whole = pool.in_order((*others, curve))
    model = pool.problem.model(whole)
    same = curve.name in node.names
    here = model.at(node.fit.by_path if same else dict(laid_over(pool, node, curve).u))
    starts = [here]
    for k, p in enumerate(model.parameters):
        if p.path == WIDTH:
            wide = here.copy()
            wide[k] = min(p.coordinate_of(_WIDER * node.fit.values[WIDTH]), p.high)
            starts.append(wide)
    fits = [pool.problem.fit(whole, whiten, [start]) for start in starts]
    return FittedSet(whole, min(fits, key=lambda one: one.chi2))


def with_finer_lamp(weighing: Weighing, best: ScoredSet, finer: FittedSet) -> ScoredSet:
    """The best set, its errors averaged over it and the same with a finer lamp."""
    weight = float(np.exp(-0.5 * max(weighing.above(finer), 0.0)))
    return averaged(best, [(weight, finer.fit.values, comparable_errors(weighing, finer))])


def comparable_errors(weighing: Weighing, finer: FittedSet) -> dict[str, float]:
    """Standard errors by path of what is the same in both: the half width of a Gaussian under a curve is none
    of a beam."""
    errors, same = finer.fit.stderr(weighing.phi), finer.names == weighing.best.names
    return {path: error for path, error in errors.items() if path != WIDTH or same}


def _finer(pool: Pool, node: FittedSet) -> Candidate | None:
    """The curve that follows the lamp of a set next more finely."""
    own = max((len(c.amplitudes) for c in node.explanation if _follows_a_lamp(c)), default=0)
    curves = [
        c
        for c in pool.problem.candidates
        if _follows_a_lamp(c) and not c.form.refines and len(c.amplitudes) >= max(own + 1, _FINE)
    ]
    curve = min(curves, key=lambda c: len(c.amplitudes), default=None)
    if curve is None or own:
        return curve
    return curve if node.is_diffuse and not node.names.isdisjoint(curve.effect.contains) else None


def _follows_a_lamp(candidate: Candidate) -> bool:
    return field_of(candidate.amplitudes[0].path) == PROFILE
