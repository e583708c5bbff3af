"""The walls of a tank as a box, and as six rectangles of Mitsuba's; scattering; one walk for all."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from lightfield.scene import Scene, Tank

pytestmark = pytest.mark.usefixtures("backend")

TANK = Tank(width_m=2.0, depth_m=1.4, length_m=6.0, behind_lamp_m=0.5, lamp_depth_m=0.4, surface="flat")
FLIGHTS = 20_000


def flights() -> tuple[mi.Point3f, mi.Vector3f]:
    """Starts all over the tank, in all directions, some of them along an axis."""
    rng = np.random.default_rng(3)
    start = np.array([rng.uniform(low, high, FLIGHTS) for low, high in TANK.box_m])
    direction = rng.normal(size=(3, FLIGHTS))
    direction[:, :6] = np.hstack([np.eye(3), -np.eye(3)])
    direction /= np.linalg.norm(direction, axis=0)
    return mi.Point3f(*map(mi.Float, start)), mi.Vector3f(*map(mi.Float, direction))


@pytest.mark.parametrize(
    ("surface", "floor", "end"), [(None, 1.0, 1.0), (0.8, 1.0, 1.0), (0.8, 0.3, 1.0), (None, 1.0, 0.2)]
)
def test_box_meets_and_reflects_as_mitsuba_does(surface: float | None, floor: float, end: float) -> None:
    """Distance, reflected part and mirrored directions of every flight; the mean of the diffuse ones."""
    from lightfield.render.tracer.build import shapes
    from lightfield.render.tracer.surfaces import Box, Shapes

    tank = TANK.model_copy(update={"floor_over_walls": floor, "end_over_walls": end})
    scene = Scene.from_dict({"tank": tank.model_dump(), "detector": {"planes_m": [3.0]}})
    loaded = mi.load_dict({"type": "scene", **shapes(scene, 0.6, surface)})
    position, direction = flights()
    rng = np.random.default_rng(4)
    turn, everywhere = mi.Point2f(*map(mi.Float, rng.random((2, FLIGHTS)))), mi.Bool(True)
    found = []
    for surfaces in (Box(tank, 0.6, surface), Shapes(loaded)):
        met = surfaces.meet(position, direction, everywhere)
        at = mi.Point3f(position + direction * met.distance)
        bounce = surfaces.bounce(met, at, direction, turn, everywhere)
        smooth = np.broadcast_to(np.array(bounce.smooth, bool), FLIGHTS)
        reflected = np.broadcast_to(np.array(bounce.reflected, float), FLIGHTS)
        found.append(
            (np.array(met.distance), smooth, reflected, np.array(bounce.position), np.array(bounce.direction))
        )
        assert not np.array(met.leaves).any()
    (far, smooth, part, place, onward), (far_m, smooth_m, part_m, place_m, onward_m) = found
    np.testing.assert_allclose(far, far_m, rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(smooth, smooth_m)
    np.testing.assert_allclose(part, part_m, rtol=2e-3, atol=2e-6)
    np.testing.assert_allclose(place, place_m, atol=1.2e-4)  # a shape's is 0.1 mm inside
    np.testing.assert_allclose(onward[:, smooth], onward_m[:, smooth], atol=2e-5)
    assert smooth.any() == (surface is not None)
    # Diffuse: each about its own wall; over all of them both are the same light, and none goes into the wall.
    low, high = np.array(TANK.box_m).T
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inside = (np.abs(place - middle[:, None]) <= half[:, None] + 1e-6).all(axis=0)
    assert inside.all()
    for one, two in zip(onward[:, ~smooth], onward_m[:, ~smooth], strict=True):
        assert stats.ks_2samp(one, two).pvalue > 1e-4


@pytest.mark.parametrize("g", [-0.3, 0.0, 0.7, 0.924, 0.99])
def test_henyey_greenstein_turns_as_its_distribution_says(g: float) -> None:
    """Angles against the closed cumulative distribution, down to small ones; azimuths even."""
    from lightfield.render.tracer.scattering import henyey_greenstein

    rng, n = np.random.default_rng(5), 200_000
    axis = np.array([0.6, -0.64, 0.48])
    forward = mi.Vector3f(*(mi.Float(np.full(n, v)) for v in axis))
    u = mi.Point2f(*map(mi.Float, rng.random((2, n))))
    turned = np.array(henyey_greenstein(g)(forward, mi.Float(0), u, mi.Bool(True)), float)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=0), 1, atol=1e-6)
    chord = np.linalg.norm(turned - axis[:, None], axis=0)
    s = 0.25 * chord**2  # sin^2(theta/2)
    # P(angle > theta) of Henyey and Greenstein's function; for g = 0 it is 1 - s.
    beyond = 1 - s if g == 0 else (1 - g**2) / (2 * g) * (1 / np.sqrt((1 - g) ** 2 + 4 * g * s) - 1 / (1 + g))
    assert stats.kstest(beyond, "uniform").pvalue > 1e-4
    right = np.cross(axis, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    across = np.arctan2(np.cross(axis, right) @ turned, right @ turned)
    assert stats.kstest(across / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-4


def test_one_trace_is_one_walk() -> None:
    """One kernel makes all outputs of a trace: each asked for alone would walk every photon again."""
    import drjit as dr

    from lightfield.render.response.grid import reference_of, scene_grid
    from lightfield.render.tracer.build import assembled
    from lightfield.render.tracer.walk import trace

    scene = Scene.from_dict({"tank": TANK.model_dump(), "detector": {"planes_m": [3.0], "pixels": 9}})
    scene = scene.with_values({"tank.wall_albedo": 0.5, "water.scattering_per_m": 0.2})
    setup = assembled(scene, scene_grid(scene), reference_of(scene))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        trace(setup, photons=6400, seed=1)
        walks = [k for k in dr.kernel_history([dr.KernelType.JIT]) if k["size"] == 100]
    assert len(walks) == 1, "100 lanes, one loop"
