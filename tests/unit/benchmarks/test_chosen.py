"""The benchmark that halves and doubles what was chosen: it meets every number, wherever it is used."""

from __future__ import annotations

import pytest

from benchmarks.chosen.values import Chosen, Used, chosen, instead, other
from lightfield.diagnosis.adequacy import robust, templates
from lightfield.diagnosis.search import cascade
from lightfield.diagnosis.search.pool import answer, evidence
from lightfield.fitting.effects import free_form


@pytest.mark.parametrize(
    ("value", "half", "double"),
    [
        (12.0, 6.0, 24.0),
        (5, 2, 10),
        (1, None, 2),
        (0.95, 0.975, 0.9),
        (0.0, None, None),
        ((2.0, "x", 4), (1.0, "x", 2), (4.0, "x", 8)),
        ({"a": 1.0}, {"a": 0.5}, {"a": 2.0}),
        (True, None, None),
        ("much", None, None),
    ],
)
def test_half_and_double(value: object, half: object, double: object) -> None:
    assert other(value, 0.5) == (half if not isinstance(half, float) else pytest.approx(half))
    assert other(value, 2.0) == (double if not isinstance(double, float) else pytest.approx(double))


def test_every_number_that_says_so_is_met_once() -> None:
    labels = [one.label for one in chosen()]
    assert len(set(labels)) == len(labels) > 300
    assert {"fitting.effects.free_form._LARGE", "diagnosis.search.pool.answer.NAMED_FIRST"} <= set(labels)


def test_another_value_is_used_and_gone() -> None:
    """In its own module, where it is imported, and as a default."""
    (one,) = [c for c in chosen() if c.label == "diagnosis.search.pool.evidence.GAP"]
    (large,) = [c for c in chosen() if c.label == "fitting.effects.free_form._LARGE"]
    (private,) = [c for c in chosen() if c.label == "diagnosis.adequacy.templates._MANY"]
    before, defaults = evidence.GAP, free_form._forms.__defaults__
    with instead(one, 77.0):
        assert evidence.GAP == cascade.GAP == 77.0
    with instead(large, 5.0):
        assert free_form._LARGE == 5.0 and 5.0 in (free_form._forms.__defaults__ or ())
    with instead(private, 7):  # another module's number has the same name and value
        assert templates._MANY == 7 and private.value == robust._MANY
    assert evidence.GAP == cascade.GAP == before and free_form._forms.__defaults__ == defaults


def test_a_number_is_used_where_a_function_ran_that_looks_it_up() -> None:
    run = Chosen("lightfield.diagnosis.search.pool.answer", "NAMED_FIRST", answer.NAMED_FIRST)
    with Used() as used:
        free_form._forms("lamp.profile_departure", (2,))
    assert not used.by(run)
    assert used.by(Chosen("lightfield.fitting.effects.free_form", "_LARGE", free_form._LARGE))
