"""What is said of an effect of the scene: neither contradicted nor borne out, or taken away."""

from __future__ import annotations

import pytest
from verdict_data import effect, explanation, verdict_data

from lightfield.diagnosis.verdict.parts import Estimate, Judgement, Reason, StatedEffect
from lightfield.diagnosis.verdict.terminal import as_text
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.diagnosis.verdict.words.stated import stated_lines


@pytest.mark.parametrize(("far", "told"), [(2.9, True), (0.4, False), (None, False)])
def test_a_size_far_from_the_stated_one_is_not_passed_over(far: float | None, told: bool) -> None:
    """Walls of 0.29 +- 0.07 where 0.03 is stated: no contradiction yet, and not what the scene says."""
    entry = StatedEffect(
        effect="wall_reflection",
        judgement="supported",
        stated={"tank.wall_albedo": 0.03},
        fitted={"tank.wall_albedo": Estimate(value=0.29, stderr=0.07, unit="1")},
        sigma_from_stated=far,
        sigma_to_remove=3.2,
    )
    (line,) = stated_lines([entry])
    assert "0.29 ± 0.07 fitted, 0.03 stated" in line
    assert ("2.9 sigma apart" in line) is told


@pytest.mark.parametrize(
    ("stderr", "beside", "said"),
    [
        (
            0.54,
            ["acceptance", "background"],
            "tell beside acceptance and background; lamp.tilt_x_deg = 0.6111",
        ),
        (0.54, ["acceptance"], "0.6111 ± 0.54 deg fitted with that free, 0.6078 stated"),
        (0.54, [], None),
        (0.0021, ["background"], None),
    ],
)
def test_an_effect_that_is_surely_there_is_not_of_a_size_that_may_be_none(
    stderr: float, beside: list[str], said: str | None
) -> None:
    """A tilt of 297 sigma was 0.61 +- 0.54 degrees: an acceptance makes up for another tilt, not for none."""
    paths = ("lamp.tilt_x_deg", "lamp.tilt_y_deg")
    entry = StatedEffect(
        effect="beam_tilt", judgement=Judgement.SUPPORTED, stated={paths[0]: 0.6078, paths[1]: -0.005},
        neutral=dict.fromkeys(paths, 0.0), beside=beside, sigma_to_remove=297.3,
        fitted={
            paths[0]: Estimate(value=0.6111, stderr=stderr, unit="deg"),
            paths[1]: Estimate(value=-0.005, stderr=0.005, unit="deg"),
        },
    )  # fmt: skip
    (line,) = stated_lines([entry])
    assert "is in the readings (297.3 sigma)" in line
    assert ("these readings hardly tell beside" in line) is (said is not None)
    assert said is None or said in line


def test_an_effect_of_the_scene_that_is_not_there_reads_as_taken_away() -> None:
    """A tank of the scene's walls is the one without the finding, not with it."""
    gone = {"tank.wall_albedo": Estimate(value=0.0, reason=Reason.HELD)}
    walls = effect("wall_reflection", "simplest", ["background", "beam_skirt"])
    walls = walls.model_copy(update={"of_scene": True, "parameters": gone})
    best = explanation("beam_tilt", "wall_reflection").model_copy(update={"parameters": gone})
    stated = StatedEffect(
        effect="wall_reflection", judgement=Judgement.ABSENT, stated={"tank.wall_albedo": 0.3},
        neutral={"tank.wall_albedo": 0.0}, fitted={"tank.wall_albedo": Estimate(value=0.07, stderr=0.06)},
    )  # fmt: skip
    found = [effect("beam_tilt", "certain"), walls]
    data = verdict_data("identified", best, found=found, stated=[stated])
    said = as_text(Verdict(**dict(data)))
    assert "\n- wall_reflection " in said and "wall_albedo = 0 instead of the scene's\n" in said
    assert "simplest; the scene's beside background with beam skirt would do as well;" in said
    assert "\nwith the scene's wall reflection: a = " in said and "without wall reflection" not in said
    assert "\nbeam tilt and no wall reflection (weight" in said
    assert "instead of no wall reflection, the scene's beside background with beam skirt would do" in said

    other = {"tank.wall_albedo": Estimate(value=0.5, stderr=0.02)}
    walls = walls.model_copy(update={"parameters": other})
    best = best.model_copy(update={"parameters": other})
    said = as_text(Verdict(**dict(verdict_data("identified", best, found=[walls], stated=[stated]))))
    assert "\n~ wall_reflection " in said
    assert "\nbeam tilt and wall reflection unlike the scene's (weight" in said
