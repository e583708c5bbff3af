"""Which of several sets that pass is the answer, and when one or two effects that pass are not."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from toy_pool import many, more_waves, pool_of, toy
from toy_problem import Toy, candidate, curve, layout

from lightfield.diagnosis import course
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.search import many as beyond
from lightfield.diagnosis.search.cascade import search
from lightfield.diagnosis.search.pool import answer
from lightfield.diagnosis.search.pool.answer import the_answer
from lightfield.diagnosis.search.pool.any_number import Data
from lightfield.diagnosis.search.pool.evidence import FAMILY, Weighing
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.verdict.best_set.so_far import SoFar
from lightfield.readings import Readings
from lightfield.scene import Scene

ALPHA = 0.01


def read(seed: int) -> Readings:
    """By formulas of their own: a lamp of 4 degrees with rings of 4 %, c = 0.1 per m, and a background."""
    rng = np.random.default_rng(seed)
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.7, 0.7, 15), np.linspace(2.5, 6.5, 5)))
    order = rng.permutation(len(x))
    x, z = x[order], z[order]
    far, off = np.hypot(x, z), np.degrees(np.arctan2(np.abs(x), z)) / 4.0
    beam = np.exp(-np.log(2) * off**2) * (1 + 0.04 * np.cos(2 * np.pi * off / 1.6))
    value = beam * np.exp(-0.1 * far) * z / far**3
    sigma = np.full(len(x), 0.005)
    value = value / value.max() + 0.008 + sigma * rng.standard_normal(len(x))
    return Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value, stderr=sigma, time_s=20.0 * np.arange(len(x)), scale="relative",
        position_mm=0.0, plane_gain_percent=0.0, tolerance_percent=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("seed", [0, pytest.param(7, marks=pytest.mark.slow)])
def test_a_lamp_with_rings_is_not_flat_because_that_passes(seed: int) -> None:
    """A flat top passes the test, alone or beside a turned receiver, where the noise is taken for too large;
    a curve costs less by 10 and by 46."""
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.1}})
    verdict = diagnose(read(seed), scene, diffuse=None, advise=False).verdict
    assert verdict.best_set == ["beam_profile", "background"] and "beam_profile" in verdict.certain
    background = verdict.ladder[-1].parameters["detector.background"]
    assert abs(background.value - 0.008) < 3 * background.stderr


def test_a_set_that_is_not_accepted_bars_none_with_an_effect_more() -> None:
    """The duplicate alone is no explanation: then it is one beside a third effect, at the price of that."""
    made = toy(copy=-2.0 * more_waves(layout())["odd"])
    problem = made.drawn(np.random.default_rng(1), odd=3.0, dusk=0.5)
    pool = pool_of(made, problem)
    by_name = {c.name: c for c in problem.candidates}
    best, copy, more = (
        pool.fit([by_name[n] for n in names], [Begin({})])
        for names in (("odd",), ("copy",), ("copy", "dusk"))
    )
    weighing = Weighing.of(pool, best)
    assert weighing.above(copy) < weighing.above(more) < FAMILY
    assert weighing.family() == [best, copy]
    assert weighing.family(lambda node: node is not copy) == [best, more]


@pytest.mark.parametrize(("size", "kept"), [(0.35, False), (1.0, True)])
def test_an_effect_that_describes_noise_is_not_in_the_answer(size: float, kept: bool) -> None:
    """Where the pure error is taken for a quarter of what the set leaves, chi-square counts four times."""
    made = toy()
    problem = made.drawn(np.random.default_rng(3), odd=6.0, braid=size)
    wide = pool_of(made, problem).ground
    pool = Pool(Ground(wide.test, 0.25, wide.nu))
    known = {c.name: c for c in problem.candidates}
    pool.fit((), [Begin({})])
    one, two = (pool.fit([known[n] for n in names], [Begin({})]) for names in (("odd",), ("odd", "braid")))
    gain, price = one.fit.chi2 - two.fit.chi2, pool.ground.price(known["braid"])
    assert pool.cost(two) < pool.cost(one)
    assert (gain > price) is kept and abs(gain - price) > 5
    found = the_answer(pool, two, ALPHA)
    assert found.names == ({"odd", "braid"} if kept else {"odd"})
    assert wide.test(found.fit).passes(ALPHA)


def test_two_effects_in_place_of_a_curve_have_one_price_as_it_has() -> None:
    """A curve of four terms follows the noise better than two effects that it contains, and costs less than
    both, each by itself: they are named, the curve stands beside them, and none outweighs the other."""
    lay = layout()
    terms = [np.cos((k + 2) * lay.x_m) * lay.x_m**2 * (lay.z_m - 5.5) for k in range(4)]
    columns = more_waves(lay) | {"round": terms[0] + 0.5 * terms[1], "ring": terms[2]}
    candidates = [candidate(n) for n in columns] + curve("bend", (4,), ("round", "ring"))
    made = Toy.of(candidates, columns | {f"bend{k}": t for k, t in enumerate(terms)}, lay)
    problem = made.drawn(np.random.default_rng(3), round=8.0, ring=8.0)
    result = many(made, problem)
    pool, by_name = result.pool, {c.name: c for c in problem.candidates}
    apart, whole = (
        pool.fit([by_name[n] for n in names], [Begin({})]) for names in (("round", "ring"), ("bend",))
    )
    assert pool.cost(apart) > pool.cost(whole) + answer.NAMED_FIRST
    assert result.adequate and result.best.names == {"round", "ring"}
    assert abs(Weighing.of(pool, result.best).above(whole)) < answer.NAMED_FIRST
    assert {e.candidate.name: e.level for e in result.evidence} == dict.fromkeys(
        ("round", "ring"), Certainty.ONE_OF
    )


def costing(cost: float, *names: str, at_edge: bool = False) -> SimpleNamespace:
    """A fitted set of effects of these names."""
    made = (SimpleNamespace(is_free_form="curve" in name, family=name, contains=()) for name in names)
    effects = [SimpleNamespace(effect=e, key=n, name=n) for e, n in zip(made, names, strict=True)]
    return SimpleNamespace(explanation=effects, key=frozenset(names), cost=cost, at_edge=at_edge)


def asked(
    sets: Callable[..., Iterable[Any]], found: SimpleNamespace, *others: SimpleNamespace
) -> list[set[str]]:
    """What is asked for in place of what was found, of a pool of these."""
    pool = SimpleNamespace(nodes=dict(enumerate([found, *others])), cost=lambda node: node.cost, ground=None)
    return [set(node.key) for node in sets(pool, found)]


def test_named_effects_come_before_curves_beside_a_cheaper_set_of_fewer_curves() -> None:
    """Of sets that cost at most 5 more than one of two curves, that of none is asked for first."""

    found = costing(10.0, "curve 1", "curve 2")
    others = [
        costing(11.0, "a", "curve 2"),
        costing(14.9, "a", "b"),
        costing(15.1, "a"),
        costing(9.0, "curve 3"),
    ]
    assert asked(answer._named_first, found, *others) == [{"a", "b"}, {"a", "curve 2"}]


def test_an_effect_as_large_as_is_plausible_gives_way_to_one_that_is_not() -> None:
    """Where that costs at most 5 more, and needs no curve."""
    found = costing(10.0, "turned receiver", at_edge=True)
    others = [costing(14.0, "tilt"), costing(12.0, "other", at_edge=True), costing(11.0, "curve")]
    others.append(costing(15.1, "dear"))
    assert asked(answer._within_their_ranges, found, *others) == [{"tilt"}]
    assert asked(answer._within_their_ranges, costing(10.0, "small"), *others) == []


def test_what_more_effects_do_not_explain_is_no_finding_of_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two effects that passed under errors that were too large do not pass under those judged anew."""
    made = toy()
    problem = made.drawn(np.random.default_rng(1), odd=4.0, dusk=-4.0)
    rng, prepared = np.random.default_rng(0), made.prepared(problem)
    two = search(prepared, 0.0, rng, ALPHA, SoFar())
    assert two.size == 2 and two.accepted
    failed = replace(many(made, problem), adequate=False)
    monkeypatch.setattr(beyond, "search_many", lambda *_: failed)
    data = Data(problem, made.sigma, Budget(0.0, 0.0, 0.0))
    _, more = beyond.beyond_two(data, prepared, two, ALPHA, 0, SoFar())
    assert (more.size, more.accepted, more.weights) == (None, [], [])
    assert more.best is None and set(more.closest.names) == {"odd", "dusk"}


@pytest.mark.parametrize(("left", "more_is_it"), [(1.0, True), (9.0, False)])
def test_two_that_pass_in_too_large_errors_are_no_answer_where_more_mend_them(
    monkeypatch: pytest.MonkeyPatch, left: float, more_is_it: bool
) -> None:
    """Ten times the stated variance, and what is left of it beside a set that does not explain it all."""
    finding = SimpleNamespace(
        many=SimpleNamespace(adequacy="about the set", at_first_sight=False), accepted=[]
    )
    more = SimpleNamespace(prepared=None, finding=finding)
    known = SimpleNamespace(
        prepared=None, finding=SimpleNamespace(many=None), with_more_effects=lambda ends: more
    )
    scale = {None: 10.0, "about the set": left}
    monkeypatch.setattr(course, "_unexplained_variance", lambda prepared, finding, about=None: scale[about])
    monkeypatch.setattr(course, "_beside_unknowns", lambda *_: None)
    assert course._unless_more_explain(known) is (more if more_is_it else known)
