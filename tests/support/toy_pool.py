"""A pool of sets of toy effects."""

from __future__ import annotations

import numpy as np
from toy_problem import Toy, candidate, curve, layout, waves

from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search.pool.any_number import Data, Many, search_many
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.verdict.best_set.so_far import SoFar


def more_waves(lay) -> dict[str, np.ndarray]:
    """Seven columns that no smooth unknown is; no two alike."""
    time = lay.phase_of_scan
    return {
        **waves(lay),
        "fan": np.cos(4 * lay.x_m) * (lay.z_m - 6.5) ** 2,
        "late": 4 * time * (lay.z_m - 6.5),
        "braid": np.sin(5 * lay.x_m + lay.z_m),
        "fringe": 3 * time * np.cos(3 * lay.x_m),
    }


def toy(**more: np.ndarray) -> Toy:
    lay = layout()
    columns = {**more_waves(lay), **more}
    return Toy.of([candidate(name) for name in columns], columns, lay)


def pool_of(made: Toy, problem: Problem) -> Pool:
    replicates = np.random.default_rng(0).standard_normal((60, 99))
    pool = Pool(Ground(made.test(problem, replicates), 1.0, 1000))
    pool.fit((), [Begin({})])
    return pool


def with_curve() -> Toy:
    """A curve of up to four smooth terms across the beam, of which the effect "round" is a special case."""
    lay = layout()
    terms = [np.cos((k + 2) * lay.x_m) * lay.x_m**2 * (lay.z_m - 5.5) for k in range(4)]
    columns = more_waves(lay) | {"round": terms[0] + 0.5 * terms[1]}
    candidates = [candidate(name) for name in columns] + curve("profile", (2, 4), ("round",))
    return Toy.of(candidates, columns | {f"profile{k}": t for k, t in enumerate(terms)}, lay)


def many(made: Toy, problem, seed: int = 0) -> Many:
    data = Data(problem, made.sigma, Budget(0.0, 0.0, 0.0))
    prepared = made.prepared(problem)
    return search_many(data, prepared, 0.01, np.random.default_rng(seed), SoFar())
