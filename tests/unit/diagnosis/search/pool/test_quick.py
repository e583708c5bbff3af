"""Steps of quick fits at the bounds of their parameters, against SciPy's bounded least squares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear
from toy_problem import Linear, Toy, candidate, layout

from lightfield.diagnosis.search.pool.quick import Begin, _within, finished_fit


def nearly_alike(rng: np.random.Generator, n: int, k: int) -> np.ndarray:
    """Columns of unit length, most of each common to all."""
    columns = 2 * rng.standard_normal((n, 1)) + rng.standard_normal((n, k))
    return columns / np.linalg.norm(columns, axis=0)


@pytest.mark.parametrize("seed", range(20))
def test_a_step_cut_at_the_bounds_still_gains(seed: int) -> None:
    """Undamped and cut afterwards, some of these steps would lose a hundred times what there is to gain."""
    rng = np.random.default_rng(seed)
    columns, residual = nearly_alike(rng, 60, 6), 10 * rng.standard_normal(60)
    gram, pull = columns.T @ columns, columns.T @ residual
    low, high = -rng.random(6), rng.random(6)
    damping, gain = 1e-3, -1.0
    while gain < 0:
        step = _within(gram, pull, damping, low, high)
        gain, damping = 2 * pull @ step - step @ gram @ step, 10 * damping
    best = lsq_linear(columns, residual, (low, high)).x
    possible = 2 * pull @ best - best @ gram @ best
    assert ((step >= low) & (step <= high)).all() and 0.95 * possible < gain <= possible * (1 + 1e-9)


def test_fits_that_end_at_bounds_are_the_best_within_them() -> None:
    """Six effects that are nearly one, in narrow ranges: steps cut at bounds ended 7 of 30 too early."""
    for seed in range(30):
        rng, lay = np.random.default_rng(seed), layout(5, 24)
        common = 5 * rng.standard_normal(lay.size)
        alike = {name: common + rng.standard_normal(lay.size) for name in "abcdef"}
        narrow = tuple(candidate(name, -rng.random(), rng.random()) for name in alike)
        made = Toy.of(narrow, alike, lay)
        sizes = {name: 100 * rng.standard_normal() for name in alike}
        problem = made.with_value(made.drawn(rng, **sizes).value)
        fit = finished_fit(problem, narrow, lambda given, s=made.sigma: (given.T / s).T, Begin({}), 60, 1e-9)
        model = problem.model(narrow)
        design = np.stack([problem.forward.columns[p.path] for p in model.parameters], axis=1)
        best = lsq_linear(design / made.sigma[:, None], problem.value / made.sigma, (model.low, model.high))
        assert fit.chi2 == pytest.approx(2 * best.cost, rel=1e-6)


class Bent(Linear):
    """The level times the exponential of the sum of all other columns, each times the value of its path."""

    def predict(self, values: Mapping[str, float]) -> np.ndarray:
        rest = [values[p] * c for p, c in self.columns.items() if p != "level" and p in values]
        return values["level"] * self.columns["level"] * np.exp(np.sum(rest, axis=0))


@pytest.mark.parametrize("seed", range(40))
def test_fits_of_what_is_not_linear_end_no_higher_than_scipys(seed: int) -> None:
    """Two to five effects that are more or less alike and change readings by half or more, in ranges that are
    wide, or so narrow that some end at a bound; SciPy goes on with all its slopes until nothing changes."""
    rng, lay = np.random.default_rng(seed), layout(5, 24)
    names, common = "abcde"[: int(rng.integers(2, 6))], rng.standard_normal(lay.size)
    columns = {name: common * rng.random() + rng.standard_normal(lay.size) for name in names}
    wide = rng.random() < 0.5
    ranges = [(-1e3, 1e3) if wide else (-80 * rng.random(), 80 * rng.random()) for _ in names]
    effects = tuple(candidate(name, *ends) for name, ends in zip(names, ranges, strict=True))
    made = Toy.of(effects, columns, lay)
    forward = Bent(made.problem.forward.columns)
    true = {"level": 1.0, "slope": 0.1} | {f"toy.{name}": 40 * rng.standard_normal() for name in names}
    value = forward.predict(true) + made.sigma * rng.standard_normal(lay.size)
    problem = replace(made.problem, forward=forward, value=value)
    model = problem.model(effects)

    def whiten(given: np.ndarray) -> np.ndarray:
        return (given.T / made.sigma).T

    fit = finished_fit(problem, effects, whiten, Begin({}), 60, 1e-9)
    oracle = least_squares(
        lambda u: whiten(value - model.predict(u)), np.clip(model.start, model.low + 1e-9, model.high - 1e-9),
        lambda u: -whiten(model.jacobian(u, model.predict(u))), bounds=(model.low, model.high), x_scale="jac",
        xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=2000,
    )  # fmt: skip
    assert fit.chi2 <= 2 * oracle.cost * (1 + 1e-6) + 1e-3
