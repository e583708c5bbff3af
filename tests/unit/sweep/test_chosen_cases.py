"""Cases are chosen by the values of their steps, as they are printed; nothing near is taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import UsageError
from lightfield.sweep.results import step_of


@pytest.mark.parametrize(
    ("steps", "value", "number"),
    [
        ([0.4, 0.6], "0.4", 0),
        ([0.4, 0.6], "0.400", 0),
        ([0.0, 0.1 + 0.2], "0.3", 1),
        ([0.01, 0.046416, 0.2], "0.0464", 1),
        ([0.01, 0.046416, 0.2], "0.04642", 1),
        ([500.1, 500.2], "500.1", 0),
        ([-1.0, 0.0], "0", 1),
    ],
)
def test_a_step_or_what_it_is_rounded_to(steps: list[float], value: str, number: int) -> None:
    assert step_of(np.array(steps), "path", value) == number
    assert step_of(np.array(steps, np.float32), "path", value) == number


@pytest.mark.parametrize(
    ("steps", "value"),
    [
        ([0.4, 0.6], "0.41"),
        ([0.4], "0.41"),
        ([0.0, 0.3], "0.01"),
        ([0.046416, 0.2], "0.05"),
        ([500.1, 500.2], "500"),
        ([0.4, 0.6], "much"),
    ],
)
def test_what_is_only_near_is_no_step_and_the_steps_are_listed(steps: list[float], value: str) -> None:
    with pytest.raises(UsageError, match=f"{value}.*{steps[0]:g}"):
        step_of(np.array(steps), "path", value)
