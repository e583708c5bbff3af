"""Residuals are told by plane where there are planes, else by bins of distance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lightfield.studies.compare.residuals import MOST_PLANES, _groups


def problem(z_m: np.ndarray) -> Any:
    n = z_m.size
    layout = SimpleNamespace(
        air=np.zeros(n, bool), z_m=z_m, x_m=np.linspace(-1, 1, n), y_m=np.zeros(n), channel=np.zeros(n, int),
        has_time=False,
    )  # fmt: skip
    return SimpleNamespace(layout=layout)


def test_planes_are_told_one_by_one():
    told = _groups(problem(np.repeat([3.0, 4.0, 5.0], 7)))
    assert [label for label, _ in told["plane"]] == ["z = 3 m", "z = 4 m", "z = 5 m"]
    assert "distance" not in told


@pytest.mark.parametrize("count", [MOST_PLANES + 1, 97])
def test_single_places_are_told_in_bins_that_hold_each_reading_once(count):
    z_m = np.random.default_rng(1).uniform(2, 9, count)
    told = _groups(problem(z_m))
    assert not told["plane"] and len(told["distance"]) == 5
    members = np.array([rows for _, rows in told["distance"]])
    assert (members.sum(axis=0) == 1).all()
    assert members.sum(axis=1).min() >= count // 5 - 1
