"""Fast scattered light of a lamp that the scene puts aside, against a fresh trace of that scene."""

from __future__ import annotations

import numpy as np
from montecarlo import least_p

from lightfield.render.at_readings import render_positions
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.source import response_for
from lightfield.render.settings import BATCHES
from lightfield.render.tracer.accumulate import DIRECTION_BATCHES
from lightfield.scene import Scene

LAMP = {"hwhm_deg": 4.0, "offset_x_m": 0.28}


def test_light_of_a_lamp_that_stands_aside() -> None:
    """By 2.7 half widths of its beam on the nearest plane: followed from the middle it was doubled."""
    places = np.array([(x, 0.0, z) for z in (1.5, 3.5) for x in (-0.6, -0.2, 0.2, 0.6)])
    water = {"absorption_per_m": 0.08, "scattering_per_m": 0.15}
    scene = Scene.from_dict({"water": water, "lamp": LAMP, "detector": {"positions_m": places.tolist()}})
    response = response_for(scene, *places.T, photons=1_000_000, keeper=Keeper(cache=False))
    modes, smooth = response.errors(scene, [None], np.zeros(len(places), int))
    rendering = render_positions(scene, rel_error=1e-3, max_photons=1e6, seed=3, cache=False)
    (mean,), (stderr,) = rendering.relative(np.array([525.0]), "diffuse")
    noise = np.linalg.norm(modes, axis=1), DIRECTION_BATCHES - 1
    difference = response.light(scene, [None])[0] - mean
    assert least_p(difference, noise, (stderr, BATCHES - 1), (smooth, np.inf)) > 0.001
    assert mean.argmax() == 2 and noise[0][2] < 0.02 * mean[2]
