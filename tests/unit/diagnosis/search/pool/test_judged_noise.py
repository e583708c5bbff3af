"""The noise that sets of many effects are judged under: its scale, and when it is judged anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_pool import many, toy, with_curve
from toy_problem import layout

from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.pool import any_number as pooled
from lightfield.diagnosis.search.pool import looks
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.diagnosis.verdict.best_set.so_far import SoFar
from lightfield.fitting.least_squares import Fit


@pytest.mark.parametrize("errors", [0.4, 2.5])
def test_the_scale_of_the_noise_is_that_of_the_errors_sets_are_judged_under(errors: float) -> None:
    """Not of those under which the best set was fitted before they were judged anew."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=2.5)
    prepared, one = made.prepared(problem), tuple(c for c in problem.candidates if c.name == "odd")
    before = Whitener(replace(prepared.noise, sigma=errors * prepared.noise.sigma))
    found = FittedSet(one, problem.fit(one, before, [problem.default_start(problem.model().start, one)]))
    bench, ground = pooled.ground_about(prepared, 0.0, np.random.default_rng(0), found)
    same = problem.fit(one, bench.whiten, [found.fit.u])
    assert ground.phi == pytest.approx(bench.test(same).phi, rel=1e-3)


def test_noise_is_judged_again_where_a_curve_was_made_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same names, but another set: what a short curve misses it calls noise and outliers."""
    made = with_curve()
    problem = made.drawn(np.random.default_rng(1), profile0=4.0, profile3=-4.0)
    short = next(c for c in problem.candidates if c.form.name == "2 terms")
    judge, about = pooled.prepare_about, []

    def prepare_about(problem: Problem, quoted, budget: Budget, explanation: Explanation, fit: Fit):
        about.append([c.form.name for c in explanation])
        return judge(problem, quoted, budget, explanation, fit)

    monkeypatch.setattr(looks, "first", lambda pool, _: pool.fit((short,), [Begin({})]))
    monkeypatch.setattr(pooled, "prepare_about", prepare_about)
    found = many(made, problem)
    assert [c.form.name for c in found.best.explanation] == ["4 terms"]
    assert about == [["2 terms"], ["4 terms"]]


def test_noise_is_told_as_judged_in_the_light_of_the_sets_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where rounds end before a set stays where its light was traced: what no effect is, 12 sigma, is
    sought within a tolerance, and nothing is ever where it was."""
    made, lay = toy(), layout()
    bump = 12 * np.exp(-(((lay.x_m - lay.x_m[3]) / 0.05) ** 2)) * (lay.z_m > 6)
    problem = made.drawn(np.random.default_rng(1), odd=20.0, dusk=-6.0)
    problem = replace(problem, value=problem.value + made.sigma * bump)
    for name, value in (
        ("can_follow", lambda _: True), ("scatters", lambda _, fit: "toy.odd" in fit.paths),
        ("following", lambda problem, fit, seed: replace(problem)), ("_NEAR", -1.0),
    ):  # fmt: skip
        monkeypatch.setattr(pooled, name, value)
    data = pooled.Data(problem, made.sigma, Budget(0.0, 0.0, 1e-4))
    found = pooled.search_many(data, made.prepared(problem), 0.01, np.random.default_rng(0), SoFar())
    assert found.tolerance == 1e-4 and "odd" in found.best.names
    assert found.pool.problem is found.prepared.problem
