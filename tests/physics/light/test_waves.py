"""Waves on the water surface: facets drawn by hand, the walk of photons, Mitsuba's rough dielectric."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from scipy.special import erf

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.candidates import UNMET, Setting, candidates
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.untestable import Hindrance
from lightfield.errors import UsageError
from lightfield.experiments.hide import Secret, hide
from lightfield.experiments.measure import Instrument
from lightfield.fitting.effects import get
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.backend import use_backend
from lightfield.render.maps import render_scene
from lightfield.render.reflected.from_lamp import fresnel
from lightfield.render.reflected.reflected_light import MORE_FACETS, ReflectedLight
from lightfield.render.reflected.waves import seen
from lightfield.scene import Scene

TANK = {"width_m": 2.4, "depth_m": 1.8, "length_m": 8.0, "behind_lamp_m": 0.4, "lamp_depth_m": 0.5}
TOP, HALF_M, PLANE_M = 0.5, 1.2, 3.0
PER_M = 0.1
#: Cells of the plane: rows from y = -1 to 0.4 m, columns from x = -0.8 to 0.8 m.
ROWS, COLUMNS = np.linspace(-1.0, 0.4, 8), np.linspace(-0.8, 0.8, 5)


def scene(slope_deg: float, **values: float) -> Scene:
    detector = {"planes_m": [PLANE_M], "width_m": 1.6, "height_m": 0.8, "pixels": 4}
    tank = {**TANK, "surface": "flat", "surface_slope_deg": slope_deg}
    made = {"lamp": {"hwhm_deg": 20.0}, "water": {"absorption_per_m": PER_M}, "tank": tank}
    return Scene.from_dict({**made, "detector": detector}).with_values(values)


def by_hand(slope_deg: float, hwhm_deg: float, photons: int = 400_000) -> tuple[np.ndarray, np.ndarray]:
    """Irradiance of the cells by way of the surface, for unit intensity, and its error: a plain walk.

    Each photon is shown 40 facets of normal slopes and meets one of them, with a chance that goes as the part
    of its way that the facet covers; what the facet sends up again is shown 40 more, and what that sends up
    once more is dropped.
    """
    rng = np.random.default_rng(11)
    # Upwards alone, uniform in solid angle over a half sphere about y.
    y, turn = rng.random(photons), rng.uniform(0, 2 * np.pi, photons)
    across = np.sqrt(1 - y * y)
    d = np.array([across * np.sin(turn), y, across * np.cos(turn)])
    theta = np.degrees(np.arccos(d[2]))
    power = np.exp(-np.log(2) * (theta / hwhm_deg) ** 2) * (theta < 90) * 2 * np.pi / photons
    way = TOP / np.maximum(d[1], 1e-6)
    met = d * way
    kept = (np.abs(met[0]) < HALF_M) & (met[2] > 0) & (met[2] < TANK["length_m"] - TANK["behind_lamp_m"])
    d, way, met, power = d[:, kept], way[kept], met[:, kept], power[kept]
    once, part = facet(d, slope_deg, rng)
    again, more = facet(once, slope_deg, rng)
    o = np.where(once[1] < 0, once, again)
    power *= np.where(once[1] < 0, part, part * more) * (o[1] < 0) * (o[2] > 0)
    on = (PLANE_M - met[2]) / np.where(o[2] > 0, o[2], 1.0)
    at = met + o * on
    power *= (on > 0) * np.exp(-PER_M * (way + on))
    cell = np.histogram2d(at[1], at[0], bins=(ROWS, COLUMNS), weights=power)[0]
    squares = np.histogram2d(at[1], at[0], bins=(ROWS, COLUMNS), weights=power**2)[0]
    area = np.diff(ROWS)[:, None] * np.diff(COLUMNS)
    return cell / area, np.sqrt(squares) / area


def facet(d: np.ndarray, slope_deg: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Where facets send light that flies along d, shape (3, n), and which part of it."""
    sigma = np.tan(np.radians(slope_deg))
    s, t = rng.normal(0, sigma, (2, d.shape[1], 40))
    covered = np.maximum(d[1][:, None] - d[0][:, None] * s - d[2][:, None] * t, 0)
    chance = np.cumsum(covered, axis=1)
    which = (rng.random(d.shape[1])[:, None] * chance[:, -1:] > chance).sum(axis=1)
    every = np.arange(d.shape[1])
    one, two = s[every, np.minimum(which, 39)], t[every, np.minimum(which, 39)]
    normal = np.array([-one, np.ones(one.size), -two]) / np.sqrt(1 + one**2 + two**2)
    cosine = (d * normal).sum(axis=0)
    return d - 2 * cosine * normal, fresnel(np.clip(cosine, 1e-9, 1.0))


def of_cells(lit: Scene) -> np.ndarray:
    """What the formula says of the cells: the mean over 4 x 4 places in each."""
    part = (np.arange(4) + 0.5) / 4
    y = (ROWS[:-1, None] + np.diff(ROWS)[:, None] * part).ravel()
    x = (COLUMNS[:-1, None] + np.diff(COLUMNS)[:, None] * part).ravel()
    gy, gx = np.meshgrid(y, x, indexing="ij")
    light = ReflectedLight.at(lit, gx.ravel(), gy.ravel(), np.full(gx.size, PLANE_M)).evaluate(lit, PER_M)
    return light.reshape(len(ROWS) - 1, 4, len(COLUMNS) - 1, 4).mean(axis=(1, 3))


@pytest.mark.parametrize(
    ("slope_deg", "hwhm_deg"),
    [(3.0, 20.0), (14.0, 40.0), *(pytest.param(8.0, at, marks=pytest.mark.slow) for at in (20.0, 9.0))],
)
def test_the_smeared_image_is_that_of_facets_drawn_by_hand(slope_deg: float, hwhm_deg: float) -> None:
    """Every cell within the error of the plain walk, and 1 % of the sum over slopes."""
    walked, error = by_hand(slope_deg, hwhm_deg)
    known = of_cells(scene(slope_deg, **{"lamp.hwhm_deg": hwhm_deg}))
    off = (walked - known) / np.hypot(error, 0.01 * known)
    assert np.abs(off).max() < 4 and np.mean(off**2) < 2


@pytest.mark.parametrize("hwhm_deg", [6.0, 20.0])
def test_nearly_still_water_is_a_mirror(hwhm_deg: float) -> None:
    """Slopes of 0.005 degrees: the image of the lamp as still water shows it, place by place."""
    still, calm = (of_cells(scene(slope, **{"lamp.hwhm_deg": hwhm_deg})) for slope in (0.0, 0.005))
    np.testing.assert_allclose(calm, still, rtol=1e-4)


def test_a_table_is_summed_as_finely_as_the_beam_that_is_tabulated(tmp_path) -> None:
    """One of half a degree; in steps of the 3.81 degrees that a table does not have it is 12 % off."""
    angle = np.append(np.linspace(0.0, 15.0, 6001), 90.0)
    columns = np.column_stack([angle, np.exp(-np.log(2) * (angle / 0.5) ** 2)])
    np.savetxt(tmp_path / "beam.csv", columns, "%.9g", ",", header="angle_deg,intensity", comments="")
    table = {"profile": "table", "intensity_table": str(tmp_path / "beam.csv"), "tilt_y_deg": 30.0}
    known = scene(2.0, **{"lamp.hwhm_deg": 0.5, "lamp.tilt_y_deg": 30.0})
    y = np.linspace(-0.9, 0.4, 5)
    found = Scene.from_dict({**known.to_dict(), "lamp": table})
    of_table, of_formula = (
        ReflectedLight.at(lit, 0 * y, y, np.full(5, 2.0)).evaluate(lit, PER_M) for lit in (found, known)
    )
    np.testing.assert_allclose(of_table, of_formula, rtol=1e-3, atol=1e-3 * of_formula.max())


@pytest.mark.parametrize(
    ("slope_deg", "hwhm_deg"), [(2.5, 20.0), pytest.param(10.0, 30.0, marks=pytest.mark.slow)]
)
def test_the_walk_of_photons_meets_the_same_facets(slope_deg: float, hwhm_deg: float) -> None:
    """Traced light of a black tank, all of which came by the surface.

    What flies up from a facet meets another one, 6 % of the light at 10 degrees: every cell agrees to 1 %,
    the mean to the stated part, which three facets in a row are within.
    """
    lit = scene(slope_deg, **{"lamp.hwhm_deg": hwhm_deg})
    rendering = render_scene(lit, max_photons=5e6, rel_error=1e-5, seed=2, cache=False)
    traced, error = (v[0].ravel() for v in rendering.relative_maps(np.array([525.0]), "diffuse"))
    grid, part = rendering.grid, (np.arange(4) + 0.5) / 4 - 0.5
    dy, dx = (v.ravel() for v in np.meshgrid(part * grid.pitch_y_m, part * grid.pitch_x_m, indexing="ij"))
    z, y, x = (v.ravel() for v in np.meshgrid(grid.z_m, grid.y_m, grid.x_m, indexing="ij"))
    points = np.add.outer(x, dx).ravel(), np.add.outer(y, dy).ravel(), np.repeat(z, 16)
    known, still = (
        ReflectedLight.at(s, *points).evaluate(s, PER_M).reshape(-1, 16).mean(axis=1)
        for s in (lit, scene(0.0, **{"lamp.hwhm_deg": hwhm_deg}))
    )
    off = (traced - known) / np.hypot(error, 0.01 * known)
    assert np.abs(off).max() < 4.5 and np.mean(off**2) < 2.5
    spread = 3 * np.sqrt(np.sum(error**2)) / traced.sum()
    assert abs(traced.mean() / known.mean() - 1) < MORE_FACETS + spread
    assert np.abs(known / still - 1).max() > 10 * np.median(error / known)


def test_a_facet_turns_light_as_mitsubas_rough_dielectric_does() -> None:
    """The same numbers, the same facets; what Mitsuba lets be shaded on its way out (Smith) goes on here."""
    from lightfield.render.tracer.build import shapes
    from lightfield.render.tracer.surfaces import Box, Shapes

    use_backend()
    lit, n, rng = scene(9.0), 20_000, np.random.default_rng(6)
    assert lit.tank is not None
    d = rng.normal(size=(3, n))
    d[1] = np.abs(d[1]) + 1e-3
    d /= np.linalg.norm(d, axis=0)
    position, direction = mi.Point3f(0, 0, 2), mi.Vector3f(*map(mi.Float, d))
    turn, everywhere = mi.Point2f(*map(mi.Float, rng.random((2, n)))), mi.Bool(True)
    found = []
    for surfaces in (
        Box(lit.tank, 0.0, 0.8),
        Shapes(mi.load_dict({"type": "scene", **shapes(lit, 0.0, 0.8)})),
    ):
        met = surfaces.meet(position, direction, everywhere)
        at = mi.Point3f(position + direction * met.distance)
        bounce = surfaces.bounce(met, at, direction, turn, everywhere)
        smooth = np.broadcast_to(np.array(bounce.smooth, bool), n)
        found.append((smooth, np.array(bounce.reflected, float), np.array(bounce.direction, float)))
    (smooth, part, onward), (smooth_m, part_m, onward_m) = found
    on = smooth & smooth_m & (part_m > 0)
    assert on.sum() > 1000 and (onward[1, on] < 0).all()
    # The frames of both differ by a turn about y, which an even distribution does not see.
    slope = np.tan(np.radians(9.0))
    for way, reflected in ((onward, part), (onward_m, part_m)):
        normal = d - way
        normal /= np.linalg.norm(normal, axis=0)
        fresnel_part = 0.8 * fresnel((d * normal).sum(axis=0))
        down = way[1, on] / np.hypot(way[0, on], way[2, on]) / slope
        # G1 of normal slopes, Smith 1967.
        shaded = 1 / (0.5 * (1 + erf(-down / 2**0.5)) + np.exp(-0.5 * down**2) / -down / (2 * np.pi) ** 0.5)
        expected = fresnel_part[on] * (shaded if reflected is part_m else 1.0)
        np.testing.assert_allclose(reflected[on], expected, rtol=0.02, atol=2e-3)
    for one, two in zip(onward[:, on], onward_m[:, on], strict=True):
        assert abs(one.mean() - two.mean()) < 4 * np.hypot(one.std(), two.std()) / np.sqrt(on.sum())
        assert one.std() == pytest.approx(two.std(), rel=0.03)


def test_what_light_sees_of_the_facets_is_their_mean() -> None:
    """Smith's closed form against the mean over slopes that were drawn."""
    rng, sigma = np.random.default_rng(8), 0.15
    s, t = rng.normal(0, sigma, (2, 200_000))
    for up in (0.02, 0.1, 0.3, 0.9):
        to = np.array([0.6, 0.0, 0.8]) * np.sqrt(1 - up * up) + np.array([0.0, up, 0.0])
        drawn = np.maximum(up - to[0] * s - to[2] * t, 0)
        assert seen(to, sigma) == pytest.approx(drawn.mean(), abs=4 * drawn.std() / np.sqrt(s.size))


@pytest.mark.slow
def test_waves_that_a_full_render_hid_are_found_beside_the_surface() -> None:
    """8 degrees, read at four heights: named, and the slope within its error."""
    rng = np.random.default_rng(3)
    across, heights, far = [-0.6, -0.2, 0.2, 0.6], [-0.9, -0.5, -0.1, 0.3], [1.5, 2.5, 3.5, 4.5]
    x, y, z = (g.ravel() for g in np.meshgrid(across, heights, far))
    bare = Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=np.ones(x.size))
    light, error = rendered_light(scene(8.0), bare, max_photons=2e6, rel_error=0.001)
    value = light / light.max()
    stderr = np.hypot(np.hypot(0.003 * value, 3e-4), error / light.max())
    shown = Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=value + stderr * rng.standard_normal(x.size), stderr=stderr
    )
    verdict = diagnose(shown, scene(0.0), only=["waves", "background"], advise=False).verdict
    assert verdict.best_set == ["waves"], verdict.sentence
    slope = verdict.explanations[0].parameters["tank.surface_slope_deg"]
    assert abs(slope.value - 8.0) < 3 * slope.stderr and slope.stderr < 1.0


def test_waves_are_not_hidden_where_no_surface_is() -> None:
    black = scene(0.0, **{"tank.surface_reflectance": 0.0})
    with pytest.raises(UsageError, match="surface_reflection"):
        hide(black, Secret(("waves",)), 1, Instrument())


def test_waves_are_not_tested_behind_a_collimator() -> None:
    lit = scene(0.0).with_values({"detector.quantity": "radiance"})
    x, y, z = (g.ravel() for g in np.meshgrid([0.0], [-0.3, 0.0, 0.3], [2.0, 3.0]))
    layout = layout_of(Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=np.ones(x.size)))
    for one, reasons in ((lit, {"waves": (Hindrance(UNMET["mirror"]),)}), (scene(0.0), {})):
        assert candidates(Setting(one, layout, 1.0, 50.0), [get("waves")], ())[1] == reasons
