"""How a detector moved between readings."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.arrays import Array
from lightfield.readings.motion import motion_of

ROW = np.linspace(-0.4, 0.4, 5)


def three_rows(one_way: bool = False) -> tuple[Array, ...]:
    """x, y, z and time: of rows of five, the second read backwards unless all are read one way."""
    x = np.concatenate([ROW, ROW if one_way else ROW[::-1], ROW])
    return x, 0 * x, np.repeat([4.5, 5.5, 6.5], 5), 10.0 * np.arange(15)


@pytest.mark.parametrize("one_way", [False, True])
def test_a_row_has_one_direction_from_its_beginning(one_way: bool) -> None:
    motion = motion_of(*three_rows(one_way))
    assert motion is not None
    back = [1.0] * 5 if one_way else [-1.0] * 5
    assert motion.way[0].tolist() == [1.0] * 5 + back + [1.0] * 5
    assert not motion.way[1:].any()
    assert motion.goes_on.tolist() == 3 * [False, True, True, True, False]
    assert motion.to_and_fro == (not one_way)


def test_it_is_known_by_the_times_whatever_the_order_of_the_table() -> None:
    """And of two wavelengths at each moment, which share it."""
    x, y, z, time_s = (np.tile(v, 2) for v in three_rows())
    mixed = np.random.default_rng(1).permutation(30)
    one, other = motion_of(x, y, z, time_s), motion_of(x[mixed], y[mixed], z[mixed], time_s[mixed])
    assert one is not None and other is not None
    assert (one.way[:, mixed] == other.way).all() and (one.way[:, :15] == one.way[:, 15:]).all()


def test_places_at_random_are_not_read_on_the_way() -> None:
    x, y, z, time_s = three_rows()
    for seed in range(20):
        order = np.random.default_rng(seed).permutation(15)
        motion = motion_of(x[order], y[order], z[order], time_s)
        assert motion is not None and not motion.to_and_fro


def test_a_track_in_loops_is_to_and_fro_and_a_straight_one_is_not() -> None:
    turn = np.linspace(0, 12, 80)
    loops, straight = 0.4 * np.sin(turn), 0.05 * turn
    z, time_s = np.linspace(4.0, 6.0, 80), np.arange(80.0)
    for x, expected in ((loops, True), (straight, False)):
        motion = motion_of(x, 0 * x, z, time_s)
        assert motion is not None and motion.to_and_fro == expected
        assert np.linalg.norm(motion.way, axis=0) == pytest.approx(1.0)


def test_what_is_read_lies_behind_along_the_way() -> None:
    x, y, z, time_s = three_rows()
    motion = motion_of(x, y, z, time_s)
    assert motion is not None
    there = motion.behind(0.01, x, y, z)
    assert there[0] - x == pytest.approx(-0.01 * motion.way[0]) and (there[2] == z).all()
    few = np.arange(15) % 2 == 0
    assert motion.some(few).behind(0.01, x[few], y[few], z[few])[0] == pytest.approx(there[0][few])


def test_without_times_or_of_several_places_at_one_nothing_is_known() -> None:
    x, y, z, time_s = three_rows()
    assert motion_of(x, y, z, np.full(15, np.nan)) is None
    assert motion_of(x, y, z, np.zeros(15)) is None
    assert motion_of(x, y, z, time_s // 20) is None
    still = motion_of(0 * x, y, 0 * z + 4.5, time_s)
    assert still is not None and not still.way.any() and not still.to_and_fro
