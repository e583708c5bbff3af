"""What the scene itself states is tested too: left out, contradicted, supported, or held."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from analytic_readings import readings, scene

from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.diagnosis.verdict.parts import StatedEffect
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.fitting import effects
from lightfield.fitting.least_squares import least_squares
from lightfield.fitting.parameter import Model
from lightfield.report.diagnosis.drawn import view_of
from lightfield.report.diagnosis.page import diagnosis_page
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings


class Haze:
    """Light scattered once: b times a halo that knows nothing of its phase function, and no errors."""

    def __init__(self, x_m: np.ndarray, z_m: np.ndarray) -> None:
        self.halo = 0.02 * np.exp(-0.12 * z_m) / (1 + x_m**2) / z_m

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> np.ndarray:
        return np.array([scene.water.scattering_per_m * self.halo for _ in wavelengths_nm])

    def errors(self, scene: Scene, *_: Any) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((len(self.halo), 0)), np.zeros(len(self.halo))

    def with_denser(self, other: Any) -> Haze:
        return self


def haze(scene: Scene, x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray, **_: Any) -> Haze:
    return Haze(np.asarray(x_m), np.asarray(z_m))


def stated(found: Diagnosis, effect: str | None) -> StatedEffect:
    return next(entry for entry in found.verdict.stated if entry.effect == effect)


def believing(values: dict[str, Any], hidden: dict[str, Any] | None = None, **given: Any) -> Diagnosis:
    """A diagnosis of readings of the plain water, or of what is hidden, by a scene that states values."""
    table, _ = readings(hidden, seed=given.pop("seed", 1), layout=given.pop("layout", "line"))
    return diagnose(table, scene(**values), diffuse=given.pop("diffuse", None), advise=False, **given)


@pytest.mark.usefixtures("undrawn")
def test_scattering_that_is_not_in_the_readings_is_said_with_its_limit() -> None:
    few = ["scattering", "background", "beam_tilt", "beam_skirt"]
    found = believing({"water.scattering_per_m": 0.15}, diffuse=haze, only=few)
    verdict, entry = found.verdict, stated(found, "scattering")
    assert (verdict.verdict, verdict.effects) == ("identified", ["scattering"])
    assert verdict.sentence.startswith(
        "Your scene's scattering is not in the readings (water.scattering_per_m <"
    )
    assert entry.judgement == "absent" and entry.stated["water.scattering_per_m"] == 0.15
    assert entry.limit is not None and 0 < entry.limit < 0.05
    assert entry.sigma_from_stated > 5 > 2 > entry.sigma_to_remove
    assert found.scene.water.scattering_per_m == 0, "the explained scene is without it"
    # Of what is left out there are no errors any more: g was looked for among the values of a fit without it.
    best = found.basis.finding.best
    assert best is not None and set(best.errors) <= set(best.fit.paths)
    assert verdict.ladder[-1].label == "- scattering"
    assert verdict.ladder[-1].error_percent < 0.5 * verdict.ladder[0].error_percent
    assert "missing" not in verdict.sentence
    assert Verdict.model_validate(json.loads(verdict.model_dump_json())) == verdict
    page = diagnosis_page(view_of(found))
    assert "What the scene states" in page and "base - scattering" in page


def test_a_background_that_is_not_there_and_a_tilt_that_the_scene_lacks() -> None:
    few = ["background", "beam_tilt", "beam_offset", "beam_skirt", "acceptance"]
    found = believing({"detector.background": 0.02}, {"lamp.tilt_x_deg": 0.25}, only=few)
    assert (found.verdict.verdict, sorted(found.verdict.effects)) == (
        "identified",
        ["background", "beam_tilt"],
    )
    assert "Your scene's background is not in the readings" in found.verdict.sentence
    assert "Beam tilt is missing in the model" in found.verdict.sentence
    assert {one.effect: one.of_scene for one in found.verdict.found} == {
        "background": True,
        "beam_tilt": False,
    }


def test_another_size_than_stated_is_a_contradiction() -> None:
    found = believing({"detector.background": 0.03}, {"detector.background": 0.01})
    entry = stated(found, "background")
    value = entry.fitted["detector.background"]
    assert (found.verdict.effects, entry.judgement) == (["background"], "contradicted")
    assert value.stderr is not None and abs(value.value - 0.01) < 4 * value.stderr
    assert "is contradicted by the readings (detector.background = 0.0" in found.verdict.sentence
    assert "not 0.03" in found.verdict.sentence
    assert found.verdict.ladder[-1].label == "~ background"


def test_what_a_rival_explains_as_well_is_no_contradiction() -> None:
    """A Gaussian beam that is tilted less, or one that a narrow receiver sees tilted less, are one."""
    found = believing({"lamp.tilt_x_deg": 0.6}, {"lamp.tilt_x_deg": 0.25})
    assert found.verdict.verdict == "ambiguous"
    assert stated(found, "beam_tilt").judgement == "undecided"
    assert "Beam tilt unlike your scene's or acceptance" in found.verdict.sentence
    others = [name for name in found.verdict.effects if name != "beam_tilt"]
    assert stated(found, "beam_tilt").beside == others


@pytest.mark.parametrize("seed", range(3))
def test_what_is_rightly_stated_is_supported(seed: int) -> None:
    own = {"detector.background": 0.01, "lamp.tilt_x_deg": 0.3, "lamp.drift_per_hour": 0.1}
    found = believing(own, own, seed=seed)
    assert found.verdict.verdict == "none"
    assert {e.effect: e.judgement for e in found.verdict.stated} == {
        "background": "supported", "beam_tilt": "supported", "lamp_drift": "supported"
    }  # fmt: skip
    assert all(e.sigma_to_remove > 5 > e.sigma_from_stated for e in found.verdict.stated)
    assert all(e.beside == [] for e in found.verdict.stated)


def test_what_is_too_small_to_be_seen_is_left_open() -> None:
    """A background of a tenth of its detection limit, stated and not there."""
    found = believing({"detector.background": 2e-4})
    assert found.verdict.verdict == "none"
    assert stated(found, "background").judgement == "undecided"
    assert "cannot be told from none" in found.as_text()


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_only_known_while_a_value_of_the_scene_is_held_is_said(seed: int) -> None:
    """A background that is stated and not there, too small to be refuted, holds the absorption off: what that
    is with it free is told, as a fit that frees the background gives it."""
    table, _ = readings(seed=seed, layout="line")
    believed = scene(**{"detector.background": 6e-4})
    found = diagnose(table, believed, diffuse=None, advise=False)
    entry = stated(found, "background")
    fitted = fit_readings(table, believed, ["background"]).estimates["water.absorption_per_m"]
    held = found.verdict.ladder[0].parameters["water.absorption_per_m"]
    assert found.verdict.best_set == []
    told = entry.if_free["water.absorption_per_m"]
    assert told.stderr and fitted.stderr and held.stderr
    assert told.value == pytest.approx(fitted.value, abs=0.2 * fitted.stderr)
    # Errors know of effects that are too small to be named: no smaller than the fit's, nor than those above.
    assert told.stderr >= 0.9 * fitted.stderr and told.stderr >= held.stderr
    own = fit_readings(table, believed, []).estimates["water.absorption_per_m"].stderr
    assert own and abs(told.value - held.value) > own
    assert "only if detector.background = 0.0006 is right; with that free" in found.as_text()


def test_what_cannot_be_tested_is_listed_as_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a table that knows nothing of the lamp's size."""
    known = {name: effect for name, effect in effects.table().items() if name != "lamp_size"}
    monkeypatch.setattr(effects, "table", lambda: known)
    found = believing({"lamp.radius_m": 0.02, "lamp.tilt_x_deg": 0.25}, {"lamp.tilt_x_deg": 0.25},
                      only=["background"])  # fmt: skip
    held = {path: e.reason for e in found.verdict.stated for path in e.stated if e.judgement == "held"}
    assert held == {
        "lamp.radius_m": "no effect of the table sets it free",
        "lamp.tilt_x_deg": "not among the effects that were considered",
    }
    assert "held as stated: lamp.tilt_x_deg = 0.25, lamp.radius_m = 0.02" in found.as_text()


def test_a_plain_scene_states_nothing() -> None:
    assert believing({}).verdict.stated == []


@pytest.mark.parametrize(
    ("path", "effect", "value", "rise"),
    [
        ("water.scattering_per_m", "scattering", 0.15, 2.706),
        ("detector.background", "background", 0.02, 3.841),
    ],
)
def test_the_limit_is_where_the_readings_are_worse_by_a_95_per_cent_quantile(
    path: str, effect: str, value: float, rise: float
) -> None:
    """Chi-square 2.71 above its least (bounded on one side), 3.84 (on two), as refits beside it have it."""
    found = believing({path: value}, diffuse=haze, only=[effect, "beam_tilt"])
    entry, finding, problem = stated(found, effect), found.finding, found.prepared.problem
    best = finding.accepted[0]
    assert entry.judgement == "absent" and entry.limit is not None and best.adequacy is not None
    phi = best.adequacy.phi
    mine, *_ = (p for c in problem.candidates for p in c.amplitudes if p.path == path)

    def chi2(at: float) -> float:
        model = Model(problem.forward, (*problem.base, mine.held(at)))
        start = [*best.fit.u[: len(problem.base)], at]
        fit = least_squares(model, problem.value, finding.whiten, start, problem.keep, tolerance=1e-6)
        return fit.chi2 / phi

    two_sided = rise > 3
    least = min(chi2(v) for v in np.linspace(-entry.limit if two_sided else 0.0, entry.limit, 21))
    at_limit = min(chi2(sign * entry.limit) for sign in ((1, -1) if two_sided else (1,)))
    assert at_limit - least == pytest.approx(rise, abs=0.1)
