"""One reflection and no scattering: grey walls by numerical integration, the water surface by images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from montecarlo import cell_average, chi_square_p, normal_scores, with_rows

from lightfield.render.maps import render_scene
from lightfield.scene import Lamp, Scene
from lightfield.scene.lamp.profile import relative_intensity

A = 0.15
TANK = {"width_m": 2.0, "depth_m": 1.5, "length_m": 9.0, "behind_lamp_m": 0.5, "lamp_depth_m": 0.6}
DETECTOR = {"planes_m": [1.0, 3.0, 5.0], "width_m": 1.8, "height_m": 0.8, "pixels": 9}


def scene(lamp: dict[str, Any], tank: dict[str, Any]) -> Scene:
    return Scene.from_dict(
        {"lamp": lamp, "water": {"absorption_per_m": A}, "tank": TANK | tank, "detector": DETECTOR}
    )


def intensity(lamp: Lamp, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Radiant intensity of a lamp at the origin towards a point."""
    across = np.maximum(np.hypot(x, y), 1e-12)
    theta = np.arctan2(across, z)
    return relative_intensity(lamp, theta * x / across, theta * y / across)


def traced_scores(
    case: Scene, reflections: tuple[int, int], field: Callable[..., np.ndarray], order: int
) -> np.ndarray:
    """Normal scores of the light with so many wall hits and surface reflections against a field."""
    rendering = render_scene(case, rel_error=1e-3, max_photons=3e6, cache=False)
    response = with_rows(rendering.response, (rendering.response.histories == (0, *reflections)).all(axis=1))
    tank = case.tank
    assert tank is not None
    mean, stderr = response.evaluate(A, 0.0, tank.wall_albedo, tank.surface_reflectance)
    truth = cell_average(rendering.grid, field, order)
    return normal_scores(mean, truth, stderr, len(response.tally))


def panels(low: float, high: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss-Legendre quadrature of degree 11 on equal panels."""
    node, weight = np.polynomial.legendre.leggauss(6)
    edges = np.linspace(low, high, count + 1)
    half = 0.5 * (high - low) / count
    return (edges[:-1, None] + half * (1 + node)).ravel(), np.tile(half * weight, count)


def test_one_diffuse_reflection() -> None:
    """Lamp to wall patch to detector, summed over both sides, floor and lid (Lambert: L = rho E / pi).

    The wall behind the lamp is dark, and the end wall shines on the detectors' backs.
    """
    rho = 0.4
    case = scene({"hwhm_deg": 25.0}, {"wall_albedo": rho})
    half, floor, top = 1.0, 0.6 - 1.5, 0.6

    def field(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        shape, total = np.shape(x), np.zeros(np.size(x))
        across, share_across = panels(floor, top, 8)
        beside, share_beside = panels(-half, half, 10)
        for i, place in enumerate(zip(np.ravel(x), np.ravel(y), np.ravel(z), strict=True)):
            along, share_along = panels(0.0, place[2], 24)
            for side in (-half, half):
                wall = side, across[:, None], along[None, :]
                total[i] += share_across @ reflected(wall, half, place) @ share_along
            for level in (floor, top):
                wall = beside[:, None], level, along[None, :]
                total[i] += share_beside @ reflected(wall, abs(level), place) @ share_along
        return total.reshape(shape)

    def reflected(wall: Any, distance: float, place: tuple[float, float, float]) -> np.ndarray:
        """Irradiance per wall area; `distance` is that of the wall's plane from the lamp."""
        x, y, z = np.broadcast_arrays(*wall)
        first = np.sqrt(x * x + y * y + z * z)
        on_wall = intensity(case.lamp, x, y, z) * np.exp(-A * first) * distance / first**3
        dx, dy, dz = place[0] - x, place[1] - y, place[2] - z
        second = np.sqrt(dx * dx + dy * dy + dz * dz)
        from_wall = np.abs(dy) if np.ptp(y) == 0 else np.abs(dx)
        return rho / np.pi * on_wall * np.exp(-A * second) * from_wall * dz / second**4

    scores = traced_scores(case, (1, 0), field, order=2)
    assert 0.001 < chi_square_p(scores) < 0.999


def fresnel(cosine: np.ndarray, index: float = 1.34) -> np.ndarray:
    """Reflectance of a water surface seen from below, unpolarised; 1 beyond the critical angle."""
    sine = index * np.sqrt(1 - cosine**2)
    out = np.sqrt(np.maximum(1 - sine**2, 0))
    s = (index * cosine - out) / (index * cosine + out)
    p = (cosine - index * out) / (cosine + index * out)
    return np.where(sine >= 1, 1.0, 0.5 * (s * s + p * p))


@pytest.mark.parametrize(
    "lamp", [{"profile": "isotropic"}, {"hwhm_deg": 30.0, "tilt_y_deg": 5.0}], ids=["all", "up"]
)
def test_mirror_image_in_the_surface(lamp: dict[str, Any]) -> None:
    """The lamp's image stands twice its depth above it and shines with Fresnel's share."""
    case = scene(lamp, {"surface": "flat"})

    def field(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        up = 2 * 0.6 - y  # the path seen from the lamp: straight to the image of the detector
        r = np.sqrt(x * x + up * up + z * z)
        tilt = np.radians(case.lamp.tilt_y_deg)
        y_beam, z_beam = up * np.cos(tilt) - z * np.sin(tilt), up * np.sin(tilt) + z * np.cos(tilt)
        return intensity(case.lamp, x, y_beam, z_beam) * fresnel(up / r) * np.exp(-A * r) * z / r**3

    scores = traced_scores(case, (0, 1), field, order=24)
    assert 0.001 < chi_square_p(scores) < 0.999
