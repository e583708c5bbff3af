"""Which of the sets that pass comes first, and what is not told apart from it by a hair."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.search.better_light import acceptance
from lightfield.diagnosis.search.pool.answer import NAMED_FIRST
from lightfield.diagnosis.search.set_of_effects import ScoredSet


@pytest.fixture(scope="module")
def passed() -> ScoredSet:
    """A set that readings with a background pass with."""
    table, scene = readings({"detector.background": 0.02})
    return diagnose(table, scene, diffuse=None, only=["background"], advise=False).finding.accepted[0]


def test_named_forms_win_where_they_suffice(passed: ScoredSet) -> None:
    """No curve is the answer that is hardly cheaper than a name in its place."""

    def costing(bic: float, curves: int) -> ScoredSet:
        effects: Any = (SimpleNamespace(effect=SimpleNamespace(is_free_form=k < curves)) for k in range(3))
        return replace(passed, explanation=tuple(effects), bic=bic)

    two, one, far = (
        costing(10.0, 2),
        costing(10.0 + 0.9 * NAMED_FIRST, 1),
        costing(10.0 + 1.1 * NAMED_FIRST, 0),
    )
    assert acceptance._named_first([two, one, far]) == [one, two, far]
    assert acceptance._named_first([two, far]) == [two, far]
    assert acceptance._named_first([]) == []


def test_what_fails_by_a_hair_and_costs_less_keeps_an_answer_from_being_alone(passed: ScoredSet) -> None:
    """Of b = 0.4 per m beside walls of 0.35 a drift and a background passed at 0.012, and were identified,
    where walls with scattering failed at 0.010 and cost less."""
    best = passed
    assert best.adequacy is not None

    def other(p: float, cheaper: float) -> ScoredSet:
        return replace(best, bic=best.bic - cheaper, adequacy=replace(best.adequacy, p=p))

    hair, far, dear, passes = other(0.009, 1.6), other(0.0009, 1.6), other(0.009, -1.6), other(0.02, 1.6)
    assert acceptance._nearly([far, dear, passes, hair], best, 0.01) == [hair]
    assert acceptance._nearly([far, dear], best, 0.01) == []


def test_sets_are_ranked_by_one_variance_whatever_is_judged_beside_each(passed: ScoredSet) -> None:
    """A lamp's size with scattering and an apparent source with it, 1.1 sigma apart, had chi-squares of 50.8
    and 52.0 and weights of 0.996 and 0.004: each was divided by a variance of its own, 1.04 and 0.88."""
    assert passed.adequacy is not None
    finding: Any = SimpleNamespace(many=None, n=65)

    def anew(chi2: float, phi: float, growth: float) -> acceptance._Anew:
        assert passed.adequacy is not None
        fit, judged = replace(passed.fit, chi2=chi2), replace(passed.adequacy, phi=phi)
        return acceptance._Anew(Any, replace(passed, fit=fit, adequacy=judged), growth)

    first, second = acceptance._scored(finding, [anew(50.8, 1.04, 0.95), anew(52.0, 0.88, 1.77)])
    assert second.bic - first.bic == pytest.approx((52.0 - 50.8) / 1.04 + 1.77 - 0.95)
