"""Repeats whose bands scatter together: a lamp's flicker against noise of every band by itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lightfield.readings.importing.replicates import Stay, alike_in_bands

BANDS, PLACES, REPEATS = 5, 40, 3


def told(common: float, own: float, known_percent: float = 0.0, seed: int = 1) -> Any:
    rng = np.random.default_rng(seed)
    stays, points = [], {}
    for place in range(PLACES):
        members = tuple(range(REPEATS * place, REPEATS * (place + 1)))
        stays.append(Stay(members, 0, place))
        level = np.exp(rng.uniform(3, 8))
        for k in members:
            flicker = 1 + common * rng.standard_normal()
            for b in range(BANDS):
                points[k, b] = SimpleNamespace(
                    value=level * (1 + b) * (flicker + own * rng.standard_normal())
                )
    return alike_in_bands(stays, points, BANDS, known_percent)


@pytest.mark.parametrize("seed", range(3))
def test_flicker_is_told_with_its_size(seed: int) -> None:
    """0.3 % of a spectrum, 0.1 % of a band: of three repeats' mean 0.17 %, nine tenths of the variance."""
    found = told(0.003, 0.001, seed=seed)
    assert found.values["percent"] == pytest.approx(0.3 / np.sqrt(REPEATS), rel=0.25)
    assert found.values["part"] == pytest.approx(90, abs=5)
    assert "plane_gain_percent = 0.1" in str(found) or "plane_gain_percent = 0.2" in str(found)


@pytest.mark.parametrize("seed", range(10))
def test_noise_of_every_band_by_itself_is_nothing_to_tell(seed: int) -> None:
    assert told(0.0, 0.003, seed=seed) is None


def test_what_the_budget_says_already_is_not_told_again() -> None:
    assert told(0.003, 0.001, known_percent=0.3) is None
