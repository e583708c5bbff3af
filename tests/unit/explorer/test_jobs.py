"""What the explorer's page is told of a verdict."""

from __future__ import annotations

import verdict_data as made

from lightfield.diagnosis.verdict.parts import Estimate, Judgement, NearestRival, Reason, StatedEffect
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.explorer.jobs import verdict_data


def test_an_effect_of_the_scene_that_is_not_there_reads_as_taken_away() -> None:
    """And no rival is far where something would do as well."""
    gone = {"tank.wall_albedo": Estimate(value=0.0, reason=Reason.HELD)}
    walls = made.effect("wall_reflection", "simplest", ["background"])
    walls = walls.model_copy(update={"of_scene": True, "parameters": gone})
    best = made.explanation("wall_reflection").model_copy(update={"parameters": gone})
    stated = StatedEffect(
        effect="wall_reflection", judgement=Judgement.SUPPORTED, stated={"tank.wall_albedo": 0.3},
        fitted={"tank.wall_albedo": Estimate(value=0.07, stderr=0.06)},
    )  # fmt: skip
    ladder = [made.rung(None)]
    rival = NearestRival(effects=["saturation"], separation_sigma=17.9)
    data = made.verdict_data(
        "identified", best, found=[walls], stated=[stated], nearest_rival=rival, ladder=ladder
    )
    told = verdict_data(Verdict(**dict(data)))
    assert [one["name"] for one in told["found"]] == ["no wall reflection"]
    assert [one["label"] for one in told["explanations"]] == ["no wall reflection"]
    assert told["rival"] is None
    sure = made.effect("saturation", "certain")
    data = made.verdict_data("identified", best, found=[sure], nearest_rival=rival, ladder=ladder)
    assert verdict_data(Verdict(**dict(data)))["rival"] == {"label": "saturation", "sigma": 17.9}
