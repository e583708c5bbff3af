"""A lamp that departs from its formula sends scattered and reflected light that departs too.

The fast response knows a beam by smooth functions of the direction; a full trace of that very lamp does not.
"""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.experiments.layouts import scan
from lightfield.formula.field import direct_field
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.diffuse.response import DiffuseResponse
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene

HWHM = 4.5
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": HWHM},
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.1},
        "tank": {"wall_albedo": 0.3},
        "detector": {"width_m": 2.0},
    }
)


def flood(q: np.ndarray) -> np.ndarray:
    """A flat top with a wide, weak skirt; q is the angle over the half width."""
    top = (1 + np.exp(-1 / 0.16)) / (1 + np.exp((q - 1) / 0.16))
    return 0.93 * top + 0.07 * np.exp(-np.log(2) * (q / 3) ** 2)


def ringed(q: np.ndarray) -> np.ndarray:
    """A narrow core in a ring, but for a constant factor."""
    return 0.7 * np.exp(-np.log(2) * (q / 0.8) ** 2) + 0.3 * np.exp(-(((q - 1.1) / 0.45) ** 2))


@pytest.fixture(scope="module")
def places() -> Readings:
    return scan(SCENE, "line", "random", np.random.default_rng(0))


@pytest.fixture(scope="module")
def response(places: Readings) -> DiffuseResponse:
    return response_for(SCENE, places.x_m, places.y_m, places.z_m)


@pytest.mark.slow
@pytest.mark.parametrize("lamp", [flood, ringed])
@pytest.mark.parametrize("changed", [{"tank.wall_albedo": 0.0}, {}, {"lamp.offset_x_m": 0.05}])
def test_fast_light_of_a_departing_lamp_is_that_of_a_render(
    lamp, changed: dict[str, float], places: Readings, response: DiffuseResponse
) -> None:
    """Scattered and reflected, 40 % of all light here: within the errors of both, about one sigma."""
    theta = np.linspace(0, 20, 81)
    log = np.log(np.maximum(lamp(theta / HWHM), 1e-6)) + np.log(2) * (theta / HWHM) ** 2
    nodes = tuple(zip(theta.tolist(), np.clip(log, -7, 7).tolist(), strict=True))
    scene = SCENE.with_values({"lamp.profile_departure": nodes, **changed})
    fast, fast_error = response.evaluate(scene)
    _, smooth = response.errors(scene, [None], np.zeros(len(fast), int))
    light, error = rendered_light(scene, places, max_photons=1e6, rel_error=0.005)
    traced = light - direct_field(scene, places.x_m, places.y_m, places.z_m)
    z = (fast - traced) / np.sqrt(error**2 + fast_error**2 + smooth**2)
    assert np.mean(traced / light) > 0.3
    # Places that mirror each other share photons: of 105 some 30 are independent, the mean square of which
    # lies between these with 99.9 % probability.
    assert 0.3 < np.mean(z**2) < 2.1
    # The plain Gaussian's light is far from it.
    plain = response.evaluate(scene.with_values({"lamp.profile_departure": ()}))[0]
    assert np.mean(((plain - traced) / np.sqrt(error**2 + fast_error**2 + smooth**2)) ** 2) > 10
