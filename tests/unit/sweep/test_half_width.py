"""The half width of a noisy spot and its stated error, against spots made with known noise."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.render.response.grid import Grid, cell_centres
from lightfield.scene import Lamp
from lightfield.sweep.derived import derive, half_width


@pytest.mark.parametrize(("pixels", "width_m"), [(65, 0.45), (65, 0.7), (33, 0.45), (21, 0.7)])
@pytest.mark.parametrize("noise", [0.005, 0.02, 0.05])
def test_stated_error_covers_the_scatter_of_simulated_spots(
    pixels: int, width_m: float, noise: float
) -> None:
    """60 Gaussian spots with Poisson-like noise: bias under 1 %, scatter 0.5 to 1.3 of the stated error."""
    c = cell_centres(2.0, pixels)
    grid = Grid(np.array([5.0]), c, c, 2 / pixels, 2 / pixels)
    spot = np.exp(-np.log(2) * (c[:, None] ** 2 + c**2) / width_m**2)
    stderr, rng = noise * np.sqrt(spot), np.random.default_rng(0)
    runs = [
        half_width(np.maximum(spot + stderr * rng.standard_normal(spot.shape), 0), stderr, grid)
        for _ in range(60)
    ]
    found, stated, _ = np.array(runs).T
    assert found.mean() == pytest.approx(width_m, rel=0.01)
    assert 0.5 < found.std() / np.sqrt((stated**2).mean()) < 1.3


def test_no_spot_no_width() -> None:
    grid = Grid(np.array([5.0]), cell_centres(1.0, 9), cell_centres(1.0, 9), 1 / 9, 1 / 9)
    assert np.isnan(half_width(np.zeros((9, 9)), np.zeros((9, 9)), grid).m)
    flat = np.ones((9, 9))
    assert np.isnan(half_width(flat, 0.01 * flat, grid).m)  # half of the maximum lies beyond the edge


def test_mirror_images_share_one_error() -> None:
    """Four cells that are one estimate: the error of their sum is four times that of one, not twice."""
    c = cell_centres(1.0, 2)
    grid = Grid(np.array([5.0]), c, c, 0.5, 0.5)
    mean, stderr = np.ones((1, 1, 2, 2)), np.full((1, 1, 2, 2), 0.1)
    alone = derive(mean, stderr, None, grid, Lamp())
    together = derive(mean, stderr, None, grid, Lamp(), np.zeros((1, 2, 2), int))
    assert alone["plane_power_stderr"][0, 0] == pytest.approx(0.25 * 0.2)
    assert together["plane_power_stderr"][0, 0] == pytest.approx(0.25 * 0.4)
    assert together["on_axis_stderr"][0, 0] == pytest.approx(0.1)
    assert alone["on_axis_stderr"][0, 0] == pytest.approx(0.05)


def test_on_the_axis_is_on_that_of_the_lamp() -> None:
    """0.15 m aside and 2 degrees to the left: at 5 m over the middle cell; a lamp beside the plane."""
    c = cell_centres(1.5, 5)
    grid = Grid(np.array([2.0, 5.0, 20.0]), c, c, 0.3, 0.3)
    mean = np.arange(75.0).reshape(1, 3, 5, 5)
    lamp = Lamp(offset_x_m=0.17, offset_y_m=0.3, tilt_x_deg=-2.0)
    found = derive(mean, 0.1 * mean, 2 * mean, grid, lamp)
    # At x = 0.100, -0.005, -0.528 and y = 0.3: row 3, columns 2, 2 and 0.
    np.testing.assert_allclose(found["on_axis"], [[17.0, 42.0, 65.0]])
    np.testing.assert_allclose(found["on_axis_stderr"], [[1.7, 4.2, 6.5]])
    np.testing.assert_allclose(found["formula_error_axis"], [[1.0, 1.0, 1.0]])
    beyond = derive(mean, 0.1 * mean, 2 * mean, grid, Lamp(offset_y_m=0.76))
    assert np.isnan(beyond["on_axis"]).all() and np.isnan(beyond["formula_error_axis"]).all()
    assert np.isfinite(beyond["plane_power"]).all()
