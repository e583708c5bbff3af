"""Readings from arrays: what is no number is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lightfield.errors import MeasurementError
from lightfield.readings import Readings


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"value": np.ma.masked_array([3.0, 99.0], [False, True])}, "value is masked in places"),
        ({"stderr": np.ma.masked_array([3.0, 99.0], [False, True])}, "stderr is masked in places"),
        ({"value": [3.0 + 1j, 4.0]}, "value does not hold numbers"),
        ({"value": [True, False]}, "value does not hold numbers"),
        ({"plane_gain_percent": "0.2"}, "plane_gain_percent is no number"),
        ({"calibration_percent": True}, "calibration_percent is no number"),
    ],
)
def test_arrays_of_what_is_no_number(given: dict[str, Any], says: str) -> None:
    with pytest.raises(MeasurementError, match=says):
        Readings.from_arrays(**{"z_m": [1, 2], "value": [3, 4], **given})
