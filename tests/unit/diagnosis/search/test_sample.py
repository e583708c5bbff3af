"""What many readings are spared: every shortcut beside the same computation with all of the readings.

From 3000 readings on, a sample leads: fits begin with it, and what it shows to be far behind is left so.
Here 400 readings count as many, so that both ways can be gone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from analytic_readings import many_lines
from toy_problem import layout, toy, tried, waves
from wave_problem import OMEGA, SIGMA, wave_problem

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem import noise as noise_module
from lightfield.diagnosis.problem import problem as problem_module
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.problem import FAR_BEHIND, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search import small_sets as search_module
from lightfield.diagnosis.search.cascade import OwnErrors
from lightfield.diagnosis.search.preparation import base_at, bench
from lightfield.diagnosis.search.profile_likelihood import profiled
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.search.small_sets import at_lowest_minima
from lightfield.diagnosis.search.told_apart import nearest_rival
from lightfield.fitting.least_squares import Fit

FEW = 120


@pytest.fixture
def many(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """400 readings are many."""
    monkeypatch.setattr(problem_module, "MANY", 300)
    monkeypatch.setattr(problem_module, "SAMPLE", FEW)
    yield


def in_full(problem: Problem) -> Problem:
    """The problem without its sample."""
    out = Problem(
        problem.forward, problem.layout, problem.value, problem.keep, problem.base, problem.candidates
    )
    out.__dict__["sample"] = None
    return out


def wave(whole: bool) -> tuple[Problem, Any, Whitener, list[int]]:
    """At whole numbers the frequencies w and pi - w are the same."""
    lay = layout(5, 80, in_order=True)
    x = np.round(4.5 * (lay.x_m + 1)) if whole else 4.5 * (lay.x_m + 1)
    problem, shaped = wave_problem(x, 1, lay)
    flat = np.zeros(lay.size)
    noise = Noise(lay, flat + SIGMA, flat + 1.0, Budget(0.0, 0.0, 0.0), flat)
    return problem, shaped, Whitener(noise), cast(Any, problem.forward).calls


@dataclass(frozen=True)
class Passing:
    """A test that every fit passes."""

    problem: Problem
    whiten: Whitener
    passed: Any

    def __call__(self, fit: Fit) -> Any:
        return self.passed


@pytest.mark.parametrize("whole", [True, False])
def test_a_profile_that_a_sample_leads_has_the_errors_of_the_full_one(many: None, whole: bool) -> None:
    """Whether there is one valley or two alike: what is far behind in the sample adds nothing to an error."""
    problem, shaped, whiten, calls = wave(whole)
    assert problem.sample is not None
    fit = problem.fit((shaped,), whiten, [np.array([1.0, 0.4, OMEGA])])
    told = []
    for one in (problem, in_full(problem)):
        calls.clear()
        found, errors = profiled(one, (shaped,), fit, whiten, 1.0)
        told.append((found, errors, calls.count(problem.layout.size)))
    (led, errors, some), (full, all_errors, every) = told
    assert led.chi2 == pytest.approx(full.chi2, abs=0.1)
    # Between the last point within the bounds and one that the sample leaves: not to the last digit.
    assert errors == pytest.approx(all_errors, rel=0.05)
    assert some < 0.9 * every


def test_a_sample_leads_scattered_light_to_its_lowest_minimum(
    many: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit that lies in the valley of twice the frequency is fetched from there as the full profile would,
    with few predictions of all places; one at the bottom stays where it is."""
    problem, shaped, whiten, calls = wave(whole=False)
    # What is told apart by a sample is light that is followed; this one is not, but its valleys are.
    for name in ("can_follow", "scatters"):
        monkeypatch.setattr(search_module, name, lambda *_: True)
    stuck = problem.fit((shaped,), whiten, [np.array([1.0, 0.1, 2.2])])
    best = problem.fit((shaped,), whiten, [np.array([1.0, 0.4, OMEGA])])
    assert best.chi2 < stuck.chi2 - 50.0
    told = []
    for begun in (stuck, best):
        passed = cast(Any, SimpleNamespace(phi=1.0))
        tried = ScoredSet((shaped,), begun, begun.chi2, passed, cast(Any, Passing(problem, whiten, passed)))
        calls.clear()
        (found,) = at_lowest_minima(problem, [tried])
        told.append((found, calls.count(problem.layout.size)))
    (fetched, some), (stayed, none) = told
    assert fetched.fit.chi2 == pytest.approx(best.chi2, abs=0.01)
    left = stuck.chi2 / (problem.keep.sum() - len(stuck.u))
    assert fetched.bic == pytest.approx(stuck.chi2 - (stuck.chi2 - fetched.fit.chi2) / left)
    assert stayed.fit is best
    calls.clear()
    profiled(in_full(problem), (shaped,), stuck, whiten, 1.0)
    assert none <= 2 < some < 0.5 * calls.count(problem.layout.size)


def test_the_nearest_rival_of_a_sample_is_the_nearest(many: None) -> None:
    """Of three rivals one is near; the others a sample rules out. The distance is that of all readings."""
    lay = layout(5, 80)
    made = toy(lay=lay, near=waves(lay)["odd"] + 0.2 * waves(lay)["rows"])
    problem = made.drawn(np.random.default_rng(0), odd=3.0)
    best, *others = (tried(made, problem, name) for name in ("odd", "dusk", "near", "rows"))
    led, full = (nearest_rival(p, made.whiten, best, others, 1.0) for p in (problem, in_full(problem)))
    assert led is not None and full is not None
    assert led.explanation.names == full.explanation.names == ("near",)
    assert led.separation_sigma == pytest.approx(full.separation_sigma, rel=1e-6)


def test_fits_that_a_sample_leads_end_where_those_of_all_readings_do(many: None) -> None:
    """The best sets to rounding; what is far behind is told worse than it is, never better."""
    lay = layout(5, 80)
    made = toy(lay=lay, near=waves(lay)["odd"] + 0.1 * waves(lay)["rows"])
    problem = made.drawn(np.random.default_rng(0), odd=5.0)
    begun = [((c,), [problem.default_start(problem.model().start, (c,))]) for c in problem.candidates]
    led, full = problem.fit_all(begun, made.whiten), in_full(problem).fit_all(begun, made.whiten)
    lowest = min(fit.chi2 for fit in full)
    behind = [fit.chi2 - lowest > 2 * FAR_BEHIND * problem.layout.size / FEW for fit in full]
    assert behind == [False, True, True, False]
    for some, every, far in zip(led, full, behind, strict=True):
        assert some.chi2 >= every.chi2 - 1e-2
        if not far:
            assert some.chi2 == pytest.approx(every.chi2, abs=1e-2)
            assert some.u == pytest.approx(every.u, abs=1e-3)


def test_the_base_model_of_many_readings_is_tested_once(many: None) -> None:
    """What preparation has asked the search is told; few readings are drawn anew, with another p."""
    made = toy(lay=layout(5, 80))
    prepared = made.prepared(made.drawn(np.random.default_rng(2), odd=3.0))
    rng = np.random.default_rng(0)
    first = base_at(prepared, 0.0, rng)
    assert base_at(prepared, 0.0, rng) is first
    few = made.prepared(in_full(prepared.problem))
    one, other = (base_at(few, 0.0, rng) for _ in range(2))
    assert one is not other and one.fit.chi2 == other.fit.chi2 == pytest.approx(first.fit.chi2)


@pytest.mark.parametrize("strength", [0.02, 0.3, 3.0])
def test_what_a_sample_calls_hopeless_is_far_behind_all_readings(many: None, strength: float) -> None:
    """And what nearly does as well is not called so."""
    made = toy(lay=layout(5, 80))
    problem = made.drawn(np.random.default_rng(2), odd=strength)
    prepared = made.prepared(problem)
    own = OwnErrors(prepared, bench(prepared, 0.0, np.random.default_rng(0)), np.random.default_rng(0))
    best, other = tried(made, problem, "odd").fit, tried(made, problem, "dusk").fit
    behind = (other.chi2 - best.chi2) / max(1.0, best.chi2 / problem.layout.size)
    assert not own.hopeless(best, best)
    assert own.hopeless(other, best) == (strength > 1)
    assert behind > FAR_BEHIND if strength > 1 else behind < FAR_BEHIND * problem.layout.size / FEW


def test_a_diagnosis_of_many_readings_is_that_without_shortcuts(monkeypatch: pytest.MonkeyPatch) -> None:
    """620 readings, as many and as few: sample, fewer shared columns and single precision between blocks move
    no number by a tenth of its error. Limits rest on a hundredth of 999 random tables: 3 % of scatter."""
    readings, believed = many_lines(620, 5, **{"lamp.offset_x_m": 0.02})
    told = []
    for limit in (10_000, 600):
        monkeypatch.setattr(problem_module, "MANY", limit)
        monkeypatch.setattr(problem_module, "SAMPLE", 300)
        monkeypatch.setattr(noise_module, "_MANY", limit)
        names = ["beam_offset", "beam_tilt", "background"]
        told.append(diagnose(readings, believed, diffuse=None, only=names, advise=False).verdict)
    full, short = told
    assert full.effects == short.effects == ["beam_offset"] and full.verdict == short.verdict
    for path, one in full.explanations[0].parameters.items():
        other = short.explanations[0].parameters[path]
        assert one.stderr is not None and other.stderr == pytest.approx(one.stderr, rel=0.01)
        assert abs(other.value - one.value) < 0.1 * one.stderr
    for name, limit_ in full.detection_limits.items():
        assert short.detection_limits[name].value == pytest.approx(limit_.value, rel=0.12)
