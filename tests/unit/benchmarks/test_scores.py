"""Names that benchmarks score by are names of the table."""

from __future__ import annotations

from typing import Any

from benchmarks.hidden_effects import judge
from benchmarks.many_effects import catalogue, scores
from lightfield.fitting import effects


def test_what_describes_an_unknown_influence_is_a_curve() -> None:
    assert set(judge.CURVE_OF.values()) <= set(effects.curves())
    assert {key.partition(":")[2] for key in judge.CURVE_OF} <= set(catalogue.UNKNOWNS)


def _told(names: list[str], **given: Any) -> dict[str, Any]:
    """A claim of one effect of 40 sigma."""
    truth = {"hidden": [], "any_of": [], "unknown": "", "delta": 40.0}
    return truth | {"verdict": "identified", "effects": names, "explanations": [{"effects": names}]} | given


def test_a_curve_is_right_for_what_it_contains_where_no_formula_of_the_table_is() -> None:
    """A measured lamp is no super-Gaussian, and a flicker nothing but a lamp's power in time."""
    lamp = {"any_of": ["beam_shape", "beam_skirt"], "hidden": ["beam_shape"]}
    for names, outcome in ((["beam_profile"], "right"), (["beam_skirt"], "right"), (["lamp_drift"], "wrong")):
        assert judge.outcome(_told(names, **lamp)) == outcome
    for names, outcome in ((["lamp_power_curve"], "right"), (["lamp_power_curve", "background"], "wrong")):
        assert judge.outcome(_told(names, unknown="unknown:flicker")) == outcome
    assert judge.outcome(_told(["beam_profile"], hidden=["beam_shape"])) == "wrong"


def test_what_may_act_is_in_the_table() -> None:
    assert {name for names in catalogue.MAY_ACT.values() for name in names} <= set(effects.table())


def _row(**given: Any) -> dict[str, Any]:
    best = {"best_set": ["beam_tilt"], "certain": [], "simplest": ["beam_tilt"], "family": [["beam_tilt"]]}
    found = [{"effect": "beam_tilt", "alternatives": [["acceptance", "detector_tilt"]]}]
    hidden = ["acceptance", "detector_tilt"]
    truth = {"hidden": hidden, "delta": dict.fromkeys(hidden, 40.0), "lamp": "", "unknown": ""}
    return truth | best | {"found": found} | given


def test_wrong_names_are_counted_over_levels_together_and_apart() -> None:
    rows = [_row(), _row(certain=["acceptance", "detector_tilt"], simplest=[])]
    assert str(scores._names(rows, "simplest")).endswith("1/1)")
    assert str(scores._names(rows, "certain", "simplest")).endswith("1/3)")


def test_a_set_that_is_told_to_do_as_well_is_not_in_the_family() -> None:
    assert not scores._in_family(_row())
    assert scores._in_family(_row(), told=True)
    assert not scores._in_family(_row(hidden=["background"], delta={"background": 9.0}), told=True)
