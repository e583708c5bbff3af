"""Amounts of what is in the water, as they are told."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from lightfield.studies.attenuation.text import amount_text


@pytest.mark.parametrize(
    ("value", "low", "high", "told"),
    [
        (0.15, 0.1496, 0.1504, "0.15 (0.1496 to 0.1504)"),
        (0.1234, 0.1, 0.15, "0.123 (0.1 to 0.15)"),
        (0.5, 0.5, 0.5, "0.5 (0.5 to 0.5)"),
    ],
)
def test_an_interval_has_as_many_digits_as_it_is_wide(value, low, high, told) -> None:
    amount = SimpleNamespace(found=True, value=value, low_68=low, high_68=high)
    assert amount_text(SimpleNamespace(amounts={"cdom": amount}), "cdom") == told
