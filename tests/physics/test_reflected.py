"""Reflected, unscattered light without noise: against the tracer, energy kept, and Fresnel's numbers."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.lamps.profile import solid_angle_sr
from lightfield.render.reflected import ReflectedLight, fresnel
from lightfield.scene import Scene

SCENE = """
[lamp]
hwhm_deg = 15.0
[water]
absorption_per_m = 0.1
[tank]
width_m = 2.0
lamp_depth_m = 0.6
length_m = 12.0
[detector]
planes_m = [4.5, 6.5]
width_m = 1.6
pixels = 4
height_m = 0.8
"""


def test_fresnel_at_normal_incidence_and_beyond_the_critical_angle() -> None:
    """((n - 1)/(n + 1))^2 = 2.11 % for n = 1.34; total beyond asin(1/n) = 48.27 degrees from the vertical."""
    assert fresnel(np.array([1.0]))[0] == pytest.approx((0.34 / 2.34) ** 2)
    assert fresnel(np.cos(np.radians([48.3, 60.0, 89.0]))) == pytest.approx(1.0)
    assert fresnel(np.cos(np.radians([48.2])))[0] < 0.9


@pytest.mark.parametrize(
    ("top", "albedo", "beam"),
    [
        ("lid", 0.5, {}),
        ("lid", 0.8, {"lamp.tilt_x_deg": 6.0, "lamp.ellipticity": 1.5}),
        ("surface", 0.0, {"lamp.offset_y_m": 0.1}),
        ("surface", 0.5, {}),
        ("lid", 0.4, {"lamp.apparent_distance_m": 1.0, "lamp.offset_x_m": -0.2}),
    ],
)
def test_traced_reflections_agree(top: str, albedo: float, beam: dict[str, float]) -> None:
    """The same light from the tracer, any number of reflections, within its stated error.

    Evaluated at 5 x 5 points of each cell, because the tracer counts whole cells.
    """
    from lightfield.render.rendering import render_scene

    values = {"tank.wall_albedo": albedo, "tank.surface_reflectance": float(top == "surface"), **beam}
    scene = Scene.from_toml(SCENE).with_values(values)
    rendering = render_scene(scene, rel_error=1e-5, max_photons=2e6, seed=4, cache=False)
    mean, stderr = (v[0].ravel() for v in rendering.relative_maps(np.array([525.0]), "diffuse"))
    grid = rendering.grid
    steps = (np.arange(5) - 2) / 5
    dy, dx = np.meshgrid(steps * grid.pitch_y_m, steps * grid.pitch_x_m, indexing="ij")
    z, y, x = (v.ravel() for v in np.meshgrid(grid.z_m, grid.y_m, grid.x_m, indexing="ij"))
    points = [np.add.outer(v, d.ravel()).ravel() for v, d in ((x, dx), (y, dy))]
    light = ReflectedLight(scene, *points, np.repeat(z, 25)).evaluate(scene, 0.1)
    expected = light.reshape(-1, 25).mean(axis=1)
    z_score = (mean - expected) / np.hypot(stderr, 0.01 * expected)  # 1 %: patches of 0.3 m
    assert np.abs(z_score).max() < 4.5
    assert np.mean(z_score**2) < 2.5
    assert mean.mean() == pytest.approx(expected.mean(), rel=0.02)


@pytest.mark.parametrize("albedo", [0.3, 0.8])
def test_closed_tank_of_clear_water_keeps_the_energy(albedo: float) -> None:
    """All that the lamp sends out ends in the walls: sum of (1 - rho) E A = power in a closed box, c = 0."""
    scene = Scene.from_toml(SCENE).with_values({"tank.wall_albedo": albedo, "tank.length_m": 8.0})
    light = ReflectedLight(scene, *(np.array([v]) for v in (0.0, 0.0, 6.0)))
    room = light.room(lid=True)
    lit = room.lit(scene.lamp, 0.0, 0.0).reshape(len(room.patches.centre), -1).mean(axis=1)
    among = room.among.through(0.0)
    irradiance = np.linalg.solve(np.eye(len(lit)) - albedo * among, lit)
    power = float(((1 - albedo) * irradiance * room.patches.area).sum())
    assert power == pytest.approx(solid_angle_sr(scene.lamp), rel=0.03)
