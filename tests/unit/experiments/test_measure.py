"""Readings are numbers, also at the edges, and their errors are stated."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.experiments.layouts import scan
from lightfield.experiments.measure import Instrument, LightAtReadings, measure
from lightfield.formula.field import direct_field
from lightfield.scene import Scene


def test_position_errors_where_no_light_arrives() -> None:
    """A beam of 1 degree, read up to 45 degrees off: its direct light underflows to 0; 0/0 is no reading."""
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 1.0}, "detector": {"planes_m": [1.0], "width_m": 2.0}})
    rng = np.random.default_rng(0)
    table = scan(scene, "line", "random", rng)
    light = direct_field(scene, table.x_m, table.y_m, table.z_m)
    assert (light == 0).any()
    readings, _ = measure(scene, table, LightAtReadings(light), Instrument(position_m=0.001), rng)
    assert np.isfinite(readings.value).all()


def test_what_the_render_does_not_know_is_stated_with_the_readings() -> None:
    """Light known to 1 %: the stated errors are 1 % larger in quadrature, the values the same."""
    scene = Scene.from_dict({"detector": {"planes_m": [4.5], "width_m": 1.0}})
    table = scan(scene, "line", "random", np.random.default_rng(0))
    light = direct_field(scene, table.x_m, table.y_m, table.z_m)
    known, guessed, instrument = (
        LightAtReadings(light),
        LightAtReadings(light, 0.01 * light),
        Instrument(0.001),
    )
    sure, clean = measure(scene, table, known, instrument, np.random.default_rng(1))
    unsure, _ = measure(scene, table, guessed, instrument, np.random.default_rng(1))
    assert (known.relative_error == 0).all() and guessed.relative_error == pytest.approx(0.01)
    assert unsure.value == pytest.approx(sure.value)
    assert np.sqrt(unsure.stderr**2 - sure.stderr**2) == pytest.approx(0.01 * clean, rel=1e-6)


def test_an_error_budget_states_the_errors_that_there_are() -> None:
    """In the units of the table's head, and nothing of what the instrument does not do."""
    table = scan(Scene(), "line", "random", np.random.default_rng(0))
    budget = Instrument(plane_gain=0.003, position_m=0.002).stated(table).budget
    assert (budget.plane_gain_percent, budget.position_mm) == (pytest.approx(0.3), pytest.approx(2.0))
    assert Instrument().stated(table).budget == table.budget


def test_a_displaced_reading_moves_by_its_direct_light() -> None:
    """Nine tenths of the light are scattered, and vary over longer ways: a stage that is off moves a reading
    by a tenth of what it does in clear water."""
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 6.0}, "detector": {"planes_m": [1.5], "width_m": 0.8}})
    table = scan(scene, "line", "random", np.random.default_rng(0))
    direct = direct_field(scene, table.x_m, table.y_m, table.z_m)

    def read(light: np.ndarray, position_m: float) -> np.ndarray:
        instrument = Instrument(noise=1e-9, position_m=position_m)
        readings, clean = measure(scene, table, LightAtReadings(light), instrument, np.random.default_rng(1))
        return readings.value / clean

    clear, murky = (read(light, 0.001) - read(light, 1e-12) for light in (direct, 10 * direct))
    assert np.abs(clear).max() > 0.003
    np.testing.assert_allclose(murky, 0.1 * clear, atol=1e-5)
