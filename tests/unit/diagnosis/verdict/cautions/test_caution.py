"""Cautions and advice are records; each kind has its words, made of its numbers and nothing else."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.assumed import Assumed, Term
from lightfield.diagnosis.verdict.cautions import noise_and_fit
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.diagnosis.verdict.next_measurement import Asks, NextMeasurement
from lightfield.diagnosis.verdict.parts import Estimate, PlaceToRead, Reason
from lightfield.fitting.curves import ABSORPTION, PROFILE
from lightfield.readings.load_warning import LoadWarning, Remarks

NUMBERS = {
    Warns.SCATTER_MORE: {"times": 1.73},
    Warns.SCATTER_FAR_MORE: {"times": 936.0},
    Warns.SCATTER_LESS: {"times": 4.26},
    Warns.IN_COMMON: {"percent": 0.58},
    Warns.AT_BOUNDARY: {"fitted": 0.125},
    Warns.WIDTH: {"ratio": 2.1, "fitted": 8.0, "stated": 3.81},
    Warns.MORE_ABSORPTION: {"ratio": 2.3, "fitted": 0.23, "stated": 0.1},
    Warns.LESS_ABSORPTION: {"ratio": 0.25, "fitted": 0.025, "stated": 0.1},
    Warns.IMMERSED: {"factor": 1.37},
    Warns.GAIN: {"ratio": 1.57, "power_w": 30.0, "calibration_percent": 10.0},
    Warns.CURVE_AT_BOUNDARY: {"functions": 2.0},
    Warns.AMPLIFIES: {"least_per_m": -0.036},
    Warns.OF_BAND: {"ratio": 0.106},
    Warns.EXCHANGED: {"exchanged": 1.1, "as_given": 57.0},
    Warns.OF_GLASS: {"glass": 0.82, "found": 1.9},
    Warns.COARSE_TABLE: {"step_deg": 1.5, "percent": 2.3},
    Warns.BEYOND_TABLE: {"beyond": 17.0, "readings": 65.0, "from_deg": 9.7},
    Warns.ANOTHER_LAMP: {"width_deg": 5.21, "better": 14.0},
    Warns.GAIN_OF_ONE: {"planes": 4.0, "z_m": 1.5, "percent": 24.0},
    Warns.ORDERED: {"times": 1.1, "p": 2e-06, "limit": 0.0001},
    Warns.NOT_CONVERGED: {"gain": 12.0, "sigma": 3.5},
    Warns.NOT_CONFIRMED: {"fitted_percent": 0.42, "rendered_percent": 3.1},
}


@pytest.mark.parametrize("warns", Warns)
def test_every_caution_says_its_numbers_and_reads_back(warns: Warns) -> None:
    if warns is Warns.TABLE:
        told = Caution.of_table(LoadWarning(Remarks.NO_TIME))
        assert told.about == "no_time"
        assert told.sentence == (
            "not all readings have a time: lamp drift cannot be tested (give time_s, seconds since the first "
            "reading)"
        )
    else:
        told = Caution(warns=warns, about="lamp.hwhm_deg", values=NUMBERS.get(warns, {}))
        for number in told.values.values():
            assert f"{number:g}" in told.sentence or f"{number:.1f}" in told.sentence
    assert "{" not in told.sentence and told.sentence
    assert Caution.model_validate(told.model_dump(mode="json")) == told


@pytest.mark.parametrize("asks", Asks)
def test_every_advice_has_words_and_reads_back(asks: Asks) -> None:
    told = NextMeasurement(
        asks=asks,
        between=[["beam_tilt"], ["detector_tilt", "background"]],
        readings=[PlaceToRead(x_m=0.3, y_m=0.0, z_m=6.5, medium="water", repeats=4)],
        separation_now_sigma=1.2,
        separation_predicted_sigma=7.5,
        laboratory={"beam_tilt": "Turn the lamp."},
    )
    assert told.sentence.endswith(".")
    assert ("beam tilt: Turn the lamp." in told.sentence) == (asks is Asks.OTHER_KIND)
    in_a_band = told.model_copy(update={"wavelength_nm": 443.0})
    assert (" readings at 443 nm (x = " in in_a_band.sentence) == (asks is Asks.PART)
    assert ("7.5 sigma" in told.sentence) == (asks is Asks.PART)
    assert ("z = 6.5" in told.sentence) == (asks in (Asks.PART, Asks.REPEAT, Asks.LOOK, Asks.IN_A_ROW))
    data = told.model_dump(mode="json")
    assert data["sentence"] == told.sentence
    assert NextMeasurement.model_validate(data) == told


@pytest.mark.parametrize(
    ("assumed", "said"),
    [
        (Assumed(Term.POSITION, 0.0), "position_mm = 0"),
        (Assumed(Term.PLANE_GAIN, 0.3),
         "plane_gain_percent = 0.3 for every stay of several readings at one distance"),
        (Assumed(Term.PLANE_GAIN, 0.2468, 5), "plane_gain_percent = 0.25 from 5 repeats of one position"),
        (Assumed(Term.PLANE_GAIN, 0.2468, 5, True),
         "plane_gain_percent = 0.25 from 5 repeats of the reference position"),
        (Assumed(Term.STDERR, 1.0, floor_percent=0.1),
         "stderr = 1 % of the reading + 0.1 % of the largest, up to a factor that is estimated"),
    ],
)  # fmt: skip
def test_what_was_assumed_is_said_from_its_data(assumed: Assumed, said: str) -> None:
    assert str(assumed) == said
    assert assumed.as_data()["term"] == assumed.term.value


def test_light_that_the_scene_has_and_the_model_lacks_is_told() -> None:
    table, scene = readings(seed=1)
    murky = scene.with_values({"water.scattering_per_m": 0.05})
    for stated, told in ((scene, False), (murky, True)):
        verdict = diagnose(table, stated, diffuse=None, only=["beam_tilt"], advise=False).verdict
        assert any("was not traced and is not in the model" in text for text in verdict.warnings) == told


@pytest.mark.parametrize(
    ("fitted", "warns"),
    [
        (["water.settling_per_m"], Warns.OF_THE_SCENES_PHASE),
        (["water.settling_per_m", "water.phase.g"], Warns.OF_ITS_PHASE),
        (["water.drift_per_m_per_hour"], None),
    ],
)
def test_scattering_is_that_of_a_phase_function(
    monkeypatch: pytest.MonkeyPatch, fitted: list[str], warns: Warns | None
) -> None:
    """Of its own where that is fitted, else of the scene's: an error of g is not in that of b."""
    adequacy = SimpleNamespace(phi=1.0, nu=50, scale_taken=False)
    finding = SimpleNamespace(
        best=None, closest=None, size=1, explaining=None, adequacy_of=lambda explaining: adequacy, scale=1.0,
        level=SimpleNamespace(bench=SimpleNamespace(phi=1.0), base=SimpleNamespace(u=[]), adequacy=adequacy),
        levels=[], many=None,
    )  # fmt: skip
    finding.levels.append(finding.level)
    as_stated = SimpleNamespace(times_stated=1.0)
    of_layout = SimpleNamespace(layout=SimpleNamespace(common=np.zeros(1)), budget=as_stated)
    prepared = SimpleNamespace(
        doubted=False, errors_stated=True, excess=1.0, raised=1.0, problem=of_layout, noise=of_layout
    )
    monkeypatch.setattr(noise_and_fit, "is_of_the_search_alone", lambda problem, fit: False)
    told = SimpleNamespace(parameters={path: SimpleNamespace(reason=None) for path in fitted})
    found = noise_and_fit.cautions(SimpleNamespace(warnings=[]), prepared, finding, [told])
    assert [one.warns for one in found] == ([warns] if warns else [])


def test_a_curve_at_the_edge_of_its_range_is_warned_of_once() -> None:
    """Not in a line for each of its functions; of a lamp's that may not bend more nothing is to be said."""
    edge, bent = Reason.AT_BOUNDARY, Reason.BENDS_NO_MORE
    reasons = {
        f"{PROFILE}.7": bent,
        f"{ABSORPTION}.1": edge,
        "lamp.tilt_x_deg": edge,
        f"{ABSORPTION}.3": edge,
    }
    found = noise_and_fit.at_boundary({p: Estimate(value=0.5, reason=why) for p, why in reasons.items()})
    assert [(one.warns, one.about, one.values) for one in found] == [
        (Warns.AT_BOUNDARY, "lamp.tilt_x_deg", {"fitted": 0.5}),
        (Warns.CURVE_AT_BOUNDARY, ABSORPTION, {"functions": 2.0}),
    ]


def test_what_effects_explain_is_no_scatter() -> None:
    """Errors of 0.2 % are right: "1.4 times as much as their errors say" was said beside three effects."""
    hidden = {"lamp.shape_exponent": 3.0, "lamp.offset_x_m": 0.05, "detector.background": 0.02}
    table, scene = readings(hidden, seed=1, noise=0.002)
    few = ["background", "beam_offset", "beam_shape", "beam_skirt", "beam_tilt", "saturation"]
    verdict = diagnose(table, scene, diffuse=None, only=few, advise=False).verdict
    assert sorted(verdict.best_set) == ["background", "beam_offset", "beam_shape"]
    assert not any("times as much as their errors say" in text for text in verdict.warnings)
    assert 0.6 < verdict.variance_scale < 1.5


def test_errors_of_few_readings_that_are_stated_too_small_are_told() -> None:
    """By 1.5, of 36 readings: beside all effects together too few are left to see it, and a chi-square of 2.6
    per degree of freedom was "as stated"."""
    told = []
    for seed in range(24):
        table, scene = readings(seed=seed, noise=0.01, layout="half")
        few = table.subset(np.random.default_rng(seed).permutation(len(table))[:36])
        few = replace(few, stderr=few.stderr / 1.5)
        told.append(diagnose(few, scene, diffuse=None, advise=False).verdict.variance_scale)
    # Mean squares of 33 have a relative spread of sqrt(2 / 33).
    assert np.mean(told) == pytest.approx(1.5**2, rel=4 * np.sqrt(2 / 33 / 24))


def test_relative_errors_are_asked_about_before_anything_is_believed() -> None:
    """One per cent in place of one per cent of 5000 counts: 15 effects were tried, and a time was told."""
    table, scene = readings(seed=1, noise=0.01)
    counts = 5000 * table.value / table.value.max()
    table = replace(table, value=counts, stderr=np.full(len(table), 0.01))
    verdict = diagnose(table, scene, diffuse=None, only=["background", "beam_tilt"], advise=False).verdict
    (told,) = (c for c in verdict.cautions if c.warns is Warns.SCATTER_FAR_MORE)
    assert told.sentence in verdict.check_first
