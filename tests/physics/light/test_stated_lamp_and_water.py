"""Fast scattered light of what a scene states and no fit moves, against a fresh trace of that scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from montecarlo import least_p

from lightfield.render.at_readings import render_positions
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.source import response_for
from lightfield.render.settings import BATCHES
from lightfield.render.tracer.accumulate import DIRECTION_BATCHES
from lightfield.scene import Scene


def compared(
    places: np.ndarray,
    lamp: dict[str, Any],
    phase: dict[str, Any] | None = None,
    tank: dict[str, Any] | None = None,
) -> tuple[float, np.ndarray, np.ndarray]:
    """Probability of a larger difference; light of the fresh trace, and the noise of the fast one."""
    water = {"absorption_per_m": 0.08, "scattering_per_m": 0.15} | ({"phase": phase} if phase else {})
    read = {"positions_m": places.tolist()}
    box = {"tank": tank} if tank else {}
    scene = Scene.from_dict({"water": water, "lamp": lamp, "detector": read, **box})
    response = response_for(scene, *places.T, photons=1_000_000, keeper=Keeper(cache=False))
    modes, smooth = response.errors(scene, [None], np.zeros(len(places), int))
    rendering = render_positions(scene, rel_error=1e-3, max_photons=1e6, seed=3, cache=False)
    (mean,), (stderr,) = rendering.relative(np.array([525.0]), "diffuse")
    noise = np.linalg.norm(modes, axis=1), DIRECTION_BATCHES - 1
    difference = response.light(scene, [None])[0] - mean
    return least_p(difference, noise, (stderr, BATCHES - 1), (smooth, np.inf)), mean, noise[0]


def test_light_of_a_lamp_that_stands_aside() -> None:
    """By 2.7 half widths of its beam on the nearest plane: followed from the middle it was doubled."""
    places = np.array([(x, 0.0, z) for z in (1.5, 3.5) for x in (-0.6, -0.2, 0.2, 0.6)])
    p, mean, noise = compared(places, {"hwhm_deg": 4.0, "offset_x_m": 0.28})
    assert p > 0.001
    assert mean.argmax() == 2 and noise[2] < 0.02 * mean[2]


def test_light_of_a_lamp_with_a_window() -> None:
    """As of a point it was a sixth too bright on the axis."""
    places = np.array([(x, 0.0, z) for z in (2.0, 4.0) for x in (-0.4, -0.2, 0.0, 0.2)])
    p, mean, noise = compared(places, {"hwhm_deg": 4.0, "radius_m": 0.2})
    assert p > 0.001
    assert noise[2] < 0.03 * mean[2]


@pytest.mark.parametrize(
    "phase",
    [{"type": "henyey-greenstein", "g": 0.3}, {"type": "fournier-forand", "n": 1.1, "mu": 4.5}],
    ids=["g", "mu"],
)
def test_light_of_a_phase_function_beyond_those_of_a_fit(phase: dict[str, Any]) -> None:
    """It was refused as "outside the traced range"."""
    places = np.array([(x, 0.0, z) for z in (3.0, 5.0) for x in (-0.6, -0.2, 0.2, 0.6)])
    p, mean, noise = compared(places, {"hwhm_deg": 6.0}, phase)
    assert p > 0.001
    assert np.all(noise < 0.05 * mean)


def test_light_of_a_lamp_off_its_axis_under_a_surface() -> None:
    """What the surface mirrors moves up where the lamp moves down: taken for that of a lamp on the axis, and
    moved with it, all diffuse light was 5 to 8 % too bright."""
    places = np.array([(x, y, z) for z in (3.5, 4.4, 5.1) for y in (-0.8, -0.2, 0.3) for x in (-0.3, 0.1)])
    tank = {"width_m": 1.2, "depth_m": 1.6, "length_m": 8.4, "lamp_depth_m": 0.6, "surface": "flat"}
    lamp = {"hwhm_deg": 9.7, "offset_y_m": -0.12}
    p, mean, noise = compared(places, lamp, {"type": "henyey-greenstein", "g": 0.87}, tank)
    assert p > 0.001
    assert np.all(noise < 0.05 * mean)
