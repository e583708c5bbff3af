"""Sets near the best one: with another form of one of its effects, whatever that promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from toy_pool import more_waves, pool_of
from toy_problem import Toy, candidate, layout

from lightfield.diagnosis.search.pool.moves import polish
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
