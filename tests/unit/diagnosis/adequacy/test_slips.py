"""Readings set aside: named always, a finding where they lie together or are too many."""

from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from analytic_readings import readings
from scipy import stats
from toy_problem import Toy, candidate, layout, waves

from lightfield.diagnosis.adequacy import slips
from lightfield.diagnosis.adequacy.slips import FALSE_ALARM, structure
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.search import kept_readings, preparation
from lightfield.diagnosis.verdict.verdict import Verdict, json_schema
from lightfield.readings import Readings
from lightfield.scene import Scene

RATE = 0.02


def verdict_on(table, scene, **options) -> Verdict:
    return diagnose(table, scene, diffuse=None, advise=False, **options).verdict


def line():
    """21 places across, five planes: 105 readings in random order, and how bright they are."""
    layout = layout_of(readings(seed=1)[0])
    return layout, np.exp(-100 * layout.angle_rad**2) / layout.z_m**2


def found(rows, layout, light, sign=-1.0, rate=0.5):
    """Structure of these rows, all on one side of the model unless said otherwise."""
    struck = np.zeros(layout.size, bool)
    struck[rows] = True
    rng = np.random.default_rng(3)
    return structure(
        struck, sign * np.ones(layout.size), np.ones(layout.size, bool), layout, light, rate, rng
    )


@pytest.mark.parametrize("stated", [True, False])
def test_a_shadow_along_a_ray_is_a_structure_and_no_slip(stated: bool) -> None:
    """A quarter of the light is missing where x/z is about 0.07: 14 of 245 readings, up to 50 sigma off."""

    def shadow(table):
        return np.where(np.abs(table.x_m / table.z_m - 0.069) < 0.006, 0.75, 1.0)

    table, scene = readings(seed=1, layout="grid", factor=shadow)
    if not stated:
        table = replace(table, stderr=np.full(len(table), np.nan))
    verdict = verdict_on(table, scene)
    assert (verdict.verdict, verdict.unexplained_coordinate) == ("unexplained", "x/z")
    assert "x/z is 0.0667 to 0.0706" in verdict.sentence
    assert f"{len(verdict.outliers)} of 245 readings were set aside" in verdict.sentence
    assert all(one.off_sigma < -5 for one in verdict.set_aside)
    assert {round(one.x_m / one.z_m, 2) for one in verdict.set_aside} == {0.07}
    assert verdict.next_measurement is not None and verdict.next_measurement.readings[0].x_m > 0
    jsonschema.validate(json.loads(verdict.model_dump_json()), json_schema())


def test_effects_beside_readings_that_no_effect_reaches_are_a_part_of_the_answer() -> None:
    """A bubble passes the window: 6 readings in a row lose 40 %. The beam lies 3 cm aside, all the same."""

    def bubble(table):
        row = layout_of(table).order.argsort()
        return np.where((row >= 40) & (row < 46), 0.6, 1.0)

    hidden = {"lamp.offset_x_m": 0.03, "lamp.drift_per_hour": 0.1}
    table, scene = readings(hidden, seed=1, layout="grid", factor=bubble)
    verdict = verdict_on(table, scene, only=["beam_offset", "lamp_drift", "background", "beam_tilt"])
    assert (verdict.verdict, verdict.effects, verdict.explanations) == ("unexplained", [], [])
    assert "are no slips" in verdict.headline and verdict.unexplained_coordinate == "time"
    assert sorted(verdict.best_set) == ["beam_offset", "lamp_drift"]
    assert verdict.certain == verdict.simplest == [] and "beam_offset" in verdict.partial
    offset = next(one for one in verdict.found if one.effect == "beam_offset").parameters["lamp.offset_x_m"]
    assert offset.stderr is not None
    assert offset.value == pytest.approx(0.03, abs=3 * offset.stderr)
    first, last = verdict.ladder[0], verdict.ladder[-1]
    assert len(verdict.ladder) == 3 and first.error_percent is not None and last.error_percent is not None
    assert last.error_percent < 0.2 * first.error_percent
    assert "of the misfit of the others" in verdict.sentence and "Certain so far: " in verdict.sentence
    assert verdict.outliers == np.flatnonzero(bubble(table) < 1).tolist()
    jsonschema.validate(json.loads(verdict.model_dump_json()), json_schema())


def test_scattered_slips_are_slips_and_are_named() -> None:
    table, scene = readings(seed=7)
    value, struck = table.value.copy(), [3, 30, 61, 100]
    value[struck] += np.array([20, -15, 12, 25]) * table.stderr[struck]
    verdict = verdict_on(replace(table, value=value), scene)
    assert verdict.verdict == "none" and verdict.doubt is None
    assert verdict.outliers == struck
    assert "4 of 105 readings were set aside" in verdict.sentence
    far = verdict.set_aside[0]
    assert (far.row, far.reason) == (100, "outlier")
    assert far.off_sigma == pytest.approx(25, rel=0.3)
    assert f"x = {table.x_m[100]:.3g}" in verdict.sentence
    assert "and 1 more" in verdict.sentence


def test_saturated_readings_are_counted_too() -> None:
    table, scene = readings(seed=7)
    saturated = table.value > np.sort(table.value)[-3]
    verdict = verdict_on(replace(table, saturated=saturated), scene)
    assert "2 saturated readings were left out" in verdict.sentence
    assert [one.reason for one in verdict.set_aside] == ["saturated"] * 2
    assert verdict.set_aside[0].off_sigma is None


def test_neighbours_in_a_row_a_plane_or_in_time_are_a_structure() -> None:
    layout, light = line()
    row = np.flatnonzero(layout.z_m == 5.5)[np.argsort(layout.x_m[layout.z_m == 5.5])][8:12]
    assert found(row, layout, light).coordinate == "place"
    plane = np.flatnonzero(layout.z_m == 6.5)[[0, 3, 5, 8, 11, 13, 16, 18, 20]]
    assert found(plane, layout, light).coordinate == "plane"
    soon = np.argsort(layout.time_s)[40:45]
    assert found(soon, layout, light).coordinate == "time"
    brightest = np.argsort(light)[-5:]
    assert found(brightest, layout, light) is not None


def test_slips_of_all_colours_at_one_moment_are_one_slip() -> None:
    """Five wavelengths are read at once: a bubble spoils five readings."""
    table, _ = readings(seed=1)
    many = table.subset(np.repeat(np.arange(len(table)), 5))
    waves = np.tile([450.0, 500.0, 550.0, 600.0, 650.0], len(table))
    layout = layout_of(replace(many, wavelength_nm=waves))
    light = np.ones(layout.size)
    assert found(np.r_[50:55, 300:305], layout, light, rate=RATE) is None
    assert found(np.arange(2, 125, 5), layout, light).coordinate is not None


def spectra():
    """Seven wavelengths at each of 25 places: 175 readings."""
    table, _ = readings(seed=1)
    waves = np.linspace(400.0, 700.0, 7)
    many = table.subset(np.repeat(np.random.default_rng(2).permutation(len(table))[:25], len(waves)))
    layout = layout_of(replace(many, wavelength_nm=np.tile(waves, 25)))
    return layout, np.ones(layout.size)


def test_slips_of_single_colours_are_no_more_than_slips_explain(monkeypatch) -> None:
    """Of 100 tables with the assumed rate of slips, each on one reading, as many are called too many as the
    level says (5 %; limit of 99.9 %); four times the rate is."""
    monkeypatch.setattr(slips, "FALSE_ALARM", 0.05)
    monkeypatch.setattr(slips, "PERMUTATIONS", 199)
    layout, light = spectra()
    rng = np.random.default_rng(4)
    alarms = 0
    for _ in range(100):
        rows = np.flatnonzero(rng.random(layout.size) < RATE)
        made = found(rows, layout, light, rng.choice([-1.0, 1.0], layout.size), rate=RATE)
        alarms += made is not None and made.coordinate is None
    assert alarms <= stats.binom.isf(0.001, 100, 0.05)
    rows = rng.permutation(layout.size)[: int(4 * RATE * layout.size)]
    many = found(rows, layout, light, rng.choice([-1.0, 1.0], layout.size), rate=RATE)
    assert many is not None and many.coordinate is None


def test_more_than_slips_explain_are_a_structure() -> None:
    """Eleven scattered ones of 105, where 2 % are assumed or 20 % are stated."""
    layout, light = line()
    rng = np.random.default_rng(1)
    rows = rng.permutation(layout.size)[:11]
    sign = rng.choice([-1.0, 1.0], layout.size)
    many = found(rows, layout, light, sign, rate=RATE)
    assert many is not None and many.coordinate is None
    assert many.chance == pytest.approx(stats.binom.sf(10, 105, RATE))
    assert found(rows, layout, light, sign, rate=0.2) is None


def _alarms(sets: int) -> int:
    """How often so many readings at random places are called a structure."""
    layout, light = line()
    rng = np.random.default_rng(5)
    alarms = 0
    for k in range(sets):
        rows = rng.permutation(layout.size)[: 3 + k % 6]
        alarms += found(rows, layout, light, rng.choice([-1.0, 1.0], layout.size)) is not None
    return alarms


def test_places_at_random_are_rarely_a_structure(monkeypatch) -> None:
    """At a level of 5 %, so that a few dozen sets can tell; within the limits of 99.9 %."""
    monkeypatch.setattr(slips, "FALSE_ALARM", 0.05)
    monkeypatch.setattr(slips, "PERMUTATIONS", 199)
    assert _alarms(100) <= stats.binom.isf(0.001, 100, 0.05)


@pytest.mark.slow
def test_places_at_random_are_called_a_structure_at_the_stated_level() -> None:
    assert _alarms(3000) <= stats.binom.isf(0.001, 3000, FALSE_ALARM)


def test_a_reading_that_the_fit_meets_is_not_set_aside(monkeypatch) -> None:
    """A rich model that a slip leads astray calls the slip's neighbour an outlier, too: it is taken back, and
    the fit is that of all readings but the slip."""
    lay = layout(5, 24)
    toy = Toy.of([candidate("odd")], {"odd": waves(lay)["odd"]}, lay)
    problem = toy.drawn(np.random.default_rng(1))
    slip, neighbour = 40, 41
    value = problem.value.copy()
    value[slip] += 20 * toy.sigma[slip]
    value[neighbour] = toy.base[neighbour]
    problem = toy.with_value(value)
    both = np.isin(np.arange(lay.size), [slip, neighbour])
    monkeypatch.setattr(kept_readings, "outliers", lambda residual, basis, keep: both & (keep > 0))
    prepared = preparation.prepare_problem(
        problem, toy.sigma, Budget(0.0, 0.0, 0.0), np.random.default_rng(0)
    )
    assert np.flatnonzero(prepared.problem.keep == 0).tolist() == [slip]
    own = np.stack([problem.forward.columns[path] for path in ("level", "slope")]) / toy.sigma
    rest = np.delete(own, slip, axis=1).T, np.delete(value / toy.sigma, slip)
    found = np.linalg.lstsq(*rest, rcond=None)[0]
    np.testing.assert_allclose(prepared.reference.u, found, atol=0.2 * toy.sigma.min())


def test_errors_in_the_place_of_stated_ones_are_not_doubted_again(monkeypatch) -> None:
    """Whose scatter is never as any law says (readings beside their places): one law is found, and an end."""
    lay, asked = layout(5, 24), list[int]()
    toy = Toy.of([candidate("odd")], {"odd": waves(lay)["odd"]}, lay)

    def never_right(kept: object) -> np.ndarray:
        asked.append(1)
        return 2.0 * toy.sigma

    monkeypatch.setattr(preparation, "_law", never_right)
    prepared = preparation.prepare_problem(
        toy.drawn(np.random.default_rng(1)), toy.sigma, Budget(0.0, 0.0, 0.0), np.random.default_rng(0)
    )
    assert prepared.doubted and len(asked) <= 3


@pytest.mark.parametrize("seed", [1, 6, 7])
def test_what_stands_a_millimetre_beside_its_place_is_no_slip(seed: int) -> None:
    """Near a narrow beam light falls by a per cent in a millimetre, thrice the error of a reading: such
    readings were set aside though they were met within their errors, and the rest scattered too little."""
    rng = np.random.default_rng(seed)
    planes = (0.7, 1.1, 1.5, 1.9, 2.4)
    places = [(x, 0.0, z) for z in planes for x in np.linspace(-0.35, 0.35, 15)]
    places += [(0.0, y, z) for z in planes for y in np.linspace(-0.3, 0.3, 7)]
    place = np.array(places)[rng.permutation(len(places))].T

    def light(x, y, z):
        far = np.sqrt(x**2 + y**2 + z**2)
        beam = np.exp(-np.log(2) * (np.degrees(np.arccos(z / far)) / 8) ** 2)
        return beam * np.exp(-0.3 * far) * z / far**3

    value = light(*(place + 0.001 * rng.standard_normal(place.shape))) / light(0, 0, 0.7)
    sigma = np.hypot(0.003 * value, 3e-4)
    value = value + sigma * rng.standard_normal(len(value))
    table = Readings.from_arrays(
        x_m=place[0], y_m=place[1], z_m=place[2], value=value, stderr=sigma, scale="relative",
        time_s=15.0 * np.arange(len(value)), plane_gain_percent=0.0, position_mm=1.0,
    )  # fmt: skip
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 8.5}, "water": {"absorption_per_m": 0.25}})
    verdict = verdict_on(table, scene)
    assert verdict.verdict == "none"
    assert all(abs(one.off_sigma) > 2 for one in verdict.set_aside)


def test_what_is_near_the_limit_does_not_hang_on_the_random_numbers() -> None:
    """Five readings near each other in a plane: a chance of 0.0018, for a limit of 0.003."""
    every, light = line()
    struck = np.isin(np.arange(every.size), [23, 25, 31, 32, 33])
    args = struck, -np.ones(every.size), np.ones(every.size, bool), every, light, 0.5
    told = [structure(*args, np.random.default_rng(seed)) for seed in range(12)]
    assert all(one is not None and one.coordinate == "place" for one in told)
