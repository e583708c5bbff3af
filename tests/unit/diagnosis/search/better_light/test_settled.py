"""What settling does to a finding: nothing without scattered light; what passes no more is not accepted."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from analytic_readings import readings
from toy_problem import Toy, candidate, layout, waves

from lightfield.diagnosis import course as stages
from lightfield.diagnosis import diagnose as diagnosing
from lightfield.diagnosis import knowledge
from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.better_light import settled as module
from lightfield.diagnosis.search.better_light import settling
from lightfield.diagnosis.search.better_light.settled import is_nearly_explained, settled
from lightfield.diagnosis.search.better_light.settling import Judge, Settled
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.followed import PHOTONS, is_of_the_search_alone, scatters
from lightfield.diagnosis.search.pool.any_number import Data
from lightfield.diagnosis.search.pool.evidence import evidence
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.least_squares import Fit
from lightfield.scene import Scene

#: Seen by errors of 0.5 % together, and hidden by a tolerance of 0.3 %.
SLANT = 0.003
#: Noise that is judged about another fit of the same light moves a fit by less than so many of its errors.
SAME = 0.01


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    table, scene = readings({"detector.background": 0.02})
    return diagnose(table, scene, diffuse=None, only=["beam_tilt", "background"], advise=False)


def data_of(found: Diagnosis, tolerance: float | None = None) -> Data:
    """The readings as they came."""
    problem, budget = found.prepared.problem, found.prepared.noise.budget
    every = replace(problem, keep=np.ones_like(problem.keep))
    budget = budget if tolerance is None else replace(budget, tolerance=tolerance)
    return Data(every, np.asarray(found.readings.stderr, float), budget)


def settle_to(monkeypatch: pytest.MonkeyPatch, slant: float) -> None:
    """With the better light the readings on the right are brighter by this part, and on the left darker."""

    def moved(
        problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener, seed: int, judge: Judge | None
    ) -> Settled:
        there = replace(problem, value=problem.value * (1 + slant * np.sign(problem.layout.x_m)))
        now = Settled(there, whiten, there.fit(explanation, whiten, [fit.u]))
        return now if judge is None else settling._under_its_noise(now, explanation, judge)

    for name, value in (
        ("settle", moved),
        ("scatters", lambda *_: True),
        ("can_follow", lambda *_: True),
    ):
        monkeypatch.setattr(module, name, value)


def test_what_does_not_scatter_is_not_traced_again(found: Diagnosis, monkeypatch) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("there is nothing to trace")

    monkeypatch.setattr(settling, "ratio_at", never)
    assert found.finding.accepted
    same = settled(data_of(found), found.prepared, found.finding, np.random.default_rng(0))
    assert same[0] is found.prepared and same[1] is found.finding


def test_an_explanation_that_settles_where_it_was_stays_accepted(found: Diagnosis, monkeypatch) -> None:
    settle_to(monkeypatch, 0.0)
    _, again = settled(data_of(found), found.prepared, found.finding, np.random.default_rng(0))
    assert (again.size, again.identified) == (1, found.finding.identified)
    assert again.accepted[0].fit.away_from(found.finding.accepted[0].fit.u) < SAME


@pytest.mark.parametrize(("scatters", "traces"), [(True, 4), (False, 1)])
def test_water_that_a_fit_has_cleared_is_not_traced_again(
    found: Diagnosis, monkeypatch, scatters: bool, traces: int
) -> None:
    """A fit by better light may end at b = 0, where there is nothing that could be traced."""
    made, best = list[float](), found.finding.accepted[0]
    assert best.test is not None and isinstance(best.test.whiten, Whitener)

    def ratio_at(light: object, values: object, photons: float, seed: int) -> tuple[None, SimpleNamespace]:
        made.append(photons)
        return None, SimpleNamespace(photons=photons)

    for name, value in (
        ("ratio_at", ratio_at),
        ("with_light", lambda problem, traced: problem),
        ("scatters", lambda *_: scatters),
        ("_MOVED", 0.0),
    ):
        monkeypatch.setattr(settling, name, value)
    settling.settle(found.prepared.problem, best.explanation, best.fit, best.test.whiten)
    assert len(made) == traces
    assert made == [PHOTONS] * traces, "no photons widen an error"


@pytest.mark.parametrize("widened", [0.3, 0.5, 1.0])
def test_a_trace_has_the_photons_that_errors_lack(widened: float) -> None:
    """An error of 1 without photons' noise, whose variance photons add to as one over their number."""
    traced = 1e6
    added = ((1 + widened) ** 2 - 1) * traced
    photons = settling._enough(traced, widened, last=traced)
    assert np.sqrt(1 + added / photons) - 1 == pytest.approx(settling._WIDENED)
    assert settling._enough(traced, widened, last=1e7) == 1e7
    assert settling._enough(traced, 100.0, last=traced) == settling._MOST_PHOTONS


def test_an_explanation_that_passes_no_more_is_not_accepted(found: Diagnosis, monkeypatch) -> None:
    """A slant of 5 % is too much; one of 0.3 % is too much for the errors alone, and within a tolerance."""
    budget = replace(found.prepared.noise.budget, tolerance=0.0)
    strict = replace(found.prepared, noise=replace(found.prepared.noise, budget=budget))
    for slant, prepared, size in ((0.05, strict, None), (0.05, found.prepared, None), (SLANT, strict, None),
                                  (SLANT, found.prepared, 1)):  # fmt: skip
        settle_to(monkeypatch, slant)
        tolerance = prepared.noise.budget.tolerance
        data = data_of(found, tolerance)
        _, after = settled(data, prepared, found.finding, np.random.default_rng(0))
        assert (after.size, len(after.accepted)) == (size, size or 0)
        assert after.level.tolerance == tolerance


def test_the_answer_is_told_in_the_light_that_it_was_settled_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it was settled before more effects than one or two were sought."""
    table, scene = readings({"detector.background": 0.02})
    search, sought, better = stages.search, list[SearchResult](), list[object]()

    def nothing_passes(*given: Any) -> SearchResult:
        sought.append(search(*given))
        return replace(sought[0], size=None, accepted=[])

    def settle(_: Data, prepared: Prepared, *__: object) -> tuple[Prepared, SearchResult]:
        better.append(copy(prepared.problem.forward))
        return replace(prepared, problem=replace(prepared.problem, forward=better[0])), sought[0]

    monkeypatch.setattr(diagnosing, "source_of", lambda *_: (None, Hindrance(Hinders.NOT_TRACED)))
    nothing = ("with_scattering", lambda *_: None)
    for name, value in (("search", nothing_passes), ("is_nearly_explained", lambda *_: True), nothing):
        monkeypatch.setattr(stages, name, value)
    monkeypatch.setattr(knowledge, "settled", settle)
    told = diagnose(table, scene, only=["beam_tilt", "background"], advise=False)
    assert told.verdict.effects == ["background"] and len(better) == 1
    assert told.basis.forward is told.basis.prepared.problem.forward is better[0]


def test_a_set_that_better_light_puts_first_is_levelled_by_its_own_rivals(monkeypatch) -> None:
    """Else its effects would pass for the simplest, whatever does as well: of them nothing was known."""
    table, scene = readings({"detector.background": 0.02})

    def settle(
        _: Data, prepared: Prepared, finding: SearchResult, *__: object
    ) -> tuple[Prepared, SearchResult]:
        assert finding.is_levelled and finding.best is not None
        other = next(t for t in finding.tried if t.test is not None and t.names == ("beam_tilt",))
        adequacy = other.test(other.fit) if other.test is not None else None
        return prepared, replace(finding, accepted=[replace(other, adequacy=adequacy)], weights=[1.0])

    monkeypatch.setattr(diagnosing, "source_of", lambda *_: (None, Hindrance(Hinders.NOT_TRACED)))
    monkeypatch.setattr(stages, "with_scattering", lambda *_: None)
    monkeypatch.setattr(knowledge, "settled", settle)
    told = diagnose(table, scene, only=["beam_tilt", "background"], advise=False)
    (tilt,) = told.verdict.found
    assert told.finding.is_levelled and tilt.effect == "beam_tilt"
    assert (tilt.level, tilt.rival) == ("one of", ["background"])
    assert tilt.gap is not None and tilt.gap < 0


def test_one_or_two_effects_nearly_explain_where_better_light_might_do(found: Diagnosis, monkeypatch) -> None:
    """Not where nothing scatters, nor where they are farther off than a trace may be wrong."""
    monkeypatch.setattr(module, "can_follow", lambda *_: True)
    for scattered in (False, True):
        monkeypatch.setattr(module, "scatters", lambda *_, known=scattered: known)
        assert is_nearly_explained(found.prepared, found.finding) == scattered
    away = replace(found.prepared.problem, value=found.prepared.problem.value[::-1])
    assert not is_nearly_explained(replace(found.prepared, problem=away), found.finding)


def test_a_base_model_that_scatters_is_settled_where_nothing_is_missing(monkeypatch) -> None:
    """Fitted again with the better light, and judged; where it passes no more, all stays as it was."""
    table, scene = readings()
    found = diagnose(table, scene, diffuse=None, only=["beam_tilt", "background"], advise=False)
    assert found.finding.size == 0
    for slant, moved in ((0.0, True), (0.05, False)):
        settle_to(monkeypatch, slant)
        prepared, after = settled(data_of(found), found.prepared, found.finding, np.random.default_rng(0))
        assert (after.level is not found.finding.level) == (prepared is not found.prepared) == moved
        assert after.size == 0 and after.level in after.levels
        assert after.level.base.away_from(found.finding.level.base.u) < SAME


@pytest.fixture(scope="module")
def several() -> Diagnosis:
    """Three effects at once: the pool finds them."""
    table, scene = readings(
        {"detector.background": 0.02, "lamp.tilt_x_deg": 0.8, "lamp.drift_per_hour": -0.1}
    )
    only = ["beam_tilt", "background", "lamp_drift"]
    return diagnose(table, scene, diffuse=None, only=only, advise=False)


def beside(
    several: Diagnosis, monkeypatch, slant: float, cheaper: bool = False
) -> tuple[SearchResult, SearchResult]:
    """A finding that accepts the best set and one of fewer effects, which costs more or is said to cost less;
    and after settling the best one alone."""
    finding = several.finding
    assert finding.many is not None and finding.beyond_two
    best, pool = finding.accepted[0], finding.many.pool
    less = next(n for n in pool.nodes.values() if len(n.explanation) == 2)
    other = replace(
        best, explanation=less.explanation, fit=less.fit, bic=-1.0 if cheaper else pool.cost(less)
    )
    before = replace(finding, accepted=[best, other], weights=[0.9, 0.1])
    settle_to(monkeypatch, slant)
    monkeypatch.setattr(module, "scatters", lambda _, fit: fit is best.fit)
    return before, settled(data_of(several), several.prepared, before, np.random.default_rng(0))[1]


@pytest.mark.parametrize(("above", "level"), [(-40.0, "one of"), (1.0, "one of"), (100.0, "certain")])
def test_nothing_is_surer_than_settled_scattering_in_its_place_leaves_it(
    monkeypatch: pytest.MonkeyPatch, above: float, level: str
) -> None:
    """The search knows a far worse fit with scattering, here with saturation, than better light gives."""
    table, scene = readings(
        {"detector.background": 0.02, "lamp.tilt_x_deg": 0.8, "lamp.drift_per_hour": -0.1}
    )
    only = ["beam_tilt", "background", "lamp_drift", "saturation"]
    found = diagnose(table, scene, diffuse=None, only=only, advise=False)
    many = found.finding.many
    assert many is not None and {e.level for e in many.evidence} == {"certain"}
    tried = []

    def settle(problem: Problem, explanation: Any, fit: Any, whiten: Whitener, seed: int) -> Settled:
        tried.append({c.name for c in explanation})
        chi2 = many.best.fit.chi2 + above * max(many.pool.ground.phi, 1.0)
        return Settled(problem, whiten, replace(fit, chi2=chi2))

    best = found.finding.accepted[0].fit
    for name, value in (
        ("can_follow", lambda *_: True), ("scatters", lambda _, fit: fit is not best), ("settle", settle),
        ("restarted", lambda problem, explanation, fit, whiten: fit), ("_IN_PLACE", "saturation"),
        ("_WITHIN", np.inf),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)
    _, after = settled(data_of(found), found.prepared, found.finding, np.random.default_rng(0))
    assert after.many is not None and {e.level for e in after.many.evidence} == {level}
    # What costs less is where the search goes on from.
    assert (after.cheaper is not None) == (above < 0)
    assert after.cheaper is None or "saturation" in after.cheaper.names
    names = many.best.names
    assert sorted(map(sorted, tried)) == sorted(sorted(names - {n} | {"saturation"}) for n in names)
    assert after.identified == (level == "certain")
    assert all((("saturation",) in e.alternatives) == (level == "one of") for e in after.many.evidence)


def test_a_search_goes_on_from_a_set_with_scattering_that_costs_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """Settled it may be far better than the search knew: what is found from there is the answer."""
    table, scene = readings(
        {"detector.background": 0.02, "lamp.tilt_x_deg": 0.8, "lamp.drift_per_hour": -0.1}
    )
    asked, beyond = [], knowledge.beyond_two

    def settle(
        _: Data, prepared: Prepared, finding: SearchResult, *__: object
    ) -> tuple[Prepared, SearchResult]:
        assert finding.many is not None
        least = None if asked else next(n for n in finding.many.pool.nodes.values() if len(n.names) == 2)
        asked.append(least)
        return prepared, replace(finding, cheaper=least)

    def search(data: Data, prepared: Prepared, *rest: Any) -> tuple[Prepared, SearchResult]:
        if asked:
            assert prepared.explanation == asked[0].explanation and prepared.reference is asked[0].fit
        return beyond(data, prepared, *rest)

    monkeypatch.setattr(diagnosing, "source_of", lambda *_: (None, Hindrance(Hinders.NOT_TRACED)))
    monkeypatch.setattr(stages, "with_scattering", lambda *_: None)
    for name, value in (("settled", settle), ("beyond_two", search)):
        monkeypatch.setattr(knowledge, name, value)
    only = ["beam_tilt", "background", "lamp_drift", "saturation"]
    verdict = diagnose(table, scene, only=only, advise=False).verdict
    assert len(asked) == 2 and len(asked[0].names) == 2
    assert set(verdict.certain) == {"beam_tilt", "background", "lamp_drift"}


def test_beside_a_width_at_its_bound_nothing_is_certain(several: Diagnosis) -> None:
    """A lamp that is brighter off its axis asks for more than an even one: what makes up for that is no
    effect that is certain, whatever sets of the same beam cost."""
    many = several.finding.many
    assert many is not None and {e.level for e in many.evidence} == {"certain"}
    fit, i = many.best.fit, many.best.fit.paths.index("lamp.hwhm_deg")
    ends = fit.u.copy()
    ends[i] = fit.model.high[i]
    there = FittedSet(many.best.explanation, replace(fit, u=ends))
    assert {e.level for e in evidence(many.pool, there, adequate=True)} == {"one of"}


def test_of_many_effects_the_price_decides_not_their_number(several: Diagnosis, monkeypatch) -> None:
    """A set of fewer effects may cost more: one of them is a curve of many functions."""
    before, after = beside(several, monkeypatch, 0.0)
    assert [t.names for t in after.accepted] == [t.names for t in before.accepted]
    assert after.size == 3 and after.identified == before.identified
    assert after.accepted[0].bic == pytest.approx(before.accepted[0].bic)


def test_what_is_known_of_effects_is_known_of_those_of_the_answer(several: Diagnosis, monkeypatch) -> None:
    """Where the best set passes no more, another one is the answer, and not for all of its effects is
    anything sure that was sure of the best one's."""
    _, after = beside(several, monkeypatch, 0.05)
    assert after.size == 2 and after.many is not None
    assert {e.candidate.key for e in after.many.evidence} == {c.key for c in after.accepted[0].explanation}
    assert not any(e.is_claimed for e in after.many.evidence) and not after.identified


def test_what_is_sure_stays_sure_while_the_best_set_of_the_search_is_accepted(
    several: Diagnosis, monkeypatch
) -> None:
    """Better light may rank another set first: what both hold no set of the search does without."""
    before, after = beside(several, monkeypatch, 0.0, cheaper=True)
    assert before.many is not None and after.many is not None
    assert (after.size, len(after.accepted)) == (2, 2)
    sure = {e.candidate.key: e.level for e in before.many.evidence}
    assert [e.level for e in after.many.evidence] == [sure[c.key] for c in after.accepted[0].explanation]
    assert set(sure.values()) == {"certain"}


@pytest.mark.parametrize("amplitude", [0.0, 0.02, 3.0])
@pytest.mark.parametrize("many", [False, True])
def test_photons_widen_errors_as_a_fit_without_their_noise_says(amplitude: float, many: bool) -> None:
    """Beside the same fit, whitened without it; 400 readings are one block, others are a chain of them."""
    lay = layout(5, 80)
    made = Toy.of([candidate(name) for name in waves(lay)], waves(lay), lay)
    columns = np.stack([made.base, *(made.sigma * wave for wave in waves(lay).values())], axis=1)
    modes = amplitude * columns * [0.01, 1.0, 1.0, 1.0]
    if many:  # the same covariance by more modes than there are readings
        modes = np.tile(modes, 150) / np.sqrt(150)
    noise = replace(made.noise_within(0.003), photon_modes=modes)
    problem, explanation = made.problem, made.problem.candidates[:2]
    start = problem.default_start(problem.model().start, explanation)
    still = Whitener(replace(noise, photon_modes=None), 0.3, 1.0, 0.003)
    expected = np.diag(problem.fit(explanation, still, [start]).covariance())
    for block in (None, 64):
        whiten = Whitener(noise, 0.3, 1.0, 0.003, block)
        fit = problem.fit(explanation, whiten, [start])
        widened = np.sqrt(np.diag(fit.covariance()) / expected).max() - 1
        told = settling._widened(Settled(problem, whiten, fit))
        assert told == pytest.approx(widened, rel=1e-3, abs=1e-5)
        assert (widened > 1) == (amplitude > 1) and (widened > 1e-3) == (amplitude > 0)


@pytest.mark.parametrize("base", ["none", "pure"])
@pytest.mark.parametrize(("per_m", "is_clear"), [(0.0, True), (1e-6, True), (0.01, False)])
@pytest.mark.parametrize("ellipticity", [1.0, 1.3])
def test_water_that_no_photon_shows_is_clear(
    per_m: float, is_clear: bool, ellipticity: float, base: str
) -> None:
    """A trace of it has no light whose ratio could be told, and of what molecules scatter hardly any. That of
    an oval beam is known by its trace alone, of which a reader is warned."""
    lamp = {"ellipticity": ellipticity}
    scene = Scene.from_dict({"lamp": lamp, "water": {"base": base, "scattering_per_m": per_m}})
    diffuse = SimpleNamespace(trace=object(), wavelengths_nm=np.array([525.0]))
    scenes = SimpleNamespace(at=lambda values, validate: scene)
    light = SimpleNamespace(diffuse=diffuse, scenes=scenes)
    problem = SimpleNamespace(forward=SimpleNamespace(light=light))
    fit = SimpleNamespace(values={})
    assert scatters(problem, fit) == (not is_clear and ellipticity == 1)
    assert is_of_the_search_alone(problem, fit) == (not is_clear and ellipticity != 1)
