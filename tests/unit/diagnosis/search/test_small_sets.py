"""The search for sets of effects: against regression, by hand, and where nothing is there to be found."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats
from toy_problem import Toy, candidate, layout, toy, waves

from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.search.small_sets import (
    accepted,
    fit_pairs,
    fit_singles,
    searched,
)
from lightfield.fitting.effects import Effect


class NoDiffuseLight:
    """What is asked where no effect acts through scattered light."""

    def promise(self, fit: Any) -> float:
        raise AssertionError

    def refit(self, explanation: Any, fit: Any) -> Any:
        raise AssertionError


def ready(made: Toy, problem: Any, count: int = 99) -> tuple[Any, Any, Any]:
    """Test, base fit, and the test of it."""
    test = made.test(problem, np.random.default_rng(1).standard_normal((problem.layout.size, count)))
    base = made.fit(problem)
    return test, base, test(base)


def test_every_single_effect_is_fitted_to_its_minimum() -> None:
    """Coordinates and chi-square are those of regression; all forms, each once."""
    made = toy()
    problem = made.drawn(np.random.default_rng(0), odd=3.0)
    fits = fit_singles(problem, *ready(made, problem))
    assert [one.explanation[0].name for one in fits] == ["odd", "dusk", "rows"]
    for one in fits:
        expected, _, chi2 = made.regression(problem, one.explanation[0].name)
        assert one.fit.chi2 == pytest.approx(chi2, abs=2e-3)  # the tolerance of a fit
        assert one.fit.u == pytest.approx(expected, rel=1e-3, abs=1e-3)


def gains(sets: int, low: float) -> np.ndarray:
    """By how much chi-square falls when one effect is set free in readings without any."""
    made, rng, out = toy(low), np.random.default_rng(5), []
    made = replace(made, problem=replace(made.problem, candidates=made.problem.candidates[1:2]))
    for _ in range(sets):
        problem = made.drawn(rng)
        test, base, at_base = ready(made, problem, 1)
        fits = fit_singles(problem, test, base, at_base)
        out.append(base.chi2 - fits[0].fit.chi2)
    return np.array(out)


def test_where_nothing_is_missing_an_effect_gains_a_chi_square_of_one() -> None:
    """Wilks (1938); 40 sets. Of one sign only: nothing in half of them, and the same in the others (Chernoff
    1954, doi:10.1214/aoms/1177728725)."""
    assert stats.kstest(gains(40, -1e3), stats.chi2(1).cdf).pvalue > 0.001
    half = gains(40, 0.0)
    none = half < 1e-3
    assert stats.binomtest(int(none.sum()), 40).pvalue > 0.001
    assert stats.kstest(half[~none], stats.chi2(1).cdf).pvalue > 0.001


def test_two_effects_that_hide_each_other_are_found_as_a_pair() -> None:
    """Columns that are alike but for a tenth, with opposite signs: alone neither takes away much."""
    lay = layout()
    made = toy(twin=-waves(lay)["odd"] + 0.15 * np.cos(9 * lay.x_m) * np.sin(3 * lay.z_m))
    problem = made.drawn(np.random.default_rng(0), odd=40.0, twin=40.0, rows=1.0)
    test, base, at_base = ready(made, problem)
    own = cast(Any, NoDiffuseLight())
    singles = searched(problem, test, fit_singles(problem, test, base, at_base), own)
    assert base.chi2 - min(s.fit.chi2 for s in singles) < 0.7 * (base.chi2 - 60)
    at_once = fit_pairs(problem, test, base, at_base, [])
    assert {c.name for c in at_once[0].explanation} == {"odd", "twin"}, "by both templates at the base model"
    pairs = searched(problem, test, fit_pairs(problem, test, base, at_base, singles), own)
    assert pairs[0].names == ("odd", "twin")
    found, _, chi2 = made.regression(problem, "odd", "twin")
    assert pairs[0].fit.chi2 == pytest.approx(chi2, rel=1e-3)
    by_name = pairs[0].fit.by_path
    assert (by_name["toy.odd"], by_name["toy.twin"]) == pytest.approx(tuple(found[-2:]), rel=0.02)


def test_the_best_single_effect_is_the_one_that_is_there() -> None:
    made = toy()
    problem = made.drawn(np.random.default_rng(2), dusk=3.0)
    test, base, at_base = ready(made, problem)
    singles = searched(problem, test, fit_singles(problem, test, base, at_base), cast(Any, NoDiffuseLight()))
    assert singles[0].names == ("dusk",) and singles[0].accepted(0.01)
    assert singles[0].bic == pytest.approx(
        made.regression(problem, "dusk")[2] / singles[0].adequacy.phi + np.log(60), rel=1e-3
    )
    assert not any(s.accepted(0.01) for s in singles[1:])


def test_explanations_by_diffuse_light_are_ranked_with_the_growth_of_their_errors() -> None:
    """An effect of scattered light is refitted under its own errors; their log determinant counts in BIC."""
    made = toy()
    problem = made.drawn(np.random.default_rng(0), odd=3.0)
    haze = replace(
        problem.candidates[0],
        effect=Effect("odd", "water", problem.candidates[0].effect.forms, "", "", "",
                      instead_of=("water.scattering_per_m",)),
    )  # fmt: skip
    object.__setattr__(haze.effect, "diffuse", True)
    problem = replace(problem, candidates=(haze, *problem.candidates[1:]))
    test, base, at_base = ready(made, problem)
    fits = fit_singles(problem, test, base, at_base)
    asked = []

    class Own:
        def hopeless(self, fit: Any, best: Any) -> bool:
            return False

        def promise(self, fit: Any) -> float:
            return float(fit.chi2)

        def refit(self, explanation: Any, fit: Any) -> Any:
            asked.append(explanation[0].name)
            return test, fit, 7.0

    others = [one for one in fits if one.explanation[0] is not haze]
    plain = {t.names: t.bic for t in searched(problem, test, others, cast(Any, NoDiffuseLight()))}
    ranked = searched(problem, test, fits, Own())
    assert asked == ["odd"]
    found = {t.names: t for t in ranked}
    phi = test(found["odd",].fit).phi
    assert found["odd",].bic == pytest.approx(found["odd",].fit.chi2 / phi + np.log(60) + 7.0)
    assert set(plain) < set(found)


def made_up(name: str, bic: float, passes: bool = True, at: float = 0.5) -> ScoredSet:
    """A fitted effect of an amplitude between 0 and 1."""
    effect = candidate(name, 0.0, 1.0)
    fit = SimpleNamespace(
        paths=("level", f"toy.{name}"),
        by_path={"level": 1.0, f"toy.{name}": at},
        at_bound=lambda: np.array([False, at in (0, 1)]),
    )
    return ScoredSet((effect,), cast(Any, fit), bic, cast(Any, SimpleNamespace(passes=lambda alpha: passes)))


def test_what_is_accepted_by_hand() -> None:
    """Best first; of one effect's forms the best; at the edge of what is plausible if there is no other."""
    a, b, worse, rejected, edge = (
        made_up("a", 10.0), made_up("b", 5.0), made_up("a", 12.0), made_up("c", 1.0, passes=False),
        made_up("d", 2.0, at=1.0),
    )  # fmt: skip
    assert accepted([a, b, worse, rejected, edge], 0.01) == [b, a]
    assert accepted([rejected, edge], 0.01) == [edge]
    assert accepted([rejected], 0.01) == []


def test_an_effect_of_the_scene_that_is_not_there_lies_at_no_edge() -> None:
    """Neutral, it is left out; at its other bound it is at an edge."""
    gone, far = made_up("a", 1.0, at=0.0), made_up("a", 1.0, at=1.0)
    stated = replace(gone.explanation[0], amplitudes=(replace(gone.explanation[0].amplitudes[0], start=0.4),))
    assert gone.at_edge and gone.at_bound
    assert not replace(gone, explanation=(stated,)).at_edge
    assert replace(far, explanation=(stated,)).at_edge
