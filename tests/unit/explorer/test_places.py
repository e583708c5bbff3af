"""Planes of the maps: spread over all distances that were read."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.explorer.places import MOST_PLANES, MapPlaces
from lightfield.readings import Readings
from lightfield.scene import Scene


@pytest.mark.parametrize("step_m", [0.005, 0.015, 0.05, 0.5])
def test_planes_reach_from_the_nearest_to_the_farthest_reading(step_m: float) -> None:
    """However dense the distances are: 1 to 4 m, in steps below and above what counts as one plane."""
    z = np.arange(1.0, 4.0 + step_m / 2, step_m)
    planes = np.array(MapPlaces.of(Scene(), Readings.from_arrays(value=np.ones(len(z)), z_m=z)).z_m)
    assert len(planes) == min(len(z), MOST_PLANES)
    assert planes[0] == 1.0 and planes[-1] == pytest.approx(4.0, abs=0.021)
    assert np.ptp(np.diff(planes)) <= 0.0201 + step_m, "evenly, but for one plane more or less between"


def test_distances_that_hardly_differ_are_one_plane() -> None:
    z = np.array([2.0, 2.004, 2.011, 3.0, 3.006])
    assert MapPlaces.of(Scene(), Readings.from_arrays(value=np.ones(5), z_m=z)).z_m == (2.0, 3.0)
