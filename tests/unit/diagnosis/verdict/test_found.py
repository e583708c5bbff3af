"""Three effects at once, from readings to the words: levels, sizes, a ladder that falls, and JSON."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from analytic_readings import readings
from verdict_data import effect, explanation, rung, verdict_data

from lightfield.diagnosis import diagnose as diagnosing
from lightfield.diagnosis import knowledge
from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.diagnosis.search.pool.equivalences import TABLE
from lightfield.diagnosis.verdict.parts import Estimate, FoundEffect, Misfit, Reason, StatedEffect
from lightfield.diagnosis.verdict.speech import Said
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.diagnosis.verdict.words import effects
from lightfield.diagnosis.verdict.words.headline import words_of
from lightfield.fitting.forward import SceneForward
from lightfield.studies.compare.readings import fit_readings

#: What is hidden: a lamp that stands 3 cm aside and drifts, and ambient light.
HIDDEN = {"lamp.offset_x_m": 0.03, "lamp.drift_per_hour": -0.12, "detector.background": 2e-3}
NAMES = {"beam_offset", "lamp_drift", "background"}


@pytest.fixture(scope="module")
def three() -> Diagnosis:
    table, believed = readings(HIDDEN, seed=2)
    return diagnose(table, believed, diffuse=None)


def test_three_effects_are_identified(three: Diagnosis) -> None:
    verdict = three.verdict
    assert (verdict.verdict, set(verdict.effects)) == ("identified", NAMES)
    assert set(verdict.best_set) == set(verdict.certain) | set(verdict.simplest) == NAMES
    assert verdict.partial == []


def test_sizes_agree_with_what_was_hidden(three: Diagnosis) -> None:
    """Within four stated errors each; and of the water, whose absorption was 13 % off."""
    sizes = {path: e for one in three.verdict.found for path, e in one.parameters.items()}
    for path in ("lamp.offset_x_m", "lamp.drift_per_hour"):
        stderr = sizes[path].stderr
        assert stderr is not None and abs(sizes[path].value - HIDDEN[path]) < 4 * stderr
    (first, *_) = three.verdict.found
    assert first.with_it.attenuation_per_m == pytest.approx(0.12 * 0.87, abs=0.004)
    assert first.with_it.scattering_per_m == 0
    absorption = three.verdict.explanations[0].parameters["water.absorption_per_m"]
    assert first.with_it.attenuation_stderr_per_m == pytest.approx(absorption.stderr)


def test_without_an_effect_the_water_would_be_another(three: Diagnosis) -> None:
    """What fits by hand say: with all three, and with the other two, worse by the square of the sigma."""
    believed = three.forward.scene
    whole = fit_readings(three.readings, believed, sorted(NAMES)).statistics
    for one in three.verdict.found:
        rest = fit_readings(three.readings, believed, sorted(NAMES - {one.effect}))
        absorption = rest.estimates["water.absorption_per_m"]
        assert one.without_it is not None and absorption.stderr is not None
        off = one.without_it.absorption_per_m - absorption.value
        assert abs(off) < 0.1 * absorption.stderr, "another minimum, or another set"
        worse = (rest.statistics.chi2 - whole.chi2) / (whole.chi2 / whole.dof)
        assert one.sigma_to_remove == pytest.approx(np.sqrt(worse), rel=0.02)
        assert one.gap is not None and one.gap <= worse, "the best rival is no worse than a drop"


def test_the_last_rung_is_the_set_as_it_is_told(three: Diagnosis) -> None:
    """Number by number: from rung to rung a fit may come to another minimum than the search has found."""
    last = three.verdict.ladder[-1].parameters
    for one in three.verdict.found:
        for path, estimate in one.parameters.items():
            assert estimate.value == pytest.approx(last[path].value, rel=1e-12)


def test_the_ladder_falls_to_the_noise(three: Diagnosis) -> None:
    """A rung for every effect, each of less chi-square; together they remove all of the misfit."""
    ladder = three.verdict.ladder
    assert len(ladder) == 4 and set(ladder[-1].effects) == NAMES
    assert all(a.chi2_per_dof > b.chi2_per_dof for a, b in pairwise(ladder))
    parts = [rung.removed_percent for rung in ladder]
    assert parts[0] is None and sum(p for p in parts if p is not None) == pytest.approx(100, abs=1)
    assert ladder[-1].error_percent < 1.5 * three.verdict.noise_floor_percent
    # Nothing but noise is left, so both are the same number but for the scatter of the noise.
    assert three.verdict.noise_floor_percent < 1.5 * ladder[-1].error_percent


def test_the_verdict_is_data_and_is_read_back(three: Diagnosis) -> None:
    data = json.loads(three.verdict.model_dump_json())
    assert set(data["best_set"]) == NAMES and set(data) >= {"certain", "simplest", "partial", "found"}
    assert Verdict.model_validate(data) == three.verdict


def test_the_text_tells_every_effect(three: Diagnosis) -> None:
    text = three.as_text()
    assert "are missing in the model" in text.splitlines()[0]
    for one in three.verdict.found:
        assert any(line.startswith(one.effect) and one.level in line for line in text.splitlines())
    assert "removes %" in text


def test_a_single_effect_has_a_level_too() -> None:
    table, believed = readings({"lamp.offset_x_m": 0.03}, seed=2)
    verdict = diagnose(table, believed, diffuse=None, advise=False).verdict
    assert verdict.verdict == "identified" and verdict.best_set == ["beam_offset"]
    assert verdict.certain + verdict.simplest == ["beam_offset"]


def test_a_turned_narrow_receiver_is_a_tilted_beam() -> None:
    """In this program's own light, but for the receiver's cosine: that of a receiver turned by 6 to 12
    degrees changes by tan(12 degrees) times the angle, 0.1 rad, over the beam."""
    line = TABLE[0]
    table, believed = readings(seed=1, layout="line")
    tilted = {"lamp.hwhm_deg": 4.0, "lamp.tilt_x_deg": 0.5}
    forward = SceneForward(believed, table)
    expected = forward.predict(tilted)
    starts = list(line.starts(tilted, tilted["lamp.hwhm_deg"]))
    assert starts
    assert all("lamp.hwhm_deg" not in start for start in line.starts({"lamp.tilt_x_deg": 0.5}, 4.0))
    for start in starts:
        turned = forward.predict(
            {
                "lamp.hwhm_deg": np.exp(start["lamp.hwhm_deg"]),
                "detector.acceptance_hwhm_deg": 10 / np.sqrt(start["detector.acceptance_hwhm_deg"]),
                "detector.tilt_x_deg": start["detector.tilt_x_deg"],
            }
        )
        bright = expected > 0.05 * expected.max()
        ratio = turned[bright] / expected[bright]
        assert np.std(ratio) / np.mean(ratio) < np.tan(np.radians(12)) * 0.1


@pytest.mark.parametrize(
    ("levels", "headline"),
    [
        (["certain"] * 3, "A, b and c are missing in the model."),
        (["certain", "certain", "one of"], "A and b are missing in the model; also c or d."),
        (["one of"] * 3, "Several effects are missing in the model: a or d; b or d; c or d."),
    ],
)
def test_what_is_said_of_three(levels: list[str], headline: str) -> None:
    found = [
        effect(n, level, *([["d"]] if level == "one of" else []))
        for n, level in zip("abc", levels, strict=True)
    ]
    assert words_of(verdict_data("identified", explanation("a", "b", "c"), found=found)).headline == headline


@pytest.mark.parametrize(
    ("reason", "why"),
    [(Reason.AT_BOUNDARY, "c, but only at the edge of what is plausible"), (None, "perhaps c")],
)
def test_what_nothing_replaces_is_said_to_lie_at_an_edge(reason: Reason | None, why: str) -> None:
    """A cusp and a flat top of 170 to 260 sigma were "perhaps beam shape": of an exponent at its end."""
    at_end = {"lamp.c": Estimate(value=8.0, reason=reason)}
    found = [effect("a", "certain"), effect("b", "certain")]
    found += [effect("c", "one of").model_copy(update={"parameters": at_end})]
    told = words_of(verdict_data("ambiguous", explanation("a", "b", "c"), found=found)).headline
    assert told.startswith(f"A and b are missing in the model; also {why}.")


def test_effects_that_one_curve_has_are_told_together() -> None:
    """CDOM or any course of it; wavelength shift or any course of it: that named one curve twice."""
    curve = ["attenuation_spectrum"]
    found = [effect("background", "certain")]
    found += [effect(name, "one of", curve) for name in ("cdom", "wavelength_shift")]
    names = [one.effect for one in found]
    assert words_of(verdict_data("ambiguous", explanation(*names), found=found)).headline == (
        "Background is missing in the model; also CDOM and wavelength shift, or any course of them "
        "(attenuation spectrum)."
    )


def test_what_the_readings_refute_is_not_missing() -> None:
    """An effect of the scene among the three of the best set, at a size of none."""
    refuted = StatedEffect(
        effect="c", judgement="absent", stated={"lamp.c": 0.02}, fitted={"lamp.c": Estimate(value=0.0)},
        neutral={"lamp.c": 0.0}, limit=0.001, sigma_from_stated=20.0, sigma_to_remove=0.1,
    )  # fmt: skip
    found = [effect(name, "certain") for name in "abc"]
    said = words_of(verdict_data("identified", explanation("a", "b", "c"), found=found, stated=[refuted]))
    assert said.sentence.startswith("Your scene's c is not in the readings (lamp.c < 0.001, not 0.02).")
    assert said.sentence.endswith("A and b are missing in the model. Both of them are certain.")


@pytest.mark.parametrize(
    ("last", "support"), [("certain", "All of them are certain."), ("simplest", "Certain: a and b.")]
)
def test_the_names_of_a_headline_are_not_said_twice(last: str, support: str) -> None:
    """Three effects stood in the headline, and in the next sentence again."""
    found = [effect("a", "certain"), effect("b", "certain"), effect("c", last)]
    said = words_of(verdict_data("identified", explanation("a", "b", "c"), found=found))
    assert said.headline == "A, b and c are missing in the model." and said.support[0] == support


def test_three_whose_sizes_are_not_known_are_not_said_to_be_missing() -> None:
    vague = effect("b", "simplest").model_copy(
        update={"parameters": {"lamp.b": Estimate(value=9.0, reason=Reason.UNDETERMINED)}}
    )
    found = [effect("a", "certain"), vague, effect("c", "simplest")]
    said = words_of(verdict_data("ambiguous", explanation("a", "b", "c"), found=found))
    assert said.headline == (
        "Perhaps a, b and c: they would explain the misfit, "
        "but these readings do not determine the size of b."
    )


def test_rivals_are_told_of_effects_that_all_explanations_have() -> None:
    """What one explanation has and another lacks is told by these."""
    found = [effect("a", "one of", ["d", "e"], ["f"]), effect("b", "certain"), effect("c", "one of", ["g"])]
    both = [explanation("a", "b", "c"), explanation("a", "b", "g")]
    assert effects.shared(found, both) == (["b"], ["Instead of a: d with e or f."])
    assert effects.shared([effect("a", "one of")], [explanation("a")]) == ([], [])


def test_two_effects_are_told_by_their_explanation() -> None:
    found = [effect("a", "certain"), effect("b", "one of")]
    said = words_of(verdict_data("ambiguous", explanation("a", "b"), found=found))
    assert said.headline.startswith("Perhaps a and b: they would explain the misfit")


def test_what_is_said_of_the_unexplained() -> None:
    """Only where the set removes half of the misfit, or something of it is certain."""
    found = [effect("a", "partial"), effect("b", "one of")]

    def said(misfit: Misfit, *removed: float, found: list[FoundEffect] = found) -> Said:
        names = "a", "b", "dip_in_x"
        ladder = [rung(None), *(rung(part, *names[: k + 1]) for k, part in enumerate(removed))]
        return words_of(verdict_data("unexplained", found=found, ladder=ladder, misfit=misfit))

    misfit = Misfit(coordinate="x", worst_at=0.3)
    told = said(misfit, 90.0, 5.0)
    assert told.headline == "Unexplained in part: it depends on x alone, most near 0.3 m."
    assert told.support[:2] == ("A and b remove 95 % of the misfit.", "Certain so far: a.")
    unsure = [effect("a", "one of"), effect("b", "one of")]
    assert said(misfit, 40.0, found=unsure).headline.startswith("Unexplained by any known effects;")
    assert said(misfit, 40.0).headline.startswith("Unexplained in part:")
    # What a local unknown removes is not what the effects do.
    assert said(misfit, 30.0, 10.0, 60.0).support[0] == "A and b remove 40 % of the misfit."
    like = said(misfit.model_copy(update={"like": "dip_in_x"}), 90.0)
    assert like.headline == "Unexplained in part: it looks like a dip in x, near x = 0.3 m."
    # At other distances a plume is read elsewhere.
    plume = said(misfit.model_copy(update={"like": "plume"}), 90.0).headline
    assert plume == "Unexplained in part: it looks like a plume, near x = 0.3 m at the farthest distance."


def test_the_simplest_comes_with_what_else_would_do() -> None:
    one = effect("beam_tilt", "simplest", ["acceptance", "detector_tilt"])
    assert effects.level(one) == "simplest; acceptance with detector tilt would do as well"
    assert effects.effect_size(one) == "beam_tilt = 0.5 ± 0.01"
    size = Estimate(value=1.0, unit="1", stderr=0.01)
    oval = {"lamp.ellipticity": size, "lamp.ellipticity_diagonal": size.model_copy(update={"value": 1.69})}
    told = effects.effect_size(effect("beam_ellipticity", "certain").model_copy(update={"parameters": oval}))
    assert told.endswith("(1.69 times as wide as across at 45 degrees from x towards y)")
    by_lamp = effect("acceptance", "simplest").model_copy(update={"other_lamp": True})
    assert effects.level(by_lamp) == "simplest; a lamp of another shape would do as well"
    detail = effect("lamp_drift", "simplest", ["lamp_power_curve"]).model_copy(update={"lamp_detail": True})
    assert effects.level(detail) == (
        "simplest; any course of it (lamp power curve) would do as well; "
        "perhaps detail of the lamp that its curve leaves out"
    )
    curve = effect("acceptance", "simplest", ["beam_profile"]).model_copy(update={"other_lamp": True})
    assert effects.level(curve) == "simplest; beam profile would do as well"


def test_courses_of_an_effect_are_told_together_and_first() -> None:
    """Else "it" would be what was named in between."""
    one = effect("lamp_drift", "one of", ["water_drift"])
    several = [["water_drift"], ["lamp_power_curve"]]
    assert effects.instead(one.model_copy(update={"alternatives": several})) == (
        "any course of it (lamp power curve) or water drift"
    )
    gains = one.model_copy(update={"effect": "water_gradient"})
    curves = [["attenuation_profile"], ["background"], ["plane_gain"]]
    assert effects.instead(gains.model_copy(update={"alternatives": curves})) == (
        "any course of it (attenuation profile or plane gain) or background"
    )
    beside = [["background_spectrum", "beam_colour"], ["beam_colour"]]
    assert effects.instead(one.model_copy(update={"alternatives": beside})) == "beam colour"


def test_an_answer_that_better_light_takes_back_is_sought_among_more_effects(monkeypatch) -> None:
    """What one effect seemed to explain is taken back once: the ladder climbs all the same."""
    table, believed = readings({"detector.background": 0.02}, seed=4)
    taken = []

    def takes_back(_, prepared, finding, *__):
        taken.append(finding.size)
        nothing = replace(finding, size=None, accepted=[], weights=[])
        return prepared, nothing if len(taken) == 1 else finding

    monkeypatch.setattr(knowledge, "settled", takes_back)
    monkeypatch.setattr(diagnosing, "source_of", lambda *_: (None, Hindrance(Hinders.NOT_TRACED)))
    found = diagnosing.diagnose(table, believed, only=["background", "beam_offset"], diffuse="trace")
    assert taken == [1, 1]
    assert found.verdict.best_set == ["background"]
    assert len(found.verdict.ladder) == 2
