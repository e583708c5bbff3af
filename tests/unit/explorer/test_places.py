"""Planes of the maps: spread over all distances that were read, and light in the water alone."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.explorer.places import MOST_PLANES, SIDE, MapPlaces
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


def test_a_map_is_empty_above_the_water() -> None:
    """Of a lamp 0.3 m below the top and 0.9 m above the floor a plane reaches as far up as down."""
    tank = {"width_m": 2.0, "depth_m": 1.2, "lamp_depth_m": 0.3, "length_m": 6.0}
    places = MapPlaces.of(Scene.from_dict({"tank": tank, "detector": {"planes_m": [2.0, 4.0]}}), None)
    above = places.y_m > 0.3
    assert above.any() and places.y_m[-1] > 0.8
    assert (places.wet == ~above[:, None]).all()
    y, z = places.columns["y_m"], places.columns["z_m"]
    assert y.max() <= 0.3 and len(y) == 2 * SIDE * (~above).sum()
    assert (z[places.rows(1)] == 4.0).all()
    shown = places.map_of(y[places.rows(1)])
    assert np.isnan(shown[above]).all()
    assert (shown[~above] == places.y_m[~above, None]).all()


def test_in_unbounded_water_there_is_light_everywhere() -> None:
    places = MapPlaces.of(Scene(), None)
    kept = np.arange(SIDE) % 2 == 0
    assert places.wet.all() and places.some(kept).sum() == len(places.z_m) * kept.sum() ** 2
