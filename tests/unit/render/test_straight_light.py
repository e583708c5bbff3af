"""Straight light in maps: formulas of the user's own on its path, and beams whose width has a colour."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.render.maps import render_scene, with_own_path
from lightfield.render.response.grid import scene_grid
from lightfield.scene import Scene

DETECTOR = {"planes_m": [1.0, 2.5], "width_m": 1.6, "pixels": 8}


def roped(width_m: float) -> Scene:
    """A rope that takes nine tenths of the light about x = 0.1 m."""
    effect = {
        "name": "rope", "family": "o", "stage": "path", "formula": "1 - depth*exp(-((x - x0)/width)**2)",
        "parameters": {
            "depth": {"unit": "1", "range": [0.0, 0.95], "neutral": 0.0, "value": 0.9},
            "x0": {"unit": "m", "range": [-0.5, 0.5], "value": 0.1},
            "width": {"unit": "m", "range": [0.02, 0.5], "value": width_m},
        },
    }  # fmt: skip
    return Scene.from_dict({"lamp": {"hwhm_deg": 12.0}, "detector": DETECTOR, "effect": [effect]})


@pytest.mark.parametrize("width_m", [0.05, 0.3])
def test_a_cell_behind_a_rope_holds_the_mean_of_what_is_left(width_m: float) -> None:
    """Of the light in it, over 400 x 40 places; cells are 0.2 m wide."""
    scene = roped(width_m)
    grid = scene_grid(scene)
    ones, none = np.ones((1, *grid.shape)), np.zeros((1, *grid.shape))
    left = with_own_path(scene, grid, np.array([525.0]), (ones, none), (ones, none))[0][0]
    for plane, z in zip(left, grid.z_m, strict=True):
        for column, x in enumerate(grid.x_m):
            at_x = x + 0.2 * ((np.arange(400) + 0.5) / 400 - 0.5)
            at_y = grid.y_m[3] + 0.2 * ((np.arange(40) + 0.5) / 40 - 0.5)
            across, up = np.meshgrid(at_x, at_y)
            angle = np.arctan(np.hypot(across, up) / z)
            light = 0.5 ** ((np.degrees(angle) / 12.0) ** 2) * np.cos(angle) ** 3
            rope = 1 - 0.9 * np.exp(-(((across - 0.1) / width_m) ** 2))
            assert plane[3, column] == pytest.approx((light * rope).sum() / light.sum(), abs=0.01)


def test_a_rope_leaves_the_noise_of_scattered_light_as_it_is() -> None:
    scene = roped(0.3)
    grid = scene_grid(scene)
    whole, straight = np.full((1, *grid.shape), 3.0), np.full((1, *grid.shape), 2.0)
    maps = whole, 0.05 * np.ones_like(whole)
    mean, error = with_own_path(scene, grid, np.array([525.0]), (straight, 0.03 * np.ones_like(whole)), maps)
    left = (mean - 1.0) / 2.0
    assert left.min() < 0.15
    np.testing.assert_allclose(error, np.hypot(0.03 * left, 0.04))


def test_a_beam_with_a_colour_has_errors_in_clear_water_too() -> None:
    """Where nothing was scattered its error is unknown, and of no account beside straight light."""
    scene = Scene.from_dict({
        "lamp": {"hwhm_deg": 10.0, "width_slope": 1.5}, "water": {"absorption_per_m": 0.1},
        "detector": {"planes_m": [2.0], "width_m": 2.0, "pixels": 10, "bands_nm": [[600, 640]]},
    })  # fmt: skip
    mean, error = render_scene(scene, max_photons=1e5, rel_error=0.1).maps()
    assert (error / mean < 0.01).all()
