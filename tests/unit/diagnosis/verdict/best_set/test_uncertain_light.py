"""An effect whose light has errors of its own is found as large as it is, not smaller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from toy_problem import Linear, Toy, candidate, layout

from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.own_errors import under_own_errors
from lightfield.diagnosis.verdict.best_set.uncertain_light import in_uncertain_light

#: Size of the effect over its error by the readings, and the photons' errors of its light over theirs.
TOLD, PHOTONS = 4.0, 0.4


@dataclass(frozen=True)
class Traced:
    """Light of which the effect's part was told with an independent error at every reading, shape (n,)."""

    linear: Linear
    error: np.ndarray

    def predict(self, values: Mapping[str, float]) -> np.ndarray:
        return self.linear.predict(values)

    def errors(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        return values["toy.haze"] * np.diag(self.error), np.zeros(len(self.error))

    def lamp_errors(self, values: Mapping[str, float]) -> np.ndarray:
        return self.linear.lamp_errors(values)


def draw(seed: int) -> tuple[float, float, float]:
    """An effect of size 1 in light that was told wrongly: its size in that light as it was told; its size and
    error in light that has errors of its own."""
    lay, rng = layout(), np.random.default_rng(seed)
    haze = np.sin(3 * lay.x_m) * lay.z_m
    haze *= TOLD / np.linalg.norm(haze)
    made = Toy.of([candidate("haze")], {"haze": haze}, lay)
    told = Toy.of([candidate("haze")], {"haze": haze + PHOTONS * rng.standard_normal(lay.size)}, lay)
    forward = Traced(told.problem.forward, PHOTONS * made.sigma)
    problem = replace(made.drawn(rng, haze=1.0), forward=forward)
    main, effects, start = Whitener(made.noise), problem.candidates, np.array([1.0, 0.1, 0.5])
    plain = under_own_errors(problem, effects, problem.fit(effects, main, [start], max_steps=0), main)[1]
    found = in_uncertain_light(problem, effects, main, start)
    return plain.values["toy.haze"], found.fit.values["toy.haze"], found.stderr()["toy.haze"]


def test_an_effect_in_uncertain_light_is_found_as_large_as_it_is() -> None:
    """Taken as it was told, with a metric of the same errors, it comes out smaller."""
    drawn = np.array([draw(seed) for seed in range(60)])
    plain, found, errors = drawn.T
    # Errors of photons of 0.4 at 60 readings, beside their own: S is 16 / 1.16, n 60 * 0.16 / 1.16.
    attenuated, of_a_mean = 16 / (16 + 60 * 0.16), 3 / np.sqrt(len(drawn))
    assert abs(plain.mean() - attenuated) < of_a_mean * plain.std()
    assert plain.mean() < 1 - of_a_mean * plain.std()
    assert abs(np.median(found) - 1) < 1.25 * of_a_mean * found.std(), "a median scatters by 1.25 times more"
    pulls = (found - 1) / errors
    assert abs(np.sqrt((pulls**2).mean()) - 1) < of_a_mean / np.sqrt(2), "errors are as large as they say"


def test_light_without_errors_is_fitted_as_ever() -> None:
    made = Toy.of([candidate("odd")], {"odd": 3 * np.sin(3 * layout().x_m)})
    problem = made.drawn(np.random.default_rng(1), odd=1.0)
    main, start = made.whiten, np.array([1.0, 0.1, 0.5])
    found = in_uncertain_light(problem, problem.candidates, main, start)
    values, covariance, _ = made.regression(problem, "odd")
    assert found.fit.away_from(values) < 0.02, "a fit ends within 1e-4 of chi-square"
    assert np.allclose(found.covariance, covariance, rtol=1e-3)


def test_what_the_readings_do_not_tell_apart_has_errors_all_the_same() -> None:
    """Two effects alike, of which Cholesky's factor of the information would be none."""
    column = 3 * np.sin(3 * layout().x_m)
    made = Toy.of([candidate("odd"), candidate("same")], {"odd": column, "same": column})
    problem = made.drawn(np.random.default_rng(1), odd=1.0)
    found = in_uncertain_light(problem, problem.candidates, made.whiten, np.array([1.0, 0.1, 0.5, 0.5]))
    alone, covariance, _ = made.regression(problem, "odd")
    assert abs(found.fit.u[2:].sum() - alone[2]) < 0.02 * np.sqrt(covariance[2, 2])
    assert np.isclose(found.covariance[2:, 2:].sum(), covariance[2, 2], rtol=1e-2)


class Reflected(Traced):
    """Light of which nothing is told where there is none: no contributions, as beside walls of albedo 0."""

    def errors(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        modes, smooth = super().errors(values)
        return modes if values["toy.haze"] else modes[:, :0], smooth


def test_a_fit_may_try_an_effect_that_is_not_there() -> None:
    """At its bound, where light has no errors at all and was fitted with some."""
    lay, low = layout(), candidate("haze", low=0.0)
    made = Toy.of([low], {"haze": np.sin(3 * lay.x_m) * lay.z_m}, lay)
    forward = Reflected(made.problem.forward, PHOTONS * made.sigma)
    problem = replace(made.drawn(np.random.default_rng(1), haze=-0.05), forward=forward)
    found = in_uncertain_light(problem, problem.candidates, made.whiten, np.array([1.0, 0.1, 0.5]))
    assert found.fit.values["toy.haze"] == 0.0
