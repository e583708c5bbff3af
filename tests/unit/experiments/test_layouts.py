"""Places of readings: inside the tank, in any tank, and written as a person would."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import UsageError
from lightfield.experiments.hide import WINDOW_PART, true_scene
from lightfield.experiments.layouts import LAYOUTS, places_of, positions, scan
from lightfield.readings import Readings
from lightfield.scene import Scene


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
@pytest.mark.parametrize("depth_m", [0.1, 0.5, 0.9])
def test_no_layout_leaves_the_water(layout: str, depth_m: float) -> None:
    """Whatever the lamp's depth, and with a last plane right before the wall."""
    tank = {"width_m": 1.2, "depth_m": 1.0, "length_m": 3.0, "behind_lamp_m": 0.3, "lamp_depth_m": depth_m}
    scene = Scene.from_dict({"tank": tank, "detector": {"planes_m": [0.5, 1.0, 1.5, 2.6]}})
    places = positions(scene, layout)
    assert scene.tank is not None
    for name, (low, high) in zip(("x_m", "y_m", "z_m"), scene.tank.box_m, strict=True):
        assert (places[name] >= low).all() and (places[name] <= high).all(), name
    assert places["z_m"].min() > 0


def test_positions_that_the_scene_lists_are_the_layout() -> None:
    listed = [[0.0, 0.1, 1.0], [0.2, 0.0, 1.5]]
    scene = Scene.from_dict({"detector": {"positions_m": listed}})
    places = positions(scene, "positions")
    assert np.stack([places[n] for n in ("x_m", "y_m", "z_m")], axis=1).tolist() == listed
    with pytest.raises(UsageError, match="single positions"):
        positions(scene, "line")
    nearest = true_scene(scene, {}, np.random.default_rng(0)).lamp.radius_m
    assert nearest == pytest.approx(WINDOW_PART * 1.0)


def test_every_place_of_a_table_is_one_of_its_layout_whatever_is_read_there() -> None:
    """One place in two colours, one twice in both, one in the second colour alone, one in no colour."""
    rows = [(1.0, 470), (1.0, 610), (2.0, 470), (2.0, 610), (2.0, 470), (2.0, 610), (1.5, 610), (3.0, np.nan)]
    z, colour = zip(*rows, strict=True)
    when = [0.0, 0.0, 20.0, 20.0, 40.0, 40.0, 60.0, 80.0]
    table = Readings.from_arrays(z_m=z, wavelength_nm=colour, time_s=when, value=np.ones(len(rows)))
    assert places_of(table)["z_m"].tolist() == [1.0, 2.0, 2.0, 1.5, 3.0]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_positions_are_written_as_a_person_would(layout: str) -> None:
    """Neither 0.19999999999999996 nor -0.0 nor 1e-16 in a table that people read."""
    places = positions(Scene.from_dict({}), layout)
    for name in ("x_m", "y_m", "z_m"):
        for value in places[name].tolist():
            assert value == float(f"{value:.6g}") and not (value == 0 and np.signbit(value))


def test_every_other_row_is_read_from_its_other_end() -> None:
    """One after the other along x; the places stay in the order in which they are listed."""
    scene = Scene.from_dict({"detector": {"planes_m": [4.5, 6.5]}})
    table = scan(scene, "grid", "rows", np.random.default_rng(0))
    places = positions(scene, "grid")
    assert (table.x_m == places["x_m"]).all() and (table.z_m == places["z_m"]).all()
    x = table.x_m[np.argsort(table.time_s)].reshape(-1, 7)
    assert (np.diff(x[::2], axis=1) > 0).all() and (np.diff(x[1::2], axis=1) < 0).all()
    assert (np.diff(table.z_m[np.argsort(table.time_s)]) >= 0).all()


def test_places_with_times_keep_them() -> None:
    """A rehearsal is of the drift that the plan was made for; another order is another rehearsal."""
    listed = Readings.from_arrays(
        x_m=[0.0, 0.1, 0.2], z_m=[2.0, 2.0, 3.0], value=np.ones(3), time_s=[60.0, 0.0, 30.0]
    )
    rng = np.random.default_rng(0)
    assert scan(Scene(), listed, "random", rng).time_s.tolist() == [60.0, 0.0, 30.0]
    assert scan(Scene(), listed, "plane", rng).time_s.tolist() == [0.0, 20.0, 40.0]
