"""What a fit's one trace says of other walls and waters, against fresh renders of each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lightfield.render.at_readings import CELL_M, AtPlaces
from lightfield.render.diffuse.bending import surrounded
from lightfield.render.diffuse.source import response_for
from lightfield.render.maps import render_scene
from lightfield.render.response.grid import positions_grid
from lightfield.scene import Scene

#: Albedo of the brightest of walls, floor and end, and scattering, per metre, of what is asked of one trace.
ASKED = ((0.3, 0.05), (0.7, 0.05), (0.7, 0.2), (0.9, 0.05), (0.9, 0.2))
#: And with a surface that reflects so much of what it should.
DIM, DIM_ASKED = 0.3, ((0.7, 0.05), (0.9, 0.2))
SPAN_M = 0.4


class Compared(NamedTuple):
    """Mean ratio of a fit's light to fresh light plane by plane, the errors of fresh light, and those stated.

    All of shape (n_planes,) and relative.
    """

    tank: str
    asked: str
    ratio: np.ndarray
    fresh: np.ndarray
    stated: np.ndarray


def places(planes: list[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Five by five on every plane."""
    line = np.linspace(-SPAN_M, SPAN_M, 5)
    z, y, x = (v.ravel() for v in np.meshgrid(planes, line, line, indexing="ij"))
    return x, y, z


def compare(name: str, scene: Scene, planes: list[float], photons: float) -> list[Compared]:
    """A fit's light in one tank, evaluated for several walls and waters."""
    x, y, z = places(planes)
    response = response_for(scene, x, y, z)
    middle = np.array([np.mean(scene.detector.bands_nm[0])])
    grid = surrounded(positions_grid(x, y, z, 2 * CELL_M, scene.lamp.hwhm_deg, scene.tank), scene.tank)
    known: dict[str, Any] = {"rel_error": 1e-4, "max_photons": photons, "symmetry": True, "seed": 7}
    found = []
    for albedo, b, top in asked_of(scene):
        values = {"tank.wall_albedo": albedo, "water.scattering_per_m": b, "tank.surface_reflectance": top}
        other = scene.with_values(values)
        light = response.light(other, [None])[0]
        modes, smooth = response.errors(other, [None], np.zeros(len(x), int))
        fresh = AtPlaces(render_scene(other, grid=grid, **known), x, y, z)
        truth, error = (v[0] for v in fresh.relative(middle, "diffuse"))
        rows = [z == plane for plane in planes]
        mean = np.array([truth[r].sum() for r in rows])
        shared = [np.hypot(np.linalg.norm(modes[r].sum(axis=0)), smooth[r].sum()) for r in rows]
        found.append(
            Compared(
                name,
                f"walls {albedo:g}, b = {b:g}" + (f", surface {top:g}" if 0 < top < 1 else ""),
                np.array([light[r].sum() for r in rows]) / mean,
                np.array([np.hypot.reduce(error[r]) for r in rows]) / mean,
                np.array(shared) / mean,
            )
        )
    return found


def asked_of(scene: Scene) -> list[tuple[float, float, float]]:
    """Wall albedo, scattering and surface reflectance of what is asked of the trace of a scene."""
    top = scene.reflectances[1]
    over = scene.tank.brightest_over_walls if scene.tank else 1.0
    asked = [(albedo, b, top) for albedo, b in ASKED]
    asked += [(albedo, b, DIM) for albedo, b in DIM_ASKED] if top else []
    return [(albedo / over, b, top) for albedo, b, top in asked]
