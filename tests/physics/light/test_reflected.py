"""Reflected, unscattered light without noise: against the tracer, energy kept, and Fresnel's numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from lightfield.render.reflected import room
from lightfield.render.reflected.from_lamp import before_lamp, fresnel, image_of_lamp
from lightfield.render.reflected.orders import REFLECTIONS, reflections_of
from lightfield.render.reflected.patches import transfer
from lightfield.render.reflected.reflected_light import ReflectedLight
from lightfield.render.reflected.room import OFTEN, Room
from lightfield.scene import Scene
from lightfield.scene.lamp.profile import solid_angle_sr
from lightfield.scene.receiver import response

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
        pytest.param("lid", 0.5, {}, marks=pytest.mark.slow),
        ("lid", 0.8, {"lamp.tilt_x_deg": 6.0, "lamp.ellipticity": 1.5}),
        pytest.param("surface", 0.0, {"lamp.offset_y_m": 0.1}, marks=pytest.mark.slow),
        ("surface", 0.5, {}),
        pytest.param("dim surface", 0.5, {}, marks=pytest.mark.slow),
        ("dim surface", 0.8, {"lamp.offset_y_m": 0.1}),
        ("lid", 0.4, {"lamp.apparent_distance_m": 1.0, "lamp.offset_x_m": -0.2}),
        ("lid", 0.6, {"detector.tilt_x_deg": 60.0}),
    ],
)
def test_traced_reflections_agree(top: str, albedo: float, beam: dict[str, float]) -> None:
    """The same light from the tracer, any number of reflections, within its stated error.

    Evaluated at 5 x 5 points of each cell, because the tracer counts whole cells.
    """
    from lightfield.render.maps import render_scene

    values = {
        "tank.wall_albedo": albedo,
        "tank.surface_reflectance": {"lid": 0.0, "surface": 1.0, "dim surface": 0.3}[top],
        **beam,
    }
    scene = Scene.from_toml(SCENE).with_values(values)
    rendering = render_scene(scene, rel_error=1e-5, max_photons=2e6, seed=4, cache=False)
    mean, stderr = (v[0].ravel() for v in rendering.relative_maps(np.array([525.0]), "diffuse"))
    grid = rendering.grid
    steps = (np.arange(5) - 2) / 5
    dy, dx = np.meshgrid(steps * grid.pitch_y_m, steps * grid.pitch_x_m, indexing="ij")
    z, y, x = (v.ravel() for v in np.meshgrid(grid.z_m, grid.y_m, grid.x_m, indexing="ij"))
    points = [np.add.outer(v, d.ravel()).ravel() for v, d in ((x, dx), (y, dy))]
    light = ReflectedLight.at(scene, *points, np.repeat(z, 25)).evaluate(scene, 0.1)
    expected = light.reshape(-1, 25).mean(axis=1)
    z_score = (mean - expected) / np.hypot(stderr, 0.01 * expected)  # 1 %: patches of 0.3 m
    assert np.abs(z_score).max() < 4.5
    assert np.mean(z_score**2) < 2.5
    assert mean.mean() == pytest.approx(expected.mean(), rel=0.02)


@pytest.mark.parametrize(
    ("top", "behind_m"), [pytest.param("lid", 15.0, marks=pytest.mark.slow), ("surface", 0.0)]
)
def test_what_comes_back_from_the_ends_of_a_long_tank(top: str, behind_m: float) -> None:
    """A tow tank of white walls and clear water, whose light returns from far beyond the readings and from
    behind the lamp: as traced, within 1 % and the trace's error (without the ends 0.5 to 0.85 of it)."""
    from lightfield.render.maps import render_scene

    tank = {"width_m": 3.66, "depth_m": 2.44, "length_m": 36.6, "wall_albedo": 0.9, "behind_lamp_m": behind_m}
    detector = {"planes_m": [2.5, 4.5, 8.5], "width_m": 2.0, "height_m": 2.0, "pixels": 4}
    scene = Scene.from_dict(
        {
            "water": {"absorption_per_m": 0.04},
            "tank": tank | {"surface": "none" if top == "lid" else "flat"},
            "detector": detector,
        }
    )
    rendering = render_scene(scene, rel_error=1e-5, max_photons=4e6, seed=4, symmetry=True, cache=False)
    mean, stderr = (v[0] for v in rendering.relative_maps(np.array([525.0]), "diffuse"))
    grid, steps = rendering.grid, (np.arange(3) - 1) / 3
    z, y, x = (v.ravel() for v in np.meshgrid(grid.z_m, grid.y_m, grid.x_m, indexing="ij"))
    dy, dx = (v.ravel() for v in np.meshgrid(steps * grid.pitch_y_m, steps * grid.pitch_x_m, indexing="ij"))
    points = np.add.outer(x, dx).ravel(), np.add.outer(y, dy).ravel(), np.repeat(z, 9)
    expected = (
        ReflectedLight.at(scene, *points).evaluate(scene, 0.04).reshape(3, 4, 4, 9).mean(axis=(1, 2, 3))
    )
    # At most four mirror images share their photons.
    error = 2 * np.sqrt((stderr**2).sum(axis=(1, 2))) / 16
    traced = mean.mean(axis=(1, 2))
    assert (np.abs(expected - traced) < 0.01 * traced + 3.5 * error).all()
    assert (error < 0.03 * traced).all()


@pytest.mark.parametrize(("albedo", "profile"), [(0.3, "gaussian"), (0.8, "gaussian"), (0.5, "isotropic")])
def test_closed_tank_of_clear_water_keeps_the_energy(albedo: float, profile: str) -> None:
    """All that the lamp sends out ends in the walls: sum of (1 - rho) E A = power in a closed box, c = 0.

    An isotropic lamp lights the wall behind it too: 4 pi sr, of which half would be missing without it.
    """
    values = {"tank.wall_albedo": albedo, "tank.length_m": 8.0, "lamp.profile": profile}
    scene = Scene.from_toml(SCENE).with_values(values)
    light = ReflectedLight.at(scene, *(np.array([v]) for v in (0.0, 0.0, 6.0)))
    room, among, _ = exchanged(light, 0.0)
    lit = room.lit(scene.lamp, False, [0.0]).reshape(len(room.patches.centre), -1).mean(axis=1)
    irradiance = np.linalg.solve(np.eye(len(lit)) - albedo * among, lit)
    power = float(((1 - albedo) * irradiance * room.patches.area).sum())
    assert power == pytest.approx(solid_angle_sr(scene.lamp), rel=0.03)
    np.testing.assert_allclose(room.among.factor, among[: len(among) // 2], rtol=1e-5)
    np.testing.assert_allclose(room.among.factor.sum(axis=1), 1.0, rtol=1e-5)
    np.testing.assert_allclose(room.reading.factor.sum(axis=1), 1.0, rtol=1e-5)


def test_light_from_behind_the_window_meets_the_surface_beyond_it() -> None:
    """From 1.5 m behind the window a ray to a reading on the axis meets the surface halfway, at
    (z - 1.5 m) / 2: beyond the window only from z = 1.5 m on."""
    lamp = Scene.from_toml(SCENE).lamp.model_copy(update={"apparent_distance_m": 1.5, "hwhm_deg": 40.0})
    places = np.array([[0.0, 0.0, z] for z in (0.5, 1.4, 1.6, 4.5)])
    _, light, _ = image_of_lamp(lamp, 0.6, places)
    assert (light[:2] == 0).all()
    assert (light[2:] > 0).all()


def exchanged(light: ReflectedLight, attenuation: float) -> tuple[Room, np.ndarray, np.ndarray]:
    """A closed room, and what all patches send to each other and all parts of them to the readings.

    Both sides of the tank, each for itself: nothing here knows that they are mirror images.
    """
    room = light.ways.room(lid=True)

    def facing(direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        normal = room.patches.normal[which]
        return np.maximum(-sum(d * normal[..., i] for i, d in enumerate(direction)), 0)

    def read(direction: Sequence[np.ndarray], _: np.ndarray) -> np.ndarray:
        return response(room.scene.detector, direction)

    def back(direction: Sequence[np.ndarray], _: np.ndarray) -> np.ndarray:
        return np.maximum(direction[2], 0)

    among = transfer(room.patches.centre, facing, room.patches)
    reading = transfer(light.ways.places, read, room.fine)
    whole = among, transfer(light.ways.places, back, room.fine)
    found = [
        t._replace(factor=t.factor / w.factor.sum(axis=1)[:, None]).through(attenuation)
        for t, w in zip((among, reading), whole, strict=True)
    ]
    return room, found[0], found[1]


def solved(light: ReflectedLight, scene: Scene, attenuation: float) -> np.ndarray:
    """Light of all reflections at once, from the linear system of the patches; (n,), as places are told."""
    assert scene.tank is not None
    room, among, reading = exchanged(light, attenuation)
    _, up, ahead = room.patches.normal.T
    albedo = np.where(up == 1, scene.tank.floor_over_walls, 1.0)
    albedo[ahead == -1] = scene.tank.end_over_walls
    albedo *= scene.tank.wall_albedo
    lit = room.lit(scene.lamp, False, [attenuation])[0]
    patches = lit.reshape(len(room.patches.centre), -1).mean(axis=1)
    every = albedo * np.linalg.solve(np.eye(len(patches)) - among * albedo, patches)
    again = np.repeat(every - albedo * patches, room.parts**2) + np.repeat(albedo, room.parts**2) * lit
    return np.asarray((reading @ again)[light.which])


@pytest.mark.parametrize(
    "aside", [{"lamp.offset_x_m": 0.3}, {"lamp.tilt_x_deg": -4.0, "lamp.tilt_y_deg": 2.0}]
)
@pytest.mark.parametrize("receiver", [{}, {"detector.tilt_x_deg": 20.0}])
def test_light_of_a_lamp_that_is_not_in_the_middle(
    aside: dict[str, float], receiver: dict[str, float]
) -> None:
    """What is opposite on both sides of the tank counts then; a receiver that looks aside sees it alone."""
    scene = Scene.from_toml(SCENE).with_values({"tank.wall_albedo": 0.5} | aside | receiver)
    light = ReflectedLight.at(scene, *np.array([[-0.6, 0.2, 4.5], [0.0, 0.0, 5.5], [0.6, 0.2, 4.5]]).T)
    found = light.evaluate(scene, 0.1)
    assert abs(found[0] / found[2] - 1) > 0.02
    assert found == pytest.approx(solved(light, scene, 0.1), rel=1e-3)


@pytest.mark.parametrize("hwhm_deg", [4.0, 14.0])
@pytest.mark.parametrize(
    ("walls", "floor", "end"),
    [(0.15, 5.0, 1.0), (0.3, 2.5, 1.0), (0.9, 1.1, 1.0), (0.9, 0.5, 0.5), (0.6, 1.0, 1.5), (0.3, 0.0, 0.0)],
)
def test_faces_of_other_albedo(walls: float, floor: float, end: float, hwhm_deg: float) -> None:
    """A floor or a far end that reflects more than walls, or less. Interpolated between a few shares (a floor
    of 0.75 between walls of 0.15, a beam of 4 degrees) light was 89 % too bright."""
    box = {"width_m": 2.0, "depth_m": 1.4, "length_m": 6.0, "behind_lamp_m": 0.4, "lamp_depth_m": 0.6}
    faces = {"wall_albedo": walls, "floor_over_walls": floor, "end_over_walls": end}
    scene = Scene.from_dict(
        {"lamp": {"hwhm_deg": hwhm_deg}, "tank": {**box, **faces}, "detector": {"planes_m": [3.0]}}
    )
    light = ReflectedLight.at(scene, *np.array([[-0.6, 0.2, 1.5], [0.0, 0.0, 3.5], [0.4, -0.6, 5.0]]).T)
    assert light.evaluate(scene, 0.1) == pytest.approx(solved(light, scene, 0.1), rel=1e-3)


@pytest.mark.parametrize("attenuation", [0.0, 0.005, 0.018])
def test_a_white_tow_tank_of_clear_water(attenuation: float) -> None:
    """Closed, walls of 0.9: light comes back from 36 m away by dozens of reflections (with sixteen of them
    followed 2.2 % of it were left out where water takes nothing)."""
    tank = {"width_m": 3.66, "depth_m": 2.44, "length_m": 36.6, "lamp_depth_m": 1.22, "wall_albedo": 0.9}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 3.81}, "tank": tank})
    light = ReflectedLight.at(scene, np.array([0.0, 0.6]), np.array([0.0, 0.2]), np.array([4.5, 6.5]))
    found = light.evaluate(scene, attenuation)
    assert found == pytest.approx(solved(light, scene, attenuation), rel=3e-3)


@pytest.mark.parametrize(
    ("albedo", "within"),
    [(0.7, 0.005), *(pytest.param(at, 0.001, marks=pytest.mark.slow) for at in (0.3, 0.5))],
)
def test_light_is_smooth_in_the_attenuation(albedo: float, within: float) -> None:
    """No jump where the interpolation changes its nodes, and little off what the walls give at that very
    attenuation, by all reflections (solved, not summed)."""
    scene = Scene.from_toml(SCENE).with_values({"tank.wall_albedo": albedo})
    places = np.array([0.0, 0.6]), np.array([0.0, 0.2]), np.array([4.5, 6.5])
    light = ReflectedLight.at(scene, *places)
    for attenuation in (0.05, 0.1, 0.15, 0.2, 0.35, 0.7):
        before, after = (light.evaluate(scene, attenuation + by) for by in (-1e-7, 1e-7))
        assert after == pytest.approx(before, rel=1e-5)
        assert light.evaluate(scene, attenuation) == pytest.approx(
            solved(light, scene, attenuation), rel=within
        )


def test_what_is_remembered_is_not_mistaken() -> None:
    """Lamp, albedo, surface and attenuation change in turn: as if each were asked first, but for the rounding
    of single precision where what is asked often is worked out at once."""
    places = np.array([0.0, 0.6]), np.array([0.0, 0.2]), np.array([4.5, 6.5])
    scene = Scene.from_toml(SCENE).with_values({"tank.wall_albedo": 0.3})
    kept = ReflectedLight.at(scene, *places)
    narrow, surface = {"lamp.hwhm_deg": 9.0}, {"tank.surface_reflectance": 1.0}
    bright = {"tank.wall_albedo": 0.6}
    rippled = {"tank.surface_reflectance": 0.4}
    changes: tuple[dict[str, float], ...] = (
        *({}, narrow, bright, narrow | bright, surface, surface | narrow, rippled),
        *(rippled | bright, rippled | narrow, {}),
    )
    fresh: dict[tuple[frozenset[tuple[str, float]], float], np.ndarray] = {}
    for change in changes:
        asked = scene.with_values(change)
        for attenuation in (0.1, 0.33, 0.1):
            key = frozenset(change.items()), attenuation
            if key not in fresh:
                fresh[key] = ReflectedLight.at(scene, *places).evaluate(asked, attenuation)
            assert kept.evaluate(asked, attenuation) == pytest.approx(fresh[key], rel=1e-6), change


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"tank.wall_albedo": 0.8, "lamp.hwhm_deg": 9.0},
        {"tank.surface_reflectance": 0.4, "lamp.tilt_y_deg": 3.0},
        {"tank.floor_over_walls": 0.4, "lamp.offset_x_m": 0.1},
        {"tank.surface_slope_deg": 4.0, "tank.surface_reflectance": 1.0},
    ],
)
def test_several_waters_at_once_are_one_after_the_other(change: dict[str, float]) -> None:
    """Each water has its own light; here they come in no order, one of them twice, two between the same
    nodes."""
    places = np.array([0.0, 0.6, 0.0]), np.array([0.0, 0.2, 0.3]), np.array([4.5, 6.5, 6.5])
    scene = Scene.from_toml(SCENE).with_values({"tank.wall_albedo": 0.05} | change)
    attenuation = np.array([0.9, 0.33, 0.0, 0.335, 1.3, 0.33])
    at_once = ReflectedLight.at(scene, *places).evaluate(scene, attenuation)
    assert at_once.shape == (6, 3)
    light = ReflectedLight.at(scene, *places)
    np.testing.assert_allclose(at_once, [light.evaluate(scene, c) for c in attenuation], rtol=1e-5)
    shares, errors = light.by_faces(scene, attenuation), light.uncertain(scene, attenuation)
    for k, c in enumerate(attenuation):
        np.testing.assert_allclose(shares[k], light.by_faces(scene, np.array([c]))[0], rtol=1e-5)
        np.testing.assert_allclose(errors[k], light.uncertain(scene, np.array([c]))[0], rtol=1e-5)


@pytest.mark.parametrize("albedo", [0.03, 0.2, 0.3, 0.55])
def test_dark_walls_need_few_reflections(albedo: float) -> None:
    """What is not followed there is nothing: beside all reflections, solved at once."""
    scene = Scene.from_toml(SCENE).with_values({"tank.wall_albedo": albedo})
    light = ReflectedLight.at(scene, np.array([0.0, 0.6]), np.array([0.0, 0.2]), np.array([4.5, 6.5]))
    assert reflections_of(albedo) < REFLECTIONS
    assert light.evaluate(scene, 0.1) == pytest.approx(solved(light, scene, 0.1), rel=1e-4)


def test_every_order_at_once_is_one_reflection_after_the_other() -> None:
    """Also of a floor that is no wall, and of a lamp that comes after a water was often asked for."""
    scene = Scene.from_toml(SCENE).with_values({"tank.wall_albedo": 0.8, "tank.floor_over_walls": 0.4})
    places = np.array([0.0, 0.6]), np.array([0.0, 0.2]), np.array([4.5, 6.5])
    room = ReflectedLight.at(scene, *places).ways.room(True)
    followed, albedo = room._operator(0.1, 0.0, 1.0), room._albedo((1.0, 0.4, 1.0))
    rng = np.random.default_rng(0)
    lit = rng.random((len(room.before), followed.first.shape[1] // len(room.before))).astype(np.float32)
    whole = rng.random(len(room.half.centre)).astype(np.float32)
    for reflections in (12, 5):
        found = followed.at_once(albedo, 12).apply(lit, whole, reflections)
        np.testing.assert_allclose(found, followed.apply(lit, whole, albedo, reflections), rtol=2e-5)

    light = ReflectedLight.at(scene, *places)
    lamps = [scene.with_values({"lamp.hwhm_deg": 15.0 + 0.1 * k}) for k in range(OFTEN + 3)]
    often = [light.evaluate(lamp, 0.1) for lamp in lamps]
    assert light.ways.room(True)._at_once, "no water was asked for often enough"
    alone = [ReflectedLight.at(scene, *places).evaluate(lamp, 0.1) for lamp in lamps[-2:]]
    np.testing.assert_allclose(often[-2:], alone, rtol=2e-5)


def test_opaque_water_stays_dark() -> None:
    """Attenuation 2 to 3 /m over 36 m is exp(-72) and less, where single precision ends and so does what
    can be interpolated: never more than the direct light, or than 1e-39."""
    scene = Scene.from_toml("[lamp]\nhwhm_deg = 5.0\n[tank]\nwall_albedo = 0.3\n")
    z = np.array([30.0, 35.9])
    reflected = ReflectedLight.at(scene, np.zeros(2), np.zeros(2), z)
    for attenuation in np.arange(2.0, 3.0, 0.03):
        light = reflected.evaluate(scene, attenuation)
        assert (light < np.exp(-attenuation * z) / z**2 + 1e-39).all()


@pytest.mark.parametrize(
    ("walls", "reflectance", "hwhm_deg"),
    [(0.5, 1.25, 15.0), (0.5, 1.5, 15.0), (0.9, 0.1, 4.0), (0.9, 0.3, 4.0), (0.9, 0.75, 30.0)],
)
def test_surfaces_between_the_nodes_are_as_at_nodes(
    walls: float, reflectance: float, hwhm_deg: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Light between walls under any surface is to 0.25 % what it is with a node there."""
    flat = {"tank.wall_albedo": walls, "tank.surface": "flat", "lamp.hwhm_deg": hwhm_deg}
    scene = Scene.from_toml(SCENE).with_values(flat)
    places, taken = np.array([[0.0, 0.0, 4.5], [0.4, 0.3, 6.5]]), np.array([0.1])
    assert scene.tank is not None
    tank = scene.tank.model_copy(update={"surface_reflectance": reflectance})
    light = Room(scene, places, False).light(scene.lamp, taken, tank)
    monkeypatch.setattr(room, "SURFACE_NODES", (reflectance,))
    right = Room(scene, places, False).light(scene.lamp, taken, tank)
    assert light == pytest.approx(right, rel=2.5e-3)


def test_light_from_a_point_in_front_of_the_window_reaches_nothing_before_it() -> None:
    """Walls between window and point are dark: no way through the water there is longer than all numbers."""
    lamp = Scene.from_toml(SCENE).lamp.model_copy(update={"apparent_distance_m": -0.5})
    assert before_lamp(lamp, np.array([0.2, 0.5, 0.6])).tolist() == [False, False, True]
