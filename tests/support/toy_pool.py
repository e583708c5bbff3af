"""A pool of sets of toy effects."""

from __future__ import annotations

import numpy as np
from toy_problem import Toy, candidate, layout, waves

from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search.pool.nodes import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin


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
