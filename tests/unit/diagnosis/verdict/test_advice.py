"""Advice: what a few readings more would show is what a fit to all of them then shows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.plan import plan
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.verdict.advice import (
    FLOOR,
    REPEATS,
    PossiblePlaces,
    Way,
    best_places,
    error_of_mean,
    possible_places,
)
from lightfield.scene import Scene


def straight_lines(own: float) -> tuple[list[Way], PossiblePlaces, np.ndarray]:
    """A parabola is true, straight lines are fitted: readings at ten places up to 1, possible ones to 2."""
    here, there = np.linspace(0, 1, 10), np.linspace(0, 2, 21)
    sigma = 0.05
    lines = np.stack([np.ones_like(here), here], axis=1) / sigma
    fitted = np.linalg.lstsq(lines, here**2 / sigma, rcond=None)[0]
    now = float(((here**2 - fitted[0] - fitted[1] * here) ** 2).sum() / sigma**2)
    error = error_of_mean(np.full(21, sigma), np.zeros(21), np.full(21, own))
    slopes = np.stack([np.ones_like(there), there], axis=1) / error[:, None]
    difference = (there**2 - fitted[0] - fitted[1] * there) / error
    way = Way(now, difference, slopes, lines.T @ lines)
    places = PossiblePlaces(np.zeros(21), np.zeros(21), there, np.zeros(21))
    return [way, way], places, here


@pytest.mark.parametrize("own", [0.0, 0.03, 0.2])
def test_predicted_separation_is_that_of_the_fit_to_all_readings(own: float) -> None:
    """Repeats beat the noise and not `own`: chi-square of the best straight line through everything."""
    ways, places, here = straight_lines(own)
    advice = best_places(ways, places)
    at = advice.places.z_m
    every = np.concatenate([here, at])
    sigma = np.concatenate([np.full(10, 0.05), np.sqrt(0.05**2 / REPEATS + own**2) * np.ones(len(at))])
    line = np.polyfit(every, every**2, 1, w=1 / sigma)
    chi2 = (((every**2 - np.polyval(line, every)) / sigma) ** 2).sum()
    assert advice.predicted_sigma == pytest.approx(np.sqrt(chi2), rel=1e-6)
    assert advice.now_sigma < advice.predicted_sigma


def test_an_error_that_repeats_do_not_beat_takes_the_separation_away() -> None:
    """Without it the parabola is seen far out; with one as large as the difference it is hardly seen."""
    clean, blurred = (best_places(*straight_lines(own)[:2]).predicted_sigma for own in (0.0, 1.0))
    assert clean > 3 * blurred


def test_no_number_of_repeats_beats_the_floor() -> None:
    """0.25 % of the reading, and the error of the light's response, stay."""
    error = error_of_mean(np.zeros(1), np.array([2.0]), np.array([0.003]))
    assert error[0] == pytest.approx(np.hypot(2 * FLOOR, 0.003))


def test_spots_are_not_one_place_in_a_small_tank() -> None:
    """All possible places within 2 cm of each other are one; the same tank ten times as large has three."""
    for size, count in ((0.01, 1), (1.0, 3)):
        ways, places, _ = straight_lines(0.0)
        near = PossiblePlaces(places.x_m, places.y_m, 1.0 + size * places.z_m / 2, places.air)
        assert len(best_places(ways, near).places.z_m) == count


def test_beside_a_lamp_close_to_the_floor_the_places_that_were_read_are_left() -> None:
    """A centimetre above it nothing else is far enough from a wall, and a plan still has its say."""
    table, believed = readings()
    tank = {"width_m": 4.0, "depth_m": 1.01, "length_m": 12.0, "lamp_depth_m": 1.0}
    low = Scene.from_dict({**believed.model_dump(exclude_unset=True), "tank": tank})
    made = plan(table, low)
    read = {tuple(place) for place in np.stack([table.x_m, table.y_m, table.z_m], axis=1).tolist()}
    for helpful in made.helpful:
        spots = helpful.advice.places
        assert {*zip(spots.x_m.tolist(), spots.y_m.tolist(), spots.z_m.tolist(), strict=True)} <= read
    assert made.limits and made.isolability.names
    layout = SimpleNamespace(layout=layout_of(table))
    places = possible_places(cast(Any, layout), low.tank)
    assert {*zip(places.x_m.tolist(), places.y_m.tolist(), places.z_m.tolist(), strict=True)} == read
    assert len(possible_places(cast(Any, layout), None).x_m) > len(read)
