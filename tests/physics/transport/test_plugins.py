"""The plugins in plain Mitsuba dictionaries, without anything else of this package."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from montecarlo import cell_average, chi_square_p, normal_scores

from lightfield.errors import RenderError
from lightfield.render.response.grid import Grid, cell_centres
from lightfield.scene import Lamp
from lightfield.scene.lamp.profile import relative_intensity

pytestmark = pytest.mark.usefixtures("backend")

A = 0.2


def scene(lamp: dict[str, Any], *planes: dict[str, Any], water: bool = True) -> Any:
    medium = {
        "type": "homogeneous",
        "id": "water",
        "sigma_t": {"type": "uniform", "value": A},
        "albedo": {"type": "uniform", "value": 0.0},
        "phase": {"type": "lightfield_phase"},
    }
    inside = {"medium": {"type": "ref", "id": "water"}} if water else {}
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "photon_tracer", "photons": 800_000},
        "water": medium,
        "lamp": {"type": "lightfield_lamp", **inside, **lamp},
        **{f"plane_{i}": {"type": "detector_plane", **plane} for i, plane in enumerate(planes)},
    })  # fmt: skip


def film(columns: int, rows: int) -> dict[str, Any]:
    return {"type": "hdrfilm", "width": columns, "height": rows, "rfilter": {"type": "box"}}


def test_maps_of_several_planes_in_any_order() -> None:
    """Closed form for a lamp turned aside, 3 W/sr on its axis; row 0 is the top, column 0 is -x."""
    lamp = Lamp(hwhm_deg=6.0, tilt_x_deg=4.0)
    size = {"width_m": 1.2, "height_m": 0.6, "film": film(12, 6)}
    loaded = scene(
        {"hwhm_deg": 6.0, "tilt_x_deg": 4.0, "intensity": 3.0}, {"z_m": 5.0, **size}, {"z_m": 3.0, **size}
    )

    def field(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        r, tilt = np.sqrt(x * x + y * y + z * z), np.radians(4.0)
        x_beam, z_beam = x * np.cos(tilt) - z * np.sin(tilt), x * np.sin(tilt) + z * np.cos(tilt)
        across = np.hypot(x_beam, y)
        theta = np.arctan2(across, z_beam)
        intensity = 3.0 * relative_intensity(lamp, theta * x_beam / across, theta * y / across)
        return intensity * np.exp(-A * r) * z / r**3

    for sensor, z in enumerate((5.0, 3.0)):
        image = np.array(mi.render(loaded, sensor=sensor, seed=3), np.float64)[::-1]
        assert image.shape == (6, 12, 2)
        grid = Grid(np.array([z]), cell_centres(1.2, 12), cell_centres(0.6, 6), 0.1, 0.1)
        scores = normal_scores(image[..., 0], cell_average(grid, field)[0], image[..., 1], batches=8)
        assert 0.001 < chi_square_p(scores) < 0.999


def test_a_detector_of_one_cell() -> None:
    """Small, on the axis, at 2 m: exp(-a r) / r^2, divided by the solid angle of a collimator.

    Over a cell of 1 mm the light is the same to 4e-6; single precision is 1e-6 of it.
    """
    small = {"z_m": 2.0, "width_m": 0.001, "film": film(1, 1)}
    for quantity, factor in {
        "irradiance": 1.0,
        "scalar_irradiance": 1.0,
        "radiance": 1 / (4 * np.pi * np.sin(np.radians(5.0)) ** 2),
    }.items():
        plane = small | {"quantity": quantity, "full_angle_deg": 20.0}
        value, error = np.array(mi.render(scene({"hwhm_deg": 5.0}, plane), seed=1), np.float64)[0, 0]
        assert error < 1e-5 * value
        assert abs(value - factor * np.exp(-A * 2.0) / 4.0) < 4 * error + 1e-5 * value


def test_scenes_that_cannot_be_traced() -> None:
    """Each says what is wrong and what to do."""
    plane = {"z_m": 2.0, "film": film(2, 2)}
    camera = {"type": "perspective", "film": film(2, 2)}
    wrong = {
        "not in water": scene({}, plane, water=False),
        "planes differ": scene({}, plane, plane | {"z_m": 3.0, "width_m": 1.0}),
        "detector planes only": scene({}, camera),
    }
    for message, loaded in wrong.items():
        with pytest.raises(RenderError, match=message):
            loaded.integrator().render(loaded)
