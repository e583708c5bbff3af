"""Advice: what a few readings more would show is what a fit to all of them then shows."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.plan import plan
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.verdict.advice import (
    FLOOR,
    REPEATS,
    PossiblePlaces,
    Way,
    best_places,
    error_curve,
    error_of_mean,
    of_place,
    possible_places,
)
from lightfield.fitting.forward import SceneForward
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
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


def test_a_place_that_is_off_is_off_for_all_repeats() -> None:
    """On the axis a reading g exp(-c z) / z^2 falls by itself times 2 / z + c per metre."""
    table, believed = readings()
    z = np.array([3.0, 7.0])
    there = SceneForward(believed, table).at(
        x_m=0 * z, y_m=0 * z, z_m=z, medium=np.array(["water", "water"]), time_s=0 * z
    )
    expected = 0.005 * 20 * np.exp(-0.12 * z) / z**2 * (2 / z + 0.12)
    assert of_place(Budget(0.0, 0.005, 0.0), there, {"gain": 20.0}) == pytest.approx(expected, rel=2e-3)


def test_what_bands_share_is_an_error_of_every_repeat() -> None:
    """Own noise of 0.003, scaled by two, and 0.02 of the reading that the bands of its spectrum share."""
    table, _ = readings()
    layout = replace(layout_of(table), common=np.full(len(table), 0.02))
    level = np.linspace(0.1, 1.0, len(table))
    noise = Noise(layout, np.full(len(table), 0.003), level, Budget(0.0, 0.0, 0.0), 0 * level)
    assert error_curve(noise, 2.0)(np.array([0.5])) == pytest.approx(np.hypot(0.003 * 2**0.5, 0.01), rel=1e-4)


def test_readings_beside_a_stated_gain_of_stays_part_as_fits_to_all_readings_do() -> None:
    """A source behind the lamp against a wide window: spots at one distance share the gain of one stay.

    What is true is known to its own errors, which the fits here leave out: a few per cent less is told.
    """
    believed = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.12}})
    truth = believed.with_values({"lamp.apparent_distance_m": 0.5, "lamp.hwhm_deg": 4.3})
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.6, 0.6, 9), [4.5, 5.5, 6.5, 7.5, 8.5]))
    rng, n = np.random.default_rng(1), len(x)
    value = direct_field(truth, x, 0 * x, z)
    value *= (1 + 0.02 * np.repeat(rng.standard_normal(5), 9)) / value.max()
    stderr = np.hypot(0.005 * value, 0.0008)
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value + stderr * rng.standard_normal(n), stderr=stderr,
        time_s=20.0 * np.arange(n), quantity="irradiance",
    )  # fmt: skip
    budget = replace(table.budget, plane_gain_percent=2.0, position_mm=0.0, tolerance_percent=0.0)
    made = diagnose(replace(table, budget=budget), believed, diffuse=None)
    advice = made.verdict.next_measurement
    assert advice is not None and advice.separation_predicted_sigma is not None
    spots = advice.readings
    columns = {
        axis: np.r_[getattr(table, axis), np.repeat([getattr(s, axis) for s in spots], REPEATS)]
        for axis in ("x_m", "y_m", "z_m")
    }
    every = Readings.from_arrays(
        **columns, value=np.ones(len(columns["x_m"])), stderr=np.ones(len(columns["x_m"])),
        time_s=20.0 * np.arange(len(columns["x_m"])), quantity="irradiance",
    )  # fmt: skip
    problem, noise = made.prepared.problem, made.prepared.noise
    forward = SceneForward(problem.forward.scene, every, full=problem.forward.reader.full)
    at = np.unique([one.z_m for one in spots], return_inverse=True)[1]
    stays = np.repeat(1 + problem.layout.visit.max() + at, REPEATS)
    spot = np.r_[np.full(n, -1), np.repeat(np.arange(len(spots)), REPEATS)]
    away = []
    for true, other in (made.finding.accepted[:2], made.finding.accepted[1::-1]):
        read = forward.predict(true.fit.values)
        sigma = np.interp(read, np.sort(noise.prediction), noise.sigma[np.argsort(noise.prediction)])
        sigma *= np.sqrt(made.finding.level.bench.phi) * np.maximum(read / noise.prediction.max(), 1)
        stay = np.r_[problem.layout.visit, stays]
        shared = np.outer(0.02 * read, 0.02 * read) * (stay[:, None] == stay)
        shared += np.outer(FLOOR * read, FLOOR * read) * ((spot[:, None] == spot) & (spot >= 0))
        factor = np.linalg.cholesky(shared + np.diag(sigma**2))
        there = replace(
            problem, forward=forward, layout=layout_of(every), value=read, keep=np.ones(forward.size)
        )
        fit = there.fit(other.explanation, partial(np.linalg.solve, factor), [other.fit.u])
        away.append(np.sqrt(fit.chi2))
    assert 0.85 * min(away) < advice.separation_predicted_sigma < 1.02 * min(away)
