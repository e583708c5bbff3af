"""Every kind of verdict, put together from findings made by hand."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.adequacy.robust import Serial
from lightfield.diagnosis.adequacy.structure import Structure
from lightfield.diagnosis.certainty import CONVINCING
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.diagnosis.search import preparation
from lightfield.diagnosis.search.cascade import Level, SearchResult
from lightfield.diagnosis.search.preparation import Prepared, bench
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.verdict.compose import VerdictBasis, kind_of, verdict_of
from lightfield.diagnosis.verdict.estimates import estimates
from lightfield.diagnosis.verdict.ladder import Step, bright, climb, percent, removed, rms_over
from lightfield.diagnosis.verdict.parts import Doubt, DoubtReason, LeftOver, Reason
from lightfield.diagnosis.verdict.rest import left_over
from lightfield.diagnosis.verdict.terminal import as_text
from lightfield.diagnosis.verdict.trust import Trust, standard_errors
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.diagnosis.verdict.words.rest import sentences
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.parameter import FitParameter, Model
from lightfield.report.diagnosis.ladder import ladder_figure
from lightfield.report.diagnosis.page import _lead
from lightfield.report.plots import plot_ladder
from lightfield.scene import Scene

TOLERANCE = 0.003
NOTHING = "No missing effect detectable if the errors are 9.2 times as large as stated"
climb_of = climb
UNTESTABLE = {"cdom": (Hindrance(Hinders.FEW_WAVELENGTHS),)}


class Case:
    """Readings of a tilted beam, with every fit that a finding about them is made of."""

    def __init__(self, factor: Any = None) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(preparation, "REPLICATES", 99)
            self._make(factor)

    def _make(self, factor: Any) -> None:
        self.table, scene = readings({"lamp.tilt_x_deg": 0.25}, seed=3, factor=factor)
        self.forward = SceneForward(scene, self.table)
        chosen = [effects.get(name) for name in ("beam_tilt", "beam_offset", "background")]
        self.problem, _ = problem_of(self.forward, self.table, chosen, None)
        problem, n = self.problem, self.problem.layout.size
        budget = Budget(0.0, 0.0, TOLERANCE)
        noise = Noise(problem.layout, self.table.stderr, np.abs(problem.value), budget, np.zeros(n))
        start = problem.model().start
        first = problem.fit((), lambda columns: columns / problem.value.max(), [start])
        self.prepared = Prepared(problem, noise, Serial(), first, (), True)
        made = bench(self.prepared, 0.0, np.random.default_rng(0))
        base = problem.fit((), made.whiten, [start])
        self.level = Level(0.0, made, base, made.test(base))
        self.tried = {c.name: self._fitted(c) for c in problem.candidates}

    def _fitted(self, candidate: Any) -> ScoredSet:
        made, base = self.level.bench, self.level.base
        starts = [self.problem.default_start(base.u, (candidate,), k) for k in (1.0, -1.0)]
        fit = self.problem.fit((candidate,), made.whiten, starts)
        return ScoredSet((candidate,), fit, fit.chi2, made.test(fit), made.test)

    def finding(
        self, size: int | None, *accepted: ScoredSet, weights: list[float] | None = None
    ) -> SearchResult:
        """A finding in which nothing else was tried."""
        n = int(self.problem.keep.sum())
        tried = list(self.tried.values())
        return SearchResult(size, self.level, [self.level], list(accepted), weights or [], tried, n)

    def verdict(
        self, finding: SearchResult, doubt: Doubt | None = None, aside: tuple[int, ...] = ()
    ) -> Verdict:
        """What is said of it."""
        best, n = finding.best, self.problem.layout.size
        starts = [finding.level.base, *([best.fit] if best else [])]
        explanation = best.explanation if best else ()
        sigma = standard_errors(self.prepared, finding)
        given = self.problem, explanation, finding.whiten, starts, 1.0, sigma
        steps = climb_of(*given, with_held_out=False)
        left_out = np.zeros(n, bool)
        left_out[list(aside)] = True
        trust = Trust(0.5, np.where(left_out, -9.0, 0.0), left_out, doubt)
        return verdict_of(
            VerdictBasis(self.forward, self.table, self.prepared, finding, steps, UNTESTABLE, trust), False
        )


@pytest.fixture(scope="module")
def case() -> Case:
    return Case()


def read_back(verdict: Verdict) -> None:
    assert Verdict.model_validate(json.loads(verdict.model_dump_json())) == verdict


@pytest.mark.parametrize(("last", "parts"), [(300.0, [None, 40.0, 40.0]), (100.0, [None, 40.0, 60.0])])
def test_what_nothing_explains_is_not_removed(last: float, parts: list[float | None]) -> None:
    """Of chi-square 1100 of 102 readings and two numbers 100 are noise; of the rest 300 leave a fifth."""

    def fit(chi2: float, numbers: int) -> SimpleNamespace:
        fitted = SimpleNamespace(chi2=chi2, residual=np.zeros(102), u=np.zeros(numbers))
        return SimpleNamespace(fit=fitted)

    found = removed([fit(1100.0, 0), fit(700.0, 1), fit(last, 2)], 1.0)
    assert found == pytest.approx(parts)


def test_nothing_is_missing(case: Case) -> None:
    verdict = case.verdict(case.finding(0))
    assert (verdict.verdict, verdict.effects, verdict.explanations) == ("none", [], [])
    assert verdict.headline == f"{NOTHING}."  # of readings that hold a tilt
    assert set(verdict.detection_limits) == {"beam_tilt", "beam_offset", "background"}
    assert f"background above {verdict.detection_limits['background'].value:.2g}" in verdict.support[0]
    assert [rung.label for rung in verdict.ladder] == ["base"]
    assert verdict.untestable == {"cdom": "needs readings at three wavelengths or more"}
    read_back(verdict)


def test_nothing_is_missing_within_the_tolerance(case: Case) -> None:
    verdict = case.verdict(replace(case.finding(0), level=replace(case.level, tolerance=TOLERANCE)))
    assert verdict.headline == f"{NOTHING}; smooth misfits up to 0.3 % count as none."
    assert (verdict.within_tolerance, verdict.tolerance_percent) == (True, pytest.approx(0.3))
    assert "a significant misfit is smaller than the tolerance and was ignored" in verdict.warnings


def test_one_answer(case: Case) -> None:
    """Named with its family and the rival; its numbers are those of the fit, its limit is not asked for."""
    tilt = case.tried["beam_tilt"]
    verdict = case.verdict(case.finding(1, tilt, weights=[CONVINCING + 0.01]))
    assert (verdict.verdict, verdict.effects) == ("identified", ["beam_tilt"])
    assert verdict.headline == "Beam tilt is missing in the model."
    (explanation,) = verdict.explanations
    estimate = explanation.parameters["lamp.tilt_x_deg"]
    assert estimate.value == tilt.fit.values["lamp.tilt_x_deg"]
    assert estimate.stderr == pytest.approx(tilt.fit.stderr(tilt.scale)["lamp.tilt_x_deg"])
    assert explanation.weight == CONVINCING + 0.01
    assert "beam_tilt" not in verdict.detection_limits
    assert verdict.nearest_rival is not None and verdict.nearest_rival.effects == ["beam_offset"]
    assert f"beam offset, is {verdict.nearest_rival.separation_sigma:.1f} sigma away" in verdict.sentence
    assert [rung.label for rung in verdict.ladder] == ["base", "+ beam_tilt"]
    read_back(verdict)


def dark(case: Case) -> np.ndarray:
    """A model whose beam is so narrow that no light arrives beside the axis, as steps of fits have it."""
    model = case.forward.predict({**case.level.base.values, "lamp.hwhm_deg": 0.05})
    assert np.any(model[bright(case.problem)] == 0)
    return model


def test_a_dark_model_has_no_error_in_per_cent(case: Case) -> None:
    model = dark(case)
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        assert np.isnan(percent(case.problem, model, bright(case.problem)))
        assert percent(case.problem, case.problem.value, bright(case.problem)) == 0


def nothing_but_numbers(verdict: Verdict) -> None:
    """What is no number is null, in the file and as plain data, and reads back."""
    for text in (verdict.model_dump_json(), json.dumps(verdict.model_dump(mode="json"), allow_nan=False)):
        assert "NaN" not in text and "Infinity" not in text
    read_back(verdict)


def test_an_explanation_that_is_dark_has_no_error_in_per_cent_and_leaves_no_floor(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, tilt = dark(case), case.tried["beam_tilt"]

    def climbed(*given: Any, **more: Any) -> list[Step]:
        base, last = climb(*given, **more)
        return [base, replace(last, fit=replace(last.fit, prediction=model), error_percent=np.nan)]

    monkeypatch.setattr(sys.modules[__name__], "climb_of", climbed)
    unlit = replace(tilt, fit=replace(tilt.fit, prediction=model))
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        verdict = case.verdict(case.finding(1, unlit, weights=[0.99]))
    (explanation,) = verdict.explanations
    assert explanation.error_percent is None and verdict.noise_floor_percent is None
    assert [rung.error_percent is None for rung in verdict.ladder] == [False, True]
    nothing_but_numbers(verdict)
    assert as_text(verdict).splitlines()[5].split() == ["noise", "floor", "-"]
    assert not any("nan" in line for line in (as_text(verdict), *_lead(verdict)))
    ladder_figure(verdict.ladder, verdict.noise_floor_percent).canvas.draw()
    assert len(plot_ladder(None, verdict.ladder, None).lines) == 1


def test_without_any_light_in_the_readings_there_is_no_floor(case: Case) -> None:
    """The brightest reading of every plane is zero: none is bright, and nothing is a part of nothing."""
    n = case.problem.layout.size
    unlit = replace(case.problem, value=np.zeros(n))
    assert not bright(unlit).any()
    given = case.level.bench.whiten, [case.level.base], 1.0, case.problem.value
    steps = climb(case.problem, (), *given, with_held_out=False)
    trust = Trust(None, np.zeros(n), np.zeros(n, bool), Doubt(reason=DoubtReason.NOTHING_BRIGHT))
    prepared = replace(case.prepared, problem=unlit)
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        assert np.isnan(percent(unlit, np.zeros(n), bright(unlit)))
        assert np.isnan(rms_over(np.zeros(0), np.zeros(0)))
        verdict = verdict_of(
            VerdictBasis(case.forward, case.table, prepared, case.finding(0), steps, UNTESTABLE, trust), False
        )
    assert verdict.noise_floor_percent is None
    nothing_but_numbers(verdict)
    only = [verdict.ladder[0].model_copy(update={"error_percent": None})]
    ladder_figure(only, None).canvas.draw()
    plot_ladder(None, only, None).figure.canvas.draw()


def test_a_rest_beside_a_dark_model_has_no_error_and_only_readings_over_light(case: Case) -> None:
    told = LeftOver(
        name="shadow", formula="1 - depth", stage="path", coordinate="x", beside=[], parameters={},
        removed_percent=90.0, error_percent=None, adequate=False, at=[0.0], factor=[0.5], stderr=[0.1],
    )  # fmt: skip
    assert LeftOver.model_validate(json.loads(told.model_dump_json())) == told
    said = sentences([told], None)
    assert said.startswith("A shadow describes 90 % of what is left (). It says where the rest is, not what.")
    model, lit = dark(case), bright(case.problem)
    fit = SimpleNamespace(
        values={}, model=SimpleNamespace(parameters=(), forward=SimpleNamespace(predict=lambda values: model))
    )
    with np.errstate(divide="raise", invalid="raise", over="ignore"):
        along, over = left_over._read(case.problem, case.table, cast(Any, fit), "dip_in_x")
    assert len(along) == len(over) == int((lit & (model > 0)).sum()) < int(lit.sum())


def test_a_rung_whose_model_is_dark_says_so(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    model = dark(case)

    def climbed(*given: Any, **more: Any) -> list[Step]:
        base, *rest = climb(*given, **more)
        error = percent(case.problem, model, bright(case.problem))
        return [replace(base, fit=replace(base.fit, prediction=model), error_percent=error), *rest]

    monkeypatch.setattr(sys.modules[__name__], "climb_of", climbed)
    verdict = case.verdict(case.finding(1, case.tried["beam_tilt"], weights=[0.99]))
    assert [rung.error_percent is None for rung in verdict.ladder] == [True, False]
    (line,) = [line for line in as_text(verdict).splitlines() if line.startswith("base ")]
    assert line.split()[1] == "-"
    read_back(verdict)
    drawn = ladder_figure(verdict.ladder, verdict.noise_floor_percent)
    drawn.canvas.draw()
    shown = [text.get_text() for text in drawn.axes[0].texts if text.get_text().endswith(" %")]
    assert len(shown) == 1 and "nan" not in "".join(shown)  # the last rung's


def test_two_answers(case: Case) -> None:
    two = (case.tried["beam_tilt"], case.tried["beam_offset"])
    verdict = case.verdict(case.finding(1, *two, weights=[0.6, 0.4]))
    assert verdict.verdict == "ambiguous"
    assert verdict.headline == "Beam tilt or beam offset: these readings cannot tell."
    assert verdict.effects == ["beam_tilt"]
    assert [e.weight for e in verdict.explanations] == [0.6, 0.4]


def test_weak_evidence_is_no_answer(case: Case) -> None:
    verdict = case.verdict(case.finding(1, case.tried["beam_tilt"], weights=[CONVINCING]))
    assert verdict.verdict == "ambiguous"
    assert verdict.headline == (
        "Perhaps beam tilt: it would explain the misfit, but the evidence against chance is weak."
    )


def test_as_many_parameters_as_readings_explain_anything(case: Case) -> None:
    tilt = case.tried["beam_tilt"]
    finding = replace(case.finding(1, tilt, weights=[1.0]), n=len(tilt.fit.u))
    verdict = case.verdict(finding)
    assert (verdict.verdict, verdict.determined) == ("ambiguous", False)
    assert "with as many parameters as there are readings anything can" in verdict.sentence


def test_what_explains_at_the_edge_of_the_plausible_is_a_perhaps(case: Case) -> None:
    """A tilt whose range ends where the readings want more: ambiguous, for that reason, and a warning."""
    tilt = case.tried["beam_tilt"]
    (candidate,), at = tilt.explanation, 0.1
    amplitude = replace(candidate.amplitudes[0], low=-at, high=at)
    narrow = case._fitted(replace(candidate, amplitudes=(amplitude,)))
    assert narrow.at_bound
    verdict = case.verdict(case.finding(1, narrow, weights=[1.0]))
    assert verdict.verdict == "ambiguous"
    assert verdict.explanations[0].parameters["lamp.tilt_x_deg"].reason is Reason.AT_BOUNDARY
    assert "only with a parameter at the edge of what is plausible" in verdict.sentence
    assert any("lamp.tilt_x_deg lies at the edge of its plausible range" in w for w in verdict.warnings)


def test_a_misfit_of_one_coordinate_is_located() -> None:
    """20 % are missing near x = 0.3 m. It says more than any doubt, and asks for readings there."""
    case = Case(lambda t: 1 - 0.2 * np.exp(-(((t.x_m - 0.3) / 0.06) ** 2)))
    doubt = Doubt(reason=DoubtReason.FLAT)
    verdict = case.verdict(case.finding(None), doubt)
    assert (verdict.verdict, verdict.unexplained_coordinate, verdict.doubt) == ("unexplained", "x", None)
    assert verdict.misfit is not None and verdict.misfit.worst_at == pytest.approx(0.3, abs=0.01)
    assert verdict.headline == ("Unexplained by any known effects; it depends on x alone, most near 0.3 m.")
    assert verdict.next_measurement is not None
    assert verdict.next_measurement.readings[0].x_m == pytest.approx(0.3, abs=0.11)
    read_back(verdict)


def test_a_doubt_is_all_that_is_said(case: Case) -> None:
    doubt = Doubt(reason=DoubtReason.NOISE, noise_percent=14.2)
    finding = case.finding(1, case.tried["beam_tilt"], weights=[1.0]).without_answer()
    verdict = case.verdict(finding, doubt)
    assert (verdict.verdict, verdict.effects, verdict.stated) == ("unexplained", [], [])
    assert verdict.doubt is not None and verdict.headline == f"Unexplained: {verdict.doubt}."
    assert "14 % of a typical bright reading" in verdict.doubt
    assert verdict.misfit is None and verdict.next_measurement is None
    read_back(verdict)


def test_readings_set_aside_that_lie_together_are_located(case: Case) -> None:
    doubt = Doubt(
        reason=DoubtReason.SET_ASIDE, structure=Structure("x/z", 0.001, span=(0.0667, 0.0706), rate=0.02)
    )
    verdict = case.verdict(case.finding(0).without_answer(), doubt, aside=(4, 7))
    assert verdict.unexplained_coordinate == "x/z"
    assert "are no slips: they lie together where x/z is 0.0667 to 0.0706." in verdict.headline
    assert [one.row for one in verdict.set_aside] == verdict.outliers == [4, 7]
    assert verdict.support[-1].startswith("2 of 105 readings were set aside")
    assert verdict.next_measurement is not None
    assert verdict.next_measurement.readings[0].x_m == case.table.x_m[4]
    read_back(verdict)


@pytest.mark.parametrize(
    ("size", "accepted", "identified", "kind"),
    [(0, [], False, "none"), (None, [], False, "unexplained"), (1, [1], True, "identified"),
     (1, [1, 2], False, "ambiguous"), (2, [1], False, "ambiguous")],
)  # fmt: skip
def test_kinds(size: int | None, accepted: list, identified: bool, kind: str) -> None:
    best = accepted[0] if accepted else None
    assert kind_of(cast(Any, SimpleNamespace(size=size, best=best, identified=identified))) == kind


def test_no_floor_is_told_that_reflects_more_than_all() -> None:
    """Walls of 0.4 that are fitted beside a floor of 7 times theirs, which moves no model any more. A
    black one is told as such."""
    scene = Scene.from_dict({"tank": {"wall_albedo": 0.2}})
    forward = SceneForward(scene, readings()[0], None)
    paths = ("tank.wall_albedo", "tank.floor_over_walls")
    walls = FitParameter(paths[0], 0.0, 1.0, 0.1, 1e-3)
    parameters = walls, replace(walls, path=paths[1], high=20.0, lowest="none")
    for floor, told, reason in ((7.0, 2.5, Reason.AT_BOUNDARY), (2.0, 2.0, None), (0.0, 0.0, Reason.NONE)):
        slopes = np.diag([10.0, 5.0 * (floor == told)])
        fit = Fit(
            Model(forward, parameters),
            np.array([0.4, floor]),
            np.ones(2),
            np.zeros(2),
            0.0,
            lambda s=slopes: s,
            True,
        )
        found = estimates(fit, 1.0, {})
        assert (found[paths[1]].value, found[paths[1]].reason) == (pytest.approx(told), reason)
        assert found[paths[1]].stderr == (None if reason else pytest.approx(0.2))
        assert found[paths[0]].stderr == pytest.approx(0.1)


def test_an_error_or_the_reason_why_there_is_none() -> None:
    """Of parameters that are held, at a bound, without a derivative, vaguely known, known to 0.1, and not
    told from others."""
    names = ("held", "bound", "still", "vague", "known", "either")
    slopes = np.zeros((3, 6))
    slopes[0, 1], slopes[1, 3], slopes[2, 4], slopes[2, 5] = 1.0, 1e-3, 10.0, 10.0
    bounds = {"held": (2.0, 2.0)}
    parameters = tuple(FitParameter(n, *bounds.get(n, (0.0, 10.0)), 1.0, 1e-3) for n in names)
    u = np.array([2.0, 10.0, 1.0, 1.0, 1.0, 1.0])
    fit = SimpleNamespace(
        paths=names, u=u, jacobian=slopes, values=dict(zip(names, u, strict=True)),
        model=SimpleNamespace(parameters=parameters),
        at_bound=lambda: np.array([False, True, False, False, False, False]),
        stderr=lambda scale: {**dict.fromkeys(names, np.nan), "vague": 1e3, "known": 0.1 * np.sqrt(scale)},
    )  # fmt: skip
    found = estimates(cast(Any, fit), 4.0, {"known": "m"}, {"known": 0.15})
    assert {n: e.reason for n, e in found.items()} == {
        "held": Reason.HELD, "bound": Reason.AT_BOUNDARY, "still": Reason.DID_NOT_MOVE,
        "vague": Reason.TOO_WIDE, "known": None, "either": Reason.UNDETERMINED,
    }  # fmt: skip
    assert (found["known"].stderr, found["known"].unit) == (pytest.approx(0.2), "m")
    assert estimates(cast(Any, fit), 1.0, {}, {"known": 0.15})["known"].stderr == 0.15
    assert found["held"].stderr is None
