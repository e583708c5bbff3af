"""Rivals of an effect: nothing beats a true set but by chance, and what is best without it is found."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy import stats
from toy_pool import pool_of, toy
from toy_problem import candidate

from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.search.pool.evidence import Evidence
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.pool.rivals import seek_rivals

DRAWS, LEVEL = 60, 0.01


def sought(seed: int, name: str, **hidden: float) -> tuple[Pool, dict[str, np.ndarray]]:
    """A pool that held the hidden set and that of one effect, after rivals of that one were sought."""
    made = toy()
    problem = made.drawn(np.random.default_rng(seed), **hidden)
    by = {c.name: c for c in problem.candidates}
    pool = pool_of(made, problem)
    best = pool.fit(tuple(by[n] for n in dict.fromkeys((*hidden, name))), [Begin({})])
    seek_rivals(pool, best, by[name])
    columns = {p: c / made.sigma for p, c in problem.forward.columns.items()}
    return pool, columns | {"value": problem.value / made.sigma}


@pytest.mark.parametrize("hidden", [{"odd": 3.0}, {"odd": 3.0, "dusk": -2.5}])
def test_a_true_set_is_beaten_as_often_as_is_stated(hidden: dict[str, float]) -> None:
    """An effect more is paid for by one per cent of noise, whichever of all it is."""
    beaten = sum(sought(seed, "odd", **hidden)[0].best().names != set(hidden) for seed in range(DRAWS))
    assert beaten <= stats.binom.isf(0.001, DRAWS, LEVEL)


def test_an_effect_of_noise_has_rivals_that_are_better() -> None:
    """Where nothing is hidden, no effect at all costs less than one."""
    kept = sum(bool(sought(seed, "odd")[0].best().names) for seed in range(DRAWS))
    assert kept <= stats.binom.isf(0.001, DRAWS, LEVEL)


def test_the_best_set_without_an_effect_is_that_of_all_there_are() -> None:
    """By textbook regression of all 64 sets of the six others."""
    for seed in range(20):
        pool, whitened = sought(seed, "odd", odd=2.0, dusk=-2.5, fan=1.5)
        others = [c.name for c in pool.problem.candidates if c.name != "odd"]
        price = stats.f.isf(LEVEL / (len(others) + 1), 1, pool.ground.nu)
        costs = {}
        for names in (some for size in range(len(others) + 1) for some in combinations(others, size)):
            design = np.stack([whitened[p] for p in ("level", "slope", *(f"toy.{n}" for n in names))], axis=1)
            left = whitened["value"] - design @ np.linalg.lstsq(design, whitened["value"], rcond=None)[0]
            costs[frozenset(names)] = float(left @ left) / pool.ground.phi + len(names) * price
        found = pool.best(lambda other: other.name != "odd")
        assert pool.cost(found) == pytest.approx(costs[frozenset(found.names)], abs=0.1)
        assert pool.cost(found) == pytest.approx(min(costs.values()), abs=0.1)


@pytest.mark.parametrize(
    ("left", "level"), [(0.0, Certainty.PARTIAL), (1.0, Certainty.PARTIAL), (41.0, Certainty.ONE_OF)]
)
def test_beside_an_unknown_that_leaves_more_than_the_errors_a_gap_has_to_be_larger(
    left: float, level: Certainty
) -> None:
    """A drift of the lamp, gap 12, was certain beside a step in time that stood for a jump of the absorption
    and left 1.75 times the variance of the errors: 41 in chi-square of 105 readings."""
    drift = Evidence(candidate("odd"), Certainty.CERTAIN, 10.5, 12.4, 12.4, 20.0, None, (), None, 1.0)
    assert drift.in_part(left).level == level
