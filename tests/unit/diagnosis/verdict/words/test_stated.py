"""What is said of an effect of the scene whose size the readings neither contradict nor bear out."""

from __future__ import annotations

import pytest

from lightfield.diagnosis.verdict.parts import Estimate, StatedEffect
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
