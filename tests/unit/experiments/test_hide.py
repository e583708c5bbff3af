"""Hidden effects: readings are numbers, and the truth is a possible scene, also at the edges."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.experiments.hide import WINDOW_PART, draw_effect, true_scene
from lightfield.experiments.layouts import LAYOUTS, positions, scan
from lightfield.experiments.measure import Instrument, Light, measure
from lightfield.formula.field import direct_field
from lightfield.scene import Scene


def test_position_errors_where_no_light_arrives() -> None:
    """A beam of 1 degree, read up to 45 degrees off: its direct light underflows to 0; 0/0 is no reading."""
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 1.0}, "detector": {"planes_m": [1.0], "width_m": 2.0}})
    rng = np.random.default_rng(0)
    table = scan(scene, "line", "random", rng)
    light = direct_field(scene, table.x_m, table.y_m, table.z_m)
    assert (light == 0).any()
    readings, _ = measure(scene, table, Light(light), Instrument(position_m=0.001), rng)
    assert np.isfinite(readings.value).all()


def test_water_clearer_than_its_base_stays_possible() -> None:
    """Pure water absorbs 0.042 /m at 525 nm: a guess of 0.04 /m less must not become less than none."""
    scene = Scene.from_dict(
        {
            "water": {"base": "pure", "absorption_per_m": -0.04},
            "detector": {"planes_m": [4.5], "bands_nm": [[520, 530]]},
        }
    )
    for seed in range(8):
        assert -0.04 < true_scene(scene, {}, np.random.default_rng(seed)).water.absorption_per_m < 0


def test_a_form_of_an_effect_is_hidden_by_its_name() -> None:
    """The first form unless another is named."""
    scene, rng = Scene(), np.random.default_rng(0)
    table = scan(scene, "line", "random", rng)
    assert set(draw_effect(scene, table, "water_gradient", rng)) == {"water.gradient_per_m2"}
    assert "water.layer_absorption_per_m" in draw_effect(scene, table, "water_gradient:layer", rng)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_and_window_fit_a_small_tank(layout: str) -> None:
    """An aquarium of a tenth of the size: readings inside it, and a smaller window."""
    tank = {"width_m": 0.4, "depth_m": 0.4, "length_m": 1.2, "behind_lamp_m": 0.05, "lamp_depth_m": 0.2}
    detector = {"planes_m": [0.2, 0.4, 0.6, 0.8], "width_m": 0.3}
    scene = Scene.from_dict({"tank": tank, "detector": detector})
    table = scan(scene, layout, "random", np.random.default_rng(0))
    assert (np.abs(table.x_m) <= 0.15 + 1e-9).all() and (table.y_m < 0.2).all()
    assert table.z_m.min() >= 0.1 and table.z_m.max() <= 1.0 + 1e-9
    assert true_scene(scene, {}, np.random.default_rng(0)).lamp.radius_m == pytest.approx(WINDOW_PART * 0.2)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_positions_are_written_as_a_person_would(layout: str) -> None:
    """Neither 0.19999999999999996 nor -0.0 nor 1e-16 in a table that people read."""
    places = positions(Scene.from_dict({}), layout)
    for name in ("x_m", "y_m", "z_m"):
        for value in places[name].tolist():
            assert value == float(f"{value:.6g}") and not (value == 0 and np.signbit(value))


def test_what_the_render_does_not_know_is_stated_with_the_readings() -> None:
    """Light known to 1 %: the stated errors are 1 % larger in quadrature, the values the same."""
    scene = Scene.from_dict({"detector": {"planes_m": [4.5], "width_m": 1.0}})
    table = scan(scene, "line", "random", np.random.default_rng(0))
    light = direct_field(scene, table.x_m, table.y_m, table.z_m)
    known, guessed, instrument = Light(light), Light(light, 0.01 * light), Instrument(0.001)
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
