"""The verdict as data: schema, ladder that can be climbed again, ledger, report of a fit."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis import ledger
from lightfield.diagnosis.diagnose import FRESH_PHOTONS, MOST_FRESH_PHOTONS, Diagnosis, diagnose
from lightfield.diagnosis.plan import plan
from lightfield.diagnosis.verdict.verdict import Verdict, json_schema
from lightfield.errors import FitError, UsageError
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings
from lightfield.studies.compare.text import as_data, as_text

HIDDEN = {"lamp.tilt_x_deg": 0.25, "detector.background": 0.01}


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    table, scene = readings(HIDDEN, seed=11)
    return diagnose(table, scene, diffuse=None)


def test_json_reads_back_and_names_every_promised_field(found: Diagnosis) -> None:
    data = json.loads(found.verdict.model_dump_json())
    assert Verdict.model_validate(data) == found.verdict
    promised = {
        "verdict", "effects", "explanations", "nearest_rival", "detection_limits", "untestable",
        "unexplained_coordinate", "ladder", "noise_floor_percent", "next_measurement", "assumed",
        "assumptions", "warnings", "cautions", "hindrances",
    }  # fmt: skip
    assert promised <= set(data) <= set(json_schema()["properties"])
    explanation = data["explanations"][0]
    assert {
        "effects",
        "families",
        "weight",
        "parameters",
        "chi2_per_dof",
        "error_percent",
        "held_out_percent",
    } <= set(explanation)
    assert explanation["parameters"]["lamp.tilt_x_deg"]["unit"] == "deg"


def test_a_stored_rung_gives_the_rung_again(found: Diagnosis, tmp_path) -> None:
    """`compare --scene rung2.toml` refits gain, width and absorption with the effects on: same minimum."""
    found.save(tmp_path)
    for k, rung in enumerate(found.verdict.ladder):
        scene = Scene.load(tmp_path / f"rung{k}.toml")
        again = fit_readings(found.readings, scene)
        assert again.statistics.error_percent == pytest.approx(rung.error_percent, rel=2e-3)
    assert scene.get("detector.background") == pytest.approx(0.01, abs=0.002)


def test_a_size_that_is_not_determined_is_no_finding(found: Diagnosis) -> None:
    """With errors ten thousand times as large the same fit explains as much and says nothing."""
    best = found.finding.accepted[0]
    assert not best.undetermined and found.finding.identified
    assert best.adequacy is not None
    vague = replace(best, adequacy=replace(best.adequacy, phi=1e8 * best.adequacy.phi))
    assert vague.undetermined
    assert not replace(found.finding, accepted=[vague]).identified


def test_a_render_that_contradicts_the_fit_is_said(found: Diagnosis, monkeypatch) -> None:
    """The same light, and light that is 5 % brighter off the axis."""
    r = found.readings
    light = direct_field(found.scene, r.x_m, r.y_m, r.z_m, r.wavelength_nm, r.medium)
    for more, said in ((0.0, False), (0.05, True)):
        fresh = light * (1 + more * (np.abs(r.x_m) > 0.3))
        monkeypatch.setattr(
            "lightfield.diagnosis.diagnose.rendered_light", lambda *_, f=fresh, **__: (f, 1e-4 * f)
        )
        verdict = found.rendered().verdict
        assert verdict.ladder[-1].rendered_error_percent is not None
        assert any("does not confirm the fit" in w for w in verdict.warnings) == said
        kind = ("unexplained", []) if said else ("identified", found.verdict.effects)
        assert (verdict.verdict, verdict.effects) == kind
        assert ("does not confirm the fit" in verdict.sentence) == said
        assert verdict.best_set == found.verdict.best_set
        assert (verdict.certain, verdict.simplest) == (
            ([], []) if said else (found.verdict.certain, found.verdict.simplest)
        )
    assert not any("does not confirm" in w for w in found.verdict.warnings)


def test_a_render_too_coarse_to_object_is_given_more_photons(found: Diagnosis, monkeypatch) -> None:
    """The first one has an error of 10 %; what a second adds counts with it, each by its photons."""
    r, asked = found.readings, []
    light = direct_field(found.scene, r.x_m, r.y_m, r.z_m, r.wavelength_nm, r.medium)

    def rendered(*_: object, max_photons: float, rel_error: float, seed: int, **__: object):
        asked.append((max_photons, rel_error, seed))
        error = 0.1 * light * np.sqrt(FRESH_PHOTONS / max_photons)
        return light, error

    monkeypatch.setattr("lightfield.diagnosis.diagnose.rendered_light", rendered)
    coarse = found.rendered(FRESH_PHOTONS).verdict.ladder[-1].rendered_stderr_percent
    asked.clear()
    last = found.rendered().verdict.ladder[-1]
    assert [photons for photons, *_ in asked] == [FRESH_PHOTONS, MOST_FRESH_PHOTONS - FRESH_PHOTONS]
    assert asked[1][1] < asked[0][1] and asked[1][2] != asked[0][2]
    together = np.sqrt(FRESH_PHOTONS / MOST_FRESH_PHOTONS)
    assert coarse is not None and coarse > 5
    assert last.rendered_stderr_percent == pytest.approx(coarse * together, rel=1e-3)


def test_an_effect_that_the_scene_has_is_not_found_again(found: Diagnosis) -> None:
    verdict = diagnose(found.readings, found.scene, diffuse=None, advise=False).verdict
    assert verdict.verdict == "none"


def test_the_ledger_counts_the_runs_on_the_same_readings(found: Diagnosis, tmp_path) -> None:
    first, second = found.save(tmp_path), found.save(tmp_path)
    assert (first.verdict.run, second.verdict.run) == (1, 2)
    assert first.older == second.older == ()
    rows = ledger.entries(tmp_path)
    assert [row["effects"] for row in rows[:3]] == [rung.effects for rung in found.verdict.ladder]
    other, _ = readings(seed=99)
    assert ledger.runs(tmp_path, ledger.readings_hash(other)) == 0


def test_files_of_earlier_runs_are_told_and_left(found: Diagnosis, tmp_path) -> None:
    """A lamp that is none of this run's beside its verdict would be taken for its own."""
    old = {"lamp.csv", "curves.json", "hypotheses.toml", "rung7.toml"}
    for name in old:
        (tmp_path / name).write_text("of another run", encoding="utf-8")
    assert set(found.save(tmp_path).older) == old
    assert all((tmp_path / name).read_text(encoding="utf-8") == "of another run" for name in old)


def test_climbing_by_hand_meets_the_diagnosis(found: Diagnosis, tmp_path) -> None:
    report = fit_readings(found.readings, found.forward.scene, ["beam_tilt", "background"])
    best = found.verdict.explanations[0]
    assert report.statistics.error_percent == pytest.approx(best.error_percent, rel=2e-3)
    assert report.statistics.adequacy_p > 0.01
    stored = report.save(tmp_path, "compare --with beam_tilt,background")
    assert Scene.load(stored).get("lamp.tilt_x_deg") == pytest.approx(0.25, abs=0.02)
    text = as_text(report)
    assert "[[Correlations]]" in text and "[[Residuals by plane]]" in text
    json.dumps(as_data(report), allow_nan=False)


def test_a_base_fit_says_where_it_fails(found: Diagnosis) -> None:
    """A tilted beam: the sum of the residuals in one of the outer rings is many sigma."""
    report = fit_readings(found.readings, found.forward.scene)
    assert report.statistics.adequacy_p < 0.01
    assert max(abs(row.mean_sigma) for row in report.residuals.where["radius"]) > 5


def test_a_missing_error_has_a_reason() -> None:
    """Spectral hardening of a gradient's opposite sign runs into its bound at zero."""
    table, scene = readings({"water.gradient_per_m2": 0.01}, seed=2)
    report = fit_readings(table, scene, ["spectral_hardening"])
    estimate = report.estimates["water.hardening_per_m"]
    assert estimate.stderr is None and estimate.reason == "at boundary"
    assert "at boundary" in as_text(report)


def test_a_form_can_be_chosen_by_name() -> None:
    table, scene = readings({"lamp.warmup_fraction": 0.1, "lamp.warmup_time_s": 400.0}, seed=2)
    straight = fit_readings(table, scene, ["lamp_drift"])
    curved = fit_readings(table, scene, ["lamp_drift:warm-up"])
    assert curved.statistics.chi2 < straight.statistics.chi2
    with pytest.raises(UsageError, match="warm-up"):
        fit_readings(table, scene, ["lamp_drift:cubic"])
    with pytest.raises(UsageError, match="same y"):
        fit_readings(table, scene, ["beam_ellipticity"])


def test_too_few_readings_are_refused() -> None:
    table, scene = readings(seed=1)
    with pytest.raises(FitError, match="more than its 3 parameters"):
        diagnose(table.subset(np.arange(3) * 21), scene, diffuse=None)


def test_what_meets_as_many_readings_as_it_has_parameters_is_not_identified() -> None:
    """Five readings of two digits, which a pair of effects with five parameters in all meets exactly."""
    z, value = np.array([3.0, 4.0, 5.0, 6.0, 7.0]), np.array([1.0, 0.45, 0.29, 0.17, 0.12])
    table = Readings.from_arrays(x_m=0 * z, y_m=0 * z, z_m=z, value=value)
    verdict = diagnose(table, Scene(), diffuse=None, only=["saturation", "water_gradient"]).verdict
    assert verdict.verdict == "ambiguous"
    assert [len(e.parameters) for e in verdict.explanations] == [len(z)]
    assert "as many parameters as there are readings" in verdict.sentence


def test_readings_without_light_are_refused() -> None:
    """A column of zeros is a mistake in the table, not a measurement."""
    table, scene = readings(seed=1)
    with pytest.raises(FitError, match="no light"):
        diagnose(replace(table, value=np.zeros(len(table))), scene, diffuse=None)


def test_plan_predicts_what_cannot_be_told_apart() -> None:
    """Gradient and hardening are both quadratic in the path: a layout in water alone cannot part them."""
    table, scene = readings(seed=1)
    made = plan(table, scene)
    k = {name: i for i, name in enumerate(made.isolability.names)}
    assert made.isolability.D[k["water_gradient"], k["spectral_hardening"]] < 3
    assert made.isolability.D[k["background"], k["beam_tilt"]] > 3
    assert made.untestable["acceptance"]


def test_same_seed_same_verdict() -> None:
    table, scene = readings(HIDDEN, seed=12)
    few = ["beam_tilt", "background", "beam_offset"]
    one, two = (
        diagnose(table, scene, diffuse=None, only=few, advise=False, seed=5).verdict for _ in range(2)
    )
    assert one == two


@pytest.mark.slow
def test_what_nothing_explains_is_not_removed() -> None:
    """Beside two shadows a drift and a tilt remove their parts of the misfit: what is left is no noise."""

    def shade(table: Readings, x_m: float) -> np.ndarray:
        return np.asarray(1 - 0.3 * np.exp(-(((table.x_m - x_m) / 0.06) ** 2)) * (table.z_m > 5))

    table, scene = readings(
        {"lamp.tilt_x_deg": 0.3, "lamp.drift_per_hour": -0.4}, seed=1, noise=0.002,
        factor=lambda t: shade(t, 0.15) * shade(t, -0.3),
    )  # fmt: skip
    only = ["beam_tilt", "lamp_drift", "background"]
    verdict = diagnose(table, scene, diffuse=None, only=only, advise=False).verdict
    base, *rungs = verdict.ladder
    assert verdict.verdict == "unexplained" and rungs[-1].chi2_per_dof > 20
    part = (base.chi2_per_dof - rungs[-1].chi2_per_dof) / base.chi2_per_dof
    assert sum(rung.removed_percent for rung in rungs) == pytest.approx(100 * part, abs=2.5)
