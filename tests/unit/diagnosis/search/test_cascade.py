"""From prepared readings to a finding: the rate of false alarms, and each answer where it is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats
from toy_problem import Toy, candidate, layout, toy, waves

from lightfield.diagnosis.adequacy import scale, score_tests, templates
from lightfield.diagnosis.certainty import CONVINCING
from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.search import cascade, linear_pairs, preparation
from lightfield.diagnosis.search import small_sets as searching
from lightfield.diagnosis.search.cascade import SearchResult, search
from lightfield.diagnosis.search.many import levelled
from lightfield.diagnosis.search.pool.any_number import Data
from lightfield.diagnosis.search.pool.evidence import GAP
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet
from lightfield.diagnosis.verdict.best_set.so_far import SoFar


def found(made: Toy, problem, tolerance: float = 0.0, alpha: float = 0.01, seed: int = 0) -> SearchResult:
    prepared = made.prepared(problem, tolerance)
    return search(prepared, tolerance, np.random.default_rng(seed), alpha, SoFar())


def alarms(sets: int, alpha: float, factor: float = 1.0) -> int:
    """How often something is said to be missing where nothing is."""
    made, rng = toy(), np.random.default_rng(9)
    return sum(found(made, made.drawn(rng, factor), alpha=alpha, seed=k).size != 0 for k in range(sets))


@pytest.mark.parametrize("factor", [1.0, 1.6])
def test_false_alarms_keep_their_level(factor: float) -> None:
    """50 sets at 5 %, errors as stated or 1.6 times as large: within the upper limit of 99.9 %."""
    assert alarms(50, 0.05, factor) <= stats.binom.isf(0.001, 50, 0.05)


@pytest.mark.slow
def test_false_alarms_are_as_many_as_stated() -> None:
    """1500 sets at 5 %, two-sided limits of 99.9 %."""
    low, high = stats.binom.isf([0.9995, 0.0005], 1500, 0.05)
    assert low <= alarms(1500, 0.05) <= high


def test_one_effect_is_the_answer() -> None:
    """Named, with the size of the regression; the missing weight is the base model's."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=3.0)
    answer = found(made, problem)
    assert (answer.size, [t.names for t in answer.accepted]) == (1, [("odd",)])
    assert answer.identified and answer.weights[0] > CONVINCING
    size = made.regression(problem, "odd")[0][-1]
    assert answer.accepted[0].fit.values["toy.odd"] == pytest.approx(size, rel=1e-3)
    assert answer.level.tolerance == 0 and len(answer.levels) == 1


def test_two_effects_are_the_answer() -> None:
    made = toy()
    answer = found(made, made.drawn(np.random.default_rng(1), odd=3.0, dusk=3.0))
    assert (answer.size, answer.accepted[0].names) == (2, ("dusk", "odd"))
    assert answer.identified


def test_a_duplicate_of_an_effect_leaves_the_answer_open() -> None:
    """The same column under two names: both are accepted, each with half of the evidence."""
    lay = layout()
    made = toy(copy=-2.0 * waves(lay)["odd"])
    answer = found(made, made.drawn(np.random.default_rng(1), odd=3.0))
    assert (answer.size, {t.names for t in answer.accepted}) == (1, {("odd",), ("copy",)})
    assert answer.weights == pytest.approx([0.5, 0.5], abs=1e-3)
    assert not answer.identified


def test_a_set_of_more_effects_that_costs_hardly_more_leaves_the_answer_open() -> None:
    """Three effects make the readings. One column is nearly the sum of two of them: with the third it passes
    every test, for one parameter less than the truth has and nearly its price in chi-square."""
    lay = layout()
    both = waves(lay)["odd"] + waves(lay)["dusk"] + 0.5 * np.cos(5 * lay.x_m) * np.cos(3 * lay.z_m)
    made = toy(both=both)
    problem = made.drawn(np.random.default_rng(1), odd=1.9, dusk=1.9, rows=3.0)
    pair, truth = (made.regression(problem, *n)[2] for n in (("both", "rows"), ("odd", "dusk", "rows")))
    assert 9 < pair - truth < 15
    answer = found(made, problem)
    assert {t.names for t in answer.accepted} == {("both", "rows")} and answer.weights[0] > CONVINCING
    answer = levelled(Data(problem, made.sigma, Budget(0, 0, 0)), made.prepared(problem), answer)
    assert answer.many is not None
    known = {e.candidate.name: e for e in answer.many.evidence}
    assert known["both"].gap_named < GAP < known["rows"].gap_named
    assert known["both"].alternatives == (("dusk", "odd"),)
    assert not answer.identified
    first, other = answer.accepted
    assert other.names == ("dusk", "odd", "rows") and abs(other.bic - first.bic) < GAP
    assert answer.weights == pytest.approx(odds_of(first, other), abs=0.01)


def odds_of(*sets: ScoredSet) -> list[float]:
    """Weights of sets by what they cost."""
    share = np.exp(-0.5 * np.array([one.bic for one in sets]) + 0.5 * sets[0].bic)
    return list(share / share.sum())


def test_a_curve_that_costs_less_leaves_the_answer_open() -> None:
    """Not one that costs about as much: what is named wins where it suffices."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=3.0)
    answer = levelled(
        Data(problem, made.sigma, Budget(0, 0, 0)), made.prepared(problem), found(made, problem)
    )
    many = answer.many
    assert many is not None and answer.identified

    def beside_curve(gap: float) -> SearchResult:
        known = [replace(e, gap=gap) for e in many.evidence]
        return replace(answer, many=replace(many, evidence=known))

    assert beside_curve(-0.9 * GAP).identified and not beside_curve(-1.1 * GAP).identified


def test_the_base_model_is_a_rival_too() -> None:
    """Of an effect that is hardly needed: weights by BIC of base and effect, chi-square by regression."""
    made = toy()
    problem = made.drawn(np.random.default_rng(3), odd=0.6)
    answer = found(made, problem, alpha=0.5)
    (one,) = answer.accepted
    assert one.names == ("odd",) and one.adequacy is not None
    scale = answer.level.bench.phi * one.adequacy.phi
    base, with_odd = (made.regression(problem, *names)[2] / scale for names in ([], ["odd"]))
    assert one.bic == pytest.approx(with_odd + np.log(60), rel=1e-3)
    odds = np.exp(0.5 * (base - with_odd - np.log(60)))
    assert answer.weights == pytest.approx([odds / (1 + odds)], rel=0.02)
    assert 0.05 < answer.weights[0] < 0.95


def test_what_no_effect_describes_is_not_explained() -> None:
    """A bump of no effect's shape, 20 sigma; and what comes nearest is still told."""
    made = toy()
    lay = made.problem.layout
    bump = 20 * np.exp(-(((lay.x_m - lay.x_m[3]) / 0.05) ** 2)) * (lay.z_m > 6)
    noise = np.random.default_rng(1).standard_normal(lay.size)
    answer = found(made, made.with_value(made.base + made.sigma * (bump + noise)))
    assert (answer.size, answer.accepted, answer.weights) == (None, [], [])
    assert not answer.identified and not answer.determined
    assert len(answer.contenders) == 3


@pytest.mark.parametrize(
    ("tolerance", "there", "size"), [(0.0, True, 1), (0.01, True, 1), (0.0, False, None), (0.01, False, 0)]
)
def test_a_misfit_within_the_tolerance_is_of_no_interest(tolerance: float, there: bool, size: int) -> None:
    """A smooth column of 1 % of the light at most, beside noise of 0.2 %: explained by its effect, whatever
    is tolerated, for an exact formula is not blurred; without it unexplained, or nothing within 1 %."""
    made = toy()
    lay = made.problem.layout
    smooth = 0.01 * np.cos(1.5 * lay.x_m) * np.sin(1.2 * lay.z_m)
    made.problem.forward.columns["toy.smooth"] = smooth * made.base
    if there:
        effects = (*made.problem.candidates, candidate("smooth"))
        made = replace(made, problem=replace(made.problem, candidates=effects))
    sharp = replace(made, sigma=made.sigma / 5)
    answer = found(sharp, sharp.drawn(np.random.default_rng(1), smooth=1.0), tolerance)
    assert answer.size == size
    assert (answer.level.tolerance > 0) == (tolerance > 0 and not there)


def test_an_answer_that_is_withheld_is_none() -> None:
    made = toy()
    answer = found(made, made.drawn(np.random.default_rng(1), odd=3.0)).without_answer()
    assert (answer.size, answer.accepted, answer.withheld) == (None, [], True)
    assert answer.without_answer().withheld
    assert not answer.without_answer(in_no_part=False).withheld, "there was none any more"


def test_the_same_readings_and_seed_give_the_same_finding() -> None:
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=0.3)
    one, two = (found(made, problem) for _ in range(2))
    assert one.level.adequacy.p == two.level.adequacy.p
    assert (one.size, one.weights) == (two.size, two.weights)


#: Numbers that were chosen, each with a smaller and a larger one.
CHOSEN = [
    (score_tests, "_SCAN_POWER", 0.4, 1.0), (score_tests, "_VISIBLE", 0.02, 0.1),
    (score_tests, "_FEWEST_BESIDE_ALL", 4, 12), (score_tests, "ABSORBED", 1e-4, 1e-2),
    (score_tests, "INDEPENDENT", 1e-12, 1e-6), (score_tests, "VARIANCE_EXCESS", 2.0, 9.0),
    (templates, "BUMP_WIDTH_M", 0.03, 0.12), (templates, "_ACROSS_TERMS", 5, 15),
    (templates, "SLOWEST_RIPPLE", 3.0, 6.0), (templates, "_STEPS", np.linspace(-0.3, 0.3, 7), np.zeros(1)),
    (scale, "SMALLEST_SCALE", 0.25, 0.8), (score_tests, "STATED_COUNT_AS", 4.0, 16.0),
    (preparation, "REPLICATES", 149, 499),
    (searching, "FAR_BEHIND", 12.0, 60.0), (searching, "_PAIRS_FROM_BASE", 3, 30),
    (linear_pairs, "_RIDGE", 1e-11, 1e-5), (searching, "_ROUGH", 3, 12), (cascade, "_EASILY", 0.1, 0.4),
]  # fmt: skip


@pytest.mark.parametrize(
    ("module", "name", "smaller", "larger"), CHOSEN, ids=lambda v: v if isinstance(v, str) else ""
)
def test_an_answer_hangs_on_no_number_that_was_chosen(
    monkeypatch: pytest.MonkeyPatch, module: object, name: str, smaller: object, larger: object
) -> None:
    """Nothing, one effect or two, with a smaller and with a larger value of each number."""
    made, rng = toy(), np.random.default_rng(4)
    for effects in ({}, {"odd": 3.0}, {"odd": 3.0, "dusk": -3.0}):
        problem = made.drawn(rng, **effects)
        for value in (smaller, larger):
            monkeypatch.setattr(module, name, value)
            answer = found(made, problem)
            assert answer.size == len(effects), value
            assert [t.names for t in answer.accepted] == ([tuple(sorted(effects))] if effects else [])


def test_what_is_in_doubt_is_the_nearest_set_without_one_of_several() -> None:
    """Not the second set, which may doubt what is certain, nor none at all: advice parts what has names."""
    made = toy()
    answer = found(made, made.drawn(np.random.default_rng(1), odd=3.0))
    assert answer.in_doubt is None
    levels = {"odd": ("certain", 6.0), "dusk": ("one of", 12.0), "fan": ("one of", 9.0)}
    evidence = [
        SimpleNamespace(level=level, gap=gap, rival=FittedSet((candidate(name),), answer.level.base))
        for name, (level, gap) in levels.items()
    ]

    def with_evidence(count: int) -> SearchResult:
        return replace(answer, many=cast("Any", SimpleNamespace(sought=True, evidence=evidence[:count])))

    assert with_evidence(1).in_doubt is None
    doubted = with_evidence(3).in_doubt
    assert doubted is not None and doubted.names == ("fan",)
    evidence[2].rival = FittedSet((), answer.level.base)
    doubted = with_evidence(3).in_doubt
    assert doubted is not None and doubted.names == ("dusk",)
    assert with_evidence(1).in_doubt is None
