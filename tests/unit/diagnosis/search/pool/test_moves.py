"""Sets that a search fits: forms of an effect and scattered light whatever they promise, large ones where
they may be the best."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from toy_pool import more_waves, pool_of, toy
from toy_problem import Linear, Toy, candidate, layout

from lightfield.diagnosis.search.pool import looks
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.pool.looks import everything
from lightfield.diagnosis.search.pool.moves import forward, polish
from lightfield.diagnosis.search.pool.quick import Begin


def test_another_form_of_an_effect_is_fitted_though_it_promises_little() -> None:
    """Two forms that share no parameter; the readings hold more of the other one. No swap is within reach."""
    columns = more_waves(lay := layout())
    others = [candidate(name) for name in columns if name != "dusk"]
    first = next(c for c in others if c.name == "odd")
    second = candidate("dusk")
    form = replace(second.form, name="other")
    second = replace(second, effect=replace(first.effect, forms=(first.form, form)), form=form)
    made = Toy.of([*others, second], columns, lay)
    problem = made.with_value(made.base + made.problem.forward.predict({"toy.odd": 2.0, "toy.dusk": 4.0}))
    pool = pool_of(made, problem)
    pool.fit((first,), [Begin({})])
    best = polish(pool, lambda _: True, swaps=0, reach=-np.inf)
    assert [c.key for c in best.explanation] == [("odd", "other")]


class Bent(Linear):
    """Of much of "fringe" readings follow another column, of which a little shows nothing."""

    def predict(self, values):
        much = max(values.get("toy.fringe", 0.0) - 2.0, 0.0)
        return super().predict({**values, "toy.much": 10.0 * much})


def bent() -> Pool:
    """Readings with five of "fringe" and six of "odd"."""
    lay = layout()
    columns = more_waves(lay)
    columns["fringe"] *= 0.3
    made = Toy.of(
        [candidate(name) for name in columns], columns | {"much": np.sin(7 * lay.x_m) * np.cos(lay.z_m)}
    )
    problem = replace(made.problem, forward=Bent(made.problem.forward.columns))
    value = made.base + problem.forward.predict({"toy.fringe": 5.0, "toy.odd": 6.0})
    return pool_of(made, replace(problem, value=value))


def test_what_promises_nothing_is_fitted_where_it_is_asked_for_anyway() -> None:
    """Much sediment beside a background: a step promised less of it than of fifteen others, and with it the
    readings cost a quarter. Nine names, one of them there, piled up in its place."""
    before = bent()
    forward(before, before.best(), 2, 1, everything, 1)
    assert all("fringe" not in node.names for node in before.nodes.values())
    pool = bent()
    found = forward(pool, pool.best(), 2, 1, everything, 2, anyway=lambda c: c.name == "fringe")
    assert found.names == {"fringe", "odd"}


@pytest.mark.parametrize("reach", [0.0, 8.0, 40.0])
def test_no_set_of_more_effects_is_better(reach: float) -> None:
    """Beside every set with one effect more than that, fitted; and one of so many might be, without noise."""
    made = toy()
    pool = pool_of(made, made.drawn(np.random.default_rng(1), odd=9.0, dusk=-9.0))
    by = {c.name: c for c in pool.problem.candidates}
    best = pool.fit((by["odd"], by["dusk"]), [Begin({})])
    most = pool.most_effects(reach)
    assert 2 <= most < len(by)
    larger = [pool.fit(some, [Begin({})]) for some in combinations(pool.problem.candidates, most + 1)]
    assert min(map(pool.cost, larger)) > pool.cost(best)
    assert most * pool.ground.price(by["odd"]) + best.chi2 <= pool.cost(best) + reach


def test_names_are_no_longer_mended_where_a_small_set_with_a_curve_left_them_behind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Swaps between names that came nowhere near a curve took 40 s."""
    made = toy()
    pool = pool_of(made, made.drawn(np.random.default_rng(1), odd=60.0, dusk=-3.0))
    by = {c.name: c for c in pool.problem.candidates}
    pool.fit((by["odd"],), [Begin({})])
    asked = []
    monkeypatch.setattr(looks, "polish", lambda pool, allowed: asked.append(allowed))
    without, every = (lambda c: c.name != "odd"), everything
    for allowed in (without, every):
        looks._polish_near(pool, allowed)
    assert asked == [every]
