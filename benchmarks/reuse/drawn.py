"""Tanks at random: the light that a diagnosis ends with, beside a fresh render of the same scene."""

from __future__ import annotations

from math import atan, degrees
from typing import Any, NamedTuple

import numpy as np

from lightfield.render.at_readings import render_positions
from lightfield.render.diffuse.diffuse_response import DiffuseResponse
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.followed import FollowedLight
from lightfield.render.diffuse.ratio import traced_ratio
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene

#: No face reflects more: of brighter walls a fit does not know.
_BRIGHTEST = 0.9
#: At the window a beam of a source behind it is so much narrower than the tank.
_OF_TANK = 0.3
_PLANES = 3


class Drawn(NamedTuple):
    """Mean light of a fit over that of a render on each lit plane, less one, and its error; (n_planes,)."""

    number: int
    what: str
    off: np.ndarray
    error: np.ndarray


def scene_of(number: int) -> Scene:
    """One of endlessly many: a tank, its lamp, water, detector, and what of them is not as usual."""
    rng = np.random.default_rng(number)

    def some(low: float, high: float, chance: float = 1.0) -> float:
        drawn, told = float(rng.uniform(low, high)), rng.random() < chance
        return drawn if told else 0.0

    def one(*values: float) -> float:
        return float(rng.choice(values))

    width, depth, length = some(0.8, 3.5), some(0.8, 2.5), some(3.0, 12.0)
    walls, below = one(0.0, 0.1, 0.3, 0.6, 0.85), depth * some(0.3, 0.7)
    brightest = _BRIGHTEST / max(walls, 0.01)
    tank: dict[str, Any] = {
        "width_m": width, "depth_m": depth, "length_m": length, "lamp_depth_m": below, "wall_albedo": walls,
        "behind_lamp_m": some(0.1, 0.5), "surface_reflectance": one(0.0, 0.0, 0.0, 0.3, 1.0),
        "floor_over_walls": min(one(1.0, 1.0, 0.0, 0.5, 2.0, 5.0), brightest),
        "end_over_walls": min(one(1.0, 1.0, 1.0, 0.0, 0.5, 3.0), brightest),
    }  # fmt: skip
    if tank["surface_reflectance"]:
        tank["surface_slope_deg"] = some(1.0, 8.0, 0.3)
    room = min(0.5 * width, below, depth - below)
    behind = some(0.1, 1.5, 0.3)
    widest = 30.0 if not behind else min(30.0, degrees(atan(_OF_TANK * room / behind)))
    lamp = {
        "hwhm_deg": float(np.exp(some(np.log(3.0), np.log(max(widest, 3.1))))), "apparent_distance_m": behind,
        "offset_x_m": room * some(-0.3, 0.3, 0.4), "offset_y_m": room * some(-0.3, 0.3, 0.4),
        "tilt_x_deg": some(-4.0, 4.0, 0.4), "tilt_y_deg": some(-4.0, 4.0, 0.4),
        "radius_m": some(0.01, 0.05, 0.3),
    }  # fmt: skip
    planes = np.sort(rng.uniform(1.0, length - tank["behind_lamp_m"] - 0.3, _PLANES))
    phase = {"type": "henyey-greenstein", "g": one(0.75, 0.9, 0.95)}
    water = {
        "absorption_per_m": some(0.03, 0.3), "scattering_per_m": one(0.0, 0.05, 0.2), "phase": phase,
        "gradient_per_m2": some(-0.01, 0.02, 0.2), "gradient_centre_m": float(planes.mean()) / 2,
    }  # fmt: skip
    across = 0.4 * width * np.array([-0.6, -0.2, 0.3, 0.7])
    up = below - depth + depth * np.array([0.15, 0.5, 0.8])
    x, y, z = (g.ravel() for g in np.meshgrid(across, up, planes))
    detector = {
        "positions_m": np.stack([x, y, z], axis=1).tolist(),
        "tilt_x_deg": some(-10.0, 10.0, 0.15), "acceptance_hwhm_deg": some(20.0, 50.0, 0.15),
    }  # fmt: skip
    return Scene.from_dict({"lamp": lamp, "tank": tank, "water": water, "detector": detector})


def compare(number: int, photons: float) -> Drawn | None:
    """One of the scenes; None where nothing is scattered or reflected."""
    scene = scene_of(number)
    x, y, z = np.asarray(scene.detector.positions_m, float).T
    middle = np.array([np.mean(scene.detector.bands_nm[0])])
    fresh = render_positions(scene, rel_error=2e-3, max_photons=photons, seed=3, cache=False)
    (mean,), (noise,) = fresh.relative(middle, "diffuse")
    if not mean.any():
        return None
    response = response_for(scene, x, y, z, photons=round(0.5 * photons), keeper=Keeper(cache=False))
    light: DiffuseResponse | FollowedLight = response
    if scene.water.scattering_per_m > 0:
        ratio = traced_ratio(scene, x, y, z, middle, photons=0.5 * photons, seed=5)
        light = FollowedLight.of(response, (x, y, z), [(scene, ratio)])
    modes, smooth = light.errors(scene, [None], np.zeros(len(x), int))
    found = light.light(scene, [None])[0]
    off, error = [], []
    for plane in np.unique(z):
        on = z == plane
        whole = mean[on].sum()
        if whole == 0:
            continue  # a plane that nothing sends light to
        of_fit = np.hypot(np.linalg.norm(modes[on].sum(axis=0)), smooth[on].sum())
        off.append(found[on].sum() / whole - 1)
        error.append(np.hypot(of_fit, np.hypot.reduce(noise[on])) / whole)
    tank, lamp = scene.tank, scene.lamp
    assert tank is not None
    what = (
        f"walls {tank.wall_albedo:.2g}, floor {tank.floor_over_walls:.2g} and end {tank.end_over_walls:.2g} "
        f"of them, surface {tank.surface_reflectance:.2g}, lamp of {lamp.hwhm_deg:.2g} deg, b = "
        f"{scene.water.scattering_per_m:.2g} per m"
    )
    return Drawn(number, what, np.array(off), np.array(error))
