"""Light of a lamp that has a wide window, beside its integral over the window."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.formula.closed_form import direct_field, points_of_window
from lightfield.scene import Scene


def integrated(x_m: np.ndarray, z_m: float, hwhm_deg: float, radius_m: float, exponent: float) -> np.ndarray:
    """Mean over a fine grid of rings; inverse square, beam and cosine of each place in the window."""
    node, weight = np.polynomial.legendre.leggauss(80)
    ring, turn = radius_m * np.sqrt(0.5 * (node + 1)), (np.arange(160) + 0.5) * (2 * np.pi / 160)
    across = x_m[:, None, None] - ring[:, None] * np.cos(turn)
    up = ring[:, None] * np.sin(turn)
    r = np.sqrt(across**2 + up**2 + z_m**2)
    beam = 0.5 ** ((np.degrees(np.arccos(z_m / r)) / hwhm_deg) ** exponent)
    return np.asarray((beam * z_m / r**3).mean(axis=2) @ (0.5 * weight))


@pytest.mark.parametrize(
    ("hwhm_deg", "radius_m", "z_m", "exponent"),
    [(3.81, 0.03, 0.6, 2.0), (3.81, 0.1, 1.0, 2.0), (1.0, 0.03, 1.0, 2.0), (3.81, 0.25, 2.0, 2.0),
     (1.0, 0.1, 1.0, 2.0), (6.0, 0.05, 1.0, 6.0)],
)  # fmt: skip
def test_a_window_wider_than_its_spot_is_all_of_it(
    hwhm_deg: float, radius_m: float, z_m: float, exponent: float
) -> None:
    """Windows of 0.7 to 6 half widths of their beams: right to a thousandth of what is on the axis."""
    lamp = {
        "profile": "super-gaussian",
        "hwhm_deg": hwhm_deg,
        "radius_m": radius_m,
        "shape_exponent": exponent,
    }
    x = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0]) * (z_m * np.tan(np.radians(hwhm_deg)) + radius_m)
    light = direct_field(Scene.from_dict({"lamp": lamp}), x, 0 * x, np.full(x.size, z_m))
    right = integrated(x, z_m, hwhm_deg, radius_m, exponent)
    assert np.abs(light - right).max() < 1e-3 * right[0]


@pytest.mark.parametrize(
    ("z_m", "radius_m"), [(3.0, 0.12), (5.0, 0.12), (6.0, 0.12), (1.3, 0.03), (1.5, 0.03)]
)
def test_a_collimator_sees_the_part_of_a_window_in_its_cone(z_m: float, radius_m: float) -> None:
    """On the axis it is a disc of the radius z tan(1 degree): its light over the cone's solid angle."""
    detector = {"quantity": "radiance", "full_angle_deg": 2.0}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 8.0, "radius_m": radius_m}, "detector": detector})
    half = np.radians(1.0)
    seen = min(z_m * np.tan(half), radius_m)
    s = (np.arange(4000) + 0.5) / 4000 * seen
    r = np.hypot(s, z_m)
    light = 0.5 ** ((np.degrees(np.arctan(s / z_m)) / 8.0) ** 2) / r**2
    expected = (light * 2 * s).sum() * (seen / 4000) / radius_m**2 / (2 * np.pi * (1 - np.cos(half)))
    found = direct_field(scene, *(np.array([v]) for v in (0.0, 0.0, z_m)))[0]
    assert found == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("radius_m", [0.02, 0.3])
def test_points_of_a_window_at_once_are_lamps_beside_each_other(radius_m: float) -> None:
    """Each with its own way through layers."""
    lamp = {"tilt_x_deg": 3.0, "offset_x_m": 0.1, "offset_y_m": -0.2, "apparent_distance_m": 0.5}
    water = {"height_gradient_per_m2": 0.05, "gradient_per_m2": 0.01}
    rest = {"water": water, "detector": {"tilt_x_deg": 5.0}}
    scene = Scene.from_dict({"lamp": {**lamp, "radius_m": radius_m}, **rest})
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-0.5, 0.5, (2, 3, 50))
    z = rng.uniform(1.0, 8.0, x.shape)
    in_air = rng.random(x.shape) < 0.3
    points, light = points_of_window(scene.lamp, z), np.zeros(x.shape)
    assert len(points) >= 7
    for u, v, share in points:
        moved = {"offset_x_m": lamp["offset_x_m"] + u, "offset_y_m": lamp["offset_y_m"] + v}
        light += share * direct_field(Scene.from_dict({"lamp": lamp | moved, **rest}), x, y, z, medium=in_air)
    assert direct_field(scene, x, y, z, medium=in_air) == pytest.approx(light, rel=1e-12)
