"""Light reflected once: quadrature and images against the tracer, and Fresnel's numbers."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.render.bounce import SingleBounce, fresnel
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


@pytest.mark.parametrize("top", ["lid", "surface"])
def test_traced_first_reflection_agrees(top: str) -> None:
    """The same light from the tracer's history (n, m, k) = (0, 1, 0) or (0, 0, 1), within its stated error.

    Wall light and image are evaluated at 5 x 5 points of each cell, because the tracer counts whole cells.
    """
    from lightfield.render.rendering import render_scene
    from lightfield.render.response import Reference

    surface = top == "surface"
    scene = Scene.from_toml(SCENE).with_values({"tank.surface_reflectance": 1.0} if surface else {})
    albedo = 0.0 if surface else 0.5
    rendering = render_scene(
        scene, reference=Reference(0.1, 0.0, albedo), rel_error=1e-5, max_photons=2e6, seed=4, cache=False
    )
    response, grid = rendering.response, rendering.grid
    row = (response.histories == ((0, 0, 1) if surface else (0, 1, 0))).all(axis=1)
    rows = response.row_weights(*(np.array([v]) for v in (0.1, 0.0, albedo, 1.0 * surface)))[0]
    batches = np.einsum("r,brc->bc", np.where(row, rows, 0.0), response.tally)
    mean, stderr = batches.mean(axis=0), batches.std(axis=0, ddof=1) / np.sqrt(len(batches))
    steps = (np.arange(5) - 2) / 5
    dy, dx = np.meshgrid(steps * grid.pitch_y_m, steps * grid.pitch_x_m, indexing="ij")
    x, y, z = (v.ravel() for v in grid.centres())
    points = [np.add.outer(v, d.ravel()).ravel() for v, d in ((x, dx), (y, dy))]
    bounce = SingleBounce(scene, *points, np.repeat(z, 25))
    light = bounce.surface(scene, 0.1) if surface else albedo * bounce.walls(scene, 0.1, lid=True)
    expected = light.reshape(-1, 25).mean(axis=1)
    z_score = (mean - expected) / np.hypot(stderr, 0.005 * expected)  # 0.5 %: the quadrature near a wall
    assert np.abs(z_score).max() < 4.5
    assert np.mean(z_score**2) < 2.5
    assert mean.mean() == pytest.approx(expected.mean(), rel=0.02)
