"""Effects too small to be named: what they would change, against regression with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from toy_problem import Toy, candidate, layout, waves

from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.verdict.best_set import unnamed
from lightfield.diagnosis.verdict.best_set.scattered_too import WithScattering
from lightfield.diagnosis.verdict.parts import Estimate, Unnamed
from lightfield.diagnosis.verdict.words.effects import unnamed_sentences

#: So many sigma of chi-square without it: below the price of one of five, which is 3.1 (chi-square 9.5).
SIZE = 2.8


def columns() -> dict[str, np.ndarray]:
    """ "lean" is half the slope of the base model; "odd" and others are like nothing in it."""
    lay = layout()
    bell = np.exp(-2 * lay.x_m**2)
    lean = bell * (lay.z_m - lay.z_m.mean()) / (0.01 * bell + 0.001) / 10
    return {**waves(lay), "lean": lean + np.cos(5 * lay.x_m + lay.z_m)}


def finding(size: float) -> tuple[Toy, SimpleNamespace]:
    """Readings without noise that hold a large effect and some of "lean", and what a search makes of them."""
    found = columns()
    made = Toy.of([candidate(name) for name in found], found)
    hidden = {"toy.odd": 4.0, "toy.lean": size}
    problem = made.with_value(made.base + made.problem.forward.predict(hidden))
    pool = Pool(Ground(made.test(problem, np.random.default_rng(0).standard_normal((60, 99))), 1.0, 1000))
    pool.fit((), [Begin({})])
    best = pool.fit([c for c in problem.candidates if c.name == "odd"], [Begin({})])
    return made, SimpleNamespace(
        many=SimpleNamespace(pool=pool, best=best),
        best=SimpleNamespace(explanation=best.explanation),
        finer_lamp=None,
    )


@dataclass(frozen=True)
class SearchResult:
    """As much of a finding as is asked for."""

    many: SimpleNamespace
    best: ScoredSet
    accepted: Sequence[ScoredSet] = ()
    level: None = None
    finer_lamp: None = None


def sigma_of(made: Toy, size: float) -> float:
    """By how much the readings are missed without "lean", by regression."""
    problem = made.with_value(made.base + made.problem.forward.predict({"toy.odd": 4.0, "toy.lean": size}))
    return float(np.sqrt(made.regression(problem, "odd")[2] - made.regression(problem, "odd", "lean")[2]))


def test_what_a_small_effect_would_change_is_told() -> None:
    """The slope with it is that of the regression with it, which is the truth."""
    made, _ = finding(1.0)
    size = SIZE / sigma_of(made, 1.0)
    made, found = finding(size)
    (one,) = unnamed.unnamed(found, {"slope": "1/m"})
    assert (one.effect, one.sigma) == ("lean", pytest.approx(SIZE, rel=0.02))
    assert list(one.with_it) == ["slope"]
    with_it = one.with_it["slope"]
    assert with_it.stderr is not None and abs(with_it.value - 0.1) < 0.25 * with_it.stderr
    node = found.many.best
    before, stderr = node.fit.values["slope"], node.fit.stderr(1.0)["slope"]
    assert abs(before - 0.1) > 2 * stderr, "the stated error does not hold the truth"
    said = unnamed_sentences([one], {"slope": Estimate(value=before, stderr=stderr, unit="1/m")})
    assert said[0].startswith("lean is too small to be named (2.8 sigma)")
    assert f"slope would be {with_it.value:.3g} ±" in said[0] and f"instead of {before:.3g};" in said[0]


def test_the_errors_of_the_best_set_reach_what_a_small_effect_would_change() -> None:
    """The truth is the slope with it: many of the fit's own errors away, and within the stated one."""
    made, _ = finding(1.0)
    made, found = finding(SIZE / sigma_of(made, 1.0))
    node = found.many.best
    best = ScoredSet(node.explanation, node.fit, 0.0, SimpleNamespace(phi=1.0, scores=()))
    (wide,) = unnamed.in_errors(SearchResult(found.many, best)).accepted
    own, apart = node.fit.stderr(1.0)["slope"], abs(node.fit.values["slope"] - 0.1)
    assert apart > 2 * own
    assert apart < wide.errors["slope"] < 3 * apart


@pytest.mark.parametrize("sigma", [0.0, 1.5])
def test_what_noise_would_make_is_not(sigma: float) -> None:
    made, _ = finding(1.0)
    _, found = finding(sigma / sigma_of(made, 1.0))
    assert unnamed.unnamed(found, {}) == []


def test_what_changes_nothing_is_not() -> None:
    """An effect of the same size that is like nothing in the model: "dusk" is odd in x."""
    found = columns()
    made = Toy.of([candidate(name) for name in found], found)
    size = SIZE / np.linalg.norm(found["dusk"])
    problem = made.with_value(made.base + made.problem.forward.predict({"toy.dusk": size}))
    pool = Pool(Ground(made.test(problem, np.random.default_rng(0).standard_normal((60, 99))), 1.0, 1000))
    best = pool.fit((), [Begin({})])
    told = unnamed.unnamed(
        SimpleNamespace(
            many=SimpleNamespace(pool=pool, best=best),
            best=SimpleNamespace(explanation=()),
            finer_lamp=None,
        ),
        {},
    )
    assert told == []
    (promise,) = [p for p in pool.promises(best) if p.candidate.name == "dusk"]
    assert promise.starts[0].gain > 6, "it is asked for all the same"


def test_scattering_that_walls_hide_is_in_the_errors_and_said() -> None:
    """The error of a value reaches what it would be with scattering, and that value's own error."""
    _, found = finding(0.0)
    node = found.many.best
    best = ScoredSet(node.explanation, node.fit, 0.0, SimpleNamespace(phi=1.0), errors={"slope": 0.0})
    also = WithScattering(
        candidate("scattering"),
        SimpleNamespace(paths=[*node.fit.paths, "b"], values={**node.fit.values, "slope": 0.3, "b": 0.1}),
        {**dict.fromkeys(node.fit.paths, 0.0), "slope": 0.4, "b": 0.05},
        saved=1.0,
    )
    (wide,) = also.widened(SearchResult(found.many, best)).accepted
    apart = node.fit.values["slope"] - 0.3
    assert wide.errors["slope"] == pytest.approx(np.hypot(0.4, apart))
    there = SimpleNamespace(many=found.many, best=wide, finer_lamp=None)
    (one,) = unnamed.unnamed(there, {"slope": "1/m", "b": "1/m"}, also)
    assert (one.effect, one.in_errors, list(one.with_it)) == ("scattering", True, ["slope", "b"])
    (said,) = unnamed_sentences([one], {})
    assert "with it slope = 0.3 ± 0.4 1/m, b = 0.1 ± 0.05 1/m; the stated errors reach there" in said


def test_scattering_that_is_too_small_where_nothing_reflects_is_not_laid_to_walls() -> None:
    """Of what walls hide its own size is told, too; in a black tank it was said to be like what reflects."""
    there = {"slope": Estimate(value=0.2, stderr=0.01, unit="1/m")}
    values = {"slope": Estimate(value=0.1, stderr=0.01, unit="1/m")}
    small = Unnamed(effect="scattering", sigma=3.6, with_it=there, in_errors=True)
    (said,) = unnamed_sentences([small], values)
    assert said.startswith("scattering is too small to be named (3.6 sigma), and every water has some: with")
    hidden = small.model_copy(update={"with_it": there | {"b": Estimate(value=0.1, unit="1/m")}})
    (said,) = unnamed_sentences([hidden], values)
    assert said.startswith("scattering is hardly told from what reflects here")


def test_scattering_that_changes_no_error_is_not_spoken_of() -> None:
    _, found = finding(0.0)
    node = found.many.best
    best = ScoredSet(node.explanation, node.fit, 0.0, SimpleNamespace(phi=1.0, scores=()))
    also = WithScattering(candidate("scattering"), node.fit, node.fit.stderr(), saved=0.0)
    (same,) = also.widened(SearchResult(found.many, best)).accepted
    there = SimpleNamespace(many=found.many, best=same, finer_lamp=None)
    assert unnamed.unnamed(there, {}, also) == []


def test_of_what_the_scene_has_another_size_is_told() -> None:
    """ "Is in the readings" and "if it is there" were said of one reflection on one page."""
    there = {"slope": Estimate(value=0.2, stderr=0.01, unit="1/m")}
    values = {"slope": Estimate(value=0.1, stderr=0.01, unit="1/m")}
    one = Unnamed(effect="wall_reflection", sigma=2.9, with_it=there, in_errors=True, stated=True)
    (said,) = unnamed_sentences([one], values)
    assert said.startswith("wall reflection of another size than the scene's is hardly asked for (2.9 sigma)")
    assert "if it is there" not in said


def test_another_form_of_an_effect_is_in_the_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    """A saturation that bends otherwise and costs 2 more: exp(-1) of the weight, where it puts absorption;
    moved by as much as in the pool, whose light is another. Not one that costs 20 more, nor other names."""

    def node(key: str, absorption: float, names: str = "saturation") -> Any:
        fit = SimpleNamespace(values={"a": absorption, key: 0.2}, stderr=lambda phi: {"a": 0.01, key: 0.1})
        return SimpleNamespace(key=key, names=frozenset({names}), fit=fit)

    best, other, dear, third = (
        node("quadratic", 0.05), node("hyperbolic", 0.07), node("cubic", 0.5), node("offset", 0.9, "offset"),
    )  # fmt: skip
    above = {"quadratic": 0.0, "hyperbolic": 2.0, "cubic": 20.0, "offset": 1.0}
    pool = SimpleNamespace(nodes={one.key: one for one in (best, other, dear, third)})
    weighing = SimpleNamespace(best=best, phi=1.0, pool=pool, above=lambda one: above[one.key])
    monkeypatch.setattr(unnamed, "_weighing", lambda finding: weighing)
    ((weight, values, errors),) = unnamed._in_other_forms(cast("Any", None), {"a": 0.06, "quadratic": 0.2})
    assert weight == pytest.approx(np.exp(-1.0))
    assert values == {"a": pytest.approx(0.08)} and errors == {"a": 0.01}
