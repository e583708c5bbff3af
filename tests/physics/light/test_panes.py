"""Panes of bare glass: their reflectance, images of the lamp in them beside rays that are followed and beside
the tracer, light of fits beside full traces, and a tank of glass that is found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from followed_in_a_tank import followed, turbid
from scipy.integrate import quad

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.maps import render_scene
from lightfield.render.reflected import panes
from lightfield.render.reflected.reflected_light import ReflectedLight
from lightfield.scene import Scene, Tank

TANK = {"width_m": 1.0, "depth_m": 0.8, "length_m": 5.0, "behind_lamp_m": 0.3, "lamp_depth_m": 0.5}
WATER, GLASS = 1.34, 1.5
PER_M = 0.1


def scene(values: Mapping[str, Any] | None = None, **tank: Any) -> Scene:
    read = {"planes_m": [1.5, 3.0, 4.2], "width_m": 0.9, "height_m": 0.56, "pixels": 8}
    plain = {"lamp": {"hwhm_deg": 15.0}, "water": {"absorption_per_m": PER_M}, "tank": TANK | tank}
    return Scene.from_dict({**plain, "detector": read}).with_values(values or {})


def two_faces(degrees: float) -> float:
    """Reflectance of a pane from angles alone (Fresnel's sine and tangent laws), face after face."""
    angle = np.radians(degrees)
    inside, outside = np.arcsin(np.sin(angle) * WATER / GLASS), np.arcsin(np.sin(angle) * WATER)
    parts = []
    for law in (np.sin, np.tan):
        first, second = ((law(a - b) / law(a + b)) ** 2 for a, b in ((angle, inside), (inside, outside)))
        # Light that comes out again at once, after two passes, after four, ...
        parts.append(first + (1 - first) ** 2 * sum(second * (first * second) ** n for n in range(60)))
    return float(np.mean(parts))


def test_reflectance_of_a_pane() -> None:
    """By the laws of sines and tangents, by the closed value at right angles, and total beyond 48 degrees."""
    ((first, second),) = [(((WATER - GLASS) / (WATER + GLASS)) ** 2, ((GLASS - 1) / (GLASS + 1)) ** 2)]
    straight = (first + second - 2 * first * second) / (1 - first * second)
    assert panes.reflectance(np.array([1.0])) == pytest.approx(straight)
    at = np.array([5.0, 25.0, 40.0, 47.0])
    assert panes.reflectance(np.cos(np.radians(at))) == pytest.approx([two_faces(a) for a in at.tolist()])
    assert panes.reflectance(np.cos(np.radians([48.3, 60.0, 90.0]))) == pytest.approx(1.0)


def test_what_panes_mirror_of_diffuse_light() -> None:
    def weighed(cosine: float) -> float:
        return 2 * cosine * float(panes.reflectance(np.array([cosine]))[0])

    critical = np.sqrt(1 - 1 / WATER**2)
    mean = sum(quad(weighed, *ends, limit=200)[0] for ends in ((0.0, critical), (critical, 1.0)))
    area = 2 * (1.0 * 0.8 + 1.0 * 5.0 + 0.8 * 5.0)
    for faces, glass in (("none", 0.0), ("sides", 2 * 0.8 * 5.0), ("all", area - 5.0)):
        found = panes.diffuse_part(Tank(**TANK, panes=faces))
        assert found == pytest.approx(mean * glass / area, rel=2e-3)


@pytest.mark.usefixtures("backend")
def test_the_tracer_has_the_same_reflectance() -> None:
    from lightfield.render.tracer.surfaces import pane_fresnel

    cosine = np.linspace(0.0, 1.0, 2001)
    np.testing.assert_allclose(np.array(pane_fresnel(mi.Float(cosine))), panes.reflectance(cosine), atol=2e-4)


def test_bare_panes_lose_nothing_of_a_beam_that_meets_them_flat() -> None:
    """Through every cross-section of a tank of glass goes all that the lamp sends out, and 0.2 % of it again:
    what both ends reflect. What comes back from the far end falls on the back of the receiver."""
    lit = scene({"lamp.hwhm_deg": 10.0}, panes="all", surface="flat")
    n = 30
    across, up = (np.arange(n) + 0.5) / n - 0.5, 0.8 * ((np.arange(n) + 0.5) / n) - 0.3
    x, y = (g.ravel() for g in np.meshgrid(across, up))
    theta = np.arange(1e-4, np.pi / 2, 2e-4)
    sent = 2 * np.pi * np.sum(np.exp(-np.log(2) * np.degrees(theta) ** 2 / 100) * np.sin(theta)) * 2e-4
    for z in (1.5, 3.0, 4.6):
        mirrored = ReflectedLight.at(lit, x, y, np.full(x.size, z)).evaluate(lit, 0.0)
        r2 = x**2 + y**2 + z**2
        straight = np.exp(-np.log(2) * (np.degrees(np.arctan2(np.hypot(x, y), z)) / 10.0) ** 2) * z / r2**1.5
        assert (mirrored + straight).mean() * 0.8 == pytest.approx(sent * (1 + two_faces(0.1) ** 2), rel=5e-4)


def followed_rays(lit: Scene, z_m: float, cells: int, rays: int = 400_000) -> tuple[np.ndarray, np.ndarray]:
    """Mirrored light in the cells of a cross-section, by rays that are followed from face to face; its error.

    Written from the definitions: nothing here knows of images.
    """
    rng, tank, lamp = np.random.default_rng(7), lit.tank, lit.lamp
    assert tank is not None
    (left, right), (floor, top), _ = tank.box_m
    width = np.radians(lamp.hwhm_deg) / np.sqrt(np.log(2))
    # Angles of a Gaussian beam, drawn in the plane; weighed by sin(theta) / theta.
    theta = width * np.sqrt(-np.log(1 - rng.random(rays)))
    weight = np.where(theta < np.pi / 2, np.pi * width**2 * np.sin(theta) / theta, 0.0)
    phi, tilt = rng.uniform(0, 2 * np.pi, rays), np.radians(lamp.tilt_x_deg)
    dx, dy, dz = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    dx, dz = dx * np.cos(tilt) + dz * np.sin(tilt), dz * np.cos(tilt) - dx * np.sin(tilt)
    ahead = dz > 0
    weight, dx, dy, dz = (v[ahead] for v in (weight, dx, dy, dz))
    x, y, z = np.full(len(dx), lamp.offset_x_m), np.full(len(dx), lamp.offset_y_m), np.zeros(len(dx))
    met, flies = np.zeros(len(dx), int), np.arange(len(dx))
    while len(flies):
        ux, uy, uz = dx[flies], dy[flies], dz[flies]
        to_side = np.where(ux > 0, right - x[flies], left - x[flies]) / ux
        to_level = np.where(uy > 0, top - y[flies], floor - y[flies]) / uy
        to_plane = (z_m - z[flies]) / uz
        step = np.minimum(np.minimum(to_side, to_level), to_plane)
        for at, u in ((x, ux), (y, uy), (z, uz)):
            at[flies] += step * u
        weight[flies] *= np.exp(-PER_M * step)
        side, on = to_side <= to_level, (to_plane > step) & (weight[flies] > 1e-9)
        degrees = np.degrees(np.arccos(np.where(side, np.abs(ux), np.abs(uy))))
        total = degrees >= CRITICAL
        pane = np.where(total, 1.0, np.interp(degrees, ANGLES, OF_PANE))
        surface = np.where(total, 1.0, np.interp(degrees, ANGLES, OF_WATER))
        up, glass = ~side & (uy > 0), side | (tank.panes == "all")
        kept = np.where(up, tank.surface_reflectance * surface, tank.pane_reflectance * glass * pane)
        flies, side, kept = flies[on], side[on], kept[on]
        weight[flies] *= kept
        met[flies] += 1
        dx[flies[side]] *= -1
        dy[flies[~side]] *= -1
    arrived = z > z_m - 1e-9
    area = (right - left) * (top - floor) / cells**2
    column = np.clip(((x - left) / (right - left) * cells).astype(int), 0, cells - 1)
    row = np.clip(((y - floor) / (top - floor) * cells).astype(int), 0, cells - 1)
    power = np.where((met > 0) & arrived, weight, 0.0)
    total, squares = (np.bincount(row * cells + column, p, cells**2) for p in (power, power**2))
    return total / rays / area, np.sqrt(squares) / rays / area


CRITICAL = np.degrees(np.arcsin(1 / WATER))
#: Close to each other where the reflectance rises steeply.
ANGLES = CRITICAL * (1 - np.linspace(0.99, 1e-4, 400) ** 2)
OF_PANE = np.array([two_faces(float(a)) for a in ANGLES])
_INSIDE, _OUT = np.radians(ANGLES), np.arcsin(WATER * np.sin(np.radians(ANGLES)))
OF_WATER = 0.5 * sum((law(_INSIDE - _OUT) / law(_INSIDE + _OUT)) ** 2 for law in (np.sin, np.tan))


@pytest.mark.parametrize(
    ("values", "faces"),
    [
        ({"lamp.offset_x_m": 0.2, "lamp.tilt_x_deg": 12.0}, {"panes": "sides", "surface": "flat"}),
        ({"lamp.hwhm_deg": 35.0, "lamp.offset_y_m": -0.1}, {"panes": "all", "pane_reflectance": 0.6}),
        ({}, {"panes": "all", "surface": "flat"}),
    ],
    ids=["flume", "half covered, wide beam", "tank of glass"],
)
def test_images_are_rays_that_are_followed(values: dict[str, float], faces: dict[str, Any]) -> None:
    lit, cells, fine = scene(values, **faces), 6, 5
    found, error = followed_rays(lit, 3.0, cells)
    at = (np.arange(cells * fine) + 0.5) / (cells * fine)
    x, y = (g.ravel() for g in np.meshgrid(at - 0.5, 0.8 * at - 0.3))
    light = ReflectedLight.at(lit, x, y, np.full(x.size, 3.0)).evaluate(lit, PER_M)
    images = light.reshape(cells, fine, cells, fine).mean(axis=(1, 3)).ravel()
    off = (images - found) / np.maximum(error, 1e-3 * images)
    assert np.mean(off**2) < 1.7 and np.abs(off).max() < 4.5
    assert images.mean() == pytest.approx(found.mean(), rel=0.01)


@pytest.mark.usefixtures("backend")
@pytest.mark.parametrize("faces", [{"panes": "sides"}, {"panes": "all", "surface": "flat"}])
def test_the_tracer_mirrors_as_images_do(faces: dict[str, Any]) -> None:
    """Every cell within its error, for a lamp behind its window too."""
    lit = scene({"lamp.apparent_distance_m": 0.2}, **faces)
    rendering = render_scene(lit, max_photons=2e6, rel_error=1e-4, seed=2, cache=False)
    mean, stderr = (v[0].ravel() for v in rendering.relative_maps(np.array([525.0]), "diffuse"))
    grid, fine = rendering.grid, 5
    step = (np.arange(fine) - 0.5 * (fine - 1)) / fine
    z, y, x = np.meshgrid(grid.z_m, grid.y_m, grid.x_m, indexing="ij")
    dy, dx = np.meshgrid(step * grid.pitch_y_m, step * grid.pitch_x_m, indexing="ij")
    places = [np.add.outer(v.ravel(), d.ravel()).ravel() for v, d in ((x, dx), (y, dy), (z, 0.0 * dx))]
    images = ReflectedLight.at(lit, *places).evaluate(lit, PER_M).reshape(-1, fine**2).mean(axis=1)
    off = (mean - images) / np.hypot(stderr, 2e-3 * images)
    assert np.mean(off**2) < 1.6 and np.abs(off).max() < 4.5
    assert mean.mean() == pytest.approx(images.mean(), rel=3e-3)


@pytest.mark.usefixtures("backend")
@pytest.mark.parametrize(
    ("tank", "stated"),
    [
        ({"panes": "all", "surface": "flat"}, {}),
        ({"panes": "all", "pane_reflectance": 0.5}, {"tank.pane_reflectance": 0.0}),
        ({"panes": "sides", "wall_albedo": 0.8, "surface": "flat", "floor_over_walls": 0.0}, {}),
        pytest.param({"panes": "all", "wall_albedo": 0.5}, {}, marks=pytest.mark.slow),
        ({"panes": "sides", "wall_albedo": 0.5, "pane_reflectance": 0.5}, {"tank.pane_reflectance": 1.0}),
        pytest.param(
            {"panes": "all", "wall_albedo": 0.5, "pane_reflectance": 0.0},
            {"tank.pane_reflectance": 1.0},
            marks=pytest.mark.slow,
        ),
        pytest.param(
            {"panes": "sides", "surface": "flat"}, {"tank.surface_reflectance": 0.0}, marks=pytest.mark.slow
        ),
    ],
)
def test_light_of_fits_in_turbid_water(tank: dict[str, Any], stated: dict[str, float]) -> None:
    """What a fit follows, by a trace of the scene as it is stated, beside a full trace of it as it is."""
    lit = turbid(**tank)
    for ratio, error, noise in followed(lit, lit.with_values(stated)):
        assert abs(ratio - 1) < 2.5 * np.hypot(error, noise)
        assert error < 0.08


def measured(truth: Scene) -> Readings:
    """Readings of a full trace, with errors of 0.5 %."""
    rng = np.random.default_rng(5)
    x, y, z = (g.ravel() for g in np.meshgrid(np.linspace(-0.3, 0.3, 5), [-0.15, 0.1], [1.0, 2.0, 3.0, 4.0]))
    bare = Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=np.ones(x.size))
    light, error = rendered_light(truth, bare, max_photons=2e6, rel_error=0.002)
    value = light / light.max()
    stderr = np.hypot(0.005 * value, error / light.max())
    noisy = value + stderr * rng.standard_normal(x.size)
    return Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=noisy, stderr=stderr)


@pytest.mark.usefixtures("backend")
@pytest.mark.parametrize(
    ("faces", "surface"), [("sides", "none"), pytest.param("all", "flat", marks=pytest.mark.slow)]
)
def test_a_tank_of_glass_that_nobody_thought_of_is_found(faces: str, surface: str) -> None:
    """The scene says that there are panes, and that they are covered."""
    table = measured(scene({"lamp.hwhm_deg": 14.0}, panes=faces, surface=surface))
    believed = scene(panes=faces, pane_reflectance=0.0, surface=surface)
    only = ["pane_reflection", "wall_reflection", "background", "water_gradient"]
    verdict = diagnose(table, believed, only=only, advise=False).verdict
    assert verdict.effects == ["pane_reflection"], verdict.sentence
    found = verdict.explanations[0].parameters["tank.pane_reflectance"]
    assert abs(found.value - 1.0) < 4 * found.stderr < 0.2


@pytest.mark.usefixtures("backend")
@pytest.mark.parametrize(
    ("tank", "about"), [({"panes": "sides"}, 'tank.panes = "sides"'), ({"wall_albedo": 0.5}, None)]
)
def test_who_says_nothing_of_panes_is_asked_for_them(tank: dict[str, Any], about: str | None) -> None:
    """Where they do better than all that was tried; walls that do reflect are no glass."""
    table = measured(scene({"lamp.hwhm_deg": 14.0}, **tank))
    verdict = diagnose(table, scene(), only=["wall_reflection", "background"], advise=False).verdict
    told = [one for one in verdict.cautions if one.warns is Warns.OF_GLASS]
    assert [one.about for one in told] == ([about] if about else [])
    assert all(one.speaks_of_a_mistake and "diagnose again" in one.sentence for one in told)
