"""Range of a lamp that does not point along its tank: about the beam's axis, and straight ahead."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.report.working_range import range_page
from lightfield.scene import Scene
from lightfield.studies.working_range.study import working_range
from lightfield.studies.working_range.text import as_text

HALF = np.radians(3.81)
C = 0.1


def scene(**parts) -> Scene:
    water = {"absorption_per_m": 0.05, "scattering_per_m": 0.05}
    return Scene.from_dict({"lamp": {"hwhm_deg": 3.81}, "water": water} | parts)


def test_the_spot_of_a_tilted_lamp_is_that_about_its_own_axis() -> None:
    """Light straight ahead stands beside it, and is said to be that; it was taken for the spot's middle."""
    tilt = np.radians(4.0)
    found = working_range(scene(lamp={"hwhm_deg": 3.81, "tilt_x_deg": 4.0}), None)
    z = 8.5

    def on(x: float) -> float:
        r, theta = np.hypot(x, z), np.arctan(x / z) - tilt
        return np.exp(-np.log(2) * (theta / HALF) ** 2) * z / r**3 * np.exp(-C * r)

    middle = z * np.tan(tilt)
    expected = brentq(lambda rho: on(middle + rho) - 0.5 * on(middle), 0.1, 2.0)
    assert float(found.dataset.half_radius_m.sel(z_m=z)) == pytest.approx(expected, rel=2e-3)
    ahead = (4.5 / z) ** 2 * np.exp(-C * (z - 4.5))
    assert float(found.dataset.light.sel(z_m=z)) == pytest.approx(ahead, rel=1e-6)
    assert "tilted by 4 and 0 degrees" in as_text(found) and "tilted by 4 and 0" in range_page(found)
    straight = as_text(working_range(scene(), None, to_m=12.0))
    assert "tilted" not in straight and "Asked from 4.5 to 12 m." in straight


def test_a_tilted_beam_is_followed_up_to_where_an_array_meets_a_side() -> None:
    """A beam of 10 degrees meets a wall at 1 m after 5.7 m: an array of 0.2 m stands there before that."""
    tank = {"width_m": 2.0, "depth_m": 2.0, "length_m": 20.0, "wall_albedo": 0.0, "surface": "none"}
    array = {"count": [3, 3], "size_m": 0.2, "radius_m": 0.5}
    tilted = scene(
        lamp={"hwhm_deg": 3.81, "tilt_x_deg": 10.0}, tank=tank, detector={"planes_m": [1.5, 3.0]}, array=array
    )
    far = float(working_range(tilted, None, to_m=12.0).dataset.z_m[-1])
    reach = np.hypot(0.1, 0.1)
    assert 1.0 - 1.5 * reach - 0.2 < far * np.tan(np.radians(10.0)) < 1.0 - reach
