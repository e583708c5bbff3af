"""A lamp's curve of more functions than their price allows: water and beam beside it count in the errors.

How finely a curve follows the lamp is a choice, made by what functions save. What the next ones would take is
then in the values of what hangs together with the lamp: how water scatters changes the beam, too.
"""

from __future__ import annotations

import numpy as np

from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.many import in_pool
from lightfield.diagnosis.search.pool.evidence import Weighing
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet
from lightfield.diagnosis.verdict.best_set.averaged import averaged
from lightfield.fitting.beam_width import WIDTH
from lightfield.fitting.curves import PROFILE, field_of
from lightfield.fitting.least_squares import Fit

#: A second fit begins with the Gaussian under the curve so much wider: it may be a narrow or a wide one, and
#: a fit ends near where it begins. Chosen: the bundled dive lamp has two such ends, 3.1 and 4.3 degrees.
_WIDER = 1.3


def with_longer_curve(finding: SearchResult, best: ScoredSet) -> ScoredSet:
    """The best set, its errors averaged over it and the same with the next longer curve of the lamp."""
    many, node = finding.many, in_pool(finding)
    longer = None if many is None or node is None else _longer(many.pool.problem, node.explanation)
    if many is None or node is None or longer is None:
        return best
    weighing = Weighing.of(many.pool, node)
    problem, whiten = many.pool.problem, many.bench.whiten
    model = problem.model(longer)
    here = model.at(node.fit.by_path)
    fits: list[Fit] = [problem.fit(longer, whiten, [here])]
    for k, p in enumerate(model.parameters):
        if p.path == WIDTH:
            wide = here.copy()
            wide[k] = min(p.coordinate_of(_WIDER * node.fit.values[WIDTH]), p.high)
            fits.append(problem.fit(longer, whiten, [wide]))
    fit = min(fits, key=lambda one: one.chi2)
    cost = weighing.above(FittedSet(longer, fit))
    return averaged(best, [(float(np.exp(-0.5 * max(cost, 0.0))), fit.values, fit.stderr(weighing.phi))])


def _longer(problem: Problem, explanation: Explanation) -> Explanation | None:
    """A set with the next longer curve of its lamp; None without a curve, or where it is the longest."""
    for curve in explanation:
        if field_of(curve.amplitudes[0].path) != PROFILE:
            continue
        forms = [
            c
            for c in problem.candidates
            if c.name == curve.name and len(c.amplitudes) > len(curve.amplitudes) and not c.form.refines
        ]
        if forms:
            other = min(forms, key=lambda c: len(c.amplitudes))
            return tuple(other if c is curve else c for c in explanation)
    return None
