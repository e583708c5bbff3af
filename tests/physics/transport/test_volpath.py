"""Scattered and wall-reflected light against Mitsuba's own `volpath`, which walks back from the detector.

The two share the geometry library and nothing of the estimator: `volpath` draws free paths with absorption in
them, connects every scattering to the lamp, and evaluates phase functions where the tracer samples them. Its
connections go with the inverse square of a distance that may vanish, so light of higher orders has infinite
variance there and no error can be stated. The comparison is for light that turned once; the sum of all
orders is held against a known value.
"""

from __future__ import annotations

import json
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from montecarlo import with_rows
from scipy import stats

from lightfield.render.maps import render_scene
from lightfield.scene import Scene

pytestmark = pytest.mark.usefixtures("backend")

HWHM_DEG = float(np.degrees(np.sqrt(np.log(2) / 157)))  # I = exp(-157 theta^2)
A, B, Z = 0.05, 0.15, 6.5
CELL = 0.1
BATCHES = 12
SMALL, WIDE = 2e-6, 0.5 * np.pi


def stock_scene(phase: dict[str, Any], walls: dict[str, Any], meter_x: float | None = None) -> Any:
    """A lamp in water for `volpath`; optionally with an irradiance meter at (x, 0, Z)."""
    water = {
        "type": "homogeneous",
        "id": "water",
        "sigma_t": {"type": "uniform", "value": A + B},
        "albedo": {"type": "uniform", "value": B / (A + B)},
        "phase": phase,
    }
    inside = {"type": "ref", "id": "water"}
    parts = {"water": water, "lamp": {"type": "lightfield_lamp", "medium": inside, "hwhm_deg": HWHM_DEG}}
    if meter_x is not None:
        turn = mi.ScalarTransform4f
        place = turn().translate([meter_x, 0, Z]) @ turn().rotate([0, 1, 0], 180) @ turn().scale(CELL / 2)
        film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
        meter = {"type": "irradiancemeter", "medium": inside, "film": film}
        parts["plate"] = {"type": "rectangle", "to_world": place, "bsdf": {"type": "null"}, "meter": meter}
    return mi.load_dict({"type": "scene", **parts, **walls})


def grey(albedo: float) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": {"type": "uniform", "value": albedo}}


OPEN = {"end": {"type": "sphere", "radius": 80.0, "flip_normals": True, "bsdf": grey(0.0)}}


def radiance(scene: Any, rays: Any, seed: int) -> np.ndarray:
    """What `volpath` sees along rays by one scattering or reflection; the lamp has no area to be seen."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, dr.width(rays.o))
    rays.wavelengths = mi.Spectrum(550.0)
    walker = mi.load_dict({"type": "volpath", "max_depth": 2})
    spectrum, _, _ = walker.sample(scene, sampler, rays, scene.emitters()[0].get_medium())
    return np.array(spectrum[0], np.float64)


def stock_irradiance(scene: Any, x: float, samples: int = 60_000) -> np.ndarray:
    """Irradiance of the cell at (x, 0, Z), one value per batch.

    Most directions are even in the logarithm of the angle from the lamp: light that scattered near the lamp
    grows as one over the squared distance, and its variance is finite only so. Below 2 microradians, where
    single precision ends, the Fournier-Forand and Petzold functions have 0.3 % of their light.
    """
    values = []
    for batch in range(BATCHES):
        rng = np.random.default_rng([batch, int(1000 * x)])
        place = np.stack([x + CELL * (rng.random(samples) - 0.5), CELL * (rng.random(samples) - 0.5)])
        place = np.concatenate([place, np.full((1, samples), Z)])
        lamp = -place / np.linalg.norm(place, axis=0)
        right = np.stack([lamp[2], 0 * lamp[2], -lamp[0]]) / np.hypot(lamp[0], lamp[2])
        up = np.cross(lamp, right, axis=0)
        narrow, turn = rng.random(samples) < 0.8, 2 * np.pi * rng.random(samples)
        psi = SMALL * (WIDE / SMALL) ** rng.random(samples)
        around = np.sin(psi) * (np.cos(turn) * right + np.sin(turn) * up) + np.cos(psi) * lamp
        cosine = np.sqrt(rng.random(samples))
        sine = np.sqrt(1 - cosine**2)
        ahead = np.stack([sine * np.cos(turn), sine * np.sin(turn), -cosine])
        direction = np.where(narrow, around, ahead)
        psi = 2 * np.arcsin(np.minimum(0.5 * np.linalg.norm(direction - lamp, axis=0), 1))
        log_density = 1 / (psi * np.log(WIDE / SMALL) * 2 * np.pi * np.sin(psi))
        facing = np.maximum(-direction[2], 0)
        density = 0.8 * np.where((psi > SMALL) & (psi < WIDE), log_density, 0) + 0.2 * facing / np.pi
        rays = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(place), mi.Vector3f(direction)))
        values.append((radiance(scene, rays, batch) * facing / np.maximum(density, 1e-30)).mean())
    return np.array(values)


def traced_irradiance(scene: Scene, places: list[float], photons: float, once: bool = True) -> np.ndarray:
    """The tracer's scattered and reflected light at (x, 0, Z), one value per place and batch.

    `once` leaves out light that turned more than once. Cells at equal distance from the axis are averaged
    where the scene has that symmetry.
    """
    rendering = render_scene(scene, rel_error=1e-3, max_photons=photons, seed=1, cache=False)
    response = rendering.response
    if once:
        response = with_rows(response, response.histories.sum(axis=1) == 1)
    maps = response.batches(A, B, scene.tank.wall_albedo if scene.tank else 0.0, part="diffuse")[:, 0]
    row, column = len(rendering.grid.y_m) // 2, len(rendering.grid.x_m) // 2
    found = []
    for x in places:
        step = round(x / CELL)
        cells = [maps[:, row, column + step], maps[:, row, column - step]]
        if scene.tank is None:
            cells += [maps[:, row + step, column], maps[:, row - step, column]]
        found.append(np.mean(cells, axis=0))
    return np.array(found)


def mean_and_error(batches: np.ndarray) -> tuple[float, float]:
    return float(batches.mean()), float(batches.std(ddof=1) / np.sqrt(len(batches)))


def agree(one: np.ndarray, other: np.ndarray, at_most: float) -> None:
    """Two sets of batches agree as well as three standard errors allow (Welch's test), and are known well."""
    (m1, e1), (m2, e2) = mean_and_error(one), mean_and_error(other)
    assert np.hypot(e1, e2) < at_most * m2
    p = stats.ttest_ind(one, other, equal_var=False).pvalue
    assert p > 2 * stats.norm.sf(3), f"{m1:.4g} +- {e1:.2g}, {m2:.4g} +- {e2:.2g}"


def lit_water(phase: dict[str, Any], **parts: Any) -> Scene:
    return Scene.from_dict({
        "lamp": {"hwhm_deg": HWHM_DEG},
        "water": {"absorption_per_m": A, "scattering_per_m": B, "phase": phase},
        "detector": {"planes_m": [Z], "width_m": 2.1, "pixels": 21},
        **parts,
    })  # fmt: skip


PHASES = {
    "henyey-greenstein": {"type": "henyey-greenstein", "g": 0.92},
    "fournier-forand": {"type": "fournier-forand", "n": 1.10, "mu": 3.5835},
    "petzold clear": {"type": "petzold", "water": "clear"},
}


def plugin(model: dict[str, Any]) -> dict[str, Any]:
    if model["type"] == "henyey-greenstein":
        return {"type": "hg", "g": model["g"]}
    return {"type": "lightfield_phase", "model": json.dumps(model)}


def test_sum_of_all_orders() -> None:
    """On and off axis: values on which two independent codes agree within 2 %, and three of our errors."""
    traced = traced_irradiance(lit_water(PHASES["henyey-greenstein"]), [0.0, 0.3, 0.6, 1.0], 6e6, once=False)
    for mine, known in zip(traced, (0.00426, 0.00341, 0.00186, 0.00059), strict=True):
        mean, error = mean_and_error(mine)
        assert error < 0.012 * known
        assert abs(mean - known) < np.hypot(0.02 * known, 3 * error)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fournier-forand", "henyey-greenstein", "petzold clear"])
def test_single_scattering_in_open_water(name: str) -> None:
    """On and off axis: sampled by the tracer, evaluated by `volpath`, strong forward peaks included.

    That of Henyey and Greenstein is in the quick tests of the meter and of the tank.
    """
    places = [0.0, 0.3, 0.6, 1.0]
    traced = traced_irradiance(lit_water(PHASES[name]), places, 2e6)
    stock = stock_scene(plugin(PHASES[name]), OPEN)
    for x, mine in zip(places, traced, strict=True):
        agree(mine, stock_irradiance(stock, x), 0.03)


def test_irradiance_meter_in_open_water() -> None:
    """The same through Mitsuba's own `irradiancemeter`, which settles what is meant by irradiance."""
    traced = traced_irradiance(lit_water(PHASES["henyey-greenstein"]), [0.6], 1e6)[0]
    stock = stock_scene(plugin(PHASES["henyey-greenstein"]), OPEN, meter_x=0.6)
    values = []
    for batch in range(BATCHES):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(1000 + batch, 150_000)
        numbers = sampler.next_1d(), sampler.next_2d(), sampler.next_2d()
        rays, _ = stock.sensors()[0].sample_ray_differential(0.0, *numbers)
        values.append(np.pi * radiance(stock, rays, batch).mean())  # cosine-weighted rays
    agree(traced, np.array(values), 0.2)


def test_single_scattering_and_reflection_in_a_tank() -> None:
    """A channel 1.2 m wide and 1 m deep, albedo 0.6, with a lid: water and walls in one detector."""
    tank = {"width_m": 1.2, "depth_m": 1.0, "length_m": 8.0, "lamp_depth_m": 0.4, "wall_albedo": 0.6}
    detector = {"planes_m": [Z], "width_m": 1.1, "pixels": 11, "height_m": 0.7}
    scene = lit_water(PHASES["henyey-greenstein"], tank=tank, detector=detector)
    turn = mi.ScalarTransform4f
    box = turn().translate([0, -0.1, 3.5]) @ turn().scale([0.6, 0.5, 4.0])
    walls = {"box": {"type": "cube", "to_world": box, "flip_normals": True, "bsdf": grey(0.6)}}
    stock = stock_scene(plugin(PHASES["henyey-greenstein"]), walls)
    for x, mine in zip([0.0, 0.5], traced_irradiance(scene, [0.0, 0.5], 2e6), strict=True):
        agree(mine, stock_irradiance(stock, x), 0.03)
