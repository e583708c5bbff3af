"""Errors averaged over models: against a posterior summed on a grid, and readings by other formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_problem import Toy, candidate, layout, waves

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.verdict.best_set import averaged
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings

TYPICAL = 3.0


def toy(lean: float, seed: int, stated: bool = False) -> tuple[Toy, ScoredSet]:
    """Readings of the base model and some of an effect that is like its slope; a fit without that effect.

    `stated`: of a scene that has an effect much like it, of the size that was found without it.
    """
    lay = layout()
    bell = np.exp(-2 * lay.x_m**2)
    like_slope = bell * (lay.z_m - lay.z_m.mean()) / (0.01 * bell + 0.001) / 20
    found = {"odd": waves(lay)["odd"], "lean": like_slope + np.cos(5 * lay.x_m + lay.z_m)}
    if stated:
        found["had"] = found["lean"] + waves(lay)["rows"]
    made = Toy.of([candidate(name) for name in found], found)
    rng = np.random.default_rng(seed)
    truth = {"toy.lean": lean}
    if stated:
        effect = made.with_value(made.problem.forward.predict(truth))
        truth["toy.had"] = -made.regression(effect, "had")[0][2]
    readings = made.base + made.problem.forward.predict(truth) + made.sigma * rng.normal(size=60)
    typical = tuple(replace(c, typical=(TYPICAL,)) for c in made.problem.candidates)
    typical = tuple(replace(c, neutral=(-1.0,)) if c.name == "had" else c for c in typical)
    problem = replace(made.with_value(readings), candidates=typical)
    test = made.test(problem, rng.standard_normal((60, 99)))
    fit = problem.fit((), test.whiten, [problem.model(()).start])
    return made, ScoredSet((), fit, 0.0, replace(test(fit), phi=1.0), test)


def on_a_grid(made: Toy, tried: ScoredSet, name: str, *stated: str) -> float:
    """Root of the mean square of slope - stated slope, by sums over level, slope and size of the effect; with
    it what the scene states is free."""
    problem, fit = tried.test.problem, tried.fit
    columns = {path: column / made.sigma for path, column in problem.forward.columns.items()}
    own = np.stack([columns[path] for path in fit.paths], axis=1)
    base = np.hstack([own, *(columns[f"toy.{other}"][:, None] for other in stated)])
    effect, value = columns[f"toy.{name}"], problem.value / made.sigma
    at = fit.paths.index("slope")
    alone, square = float(np.linalg.inv(own.T @ own)[at, at]), np.linalg.inv(base.T @ base)
    moves = square @ base.T @ effect

    def of_size(size: float) -> tuple[float, float]:
        """Chi-square, and the mean square of the slope about the stated one, with a given size."""
        u = square @ base.T @ (value - size * effect)
        left = value - size * effect - base @ u
        return float(left @ left), alone + (size * moves[at]) ** 2

    spread = averaged._SPREAD * TYPICAL
    sizes = np.linspace(-8 * spread, 8 * spread, 8001)
    chi2, squares = np.array([of_size(s) for s in sizes]).T
    without, _ = of_size(0.0)
    density = np.exp(-0.5 * (sizes / spread) ** 2 - 0.5 * (chi2 - without)) / np.sqrt(2 * np.pi) / spread
    step = sizes[1] - sizes[0]
    weight, moment = averaged._ODDS * density.sum() * step, averaged._ODDS * (density * squares).sum() * step
    return float(np.sqrt((alone + moment) / (1 + weight)))


@pytest.mark.parametrize("lean", [0.0, 0.03, 0.3, 3.0])
def test_an_effect_more_widens_errors_as_its_posterior_says(lean: float) -> None:
    made, tried = toy(lean, 3)
    wide = averaged.with_an_effect_more((), tried.fit, tried.adequacy, 1.0)
    expected = max(on_a_grid(made, tried, name) for name in ("odd", "lean"))
    assert wide["slope"] == pytest.approx(max(expected, tried.fit.stderr()["slope"]), rel=0.02)


@pytest.mark.parametrize("lean", [1.0, 2.0])
def test_what_the_scene_states_would_be_another_one_with_an_effect_more(lean: float) -> None:
    """It may have been found without that effect: held, it would make the rest far too sure."""
    made, tried = toy(lean, 3, stated=True)
    wide = averaged.with_an_effect_more((), tried.fit, tried.adequacy, 1.0)
    expected = max(on_a_grid(made, tried, name, "had") for name in ("odd", "lean"))
    assert wide["slope"] == pytest.approx(max(expected, tried.fit.stderr()["slope"]), rel=0.02)
    assert expected > 1.5 * max(on_a_grid(made, tried, name) for name in ("odd", "lean"))
    assert abs(tried.fit.values["slope"] - 0.1) < 1.5 * expected


def test_in_any_unit_of_the_level() -> None:
    """A column that is longer by 1e15, as that of a faint background in W is, changes no other error."""
    _, tried = toy(0.3, 3)
    known = tried.fit
    at = known.paths.index("level")
    unit = np.where(np.arange(len(known.u)) == at, 1e15, 1.0)
    level = known.model.parameters[at]
    base = [*known.model.parameters]
    base[at] = replace(level, low=level.low / 1e15, high=level.high / 1e15, step=level.step / 1e15)
    model = replace(known.model, parameters=tuple(base))
    slopes = known.jacobian * unit
    fit = replace(known, model=model, u=known.u / unit, differentiate=lambda: slopes)
    wide = averaged.with_an_effect_more((), known, tried.adequacy, 1.0)
    assert averaged.with_an_effect_more((), fit, tried.adequacy, 1.0)["slope"] == pytest.approx(wide["slope"])


SCENE = {
    "lamp": {"hwhm_deg": 9.5},
    "water": {"absorption_per_m": 0.13},
    "detector": {"planes_m": [1.5, 2.5, 3.5, 4.5, 5.5]},
}


def campaign(seed: int, lamp_per_hour: float, water_per_hour: float) -> Readings:
    """By formulas of their own: a lamp of 9 degrees in water of 0.12 per metre, both of which drift."""
    rng = np.random.default_rng(seed)
    places = [(x, z) for z in SCENE["detector"]["planes_m"] for x in np.linspace(-0.9, 0.9, 13)]
    x, z = np.array(places)[rng.permutation(len(places))].T
    hour = np.arange(len(x)) / 40
    far = np.hypot(x, z)
    value = np.exp(-np.log(2) * (np.degrees(np.arctan2(np.abs(x), z)) / 9.0) ** 2) * z / far**3
    value = value * np.exp(-0.12 * (1 + water_per_hour * hour) * far) * (1 + lamp_per_hour * hour)
    value = value / value.max()
    sigma = np.hypot(0.006 * value, 3e-4)
    value = value + sigma * rng.standard_normal(len(value))
    return Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value, stderr=sigma, time_s=3600 * hour, scale="relative"
    )


@pytest.mark.slow
def test_absorption_beside_a_drift_that_is_too_small_to_be_named() -> None:
    """Twelve campaigns: the errors of the fit with the drift that is named hold the absorption in half."""
    off, own = [], []
    for seed in range(12):
        table, scene = campaign(seed, 0.03 * (-1) ** seed, 0.02), Scene.from_dict(SCENE)
        verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
        assert verdict.best_set == ["lamp_drift"]
        found = verdict.ladder[-1].parameters["water.absorption_per_m"]
        fitted = fit_readings(table, scene, ["lamp_drift"]).estimates["water.absorption_per_m"]
        off.append(abs(found.value - 0.12) / found.stderr)
        own.append(abs(fitted.value - 0.12) / fitted.stderr)
    assert np.sqrt(np.mean(np.square(own))) > 2.0
    assert np.sum(np.array(off) < 3) == 12 and np.sum(np.array(off) < 2) >= 8


def test_beside_the_error_that_knows_of_more_stands_that_of_the_effects_that_are_named() -> None:
    """By least squares of the logarithm of the same formula, in gain, width, absorption, drift of the lamp.

    Up to the noise, which is judged by the readings: it is in the errors of all.
    """
    table = campaign(0, 0.03, 0.02)
    far, hour = np.hypot(table.x_m, table.z_m), table.time_s / 3600
    angle = np.degrees(np.arctan2(np.abs(table.x_m), table.z_m))
    slopes = np.stack([np.ones_like(far), 2 * np.log(2) * angle**2 / 9.0**3, -far, hour], axis=1)
    errors = np.sqrt(np.diag(np.linalg.inv((slopes.T * (table.value / table.stderr) ** 2) @ slopes)))
    verdict = diagnose(table, Scene.from_dict(SCENE), diffuse=None, advise=False).verdict
    assert verdict.best_set == ["lamp_drift"]
    found = verdict.ladder[-1].parameters
    water, beam = found["water.absorption_per_m"], found["lamp.hwhm_deg"]
    assert water.stderr > 1.5 * water.stderr_of_set
    ratio = water.stderr_of_set / (beam.stderr_of_set or beam.stderr)
    assert ratio == pytest.approx(errors[2] / errors[1], rel=0.1)


def test_absorption_read_from_near_to_far_knows_that_the_lamp_may_drift() -> None:
    """Time is distance there: nothing tells a drift of the lamp from water; errors have its typical size."""
    table = campaign(3, 0.0, 0.0)
    far = np.hypot(table.x_m, table.z_m)
    table, scene = (
        replace(table, time_s=3600 * far / far.max() + np.arange(len(far)) / 100),
        Scene.from_dict(SCENE),
    )
    verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
    assert verdict.best_set == []
    found = verdict.ladder[-1].parameters["water.absorption_per_m"]
    fitted = fit_readings(table, scene, []).estimates["water.absorption_per_m"]
    assert found.stderr > 1.5 * fitted.stderr
    # A drift of one per cent in the hour would change it by 0.01 / far.max().
    assert found.stderr > 0.2 * 0.01 / far.max()


def test_a_parameter_that_a_curve_of_the_other_set_changes_is_not_averaged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The slope beside a curve that acts on it is another slope; the level is averaged as ever."""
    made, best = toy(0.0, 3)
    (odd, _) = made.problem.candidates
    problem = best.test.problem
    fit = problem.fit((odd,), best.test.whiten, [problem.model((odd,)).start])
    moved = replace(fit, u=fit.u + 5 * np.sqrt(np.diag(fit.covariance())))
    best = replace(best, errors=best.fit.stderr())
    other = replace(best, explanation=(odd,), fit=moved, test=None)
    plain = averaged.with_others([best, other]).errors
    monkeypatch.setattr(averaged, "_CHANGED", {"odd": "slope"})
    apart = averaged.with_others([best, other]).errors
    assert plain["slope"] > 2 * best.errors["slope"] and apart["slope"] == best.errors["slope"]
    assert plain["level"] == apart["level"] > 2 * best.errors["level"]
