"""Readings taken to and fro whose places lag behind the motion: a slow detector, or play in the stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from analytic_readings import many_lines

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings

#: A lag, and effects that a scan to and fro with one was taken for, and such as it is not like.
ASKED = ["lag", "lamp_drift", "water_gradient", "background", "beam_offset"]


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


def test_a_lag_is_named_with_its_size() -> None:
    """2 mm in rows that alternate were "lamp drift", certain, with a warm-up of 588 +- 700 s."""
    table, believed = many_lines(75, 5)
    verdict = diagnose(to_and_fro(table, 0.005), believed, diffuse=None, only=ASKED, advise=False).verdict
    assert verdict.best_set == ["lag"]
    found = verdict.explanations[0].parameters["detector.lag_m"]
    assert found.stderr is not None and found.value == pytest.approx(0.005, abs=3 * found.stderr)
    assert found.stderr < 0.0006


def test_a_lag_beside_others_leaves_them_right() -> None:
    table, believed = many_lines(75, 5, **{"lamp.offset_x_m": 0.02})
    verdict = diagnose(to_and_fro(table, 0.004), believed, diffuse=None, only=ASKED, advise=False).verdict
    assert set(verdict.best_set) == {"lag", "beam_offset"}
    for path, true in (("lamp.offset_x_m", 0.02), ("detector.lag_m", 0.004)):
        found = verdict.explanations[0].parameters[path]
        assert found.stderr is not None and found.value == pytest.approx(true, abs=4 * found.stderr)


@pytest.mark.parametrize("hidden", [{"water.gradient_per_m2": 0.02}, {"lamp.offset_x_m": 0.005}, {}])
def test_what_is_no_lag_is_not_called_so(hidden: dict[str, float]) -> None:
    """An offset is the same whichever way the stage runs."""
    table, believed = many_lines(75, 5, **hidden)
    verdict = diagnose(to_and_fro(table), believed, diffuse=None, only=ASKED, advise=False).verdict
    assert bool(verdict.best_set) == bool(hidden) and "lag" not in verdict.best_set


def test_rows_in_one_direction_show_no_lag() -> None:
    """It is an offset there."""
    table, believed = many_lines(75, 5)
    moved = replace(table, x_m=table.x_m + 0.005)
    verdict = diagnose(moved, believed, diffuse=None, only=ASKED, advise=False).verdict
    assert verdict.best_set == ["beam_offset"] and "lag" in verdict.untestable
