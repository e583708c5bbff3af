"""The verdict in words: they follow from its fields, and no program reads them back."""

from __future__ import annotations

import json

import pytest

from lightfield.diagnosis.verdict import words
from lightfield.diagnosis.verdict.verdict import Estimate, Explanation, Reason


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
    text = words.sentence(
        "ambiguous", [explanation("scattering", reason=reason)], None, {}, None, "", "", True
    )
    assert text == f"Perhaps scattering: it would explain the misfit, but {said}."


def test_reasons_are_written_as_ever() -> None:
    """Programs compare the values in the JSON file."""
    written = [
        json.loads(Estimate(value=0.0, reason=reason).model_dump_json())["reason"] for reason in Reason
    ]
    assert written == [
        "held", "at boundary", "did not move the model", "undetermined",
        "undetermined: error wider than the allowed range",
    ]  # fmt: skip
