"""Figures of a sweep: the scale of its maps."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.report.sweep import _scale_of


@pytest.mark.parametrize(
    ("values", "low", "top"),
    [
        ([2.0, 8.0, np.nan], 2.0, 8.0),  # within a decade: not four of them for one
        ([1e-9, 0.0, -1.0, 8.0], 8e-4, 8.0),  # four decades at most
        ([8.0, 8.0], 4.0, 8.0),
        ([np.nan, 0.0], 0.5, 1.0),
    ],
)
def test_a_scale_spans_what_is_there(values: list[float], low: float, top: float) -> None:
    assert _scale_of(np.array(values)) == pytest.approx((low, top))
