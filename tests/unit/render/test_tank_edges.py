"""Edges of a tank in a picture, against a projection by hand."""

from __future__ import annotations

import numpy as np

from lightfield.render.picture import Picture, as_seen
from lightfield.render.tank_edges import edges_in_view
from lightfield.scene.tank import Tank

TANK = Tank(width_m=2.0, depth_m=2.0, lamp_depth_m=0.5, length_m=4.5, behind_lamp_m=0.5)
#: Half a metre from the wall at +x, 4 m from the far end: 25 pixels a metre there.
SEEN = edges_in_view(TANK, np.array([0.5, 0.0, 0.0]), np.array([0.5, 0.0, 1.0]), 90.0, (200, 200))


def test_the_far_end_stands_where_its_corners_are_seen() -> None:
    """+x is on the left, for the camera looks along the beam."""
    across, up = np.flatnonzero(SEEN[100] > 0.3), np.flatnonzero(SEEN[:, 100] > 0.3)
    assert set(across) == {87, 137} and set(up) == {87, 137}
    assert SEEN[112, 90:135].max() == 0 == SEEN[110:115, 112].max()


def test_edges_behind_the_eye_are_not_seen_and_those_beside_it_reach_the_rim() -> None:
    ahead = SEEN[:, :87].max(axis=0)
    assert (ahead > 0).all()
    back = edges_in_view(TANK, np.array([0.5, 0.0, 4.5]), np.array([0.5, 0.0, 5.0]), 90.0, (20, 20))
    assert not back.any()


def test_black_walls_in_the_dark_show_where_the_tank_is() -> None:
    """A picture of a tank with dark walls was the lamp alone; where the tank ends it did not tell."""
    black = np.zeros((200, 200, 3))
    assert not as_seen(Picture(black, (), np.zeros(3))).any()
    lined = as_seen(Picture(black, (), np.zeros(3), SEEN))
    assert lined[100, 87].min() > 40 and lined[112, 112].max() == 0
    assert (
        as_seen(Picture(black + 1.0, (), np.zeros(3), SEEN)) >= as_seen(Picture(black + 1.0, (), np.zeros(3)))
    ).all()
