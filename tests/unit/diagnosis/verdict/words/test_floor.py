"""An error below the noise floor is explained where it lies far below."""

from __future__ import annotations

import pytest
from verdict_data import rung, verdict_data

from lightfield.diagnosis.verdict.words.floor import left_of_floor, why_below


@pytest.mark.parametrize(
    ("floor", "left", "chance", "said"),
    [
        (12.0, 11.0, 0.9, "are larger than what is left (of such errors a fit would leave 11 ± 0.9 %)."),
        (12.0, 11.0, 6.0, "by chance: few readings make most of both; of such errors a fit leaves 11 ± 6 %."),
        (3.3, 2.8, 0.2, "as the fit follows a part of the noise; of such errors a fit leaves 2.8 ± 0.2 %."),
        (2.7, 2.7, 0.2, None),
        (0.4, 0.4, 0.1, None),
        (12.0, None, None, None),
    ],
)
def test_a_floor_above_the_error_is_explained(
    floor: float, left: float | None, chance: float | None, said: str | None
) -> None:
    """By errors that are too large, or by what the fit and chance have brought the error below it: of a floor
    of 2.4 % above an error of 1.7 % one reading made most, and 40 numbers of 165 readings follow noise."""
    last = rung(None).model_copy(update={"error_percent": 2.6})
    v = verdict_data(
        "none", ladder=[last], noise_floor_percent=floor, left_by_fit_percent=left,
        left_by_fit_stderr_percent=chance,
    )  # fmt: skip
    assert (left_of_floor(v) is None) == (said is None)
    if said is None:
        assert why_below(v) == ""
    else:
        assert why_below(v).startswith("The floor lies above the error") and why_below(v).endswith(said)
