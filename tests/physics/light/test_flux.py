"""The flux vector against receivers that were tilted before the trace, and against a walk of its own."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from montecarlo import keeps_its_rate, least_p, same_light_p
from scipy import stats

from lightfield.errors import RenderError
from lightfield.formula.closed_form import direct_field
from lightfield.formula.own_formulas import lit
from lightfield.formula.vector import direct_flux, on_receivers, with_back
from lightfield.render.flux.traced_field import Region, TracedField, traced_field
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import ArrayModel
from lightfield.studies.follower.elements import Elements
from lightfield.studies.follower.frames import POSE
from lightfield.studies.working_range.smooth_light import smooth_light

PLANES, SIDE, PITCH = [3.0, 4.0], 0.6, 0.2
A, B, G = 0.05, 0.3, 0.8
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 8.0},
        "water": {
            "absorption_per_m": A,
            "scattering_per_m": B,
            "phase": {"type": "henyey-greenstein", "g": G},
        },
        "detector": {"planes_m": PLANES, "width_m": 1.4, "pixels": 7},
    }
)
REGION = Region(SIDE, 2.9, 4.1)


@pytest.fixture(scope="module")
def field() -> TracedField:
    return traced_field(SCENE, REGION, photons=6e5, cache=False)


@pytest.mark.parametrize(
    "tilt_deg", [40.0, *(pytest.param(at, marks=pytest.mark.slow) for at in (0.0, -25.0))]
)
def test_tilted_receivers_read_the_flux_vector(field: TracedField, tilt_deg: float) -> None:
    """Maps of a scene whose detector is tilted, traced with its own response, other seeds and cells."""
    tilted = SCENE.with_values({"detector.tilt_x_deg": tilt_deg})
    done = render_scene(tilted, rel_error=1e-4, max_photons=2e6, seed=3, cache=False)
    maps, errors = (v[0] for v in done.relative_maps(np.array([525.0]), "diffuse"))
    z, y, x = (v.ravel() for v in np.meshgrid(PLANES, done.grid.y_m, done.grid.x_m, indexing="ij"))
    place = np.stack([x, y, z], axis=1)
    turn = np.radians(tilt_deg)
    normal = np.tile([np.sin(turn), 0.0, -np.cos(turn)], (len(place), 1))
    mean, error = field.irradiance(place, normal)
    diffuse = mean - on_receivers(direct_flux(SCENE, place), normal)
    inside = (np.abs(x) <= SIDE) & (np.abs(y) <= SIDE)
    ratio = (maps.ravel() / diffuse)[inside]
    known = np.hypot(errors.ravel() / maps.ravel(), error / diffuse)[inside]
    assert np.median(known) < 0.02
    # A cell of 0.2 m reads its mean: the spline at its middle and the curvature of the light differ by this.
    cells = _means_over_cells(field, place, normal)[inside] / diffuse[inside]
    excess = ratio / cells - 1
    # Of a receiver turned by 40 degrees, what comes from beyond 50 degrees on one side is what is left out.
    most = 0.03 if tilt_deg else 0.005
    assert -0.005 < np.average(excess, weights=known**-2) < most


#: A small tank with bright walls: a seventh of the diffuse light on the axis flies back, at 5.5 m.
BRIGHT = {
    "lamp": {"hwhm_deg": 6.0}, "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.15},
    "tank": {"width_m": 2.0, "depth_m": 2.0, "length_m": 8.0, "wall_albedo": 0.6},
    "detector": {"planes_m": [4.5, 5.5]},
}  # fmt: skip
IN_TANK = np.array([[0.2, 0.1, 4.5], [0.0, 0.0, 5.5]])


@pytest.fixture(scope="module")
def bright() -> TracedField:
    return traced_field(Scene.from_dict(BRIGHT), Region(0.4, 4.2, 6.0), photons=2e6, cache=False)


@cache
def rendered(tilt_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Diffuse light in the bright tank on receivers turned towards +x, and its errors."""
    detector = {"positions_m": IN_TANK.tolist(), "bands_nm": [[520.0, 530.0]], "tilt_x_deg": tilt_deg}
    scene = Scene.from_dict({**BRIGHT, "detector": detector})
    done = render_scene(scene, rel_error=1e-3, max_photons=2e6, seed=3, cache=False)
    value, error = (v[0].ravel() for v in done.relative_maps(np.array([525.0]), "diffuse"))
    return value, error


@pytest.mark.parametrize(
    ("tilt_deg", "guess"),
    [(0.0, 0.0), *(pytest.param(*wide, marks=pytest.mark.slow) for wide in ((40.0, 0.02), (60.0, 0.04)))],
)
def test_light_that_walls_send_back_is_read(bright: TracedField, tilt_deg: float, guess: float) -> None:
    """Exactly by receivers that face the lamp. `guess` is what the even hemisphere leaves open (measured: 1.2
    and 3.5 % of the diffuse light); without what flies back 10 to 28 % of that would be missing."""
    turn = np.radians(tilt_deg)
    normal = np.tile([np.sin(turn), 0.0, -np.cos(turn)], (len(IN_TANK), 1))
    mean, error = bright.irradiance(IN_TANK, normal)
    direct = on_receivers(direct_flux(bright.scene, IN_TANK), normal)
    value, stderr = rendered(tilt_deg)
    assert (np.abs(mean - direct - value) < guess * value + 3.5 * np.hypot(error, stderr)).all()
    net = on_receivers(bright.diffuse_flux(IN_TANK)[:, :3], normal)
    assert (net < 0.93 * value).all()


def test_a_receiver_that_faces_away_reads_what_flies_back(bright: TracedField) -> None:
    away = np.tile([0.0, 0.0, 1.0], (len(IN_TANK), 1))
    expected = bright.diffuse_flux(IN_TANK)[:, 3]
    np.testing.assert_allclose(bright.reading(IN_TANK, away), expected, rtol=1e-5)
    np.testing.assert_allclose(bright.irradiance(IN_TANK, away)[0], expected, rtol=1e-5)


def test_the_smooth_light_of_ranges_has_it_too(bright: TracedField) -> None:
    """On the axis and 0.2 m beside it, facing the lamp; a smooth fit, hence 1 % of the diffuse light."""
    normal = np.tile([0.0, 0.0, -1.0], (len(IN_TANK), 1))
    mean, error = smooth_light(bright.scene, 4.5, 5.5, 0.25, 2e6).irradiance(IN_TANK, normal)
    value, stderr = rendered(0.0)
    diffuse = mean - on_receivers(direct_flux(bright.scene, IN_TANK), normal)
    assert (np.abs(diffuse - value) < 0.01 * value + 3.5 * np.hypot(error, stderr)).all()


def test_readings_of_an_array_between_bright_walls_have_their_slopes(bright: TracedField) -> None:
    """By place and by every turn, against differences of the readings."""
    normal = np.array([[0.5, 0.0, -0.8], [-0.6, 0.3, -0.7]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    elements = Elements(np.array([[0.05, 0.0, 0.0], [-0.05, 0.02, 0.0]]), normal)
    model, step = ArrayModel(bright, elements), 1e-4
    pose = np.array([0.1, -0.05, 5.0, 0.1, -0.2, 0.3])
    slopes = model.by_pose(pose[None], POSE)[0]
    for k in range(6):
        moved = pose + step * np.eye(6)[k], pose - step * np.eye(6)[k]
        ahead, behind = (model.readings(p[None])[0] for p in moved)
        np.testing.assert_allclose(slopes[:, k], (ahead - behind) / (2 * step), rtol=2e-3, atol=1e-5)


def _means_over_cells(field: TracedField, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    total = 0.0
    for dx in (-PITCH / 3, 0, PITCH / 3):
        for dy in (-PITCH / 3, 0, PITCH / 3):
            there = place + np.array([dx, dy, 0.0])
            total = total + with_back(field.diffuse_flux(there), normal) / 9
    return np.asarray(total)


def in_another_water(field: TracedField, seed: int, photons: float) -> list[np.ndarray]:
    """Readings at 40 places of a field weighed to other water and of a trace there, batch by batch."""
    other = SCENE.with_values({"water.scattering_per_m": 0.2, "water.absorption_per_m": 0.1})
    fresh = traced_field(other, REGION, photons=photons, seed=seed, cache=False)
    rng = np.random.default_rng(1)
    place = rng.uniform([-SIDE, -SIDE, 2.9], [SIDE, SIDE, 4.1], (40, 3))
    normal = np.tile([0.3, 0.0, -np.sqrt(1 - 0.09)], (40, 1))
    return [f.batches(place, normal) for f in (field.in_water_of(other), fresh)]


def test_another_water_without_another_trace(field: TracedField) -> None:
    """Weighed to less scattering and more absorption: as a trace there, within the errors of both."""
    found = in_another_water(field, 9, 6e5)
    assert same_light_p(*found) > 0.001
    # All places together are known better: their mean, of eight independent traces each.
    means = [(batches / found[1].mean(axis=0)).mean(axis=1) for batches in found]
    error = np.sqrt(sum(m.var(ddof=1) / len(m) for m in means))
    assert error < 0.005
    assert stats.ttest_ind(*means, equal_var=False).pvalue > 0.001


@pytest.mark.slow
def test_another_water_keeps_the_rate_of_its_test() -> None:
    """Of 40 places that share cells, and of their mean."""

    def p_of(seed: int) -> float:
        field = traced_field(SCENE, REGION, photons=1e5, seed=1000 + seed, cache=False)
        return same_light_p(*in_another_water(field, seed, 1e5))

    keeps_its_rate(p_of)


@pytest.mark.slow
def test_dense_water_between_walls_in_clearer_water() -> None:
    """From b = 2.1 to 1.05 per m, far from the lamp, where much light was reflected and scattered five times
    or more: as a trace there, as stated. By the mean length of all cells it was half too bright."""
    tank = {"width_m": 2.4, "depth_m": 1.6, "length_m": 8.0, "lamp_depth_m": 0.8, "wall_albedo": 0.5}
    lamp, region = {"hwhm_deg": 12.0}, Region(0.4, 0.8, 5.0, 0.16)
    parts = {"lamp": lamp, "tank": tank, "detector": {"planes_m": PLANES}}
    dense, clear = (
        Scene.from_dict({**parts, "water": {"absorption_per_m": A, "scattering_per_m": b}})
        for b in (2.1, 1.05)
    )
    traced, fresh = (
        traced_field(one, region, photons=4e5, seed=seed, cache=False)
        for seed, one in enumerate((dense, clear))
    )
    x, y = (v.ravel() for v in np.meshgrid([-0.3, 0.0, 0.3], [-0.3, 0.0, 0.3]))
    place, normal = np.stack([x, y, np.full(9, 4.8)], axis=1), np.tile([0.0, 0.0, -1.0], (9, 1))
    (found, stated), (mine, noise) = (
        one.irradiance(place, normal) for one in (traced.in_water_of(clear), fresh)
    )
    assert np.median(stated / mine) < 0.15
    assert least_p(found - mine, (stated, np.inf), (noise, 7)) > 0.001
    means = [field.batches(place, normal).mean() for field in (traced.in_water_of(clear), fresh)]
    assert abs(means[0] / means[1] - 1) < 0.15


def test_flux_vector_of_an_independent_walk(field: TracedField) -> None:
    """A plain photon walk in NumPy, with nothing in common: all components on a plane, in rings."""
    rings = np.array([0.0, 0.25, 0.5])
    mean, error = _walk(rings, z=3.5, photons=400_000)
    turn = 2 * np.pi * (np.arange(12) + 0.5) / 12
    for ring, (low, high) in enumerate(pairwise(rings)):
        radius = np.sqrt((np.arange(6) + 0.5) / 6 * (high**2 - low**2) + low**2)
        r, t = (v.ravel() for v in np.meshgrid(radius, turn))
        flux = field.diffuse_flux(np.stack([r * np.cos(t), r * np.sin(t), np.full(r.shape, 3.5)], axis=1))
        outward = flux[:, 0] * np.cos(t) + flux[:, 1] * np.sin(t)
        for mine, theirs, known in (
            (outward.mean(), mean[ring, 0], error[ring, 0]),
            (flux[:, 2].mean(), mean[ring, 1], error[ring, 1]),
            (flux[:, 3].mean(), mean[ring, 2], error[ring, 2]),
        ):
            assert abs(mine - theirs) < 4 * known + 0.01 * abs(theirs)
    assert (error[:, 1] < 0.02 * mean[:, 1]).all() and (error[:, 0] < 0.06 * mean[:, 0]).all()


def _walk(rings: np.ndarray, z: float, photons: int) -> tuple[np.ndarray, np.ndarray]:
    """Outward, forward and backward flux through rings of a plane, scattered light only, with errors."""
    rng = np.random.default_rng(11)
    width = np.radians(SCENE.lamp.hwhm_deg)
    theta = np.sqrt(-np.log(rng.random(photons)) / np.log(2)) * width
    solid = np.pi * width**2 / np.log(2) * np.sin(theta) / theta
    phi = 2 * np.pi * rng.random(photons)
    u = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    p, length, weight, batch = np.zeros((3, photons)), np.zeros(photons), solid, np.arange(photons) % 10
    found, area = np.zeros((10, len(rings) - 1, 3)), np.pi * np.diff(rings**2)
    for order in range(40):
        flight = -np.log(rng.random(len(weight))) / B
        t = (z - p[2]) / u[2]
        at = p + u * t
        r = np.hypot(at[0], at[1])
        crosses = (t > 0) & (t < flight) & (order > 0) & (r < rings[-1])
        light = (weight * np.exp(-A * (length + np.where(crosses, t, 0))))[crosses]
        out = ((u[0] * at[0] + u[1] * at[1]) / np.maximum(r, 1e-12) / np.maximum(np.abs(u[2]), 0.02))[crosses]
        place = batch[crosses], np.searchsorted(rings, r[crosses], side="right") - 1
        for part, value in enumerate((out, np.sign(u[2][crosses]), (u[2][crosses] < 0).astype(float))):
            np.add.at(found, (*place, part), light * value)
        p, length = p + u * flight, length + flight
        keep = (length < 20) & (np.abs(p[2] - z) < 8)
        p, u, length, weight, batch = p[:, keep], u[:, keep], length[keep], weight[keep], batch[keep]
        q = (1 - G * G) / (1 - G + 2 * G * rng.random(len(weight)))
        c = (1 + G * G - q * q) / (2 * G)
        s, phi = np.sqrt(np.maximum(1 - c * c, 0)), 2 * np.pi * rng.random(len(weight))
        side = np.stack([u[2], 0 * u[2], -u[0]]) / np.hypot(u[0], u[2])
        up = np.cross(u, side, axis=0)
        u = c * u + s * (np.cos(phi) * side + np.sin(phi) * up)
        u /= np.linalg.norm(u, axis=0)
    found /= (photons / 10) * area[:, None]
    return found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(10)


def test_direct_flux_is_the_direct_field() -> None:
    """Facing the lamp's plane: the closed form of irradiance; with an apparent source, offset and window."""
    wide = SCENE.with_values({"lamp.apparent_distance_m": 0.7, "lamp.offset_x_m": 0.1, "lamp.radius_m": 0.05})
    place = np.array([[0.2, -0.1, 3.0], [0.0, 0.5, 5.0], [0.1, 0.1, -1.0]])
    read = on_receivers(direct_flux(wide, place), np.tile([0.0, 0.0, -1.0], (3, 1)))
    np.testing.assert_allclose(read, direct_field(wide, *place.T), rtol=1e-12)
    assert (on_receivers(direct_flux(wide, place), np.tile([0.0, 0.0, 1.0], (3, 1))) == 0).all()


def test_a_formula_of_the_angle_shapes_the_beam_that_is_traced() -> None:
    """Photon for photon the light of the lamp that has it as a departure, and a ring is brighter."""
    ring = {"name": "ring", "stage": "source", "formula": "1 + a*theta"}
    ring["parameters"] = {"a": {"range": [0.0, 1.0], "neutral": 0.0, "value": 0.3}}
    with_ring = SCENE.model_copy(update={"effect": Scene.from_dict({"effect": [ring]}).effect})
    place, few = np.array([[0.2, 0.1, 3.4], [0.0, -0.3, 3.9]]), {"photons": 2e4, "cache": False}
    read, same, plain = (
        traced_field(one, REGION, **few).diffuse_flux(place) for one in (with_ring, lit(with_ring), SCENE)
    )
    np.testing.assert_allclose(read, same, rtol=1e-5, atol=1e-9)  # photons are added in any order
    assert (read[:, 2] > 1.5 * plain[:, 2]).all()


def test_parts_of_a_trace_make_the_whole(field: TracedField) -> None:
    """Batches average to the field, and so do fields that lack one of them; what they lack is that batch."""
    place = np.array([[0.2, 0.1, 3.4], [0.0, -0.3, 3.9]])
    normal = np.tile([0.0, 0.0, -1.0], (2, 1))
    whole, batches = field.reading(place, normal), field.batches(place, normal)
    without = np.array([part.reading(place, normal) for part in field.leave_one_out()])
    np.testing.assert_allclose(batches.mean(axis=0), whole, rtol=1e-5)
    np.testing.assert_allclose(
        without * (len(batches) - 1) + batches, len(batches) * np.tile(whole, (len(batches), 1)), rtol=1e-5
    )


def test_a_region_beyond_the_walls_is_refused() -> None:
    narrow = Scene.from_dict(
        {**SCENE.model_dump(exclude={"tank"}), "tank": {"width_m": 1.4, "wall_albedo": 0.2}}
    )
    with pytest.raises(RenderError, match="no water"):
        traced_field(narrow, REGION, photons=1e4, cache=False)
    with pytest.raises(RenderError, match="no water"):
        traced_field(SCENE, Region(0.5, 2.0, 1.0), photons=1e4, cache=False)
