"""Cases are chosen and called by the values of their steps, as they are printed; nothing near is one."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import UsageError
from lightfield.sweep.results import case_label, step_of


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


@pytest.mark.parametrize(
    ("values", "labels"),
    [
        ((0.1, 5.0, 1e-7), ["p=0.1", "p=5", "p=1e-07"]),
        ((0.1234567, 0.1234569), ["p=0.1234567", "p=0.1234569"]),
        (
            ("a/b.csv", "a-b.csv", "a b.csv", "ab.csv"),
            ["p=a%2Fb.csv", "p=a-b.csv", "p=a%20b.csv", "p=ab.csv"],
        ),
        (([1.0, 2.5], [1.0, 25.0]), ["p=[1.0,2.5]", "p=[1.0,25.0]"]),
    ],
)
def test_a_case_has_a_folder_of_its_own(values: tuple[object, ...], labels: list[str]) -> None:
    """Where two had one, the images of the second took the place of those of the first."""
    assert [case_label({"p": value}) for value in values] == labels
