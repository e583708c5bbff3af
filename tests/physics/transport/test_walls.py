"""One reflection and no scattering: grey walls by numerical integration, the water surface by images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from montecarlo import cell_average, keeps_its_rate, turned_p, with_rows

from lightfield.render.maps import render_scene
from lightfield.render.response.grid import Grid
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


class Traced(NamedTuple):
    """Light of one kind, shape (n_batches, n_planes, n_y, n_x), and its cells."""

    batches: np.ndarray
    grid: Grid


def traced(case: Scene, reflections: tuple[int, int], photons: float = 3e6, seed: int = 0) -> Traced:
    """Light with so many wall hits and surface reflections."""
    rendering = render_scene(case, rel_error=1e-4, max_photons=photons, seed=seed, cache=False)
    response = with_rows(rendering.response, (rendering.response.histories == (0, *reflections)).all(axis=1))
    tank = case.tank
    assert tank is not None
    batches = response.batches(A, 0.0, tank.wall_albedo, tank.surface_reflectance)
    return Traced(batches, rendering.grid)


def panels(low: float, high: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss-Legendre quadrature of degree 11 on equal panels."""
    node, weight = np.polynomial.legendre.leggauss(6)
    edges = np.linspace(low, high, count + 1)
    half = 0.5 * (high - low) / count
    return (edges[:-1, None] + half * (1 + node)).ravel(), np.tile(half * weight, count)


RHO = 0.4
GREY = scene({"hwhm_deg": 25.0}, {"wall_albedo": RHO})


def once_reflected() -> Callable[..., np.ndarray]:
    """Lamp to wall patch to detector, summed over both sides, floor and lid (Lambert: L = rho E / pi).

    The wall behind the lamp is dark, and the end wall shines on the detectors' backs.
    """
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
        on_wall = intensity(GREY.lamp, x, y, z) * np.exp(-A * first) * distance / first**3
        dx, dy, dz = place[0] - x, place[1] - y, place[2] - z
        second = np.sqrt(dx * dx + dy * dy + dz * dz)
        from_wall = np.abs(dy) if np.ptp(y) == 0 else np.abs(dx)
        return RHO / np.pi * on_wall * np.exp(-A * second) * from_wall * dz / second**4

    return field


def test_one_diffuse_reflection() -> None:
    """As by numerical integration."""
    found = traced(GREY, (1, 0))
    assert turned_p(found.batches - cell_average(found.grid, once_reflected(), order=2)) > 0.003


@pytest.mark.slow
def test_one_diffuse_reflection_keeps_the_rate_of_its_test() -> None:
    """A photon reaches several planes. By chi-square of independent cells 34 of 200 were below 0.1."""
    truth = cell_average(traced(GREY, (1, 0), 1e4).grid, once_reflected(), order=2)
    keeps_its_rate(lambda seed: turned_p(traced(GREY, (1, 0), 6e5, seed).batches - truth))


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

    found = traced(case, (0, 1), seed=1)
    assert turned_p(found.batches - cell_average(found.grid, field, order=24)) > 0.003
