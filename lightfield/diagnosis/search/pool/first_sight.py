"""When a search for any number of effects ends with its first sets."""

from __future__ import annotations

import numpy as np

from lightfield.diagnosis.search.pool.any_number import Ends, ground_about
from lightfield.diagnosis.search.pool.fitted_sets import Node, Pool
from lightfield.diagnosis.search.preparation import Prepared

#: Chi-square over that of the noise from which on a set misses the readings by far. Chosen: what lacks one of
#: several effects leaves more.
_FAR = 2.0


def misses_by_far(tolerance: float) -> Ends:
    """Where the best of them misses the readings by far more than their noise and the tolerance."""

    def ends(prepared: Prepared, pool: Pool, known: Node, found: Node) -> bool:
        made, ground = ground_about(prepared, tolerance, np.random.default_rng(0), found)
        problem = prepared.problem
        residual = made.whiten(problem.keep * (problem.value - found.fit.prediction))
        return float(residual @ residual) > _FAR * ground.phi * (problem.keep.sum() - len(found.fit.u))

    return ends


def leaves(part: float) -> Ends:
    """Where the best of them leaves more than a part of the variance that is left beside what was known."""

    def ends(prepared: Prepared, pool: Pool, known: Node, found: Node) -> bool:
        kept = float(prepared.problem.keep.sum())
        now, before = (node.fit.chi2 / (kept - len(node.fit.u)) for node in (found, known))
        return now > part * before

    return ends
