"""The verdict in words: they follow from its fields, and no program reads them back."""

from __future__ import annotations

import json

import pytest
from verdict_data import LIGHT, effect, explanation, verdict_data

from lightfield.diagnosis.adequacy.structure import Structure
from lightfield.diagnosis.verdict.next_measurement import repeat, what_next
from lightfield.diagnosis.verdict.parts import (
    Doubt,
    DoubtReason,
    Estimate,
    Misfit,
    NearestRival,
    PlaceToRead,
    Reason,
)
from lightfield.diagnosis.verdict.speech import Said, exactly, roughly
from lightfield.diagnosis.verdict.words.doubt import doubt
from lightfield.diagnosis.verdict.words.effects import (
    effect_size,
    half_widths,
    instead,
    means_something,
    why_first,
)
from lightfield.diagnosis.verdict.words.headline import words_of


@pytest.mark.parametrize(
    ("reason", "said"),
    [
        (Reason.AT_BOUNDARY, "only with a parameter at the edge of what is plausible"),
        (Reason.UNDETERMINED, "these readings do not determine its size"),
        (Reason.TOO_WIDE, "these readings do not determine its size"),
        (Reason.HELD, "the evidence against chance is weak"),
        (None, "the evidence against chance is weak"),
    ],
)
def test_a_doubt_follows_from_the_reason_why_there_is_no_error(reason: Reason | None, said: str) -> None:
    text = words_of(verdict_data("ambiguous", explanation("scattering", reason=reason)))
    assert text == Said.of(f"Perhaps scattering: it would explain the misfit, but {said}.")


def test_a_curve_that_would_follow_anything_is_no_weak_evidence() -> None:
    """Sixty sigma are no chance; what is open is whether any other readings would be met as well."""
    found = [effect("scattering", "one of", hardly_tested=True)]
    text = words_of(verdict_data("ambiguous", explanation("scattering"), found=found))
    assert "so would it nearly any readings at these places" in text.sentence
    assert "chance" not in text.sentence


def test_what_stands_against_the_only_explanation_is_said() -> None:
    """Not that the evidence against chance is weak; and what is certain all the same."""
    pair = ["stratification", "surface_reflection"]
    found = [effect("saturation", "certain"), effect("beam_offset", "one of", pair)]
    text = words_of(verdict_data("ambiguous", explanation("saturation", "beam_offset"), found=found))
    assert text.headline == (
        "Perhaps saturation and beam offset: they would explain the misfit, but other sets do as well."
    )
    assert text.support == (
        "Certain: saturation.",
        "Instead of beam offset: stratification with surface reflection.",
    )


def test_a_set_of_three_among_others_is_one() -> None:
    """It was "background spectrum with scattering with scattering slope or chlorophyll"."""
    one = effect("sediment", "one of", ["a", "b", "c"], ["d"])
    assert instead(one) == "a with b and c, or d"


def test_of_one_set_that_is_told_all_is_said_that_does_as_well() -> None:
    """Also what stands in another explanation of no weight: sixteen sigma are no weak evidence."""
    found = [
        effect("lamp_size", "one of", ["apparent_source"]),
        effect("scattering", "one of", ["beam_skirt"]),
    ]
    sets = (("lamp_size", 0.97), ("apparent_source", 0.03))
    told = [explanation(name, "scattering").model_copy(update={"weight": weight}) for name, weight in sets]
    text = words_of(verdict_data("ambiguous", *told, nearest_rival=RIVAL, found=found))
    assert text.headline == (
        "Perhaps lamp size and scattering: they would explain the misfit, but other sets do as well."
    )
    assert text.support == (
        "Instead of lamp size: apparent source.",
        "Instead of scattering: beam skirt.",
    )


def test_several_explanations_that_share_an_effect_do_not_make_it_sure() -> None:
    instead = "Instead of beam offset: surface reflection."
    pairs = [explanation("beam_offset", "saturation"), explanation("beam_offset", "background")]
    found = [effect("beam_offset", "one of", ["surface_reflection"])]
    text = words_of(verdict_data("ambiguous", *pairs, nearest_rival=RIVAL, found=found))
    assert text.headline == (
        "Beam offset, and saturation or background or others: these readings cannot tell."
    )
    assert text.support[-1] == instead and text.sentence.endswith(instead)


def test_sets_that_share_nothing_are_told_apart_and_what_weighs_nothing_is_not_told() -> None:
    sets = [explanation("water_gradient", "settling"), explanation("background", "saturation")]
    text = words_of(verdict_data("ambiguous", *sets))
    assert text.headline == (
        "Water gradient and settling; or background and saturation: these readings cannot tell."
    )
    weightless = [explanation(name, "saturation").model_copy(update={"weight": 0.004}) for name in "abc"]
    text = words_of(verdict_data("ambiguous", *sets, *weightless))
    assert text.headline == (
        "Water gradient and settling; or background and saturation: these readings cannot tell."
    )


def test_reasons_are_written_as_ever() -> None:
    """Programs compare the values in the JSON file."""
    written = [
        json.loads(Estimate(value=0.0, reason=reason).model_dump_json())["reason"] for reason in Reason
    ]
    assert written == [
        "held", "at boundary", "did not move the model", "undetermined",
        "undetermined: error wider than the allowed range", "none at all",
        "as sudden as these readings tell", "bends no more", "before all readings",
    ]  # fmt: skip


RIVAL = NearestRival(effects=["acceptance"], separation_sigma=5.0)


@pytest.mark.parametrize(
    ("kind", "effects", "rival", "sentence", "headline", "support"),
    [
        ("identified", [("scattering", "beam_tilt")], RIVAL,
         "Scattering and beam tilt are missing in the model within 1 % (family: water); the next rival, "
         "acceptance, is 5.0 sigma away.",
         "Scattering and beam tilt are missing in the model within 1 %.",
         ["Family: water; the next rival, acceptance, is 5.0 sigma away."]),
        ("ambiguous", [("scattering",), ("acceptance",)], RIVAL,
         "Scattering or acceptance: these readings cannot tell (scattering lies 5.0 sigma from acceptance) "
         "within 1 %.",
         "Scattering or acceptance: these readings cannot tell within 1 %.",
         ["Scattering lies 5.0 sigma from acceptance."]),
        # One that is not among those which cannot be told is no answer to which of them it is.
        ("ambiguous", [("scattering",), ("background",)], RIVAL,
         "Scattering or background: these readings cannot tell (what comes next, acceptance, lies 5.0 sigma "
         "from scattering) within 1 %.",
         "Scattering or background: these readings cannot tell within 1 %.",
         ["What comes next, acceptance, lies 5.0 sigma from scattering."]),
        ("ambiguous", [("scattering",), ("acceptance",)], None,
         "Scattering or acceptance: these readings cannot tell within 1 %.",
         "Scattering or acceptance: these readings cannot tell within 1 %.", []),
        ("none", [], None,
         "No missing effect detectable; smooth misfits up to 1 % count as none. "
         "No effect of plausible size would have been seen: these "
         "readings say nothing of any.",
         "No missing effect detectable; smooth misfits up to 1 % count as none.",
         ["No effect of plausible size would have been seen: these readings say nothing of any."]),
    ],
)  # fmt: skip
def test_what_was_found_and_how_sure_that_is_are_kept_apart(
    kind: str, effects: list, rival: NearestRival | None, sentence: str, headline: str, support: list[str]
) -> None:
    """The page sets the one large and the other small; the terminal says both in one sentence."""
    found = [explanation(*names) for names in effects]
    said = words_of(verdict_data(kind, *found, nearest_rival=rival, within_tolerance=True))
    assert said == Said(sentence, headline, tuple(support))
    against, aside = "Your scene's background is not in the readings.", "1 of 5 readings was set aside."
    more = said.after(against).then(aside)
    assert more.sentence == f"{against} {sentence} {aside}"
    assert more.headline == f"{against} {headline}" and more.support == (*support, aside)


def test_a_rival_is_not_said_to_be_far_where_others_would_do_as_well() -> None:
    """The table said that a course of the gradient would do as well, the headline that the next is far."""
    found = [effect("beam_offset", "certain"), effect("water_gradient", "simplest", ["plane_gain"])]
    best = explanation("beam_offset", "water_gradient")
    (near,) = words_of(verdict_data("identified", best, nearest_rival=RIVAL, found=found)).support
    assert near == (
        "Family: water; instead of water gradient, any course of it (plane gain) would do as well; "
        "the next rival with none of these, acceptance, is 5.0 sigma away."
    )
    same = NearestRival(effects=["beam_offset", "plane_gain"], separation_sigma=1.0)
    (near,) = words_of(verdict_data("identified", best, nearest_rival=same, found=found)).support
    assert near.endswith("(plane gain) would do as well.")


NO_BEAM = "these readings do not look like a beam through water"
NO_SLIPS = "some readings fit no known effect, and are no slips: they lie together"


@pytest.mark.parametrize(
    ("reason", "found", "said"),
    [
        (DoubtReason.NOTHING_BRIGHT, {}, f"{NO_BEAM}: no bright one is left"),
        (DoubtReason.NOISE, {"noise_percent": 13.6},
         "the noise is 14 % of a typical bright reading, too much to name an effect or to rule one out; "
         "these may be no readings of a beam through water"),
        (DoubtReason.COARSE, {"noise_percent": 28.9},
         "these readings come in steps, and rounding alone moves a typical bright one by 29 %: too much to "
         "name an effect or to rule one out"),
        (DoubtReason.FLAT, {},
         f"{NO_BEAM}: they do not change from place to place, where the lamp's light does"),
        (DoubtReason.NO_BETTER, {},
         f"{NO_BEAM}: one and the same value everywhere tells them as well as the model does"),
        (DoubtReason.PINNED, {"pinned": {"gain": 0.74, "water.absorption_per_m": -0.0}},
         f"{NO_BEAM}: they ask for more than gain = 0.74 and water.absorption_per_m = 0 allows, the edge of "
         "what is possible"),
        (DoubtReason.SCATTER, {"times": 3.44},
         "the readings scatter 3.4 times as much as their errors say, as no effect would: the errors are too "
         "small, or something changes from one reading to the next"),
        (DoubtReason.NOT_CONFIRMED,
         {"named": ["beam_tilt", "cdom"], "fitted_percent": 0.4, "rendered_percent": 2.13},
         "beam tilt and CDOM would explain the readings, but the fresh render does not confirm the fit "
         "(2.1 % against 0.4 %)"),
        (DoubtReason.NOT_CONFIRMED, {"fitted_percent": 0.4, "rendered_percent": 2.13},
         "the base model would explain the readings, but the fresh render does not confirm the fit (2.1 % "
         "against 0.4 %)"),
    ],
)  # fmt: skip
def test_a_doubt_is_said_from_its_data(reason: DoubtReason, found: dict, said: str) -> None:
    assert doubt(Doubt(reason=reason, **found)) == said


@pytest.mark.parametrize(
    ("structure", "said"),
    [
        (Structure("plane", 0.0, span=(4.5, 4.5)), f"{NO_SLIPS} where z is 4.5 m"),
        (Structure("angle", 0.0, span=(1.234, 2.0)), f"{NO_SLIPS} where the angle from the axis is 1.23 to 2 "
         "degrees"),
        (Structure("y/z", 0.0, span=(0.1, 0.2)), f"{NO_SLIPS} where y/z is 0.1 to 0.2"),
        (Structure("wavelength", 0.0, span=(450.0, 500.0)),
         f"{NO_SLIPS} where the wavelength is 450 to 500 nm"),
        (Structure("signal", 0.0, span=(3.0, 9.0)), f"{NO_SLIPS} among readings of equal size"),
        (Structure("time", 0.0, span=(41.0, 45.0)), f"{NO_SLIPS} in the scan, readings 41 to 45"),
        (Structure("place", 0.0, box_m=((-0.1, 0.1), (-1e-17, 0.0), (5.5, 5.5))),
         f"{NO_SLIPS} at neighbouring places, x = -0.1 to 0.1, y = 0, z = 5.5 m"),
        (Structure(None, 0.0, rate=0.02),
         "some readings fit no known effect, and are no slips: there are more of them than the 2 % that "
         "slips explain"),
    ],
)  # fmt: skip
def test_what_readings_set_aside_share_is_said_from_its_data(structure: Structure, said: str) -> None:
    assert doubt(Doubt(reason=DoubtReason.SET_ASIDE, structure=structure)) == said


@pytest.mark.parametrize(
    ("misfit", "said"),
    [
        (None, "it is not a function of one coordinate"),
        (Misfit(coordinate="time", worst_at=12.34), "it depends on time alone, most near 12.3 minutes"),
        (Misfit(coordinate="signal", worst_at=0.5), "it depends on signal alone, most near 0.5"),
        (Misfit(coordinate="angle", worst_at=2.0, period_deg=1.52),
         "it depends on angle alone, with a period of 1.5 degrees"),
        (Misfit(coordinate="time", worst_at=2.0, period_s=421.3, like="ripple_in_time"),
         "it depends on time alone, with a period of 421 s"),
        (Misfit(coordinate="plane", worst_at=4.5, at_one=True),
         "it lies in the plane at 4.5 m alone, which may stand elsewhere than stated"),
    ],
)  # fmt: skip
def test_where_a_misfit_lies_is_said_from_its_data(misfit: Misfit | None, said: str) -> None:
    text = words_of(verdict_data("unexplained", misfit=misfit, determined=False))
    assert text.headline == f"Unexplained by any known effects; {said}."


def test_what_was_not_asked_for_is_not_ruled_out() -> None:
    """Of two effects alone nothing follows for all that are known."""
    asked = ["scattering", "beam_tilt"]
    by = "the effects asked for (scattering and beam tilt)"
    open_ = words_of(verdict_data("unexplained", asked=asked))
    assert open_.headline.startswith(f"Unexplained by {by};")
    assert words_of(verdict_data("none", asked=asked)).headline == (
        "No missing effect among those asked for (scattering and beam tilt) detectable."
    )
    words = "Other effects were not considered"
    assert words in open_.sentence and words not in words_of(verdict_data("unexplained")).sentence


def test_what_to_repeat_follows_from_where_the_misfit_is() -> None:
    spot = PlaceToRead(x_m=0.3, y_m=0.0, z_m=6.5, medium="water", repeats=3)
    time = Misfit(coordinate="time", worst_at=3.0)
    assert repeat(spot, time).sentence.startswith("Repeat one reference position every few minutes:")
    for other in (None, Misfit(coordinate="x", worst_at=0.3)):
        assert repeat(spot, other).sentence == (
            "Repeat readings where the misfit is largest (x = 0.30, y = 0.00, z = 6.50 m) at another time: "
            "what repeats is a structure, what does not is noise."
        )


def test_no_reading_asked_for_is_no_contradiction_of_a_verdict_that_leaves_something_open() -> None:
    assert what_next("identified", None) == what_next("none", None) == "No further reading is asked for."
    for kind in ("ambiguous", "unexplained"):
        assert what_next(kind, None).startswith("No reading is named")


def test_the_width_under_a_curve_is_not_told() -> None:
    """Only with a curve over the angle: one of the power leaves the beam as it is."""
    others = ["lamp.hwhm_deg", "water.absorption_per_m"]
    beam, power = "lamp.profile_departure.0", "lamp.power_departure.0"
    width = "lamp.hwhm_deg"
    assert not means_something(width, [*others, beam])
    assert means_something(width, [*others, power]) and means_something(width, others)
    assert means_something(others[1], [*others, beam])


@pytest.mark.parametrize(
    ("percent", "said"),
    [
        (2.34, "a curve of 1 functions, changing the readings by 2.3 % rms"),
        (502.4, "a curve of 1 functions, changing the readings by a factor of 150 (rms)"),
    ],
)
def test_a_curve_that_changes_readings_many_times_is_told_as_a_factor(percent: float, said: str) -> None:
    """The rms change of a logarithm was called "502 % rms of the readings"."""
    one = effect("beam_profile", "certain").model_copy(update={"rms_percent": percent})
    assert effect_size(one) == said


@pytest.mark.parametrize(
    ("ellipticity", "said"),
    [
        (1.25, "1.25 times as wide as across at 90 degrees from x towards y"),
        (1.0034, "0.34 % wider than across at 90 degrees from x towards y"),
        (1.0004, "hardly oval"),
    ],
)
def test_an_oval_is_told_with_digits_that_say_something(ellipticity: float, said: str) -> None:
    """ "1 times as wide as across" was said of a beam that 4.4 sigma told from a round one."""
    sizes = {"lamp.ellipticity": ellipticity, "lamp.ellipticity_diagonal": 1.0}
    one = effect("beam_ellipticity", "certain").model_copy(
        update={"parameters": {path: Estimate(value=value, stderr=1e-4) for path, value in sizes.items()}}
    )
    assert effect_size(one).endswith(f" ({said})")


def test_of_an_oval_beam_both_half_widths_are_told() -> None:
    """5.2 degrees, of an oval of 4.92 and 6.15: it was that of its profile, in no direction its own."""
    oval = LIGHT.model_copy(update={"hwhm_deg": 5.2, "oval_hwhm_deg": (4.9213, 6.1498)})
    assert (half_widths(oval, 3), half_widths(LIGHT, 3)) == ("4.92 and 6.15", "4")
    assert half_widths(oval.model_copy(update={"oval_hwhm_deg": (5.278, 5.281)}), 3) == "5.28"


def test_nought_has_no_sign() -> None:
    """An absorption at the end of its range is 0, and not -0."""
    one = Estimate(value=-0.0, unit="1/m")
    assert exactly(one).startswith("0 ") and roughly(one) == "0 1/m"


def test_why_a_size_has_no_error_follows_its_unit() -> None:
    """It was "0.7 (at boundary) m"."""
    assert exactly(Estimate(value=0.7, unit="m", reason=Reason.AT_BOUNDARY)) == "0.7 m (at boundary)"


def test_what_is_perhaps_there_is_not_called_certain_by_its_name() -> None:
    """A headline said "Perhaps fouling", and the next sentence "Certain: fouling"."""
    edge = explanation("fouling", reason=Reason.AT_BOUNDARY)
    text = words_of(verdict_data("ambiguous", edge, found=[effect("fouling", "certain")]))
    assert text.headline.startswith("Perhaps fouling: it would explain the misfit, but only with a parameter")
    assert text.support == ("That an effect like it acts is certain.",)


def test_why_an_explanation_of_less_weight_stands_first_is_said() -> None:
    named = explanation("beam_shape", "background").model_copy(update={"weight": 0.2})
    curve = explanation("beam_profile", "background").model_copy(update={"weight": 0.7})
    other = explanation("beam_skirt", "background").model_copy(update={"weight": 0.1})
    assert why_first([named, curve, other]).startswith("The first needs fewer curves")
    assert why_first([curve, named]) == why_first([named, other]) == why_first([]) == ""
