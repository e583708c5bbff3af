"""A lamp that departs from its formula sends scattered and reflected light that departs too.

The fast response knows a beam by smooth functions of the direction; a full trace of that very lamp does not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from beams import flood
from montecarlo import keeps_its_rate, least_p
from scipy import stats

from lightfield.experiments.layouts import scan
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.diffuse.diffuse_response import DiffuseResponse
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.source import PHOTONS, response_for
from lightfield.render.settings import BATCHES
from lightfield.render.tracer.accumulate import DIRECTION_BATCHES
from lightfield.scene import Scene

Lamp = Callable[[np.ndarray], np.ndarray]

HWHM = 4.5
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": HWHM},
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.1},
        "tank": {"wall_albedo": 0.3},
        "detector": {"width_m": 2.0},
    }
)


def ringed(q: np.ndarray) -> np.ndarray:
    """A narrow core in a ring, but for a constant factor."""
    return 0.7 * np.exp(-np.log(2) * (q / 0.8) ** 2) + 0.3 * np.exp(-(((q - 1.1) / 0.45) ** 2))


@pytest.fixture(scope="module")
def places() -> Readings:
    return scan(SCENE, "line", "random", np.random.default_rng(0))


def traced(places: Readings, photons: int = PHOTONS, seed: int = 0) -> DiffuseResponse:
    """The fast response."""
    return response_for(
        SCENE, places.x_m, places.y_m, places.z_m, photons=photons, seed=seed, keeper=Keeper(cache=False)
    )


@pytest.fixture(scope="module")
def response(places: Readings) -> DiffuseResponse:
    return traced(places)


def departing(lamp: Lamp, changed: dict[str, float]) -> Scene:
    theta = np.linspace(0, 20, 81)
    log = np.log(np.maximum(lamp(theta / HWHM), 1e-6)) + np.log(2) * (theta / HWHM) ** 2
    nodes = tuple(zip(theta.tolist(), np.clip(log, -7, 7).tolist(), strict=True))
    return SCENE.with_values({"lamp.profile_departure": nodes, **changed})


class Beside(NamedTuple):
    """Fast light beside that of a render: difference, and errors of both; the render's part of all light."""

    away: np.ndarray
    own: np.ndarray
    smooth: np.ndarray
    error: np.ndarray
    part: np.ndarray

    def p(self) -> float:
        """Probability of a larger difference at the place that differs most."""
        own, error = (self.own, DIRECTION_BATCHES - 1), (self.error, BATCHES - 1)
        return least_p(self.away, own, error, (self.smooth, np.inf))

    def mean_square(self) -> float:
        """Of the differences, in all that is stated."""
        return float(np.mean(self.away**2 / (self.own**2 + self.smooth**2 + self.error**2)))


def beside(
    response: DiffuseResponse, scene: Scene, places: Readings, photons: float = 1e6, seed: int = 1
) -> Beside:
    """The response's light of a scene beside a render of it."""
    fast, own = response.evaluate(scene)
    _, smooth = response.errors(scene, [None], np.zeros(len(fast), int))
    light, error = rendered_light(scene, places, max_photons=photons, rel_error=0.005, seed=seed)
    diffuse = light - direct_field(scene, places.x_m, places.y_m, places.z_m)
    return Beside(fast - diffuse, own, smooth, error, diffuse / light)


CHANGED: list[dict[str, float]] = [{"tank.wall_albedo": 0.0}, {}, {"lamp.offset_x_m": 0.05}]


@pytest.mark.slow
@pytest.mark.parametrize("lamp", [flood, ringed])
@pytest.mark.parametrize("changed", CHANGED)
def test_fast_light_of_a_departing_lamp_is_that_of_a_render(
    lamp: Lamp, changed: dict[str, float], places: Readings, response: DiffuseResponse
) -> None:
    """Scattered and reflected, 40 % of all light here: within the errors of both, about one sigma."""
    scene = departing(lamp, changed)
    found = beside(response, scene, places)
    assert np.mean(found.part) > 0.3
    assert found.p() > 0.001
    # Places that mirror each other share photons: of 105 some 30 are independent.
    low, high = stats.chi2.ppf([0.001, 0.999], 30) / 30
    assert low < found.mean_square() < high
    # The plain Gaussian's light is far from it.
    plain = response.evaluate(scene.with_values({"lamp.profile_departure": ()}))[0]
    fast = response.evaluate(scene)[0]
    assert found._replace(away=found.away + plain - fast).mean_square() > 10


@pytest.mark.slow
@pytest.mark.parametrize("lamp", [flood, ringed])
def test_fast_light_of_a_departing_lamp_keeps_the_rate_of_its_test(lamp: Lamp, places: Readings) -> None:
    """Of a lamp aside, with a fifth of the photons."""
    scene = departing(lamp, CHANGED[-1])
    keeps_its_rate(
        lambda seed: beside(traced(places, PHOTONS // 5, seed), scene, places, 2e5, 1000 + seed).p()
    )
