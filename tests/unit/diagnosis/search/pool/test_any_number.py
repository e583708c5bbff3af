"""Any number of effects, against every set there is by textbook regression."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from toy_pool import many, more_waves, pool_of, toy, with_curve
from toy_problem import Toy, candidate, curve, layout

from lightfield.diagnosis.problem import problem as problems
from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.search.pool import any_number as pooled
from lightfield.diagnosis.search.pool.answer import NAMED_FIRST, named
from lightfield.diagnosis.search.pool.any_number import Data, Many, search_many
from lightfield.diagnosis.search.pool.backward import linear_backward
from lightfield.diagnosis.search.pool.evidence import Evidence, evidence
from lightfield.diagnosis.search.pool.looks import everything
from lightfield.diagnosis.search.pool.moves import polish
from lightfield.diagnosis.search.pool.quick import Begin, finished_fit, quick_fit
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.diagnosis.verdict.best_set.so_far import SoFar
from lightfield.fitting.effects import Effect, Form, Free
from lightfield.fitting.least_squares import Fit


def regression(found: Many, names: Iterable[str]) -> tuple[np.ndarray, float]:
    """Sizes and chi-square of base and effects on what the search kept, as it was whitened."""
    pool, whiten = found.pool, found.bench.whiten
    problem = pool.problem
    paths = ("level", "slope", *(f"toy.{n}" for n in names))
    columns = np.stack([problem.forward.columns[p] for p in paths], axis=1)
    design, value = whiten(problem.keep[:, None] * columns), whiten(problem.keep * problem.value)
    sizes = np.linalg.lstsq(design, value, rcond=None)[0]
    return sizes, float(((value - design @ sizes) ** 2).sum())


def every_set(found: Many, phi: float) -> dict[frozenset[str], float]:
    """Cost of every set of effects, at a variance scale."""
    names = [c.name for c in found.pool.problem.candidates]
    price = stats.f.isf(0.01 / len(names), 1, found.pool.ground.nu)
    sets = (some for size in range(len(names) + 1) for some in combinations(names, size))
    return {frozenset(some): regression(found, some)[1] / phi + len(some) * price for some in sets}


@pytest.mark.parametrize("seed", [1, 2])
def test_four_effects_are_the_best_of_all_sets(seed: int) -> None:
    """And every gap is the one to the best of all sets without that effect."""
    made = toy()
    problem = made.drawn(np.random.default_rng(seed), odd=2.5, dusk=-2.5, fan=1.5, braid=2.5)
    found = many(made, problem)
    costs = every_set(found, found.pool.ground.phi)
    assert found.best.names == min(costs, key=costs.__getitem__) == {"odd", "dusk", "fan", "braid"}
    assert found.adequate and {e.level for e in found.evidence} == {"certain"}
    sizes, chi2 = regression(found, [c.name for c in found.best.explanation])
    assert found.best.fit.u == pytest.approx(sizes, rel=1e-2)
    spare = found.prepared.problem.keep.sum() - len(sizes)
    costs = every_set(found, max(found.pool.ground.phi, chi2 / spare))
    for one in found.evidence:
        rival = min(cost for names, cost in costs.items() if one.candidate.name not in names)
        assert one.gap == pytest.approx(rival - costs[found.best.names], abs=0.3)


def test_light_that_is_traced_where_the_best_set_lies_needs_no_excuse(monkeypatch) -> None:
    """Light of a first trace is off by a part of another effect, which is then found beside it."""
    made = toy()
    columns = more_waves(layout())
    wrong = toy(odd=columns["odd"] - 0.15 * columns["braid"])
    value = made.drawn(np.random.default_rng(1), odd=20.0, dusk=-2.5).value
    problem = wrong.with_value(value)
    assert many(wrong, problem).best.names == {"odd", "dusk", "braid"}

    def following(problem, fit, seed: int):
        return replace(problem, forward=made.problem.forward)

    for name, own in (("can_follow", lambda *_: True), ("following", following)):
        monkeypatch.setattr(pooled, name, own)
    monkeypatch.setattr(pooled, "scatters", lambda _, fit: "toy.odd" in fit.paths)
    assert many(wrong, problem).best.names == {"odd", "dusk"}


def test_nothing_is_found_where_nothing_is() -> None:
    """Twenty sets: none is named with the chance of 0.01 each (five sigma would be three)."""
    made, rng = toy(), np.random.default_rng(3)
    named_sets = [bool(many(made, made.drawn(rng)).best.names) for _ in range(20)]
    assert sum(named_sets) <= stats.binom.isf(0.001, 20, 0.01)


def test_a_product_of_two_others_is_the_simplest_only() -> None:
    """Its column is the sum of two others': with one effect more the readings are met as well."""
    lay = layout()
    columns = more_waves(lay)
    made = toy(sum=columns["odd"] + columns["braid"])
    found = many(made, made.drawn(np.random.default_rng(1), sum=3.0, dusk=3.0, fan=2.0))
    levels = {e.candidate.name: e.level for e in found.evidence}
    assert levels == {"sum": "simplest", "dusk": "certain", "fan": "certain"}
    (of_sum,) = [e for e in found.evidence if e.candidate.name == "sum"]
    assert of_sum.gap > 6 and of_sum.gap_plus < 3
    assert ("braid", "odd") in of_sum.alternatives


def test_a_duplicate_is_one_of_two() -> None:
    made = toy(copy=-2.0 * more_waves(layout())["odd"])
    found = many(made, made.drawn(np.random.default_rng(1), odd=3.0, dusk=3.0, fan=2.0))
    levels = {e.candidate.name: (e.level, e.alternatives) for e in found.evidence}
    (one,) = levels.keys() & {"odd", "copy"}
    other = {"odd": "copy", "copy": "odd"}[one]
    assert levels[one] == ("one of", ((other,),))
    assert levels["dusk"][0] == levels["fan"][0] == "certain"


@pytest.mark.parametrize(("one_curve", "level"), [(True, "one of"), (False, "certain")])
def test_of_two_forms_of_a_curve_none_is_certain_where_one_is_at_its_bound(
    one_curve: bool, level: str
) -> None:
    """A lamp with straight flanks was certainly a super-Gaussian beside a second Gaussian that took all the
    light that it may: what they make together is a curve, and neither is there."""
    lay = layout()
    bounded = [candidate("odd"), candidate("dusk", high=2.0), candidate("fan")]
    both = curve("curve", (2,), ("odd", "dusk") if one_curve else ("odd",))
    columns = more_waves(lay) | {"curve0": lay.x_m**3, "curve1": lay.x_m**5}
    made = Toy.of([*bounded, *both], columns, lay)
    found = many(made, made.drawn(np.random.default_rng(1), odd=6.0, dusk=2.5, fan=6.0))
    levels = {e.candidate.name: e.level for e in found.evidence}
    assert levels == {"odd": level, "dusk": "one of", "fan": "certain"}


@pytest.mark.parametrize(("dusk", "high", "level"), [(0.7, 1e3, "partial"), (30.0, 10.0, "one of")])
def test_what_is_certain_beside_an_unknown_is_said(dusk: float, high: float, level: str) -> None:
    """A structure of no effect's shape, 12 sigma, beside effects of hundreds of sigma and of few. Where any
    effect lies at its bound nothing is certain: the set bends to follow what it lacks."""
    lay = layout()
    columns = more_waves(lay)
    made = Toy.of([candidate(n, high=high if n == "dusk" else 1e3) for n in columns], columns, lay)
    bump = 12 * np.exp(-(((lay.x_m - lay.x_m[3]) / 0.05) ** 2)) * (lay.z_m > 6)
    effects = made.problem.forward.predict({"toy.odd": 60.0, "toy.dusk": dusk})
    noise = np.random.default_rng(1).standard_normal(lay.size)
    found = many(made, made.with_value(made.base + effects + made.sigma * (bump + noise)))
    assert not found.adequate
    levels = {e.candidate.name: e.level for e in found.evidence}
    assert levels["odd"] == level
    assert all(each == "one of" for name, each in levels.items() if name != "odd")


DUSK_AND_FAN = frozenset({("dusk", "linear"), ("fan", "linear")})
TWO_TERMS = frozenset({("profile", "2 terms")})


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_named_form_wins_where_it_suffices(seed: int) -> None:
    """Certain even beside the curve that contains it, which does as well at any time: the curve has more to
    pay, and the named effect is judged against what is not its own special case."""
    made = with_curve()
    found = many(made, made.drawn(np.random.default_rng(seed), round=4.0, dusk=3.0, fan=2.0))
    assert found.best.names == {"round", "dusk", "fan"}
    (of_round,) = [e for e in found.evidence if e.candidate.name == "round"]
    assert 3 < of_round.gap < of_round.gap_named and of_round.level == "certain"
    (curve_instead,) = [n for n in found.pool.nodes.values() if n.key == {*TWO_TERMS, *DUSK_AND_FAN}]
    extra = found.best.fit.chi2 - curve_instead.fit.chi2
    assert extra > -0.1, "the curve contains it"


def test_a_curve_is_found_where_no_name_will_do() -> None:
    """With as many terms as it takes, and never beside what it contains."""
    made = with_curve()
    problem = made.drawn(np.random.default_rng(1), profile0=4.0, profile3=-4.0, dusk=3.0)
    found = many(made, problem)
    assert found.best.names == {"profile", "dusk"} and found.adequate
    (form,) = [c.form.name for c in found.best.explanation if c.name == "profile"]
    assert form == "4 terms"
    assert not any({"profile", "round"} <= n.names for n in found.pool.nodes.values())


@pytest.mark.parametrize(("beside", "best"), [(1.8, "round"), (2.2, "profile")])
def test_a_named_effect_wins_where_a_curve_is_cheaper_by_little(beside: float, best: str) -> None:
    """By 2.3 and by 6.4, with what a regression leaves of each; then they are one of two ways to see it."""
    made = with_curve()
    drawn = made.drawn(np.random.default_rng(1), round=4.0, profile1=beside, dusk=3.0, fan=2.0)
    found = many(made, drawn)
    ground = found.pool.ground
    price = {d: d * stats.f.isf(ground.level, d, ground.nu) for d in (1, 2)}
    chi2 = {
        names: regression(found, (*names, "dusk", "fan"))[1] / ground.phi
        for names in (("round",), ("profile0", "profile1"))
    }
    ahead = chi2["round",] + price[1] - chi2["profile0", "profile1"] - price[2]
    assert (0 < ahead < NAMED_FIRST) if best == "round" else ahead > NAMED_FIRST
    assert found.best.names == {best, "dusk", "fan"} and found.adequate
    assert {e.candidate.name: e.level for e in found.evidence} == {
        best: "one of", "dusk": "certain", "fan": "certain"
    }  # fmt: skip


@pytest.mark.parametrize(("spare", "level"), [(3, "one of"), (4, "certain")])
def test_a_curve_that_little_could_contradict_is_no_claim(spare: int, level: str) -> None:
    """Four terms that fit where three more would follow any readings: that they do says nothing."""
    made = with_curve()
    problem = made.drawn(np.random.default_rng(1), profile0=4.0, profile3=-4.0, dusk=3.0)
    every = tuple(replace(c, spare=spare) if c.name == "profile" else c for c in problem.candidates)
    problem = replace(problem, candidates=every)
    pool = pool_of(made, problem)
    whole = [c for c in every if c.form.name == "4 terms" or c.name == "dusk"]
    node = pool.fit(whole, [Begin({})])
    found = {e.candidate.name: e.level for e in evidence(pool, node, adequate=True)}
    assert found == {"profile": level, "dusk": "certain"}


@pytest.mark.parametrize(("ahead", "level"), [(-4.0, "certain"), (0.0, "simplest"), (4.0, "one of")])
def test_the_simplest_is_no_claim_where_one_effect_more_does_much_better(ahead: float, level: str) -> None:
    """A set without the effect and with one more, that costs 20 more, is ahead by so much at equal weight."""
    sure = Evidence(candidate("odd"), "certain", 9.0, 20.0, 20.0, 20.0, None, (), None, 1.0)
    best, rival = (SimpleNamespace(names=frozenset(names)) for names in (("odd",), ("dusk", "fan")))
    weighing = SimpleNamespace(above=lambda node: 20.0, above_unpriced=lambda node: -ahead, best=best)
    assert sure.against(weighing, rival).level == level


def test_a_curve_is_made_longer_from_where_it_lies() -> None:
    """A form of four terms beside one of two, once the latter is the best set."""
    made = with_curve()
    problem = made.drawn(np.random.default_rng(1), profile0=4.0, profile3=-4.0)
    pool = pool_of(made, problem)
    short = next(c for c in problem.candidates if c.form.name == "2 terms")
    pool.fit((short,), [Begin({})])
    polish(pool, lambda c: c.name == "profile", rounds=1)
    assert pool.best().key == {("profile", "4 terms")}
    assert pool.best().fit.chi2 == pytest.approx(expected_of_curve(made, problem), abs=0.05)


def expected_of_curve(made: Toy, problem) -> float:
    """Chi-square of base and all four terms, by regression."""
    return made.regression(problem, *(f"profile{k}" for k in range(4)))[2]


def test_elimination_from_everything_leaves_what_is_there() -> None:
    """Four effects in one move from nothing."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=3.0, dusk=-3.0, fan=2.0, braid=3.0)
    pool = pool_of(made, problem)
    linear_backward(pool, pool.nodes[frozenset()], everything, fits=1)
    assert pool.best().names == {"odd", "dusk", "fan", "braid"}


def test_a_quick_fit_ends_where_regression_does() -> None:
    """With its own slopes, with those of nowhere, and with wrong ones."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=3.0, dusk=-3.0)
    chosen = tuple(c for c in problem.candidates if c.name in ("odd", "dusk"))
    expected, _, chi2 = made.regression(problem, *(c.name for c in chosen))
    own = made.fit(problem, *chosen)
    right = dict(zip(own.paths, own.jacobian.T, strict=True))
    bent = {path: column * 1.5 + 0.5 for path, column in right.items()}
    for slopes in ({}, right, bent):
        quick = quick_fit(problem, chosen, made.whiten, Begin({}, slopes), 60, 1e-6)
        assert quick.chi2 == pytest.approx(chi2, abs=0.1)
        settled = finished_fit(problem, chosen, made.whiten, Begin({}, slopes), 60, 1e-6)
        assert settled.chi2 == pytest.approx(chi2, abs=1e-5)
        assert settled.u == pytest.approx(expected, abs=1e-3)
        assert np.allclose(settled.jacobian, own.jacobian, rtol=1e-4, atol=1e-6)


def test_a_fit_far_from_the_best_is_left_within_a_hundredth_of_the_way() -> None:
    """And one that is near goes on to the end, whatever slopes it begins with."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=30.0, dusk=-30.0)
    chosen = tuple(c for c in problem.candidates if c.name == "odd")
    _, _, chi2 = made.regression(problem, "odd")
    own = made.fit(problem, *chosen)
    bent = {path: column * 1.5 + 0.5 for path, column in zip(own.paths, own.jacobian.T, strict=True)}
    taken = []
    for near in (0.0, 0.5 * chi2, np.inf):
        rough = quick_fit(problem, chosen, made.whiten, Begin({}, bent), 60, 1e-6, near)
        distance = max(chi2 - near, 0.0)
        assert chi2 * (1 - 1e-9) <= rough.chi2 <= chi2 * (1 + 1e-3) + 0.01 * distance
        taken.append(rough.evaluations)
    assert taken[0] <= taken[1] <= taken[2] and taken[0] < taken[2]


def test_an_effect_whose_light_is_no_number_is_left_where_it_was() -> None:
    """And no light is asked for where a parameter is no number."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=2.5)

    class Broken:
        light = problem.forward.light

        def predict(self, values):
            assert all(np.isfinite(v) for v in values.values())
            return problem.forward.predict(values) * (np.nan if values.get("toy.fan", 0.0) else 1.0)

    both = [c for c in problem.candidates if c.name in ("odd", "fan")]
    fit = finished_fit(replace(problem, forward=Broken()), tuple(both), made.whiten, Begin({}), 20, 1e-6)
    found, _, _ = made.regression(problem, "odd")
    assert fit.values["toy.odd"] == pytest.approx(found[-1], rel=1e-3) and fit.values["toy.fan"] == 0


def test_a_set_without_any_light_is_behind_all_others() -> None:
    """Also in the order of costs and in weights, where a chi-square that is no number would spoil all."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=2.5)

    class Dark:
        light = problem.forward.light

        def predict(self, values):
            return problem.forward.predict(values) * (np.nan if "toy.fan" in values else 1.0)

    pool = pool_of(made, replace(problem, forward=Dark()))
    odd, fan = (next(c for c in problem.candidates if c.name == n) for n in ("odd", "fan"))
    dark = pool.fit((fan,), [Begin({})])
    best = pool.fit((odd,), [Begin({})])
    assert pool.cost(dark) == float("inf") and pool.best() is best
    (one,) = evidence(pool, best, adequate=True)
    assert 0.9 < one.weight <= 1 and one.level == "certain"


def test_bounds_hold() -> None:
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=3.0)
    (one,) = (candidate("odd", 0.0, 1.0),)
    fit = finished_fit(problem, (one,), made.whiten, Begin({}), 60, 1e-6)
    assert fit.u[-1] == 1.0 and bool(fit.at_bound()[-1])


def test_scattered_light_is_not_asked_for_without_end() -> None:
    """What has been spent on it is counted; sets without it are fitted all the same, as long as there are
    readings for their parameters."""
    made = toy()
    pool = pool_of(made, made.drawn(np.random.default_rng(1)))
    direct = made.problem.candidates[:2]
    free = (Free("water.scattering_per_m", 0.0, 2.0, 0.02),)
    effect = Effect("scatter", "toy", (Form("linear", free),), "", "", "")
    diffuse = replace(candidate("scatter"), effect=effect)
    assert effect.diffuse and pool.affordable([*direct, diffuse])
    pool.diffuse = pool.most_diffuse
    assert pool.affordable(direct) and not pool.affordable([*direct, diffuse])
    assert not pool.affordable([candidate(f"n{k}") for k in range(60)])


def test_of_many_readings_a_sample_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """And what it finds is fitted to all of them: sizes are those of the regression on all."""
    monkeypatch.setattr(problems, "MANY", 200)
    monkeypatch.setattr(problems, "SAMPLE", 120)
    lay = layout(planes=5, across=60)
    columns = more_waves(lay)
    made = Toy.of([candidate(name) for name in columns], columns, lay)
    problem = made.drawn(np.random.default_rng(1), odd=2.0, dusk=-2.0, fan=1.0)
    assert problem.sample is not None
    found = many(made, problem)
    assert found.best.names == {"odd", "dusk", "fan"} and found.adequate
    assert len(found.best.fit.residual) == lay.size == 300
    sizes, _ = regression(found, [c.name for c in found.best.explanation])
    assert found.best.fit.u == pytest.approx(sizes, rel=1e-2)


def test_a_search_of_many_effects_that_is_stopped_leaves_its_best_set() -> None:
    """Told whenever a set was fitted: how many so far, the error of the best, and its names."""
    lines: list[str] = []

    class Stopped(SoFar):
        def tried(self, sets: int, problem: Problem, explanation: Explanation, fit: Fit) -> None:
            super().tried(sets, problem, explanation, fit)
            if self.sets == 12:
                raise KeyboardInterrupt

    made, so_far = toy(), Stopped(lines.append)
    problem = made.drawn(np.random.default_rng(1), odd=2.5, dusk=-2.5, fan=1.5, braid=2.5)
    data = Data(problem, made.sigma, Budget(0.0, 0.0, 0.0))
    with pytest.raises(KeyboardInterrupt):
        search_many(data, made.prepared(problem), 0.01, np.random.default_rng(0), so_far)
    counts = [int(line.split()[0]) for line in lines]
    assert counts == list(range(1, 13))
    assert so_far.best is not None and 1 <= len(so_far.best.explanation) <= 4
    assert lines[-1] == (
        f"12 sets of effects tried; best so far: {so_far.best.error_percent:.3g} % with "
        + " + ".join(c.name for c in so_far.best.explanation)
    )
    errors = [float(line.split("best so far: ")[1].split(" %")[0]) for line in lines]
    assert errors[-1] < errors[0]


def test_the_search_is_the_same_twice() -> None:
    made = toy()
    problem = made.drawn(np.random.default_rng(5), odd=1.0, dusk=1.0, fan=0.7)
    one, two = many(made, problem), many(made, problem)
    assert [e.gap for e in one.evidence] == [e.gap for e in two.evidence]
    assert one.adequacy.p == two.adequacy.p
    assert isinstance(one.best, FittedSet) and named(one.best.explanation[0])
