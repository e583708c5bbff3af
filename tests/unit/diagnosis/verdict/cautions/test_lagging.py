"""Readings taken to and fro whose places lag behind the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from analytic_readings import many_lines

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.diagnosis.verdict.cautions.lagging import directions
from lightfield.readings import Readings

#: Effects that a scan to and fro with a lag was taken for, and such as it is not like.
ASKED = ["lamp_drift", "water_gradient", "background", "beam_offset"]


def to_and_fro(table: Readings, lag_m: float = 0.0) -> Readings:
    """The same lines, every other one read from right to left; the stage is ahead of the light by so much."""
    lines = table.x_m.reshape(5, -1)
    order = np.arange(table.x_m.size).reshape(lines.shape)
    order[1::2] = order[1::2, ::-1]
    back = np.zeros(lines.shape)
    back[1::2] = 1.0
    now = table.subset(order.ravel())
    x = now.x_m + lag_m * (1 - 2 * back.ravel())
    return replace(now, x_m=x, time_s=10.0 * np.arange(x.size))


def test_a_lag_is_told_with_its_size_and_what_is_left_beside_it() -> None:
    """2 mm in rows that alternate were "lamp drift", certain, with a warm-up of 588 +- 700 s."""
    table, believed = many_lines(75, 5)
    verdict = diagnose(to_and_fro(table, 0.005), believed, diffuse=None, only=ASKED, advise=False).verdict
    (told,) = (c for c in verdict.cautions if c.warns is Warns.LAGS)
    assert told.values["lag_mm"] == pytest.approx(5.0, abs=0.5)
    assert told.about == "the scene as it is" and told.sentence in verdict.check_first
    assert told.values["lagging"] < 1.3


@pytest.mark.parametrize("hidden", [{"water.gradient_per_m2": 0.02}, {"lamp.offset_x_m": 0.005}, {}])
def test_of_what_is_no_lag_nothing_is_said(hidden: dict[str, float]) -> None:
    """An offset is the same whichever way the stage runs."""
    table, believed = many_lines(75, 5, **hidden)
    verdict = diagnose(to_and_fro(table), believed, diffuse=None, only=ASKED, advise=False).verdict
    assert bool(verdict.best_set) == bool(hidden)
    assert not [c for c in verdict.cautions if c.warns is Warns.LAGS]


def test_rows_in_one_direction_show_no_lag() -> None:
    """It is an offset there: rows that begin anew on the left have turns, which are left out."""
    table, believed = many_lines(75, 5)
    verdict = diagnose(
        replace(table, x_m=table.x_m + 0.005), believed, diffuse=None, only=ASKED, advise=False
    ).verdict
    assert verdict.best_set == ["beam_offset"]
    assert not [c for c in verdict.cautions if c.warns is Warns.LAGS]


@pytest.mark.parametrize("seed", range(4))
def test_places_in_random_order_show_no_lag(seed: int) -> None:
    """No rows, no motion to and fro. Of a third of them a lag of 1 to 14 mm did as well in 7 of 70 campaigns
    of others that had none: what is told rests on all."""
    table, believed = many_lines(75, 5, **{"water.gradient_per_m2": 0.01})
    order = np.random.default_rng(seed).permutation(75)
    mixed = replace(table.subset(order), time_s=10.0 * np.arange(75))
    verdict = diagnose(mixed, believed, diffuse=None, only=ASKED, advise=False).verdict
    assert verdict.best_set
    assert not [c for c in verdict.cautions if c.warns is Warns.LAGS]


def test_the_motion_goes_on_along_rows_and_nowhere_else() -> None:
    table, _ = many_lines(15, 3)
    way = directions(to_and_fro_of_three(table))
    assert way is not None
    assert way[0].tolist() == [0, 1, 1, 1, 0, 0, -1, -1, -1, 0, 0, 1, 1, 1, 0]
    assert not way[1:].any()
    assert directions(replace(table, time_s=np.full(15, np.nan))) is None
    assert directions(replace(table, time_s=np.zeros(15))) is None


def to_and_fro_of_three(table: Readings) -> Readings:
    order = np.arange(15).reshape(3, 5)
    order[1] = order[1, ::-1]
    return replace(table.subset(order.ravel()), time_s=np.arange(15.0))
