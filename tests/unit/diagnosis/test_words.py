"""The verdict in words: they follow from its fields, and no program reads them back."""

from __future__ import annotations

import json

import pytest

from lightfield.diagnosis.verdict import words
from lightfield.diagnosis.verdict.parts import Estimate, Explanation, NearestRival, Reason


def explanation(*effects: str, reason: Reason | None = None) -> Explanation:
    return Explanation(
        effects=list(effects), families=["water"] * len(effects), forms=["linear"] * len(effects), weight=0.5,
        parameters={"water.scattering_per_m": Estimate(value=0.1, reason=reason)},
        chi2_per_dof=1.0, error_percent=1.0, held_out_percent=None, adequacy_p=0.5,
    )  # fmt: skip


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
    text = words.said("ambiguous", [explanation("scattering", reason=reason)], None, {}, None, "", True)
    assert text == words.Said.of(f"Perhaps scattering: it would explain the misfit, but {said}.")


def test_reasons_are_written_as_ever() -> None:
    """Programs compare the values in the JSON file."""
    written = [
        json.loads(Estimate(value=0.0, reason=reason).model_dump_json())["reason"] for reason in Reason
    ]
    assert written == [
        "held", "at boundary", "did not move the model", "undetermined",
        "undetermined: error wider than the allowed range",
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
         "Scattering or acceptance: these readings cannot tell (the first lies 5.0 sigma from acceptance) "
         "within 1 %.",
         "Scattering or acceptance: these readings cannot tell within 1 %.",
         ["The first lies 5.0 sigma from acceptance."]),
        ("ambiguous", [("scattering",), ("acceptance",)], None,
         "Scattering or acceptance: these readings cannot tell within 1 %.",
         "Scattering or acceptance: these readings cannot tell within 1 %.", []),
        ("none", [], None,
         "No missing effect detectable within 1 %. No effect of plausible size would have been seen: these "
         "readings say nothing of any.",
         "No missing effect detectable within 1 %.",
         ["No effect of plausible size would have been seen: these readings say nothing of any."]),
    ],
)  # fmt: skip
def test_what_was_found_and_how_sure_that_is_are_kept_apart(
    kind: str, effects: list, rival: NearestRival | None, sentence: str, headline: str, support: list[str]
) -> None:
    """The page sets the one large and the other small; the terminal says both in one sentence."""
    found = [explanation(*names) for names in effects]
    said = words.said(kind, found, rival, {}, None, " within 1 %", True)
    assert said.fields == {"sentence": sentence, "headline": headline, "support": support}
    against, aside = "Your scene's background is not in the readings.", "1 of 5 readings was set aside."
    more = said.after(against).then(aside)
    assert more.sentence == f"{against} {sentence} {aside}"
    assert more.headline == f"{against} {headline}" and more.support == (*support, aside)
