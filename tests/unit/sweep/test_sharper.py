"""What is told of a map of coarse cells is what the light is at places: a spot of 10 cm in cells of 17.

Expected: the field at the axis, and its half width by bisection. The map is its mean over cells, by sums over
a grid of its own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.render.response.grid import Grid, scene_grid
from lightfield.scene import Scene
from lightfield.scene.bands import over_bands
from lightfield.studies.compare.maps import closed_form, compare_plane
from lightfield.sweep.derived import GridFormula, at_places, derive, straight_widths_m

Light = Callable[[np.ndarray, np.ndarray], np.ndarray]
FINE = 24


def scene(pixels: int, hwhm_deg: float) -> Scene:
    return Scene.from_dict(
        {
            "lamp": {"hwhm_deg": hwhm_deg},
            "water": {"absorption_per_m": 0.1},
            "detector": {"planes_m": [2.0], "width_m": 4.0, "pixels": pixels},
        }
    )


def means(field: Light, grid: Grid) -> np.ndarray:
    """Over each cell, shape (n_y, n_x)."""
    part = (np.arange(FINE) + 0.5) / FINE - 0.5
    x = np.add.outer(grid.x_m, part * grid.pitch_x_m).ravel()
    y = np.add.outer(grid.y_m, part * grid.pitch_y_m).ravel()
    light = field(*np.meshgrid(x, y))
    return np.asarray(light.reshape(len(grid.y_m), FINE, len(grid.x_m), FINE).mean(axis=(1, 3)))


def half_width_m(field: Light) -> float:
    def over_half(x: float) -> float:
        return float(field(np.array([x]), np.zeros(1))[0] / field(np.zeros(1), np.zeros(1))[0] - 0.5)

    return float(brentq(over_half, 1e-3, 1.5))


@pytest.mark.parametrize(
    ("pixels", "hwhm_deg", "halo"),
    [
        (24, 3.0, 0.0),
        (25, 6.0, 0.0),
        pytest.param(65, 3.0, 0.0, marks=pytest.mark.slow),
        pytest.param(65, 9.0, 0.0, marks=pytest.mark.slow),
        (65, 3.0, 0.3),
        pytest.param(65, 9.0, 0.3, marks=pytest.mark.slow),
    ],
)
def test_axis_and_width_are_those_of_the_light_itself(pixels: int, hwhm_deg: float, halo: float) -> None:
    """Also where scattered light, wider by half, lies over the straight light, in cells of half of its width
    and less: of its own blur nothing is known."""
    one = scene(pixels, hwhm_deg)
    grid, spectrum = scene_grid(one), over_bands(one)
    wide = 1.5 * 2.0 * np.tan(np.radians(hwhm_deg))

    def field(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        straight = closed_form(one, x, y, np.full_like(x, 2.0), spectrum_of_the_band)
        on_axis = closed_form(one, *(np.zeros(1), np.zeros(1), np.full(1, 2.0)), spectrum_of_the_band)
        return np.asarray(straight + halo * on_axis * np.exp(-np.log(2) * (x * x + y * y) / wide**2))

    spectrum_of_the_band = type(spectrum)(*(v[0] for v in spectrum))
    mean = means(field, grid)
    formula = GridFormula.of(one, grid)
    assert formula is not None
    maps = formula.bands(one)
    places = at_places(one, grid.z_m, straight_widths_m(one, grid))
    found = derive(mean[None, None], 1e-6 * mean[None, None], maps, grid, one.lamp, None, places)
    axis, width = float(field(np.zeros(1), np.zeros(1))[0]), half_width_m(field)
    plane = compare_plane(525.0, 2.0, grid.x_m, grid.y_m, mean, 1e-6 * mean, maps[0, 0]).sharpened(
        lambda x, y: closed_form(one, x, y, np.full_like(x, 2.0), spectrum_of_the_band)
    )
    plain = derive(mean[None, None], 1e-6 * mean[None, None], maps, grid, one.lamp)
    told = {"on_axis": (axis, plane.axis.render[0]), "half_width": (width, plane.render_spot.hwhm_m)}
    for name, (true, of_plane) in told.items():
        stated = float(found[f"{name}_stderr"][0, 0])
        for value in (found[name][0, 0], of_plane):
            assert value == pytest.approx(true, rel=4e-3, abs=stated), name
        assert pixels > 60 or abs(plain[name][0, 0] / true - 1) > 0.02, name
    straight = float(closed_form(one, *(np.zeros(1), np.zeros(1), np.full(1, 2.0)), spectrum_of_the_band)[0])
    assert found["formula_error_axis"][0, 0] == pytest.approx(straight / axis - 1, abs=4e-3)
    assert plane.axis_error == pytest.approx(found["formula_error_axis"][0, 0], abs=1e-6)
