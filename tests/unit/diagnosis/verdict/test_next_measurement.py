"""What to do next, in words that follow from where readings lie."""

from __future__ import annotations

import pytest

from lightfield.diagnosis.verdict.next_measurement import look
from lightfield.diagnosis.verdict.parts import SetAside, WhyAside


def _aside(sigma: float | None) -> SetAside:
    reason = WhyAside.SATURATED if sigma is None else WhyAside.OUTLIER
    at = {"x_m": 0.2, "y_m": 0.0, "z_m": 5.0, "medium": "water", "wavelength_nm": None}
    return SetAside(row=0, reason=reason, off_sigma=sigma, **at)


@pytest.mark.parametrize(
    ("sigmas", "above", "said"),
    [
        ((14.0, 9.8, None), True, "Look for what sends or mirrors light to the readings set aside, or for a"),
        ((-14.0, -9.8), False, "Look for what stands between the lamp and the readings set aside, and"),
        ((14.0, -9.8), None, "Look for what shades the readings set aside, or sends more light there, and"),
    ],
)
def test_bright_readings_set_aside_are_not_laid_to_something_in_the_way(
    sigmas: tuple[float | None, ...], above: bool | None, said: str
) -> None:
    asked = look([_aside(sigma) for sigma in sigmas])
    assert asked.above_model is above and asked.sentence.startswith(said)
    assert "the farthest at x = 0.2, y = 0, z = 5 m" in asked.sentence
