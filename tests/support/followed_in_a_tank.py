"""Light that a fit follows in a tank of turbid water, beside a full trace."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from lightfield.render.at_readings import render_positions
from lightfield.render.diffuse.diffuse_response import DiffuseResponse
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.followed import FollowedLight
from lightfield.render.diffuse.ratio import Ratio, traced_ratio
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene

BOX = {"width_m": 2.0, "depth_m": 1.6, "length_m": 8.0, "behind_lamp_m": 0.4, "lamp_depth_m": 0.7}
PLANES_M = (4.0, 6.0)


def turbid(**tank: Any) -> Scene:
    """Read at nine places of two planes."""
    x, y, z = (g.ravel() for g in np.meshgrid([-0.4, 0.0, 0.4], [-0.4, 0.0, 0.4], PLANES_M))
    water = {"absorption_per_m": 0.1, "scattering_per_m": 0.15}
    read = {"positions_m": np.stack([x, y, z], axis=1).tolist()}
    return Scene.from_dict({"lamp": {"hwhm_deg": 8.0}, "water": water, "tank": BOX | tank, "detector": read})


@cache
def traced(lit: Scene) -> tuple[np.ndarray, np.ndarray, Ratio]:
    """Diffuse light by a full trace, its error, and the ratio that fits follow; of some scenes twice."""
    x, y, z = np.asarray(lit.detector.positions_m, float).T
    full = render_positions(lit, rel_error=1e-3, max_photons=3e6, seed=3, cache=False)
    (mean,), (noise,) = full.relative(np.array([525.0]), "diffuse")
    return mean, noise, traced_ratio(lit, x, y, z, np.array([525.0]), photons=1e6, seed=5)


@cache
def response(believed: Scene) -> DiffuseResponse:
    """A fit's own trace, by which it follows several scenes."""
    x, y, z = np.asarray(believed.detector.positions_m, float).T
    return response_for(believed, x, y, z, photons=1_000_000, keeper=Keeper(cache=False))


def followed(lit: Scene, believed: Scene) -> list[tuple[float, float, float]]:
    """Light that a fit follows over that of a fresh trace, on two planes; its stated error; the trace's.

    The fit's own trace is of the scene that is believed, its light that of the scene that is lit.
    """
    x, y, z = np.asarray(lit.detector.positions_m, float).T
    mean, noise, ratio = traced(lit)
    follows = FollowedLight.of(response(believed), (x, y, z), [(lit, ratio)])
    light = follows.light(lit, [None])[0]
    modes, smooth = follows.errors(lit, [None], np.zeros(len(x), int))
    out = []
    for plane in PLANES_M:
        on = z == plane
        whole, error = mean[on].sum(), np.hypot(np.linalg.norm(modes[on].sum(axis=0)), smooth[on].sum())
        out.append((light[on].sum() / whole, error / whole, noise[on].sum() / whole))
    return out
