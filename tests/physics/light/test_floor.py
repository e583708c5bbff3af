"""A floor or a far end that reflects otherwise than walls: against a sum over the floor, a full trace, and in
a fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from followed_in_a_tank import followed, turbid

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.diffuse.source import response_for
from lightfield.render.maps import render_scene
from lightfield.render.reflected.reflected_light import ReflectedLight
from lightfield.scene import Scene

TANK = {"width_m": 2.0, "depth_m": 1.4, "length_m": 6.0, "behind_lamp_m": 0.4, "lamp_depth_m": 0.6}
PER_M = 0.1


def scene(walls: float, floor: float, **tank: float) -> Scene:
    lamp, water = {"hwhm_deg": 25.0}, {"absorption_per_m": PER_M}
    box = {**TANK, "wall_albedo": walls, "floor_over_walls": floor, **tank}
    return Scene.from_dict({"lamp": lamp, "water": water, "tank": box, "detector": {"planes_m": [3.0]}})


def places() -> tuple[np.ndarray, ...]:
    x, y, z = (g.ravel() for g in np.meshgrid([-0.5, 0.0, 0.4], [-0.6, -0.2, 0.3], [1.5, 2.5, 3.5, 4.5]))
    return x, y, z


def test_light_of_a_floor_alone_is_a_sum_over_it() -> None:
    """Once reflected: I(theta) cos / r^2 on the floor, albedo / pi of that, cos cos / d^2 at the reading."""
    x, y, z = places()
    room = ReflectedLight.at(scene(1e-4, 1.0), x, y, z)
    # Walls of 1e-4: next to nothing meets two of them, and of the difference they are no part.
    bright, dim = (room.evaluate(scene(1e-4, share), PER_M) for share in (90.0, 40.0))
    found = (bright - dim) / 0.005
    u, w = (np.arange(400) + 0.5) / 400 * 2.0 - 1.0, (np.arange(1200) + 0.5) / 1200 * 6.0 - 0.4
    gx, gz = (g.ravel() for g in np.meshgrid(u, w, indexing="ij"))
    below = -(1.4 - 0.6)
    r = np.sqrt(gx**2 + below**2 + gz**2)
    theta = np.degrees(np.arctan2(np.hypot(gx, below), gz))
    lit = np.exp(-np.log(2) * (theta / 25.0) ** 2 - PER_M * r) * -below / r**3
    area = (2.0 / 400) * (6.0 / 1200)
    expected = []
    for px, py, pz in zip(x, y, z, strict=True):
        d = np.sqrt((px - gx) ** 2 + (py - below) ** 2 + (pz - gz) ** 2)
        up, ahead = (py - below) / d, np.maximum(pz - gz, 0.0) / d
        expected.append(np.sum(lit / np.pi * np.exp(-PER_M * d) * up * ahead / d**2) * area)
    np.testing.assert_allclose(found, expected, rtol=0.02)


@pytest.mark.parametrize(
    ("walls", "floor", "end"), [(0.15, 4.0, 1.0), (0.6, 0.2, 1.0), (0.6, 1.0, 0.0), (0.2, 2.0, 4.0)]
)
def test_traced_faces_are_those_of_patches(walls: float, floor: float, end: float) -> None:
    """The walk of photons and the exchange between patches: the mean over every cell within its error."""
    short = {"tank.length_m": 4.5, "lamp.hwhm_deg": 12.0}
    read = {"detector.width_m": 1.6, "detector.height_m": 1.0, "detector.pixels": 4}
    lit = scene(walls, floor, end_over_walls=end).with_values(short | read)
    rendering = render_scene(lit, max_photons=1e6, rel_error=0.001)
    ((traced,), (stderr,)) = (v[0] for v in rendering.relative_maps(np.array([525.0]), "diffuse"))
    grid = rendering.grid
    part = (np.arange(6) + 0.5) / 6 - 0.5
    u, v = (g.ravel() for g in np.meshgrid(grid.x_m, grid.y_m))
    x = (u[:, None] + np.repeat(part, 6) * grid.pitch_x_m).ravel()
    y = (v[:, None] + np.tile(part, 6) * grid.pitch_y_m).ravel()
    z = np.full(x.size, 3.0)
    room = ReflectedLight.at(lit, x, y, z)
    faces = lit, scene(walls, 1.0).with_values(short)
    known, plain = (room.evaluate(each, PER_M).reshape(u.size, -1).mean(axis=1) for each in faces)
    off = (traced.ravel() - known) / np.hypot(stderr.ravel(), 0.01 * known)
    assert np.abs(off).max() < 4.5 and np.mean(off**2) < 2.5
    assert np.abs(known / plain - 1).max() > 0.2 > 3 * np.median(stderr.ravel() / known)


@pytest.mark.slow
def test_light_that_the_floor_and_particles_turned_follows_the_floor() -> None:
    """A response traced with a floor like the walls, asked for a brighter one, against its own full trace."""
    x, y, z = places()
    lit = scene(0.15, 4.0).with_values({"water.scattering_per_m": 0.15})
    table = Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=np.ones(x.size))
    light, stderr = rendered_light(lit, table, max_photons=4e6, rel_error=0.001)
    direct = rendered_light(scene(0.0, 1.0), table, max_photons=1e3)[0] * np.exp(
        -0.15 * np.sqrt(x**2 + y**2 + z**2)
    )
    fast = response_for(lit, x, y, z, photons=300_000).evaluate(lit)
    off = (light - direct) / fast[0] - 1
    error = np.hypot(stderr / (light - direct), fast[1] / fast[0])
    assert np.abs(off).max() < 4 * error.max() + 0.02
    assert abs(np.mean(off)) < 0.02


@pytest.fixture(scope="module")
def hidden() -> tuple[Readings, Scene]:
    """Readings of a full trace: grey walls of 0.15 over a floor of 0.6."""
    rng = np.random.default_rng(5)
    x, y, z = (
        g.ravel() for g in np.meshgrid([-0.6, -0.2, 0.2, 0.6], [-0.6, -0.3, 0.0, 0.3], [1.5, 2.5, 3.5, 4.5])
    )
    truth = scene(0.15, 4.0).with_values({"lamp.hwhm_deg": 23.0})
    bare = Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=np.ones(x.size))
    light, error = rendered_light(truth, bare, max_photons=2e6, rel_error=0.001)
    value = light / light.max()
    stderr = np.hypot(np.hypot(0.005 * value, 5e-4), error / light.max())
    shown: dict[str, Any] = {"value": value + stderr * rng.standard_normal(x.size), "stderr": stderr}
    return Readings.from_arrays(x_m=x, y_m=y, z_m=z, **shown), scene(0.0, 1.0)


@pytest.mark.slow
def test_a_bright_floor_is_found_beside_its_walls(hidden: tuple[Readings, Scene]) -> None:
    table, believed = hidden
    only = ["wall_reflection", "floor_reflection", "background"]
    verdict = diagnose(table, believed, only=only, advise=False).verdict
    assert verdict.effects == ["wall_reflection", "floor_reflection"], verdict.sentence
    values = verdict.explanations[0].parameters
    for path, true in (("tank.wall_albedo", 0.15), ("tank.floor_over_walls", 4.0)):
        assert abs(values[path].value - true) < 4 * values[path].stderr + 0.03 * true, path


@pytest.mark.parametrize(
    "values",
    [
        {"tank.floor_over_walls": 0.0},
        {"tank.end_over_walls": 0.0},
        {"water.gradient_per_m2": 0.05, "water.gradient_centre_m": 3.0, "tank.surface_reflectance": 1.0},
        {"water.gradient_per_m2": 0.01, "water.gradient_centre_m": 6.0},
        {"water.absorption_departure": ((0.0, 0.06), (4.0, 0.0), (8.0, 0.08))},
    ],
    ids=["black floor", "black end", "gradient", "gradient that leaves less", "curve"],
)
def test_what_a_fit_guesses_of_light_from_walls_is_in_its_errors(values: dict[str, Any]) -> None:
    """Light that is scattered too follows floor and end as other light does, and layers dim it as if it came
    straight: under a black floor 3 % too bright at 6 m, where 0.6 to 0.8 % were stated."""
    lit = turbid(wall_albedo=0.8).with_values(values)
    surface = "tank.surface_reflectance"
    believed = turbid(wall_albedo=0.8).with_values({surface: values.get(surface, 0.0)})
    for ratio, stated, noise in followed(lit, believed):
        assert abs(ratio - 1) < 2.5 * np.hypot(stated, noise)


@pytest.mark.parametrize(
    ("walls", "values"),
    [
        (0.8, {"tank.floor_over_walls": 0.0}),
        (0.8, {"tank.end_over_walls": 0.0}),
        (0.15, {"tank.floor_over_walls": 5.0}),
        (0.3, {"tank.end_over_walls": 3.0}),
    ],
)
def test_a_floor_and_an_end_that_the_scene_states_are_in_the_trace_of_a_fit(
    walls: float, values: dict[str, float]
) -> None:
    lit = turbid(wall_albedo=walls).with_values(values)
    for ratio, stated, noise in followed(lit, lit):
        assert abs(ratio - 1) < 2.5 * np.hypot(stated, noise) < 0.03
