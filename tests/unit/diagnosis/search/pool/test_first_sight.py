"""A search for any number of effects ends with its first sets where they promise nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_pool import toy

from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.many import leaves, misses_by_far
from lightfield.diagnosis.search.pool.any_number import Data, Many, never, search_many
from lightfield.diagnosis.verdict.best_set.so_far import SoFar


def sought(hidden: dict[str, float], scatter: float, ends, known: str) -> Many:
    """Readings that scatter more than they say, of which one effect is known."""
    made = toy()
    problem = made.drawn(np.random.default_rng(2), **hidden)
    more = np.random.default_rng(3).standard_normal(len(problem.value))
    problem = replace(problem, value=problem.value + scatter * made.sigma * more)
    (one,) = (c for c in problem.candidates if c.name == known)
    prepared = made.prepared(problem)
    fit = problem.fit((one,), Whitener(prepared.noise), [np.array([*[p.start for p in problem.base], 0.0])])
    prepared = replace(prepared, explanation=(one,), reference=fit)
    data = Data(problem, made.sigma, Budget(0.0, 0.0, 0.0))
    return search_many(data, prepared, 0.01, np.random.default_rng(0), SoFar(), ends)


@pytest.mark.parametrize(
    ("hidden", "scatter", "at_first_sight"),
    [({"odd": 6.0}, 1.5, True), ({"odd": 6.0, "dusk": -6.0, "fan": 6.0}, 0.0, False)],
)
def test_scatter_that_no_effect_takes_away_is_seen_at_once(hidden, scatter, at_first_sight) -> None:
    """Of variance that is noise the best of more effects leave nearly all, of that by effects a part."""
    found = sought(hidden, scatter, leaves(0.8), known="odd")
    assert found.at_first_sight is at_first_sight
    assert found.adequate is not at_first_sight
    if not at_first_sight:
        assert found.best.names == set(hidden)
        assert found.best.fit.chi2 == sought(hidden, scatter, never, known="odd").best.fit.chi2


@pytest.mark.parametrize(("sigma", "at_first_sight"), [(10.0, True), (1.5, False)])
def test_what_misses_by_far_is_left_to_others(sigma: float, at_first_sight: bool) -> None:
    """A shadow of so many standard errors, which is no effect, beside one."""
    made = toy()
    problem = made.drawn(np.random.default_rng(2), odd=6.0)
    shadow = np.exp(-(((problem.layout.x_m - 0.3) / 0.8) ** 2))
    problem = replace(problem, value=problem.value - sigma * made.sigma * shadow)
    data = Data(problem, made.sigma, Budget(0.0, 0.0, 0.0))
    rng = np.random.default_rng(0)
    found = search_many(data, made.prepared(problem), 0.01, rng, SoFar(), misses_by_far(0.0))
    assert found.at_first_sight is at_first_sight
