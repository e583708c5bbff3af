"""Readings beside the light that `range` tells: over that at the reference, with their errors."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import MeasurementError
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.working_range.study import working_range

SCENE = Scene.from_dict({"water": {"absorption_per_m": 0.1}, "detector": {"planes_m": [4.5, 8.5]}})


def test_dark_readings_and_those_without_an_error_are_shown_as_they_are() -> None:
    """Nothing, less than nothing by its noise, and an error that nobody states, over 2 +- 0.02."""
    readings = Readings.from_arrays(
        z_m=[4.5, 6.5, 7.5, 8.5], value=[2.0, 0.0, -0.02, 0.5], stderr=[0.02, 0.04, 0.04, np.nan]
    )
    shown = working_range(SCENE, None, readings).readings
    assert shown.value.values.tolist() == pytest.approx([1.0, 0.0, -0.01, 0.25])
    assert shown.stderr.values[:3].tolist() == pytest.approx([0.0, 0.02, np.hypot(0.02, 0.01 * 0.01)])
    assert np.isnan(shown.stderr.values[3])
    dark = Readings.from_arrays(z_m=[4.5, 8.5], value=[0.0, 0.5], stderr=[0.02, 0.01])
    with pytest.raises(MeasurementError, match=r"no light to compare with"):
        working_range(SCENE, None, dark)
