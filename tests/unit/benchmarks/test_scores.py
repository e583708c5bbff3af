"""Names that benchmarks score by are names of the table."""

from __future__ import annotations

from benchmarks.many_effects import catalogue, scores
from lightfield.fitting import effects


def test_what_describes_an_unknown_influence_is_a_curve() -> None:
    assert set(scores._CURVE_OF.values()) <= set(effects.curves())
    assert {key.partition(":")[2] for key in scores._CURVE_OF} <= set(catalogue.UNKNOWNS)


def test_what_may_act_is_in_the_table() -> None:
    assert {name for names in catalogue.MAY_ACT.values() for name in names} <= set(effects.table())
