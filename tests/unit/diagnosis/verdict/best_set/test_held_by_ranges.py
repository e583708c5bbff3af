"""Errors beside an effect at the end of its range, against regression without that end."""

from __future__ import annotations

import numpy as np
import pytest
from toy_problem import Toy, candidate, layout

from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.verdict.best_set.held_by_ranges import reaching


@pytest.mark.parametrize(("high", "held"), [(2.0, True), (50.0, False)])
def test_errors_reach_what_a_regression_without_the_end_finds(high: float, held: bool) -> None:
    """Of an effect of 6 sigma that may be 2 at most, and one that goes with it by nine tenths."""
    lay = layout()
    odd = 3 * lay.x_m
    fan = 0.9 * odd + 0.6 * lay.x_m**2 * (lay.z_m - 6)
    made = Toy.of([candidate("odd", high=high), candidate("fan")], {"odd": odd, "fan": fan}, lay)
    problem = made.drawn(np.random.default_rng(2), odd=6.0, fan=4.0)
    model = problem.model(problem.candidates)
    fit = problem.fit(problem.candidates, made.whiten, [model.start])
    test = made.test(problem, np.random.default_rng(1).standard_normal((lay.size, 20)))
    one = ScoredSet(problem.candidates, fit, fit.chi2, None, test)
    found, covariance, _ = made.regression(problem, "odd", "fan")
    free, stderr = found[3], np.sqrt(covariance[3, 3])
    wider = reaching(one)
    assert ("toy.odd" in {p for p, at in zip(fit.paths, fit.at_bound(), strict=True) if at}) == held
    if held:
        assert wider.errors["toy.fan"] == pytest.approx(
            np.hypot(stderr, free - fit.values["toy.fan"]), rel=1e-3
        )
        assert abs(free - fit.values["toy.fan"]) > 3 * fit.stderr()["toy.fan"]
        assert "toy.odd" not in wider.errors
    else:
        assert wider is one
