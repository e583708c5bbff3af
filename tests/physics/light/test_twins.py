"""What NumPy and the tracer each compute for themselves is the same physics."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from beams import aside, phi_table
from pydantic import ValidationError

from lightfield.formula.own_formulas import lit
from lightfield.render.reflected.from_lamp import fresnel
from lightfield.render.reflected.patches import walls
from lightfield.render.response.grid import Grid, scene_grid
from lightfield.render.tracer.absorption import BEYOND_M, Absorption
from lightfield.render.tracer.absorption import ReferenceWater as TracedWater
from lightfield.render.tracer.build import shapes
from lightfield.render.tracer.emission import TABLE, Emission
from lightfield.render.tracer.planes import OPEN_WATER_REACH, Planes
from lightfield.render.xml import mitsuba_dict
from lightfield.scene import Detector, Lamp, Scene, Tank, Water
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import acts_on
from lightfield.scene.lamp.frame import beam_angles, beam_axes, source_point
from lightfield.scene.lamp.profile import relative_intensity
from lightfield.scene.receiver import RECEIVER, response
from lightfield.scene.tank import WATER_INDEX
from lightfield.scene.water.layers import layers_depth
from lightfield.scene.water.molecular import refractive_index

pytestmark = pytest.mark.usefixtures("backend")

SINGLE = 2e-6  # what single precision leaves


def directions(n: int, steepest: float = 0.0) -> np.ndarray:
    """Unit vectors all over the sphere, or forward alone; the first along z. Shape (3, n)."""
    rng = np.random.default_rng(5)
    z = rng.uniform(steepest or -1.0, 1.0, n)
    turn, across = rng.uniform(0, 2 * np.pi, n), np.sqrt(1 - z * z)
    found = np.array([across * np.cos(turn), across * np.sin(turn), z])
    found[:, 0] = 0, 0, 1
    return found


TILTS = [(0.0, 0.0), (3.0, 0.0), (0.0, -2.0), (5.0, 20.0), (-60.0, 45.0)]


@pytest.mark.parametrize("tilt", TILTS)
def test_frame_of_the_beam(tilt: tuple[float, float]) -> None:
    """Orthonormal, right-handed, level to the right; the axis at tan of both tilts; both twins alike."""
    lamp = Lamp(tilt_x_deg=tilt[0], tilt_y_deg=tilt[1])
    right, up, axis = axes = np.array(beam_axes(lamp))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(np.cross(right, up), axis, atol=1e-15)
    np.testing.assert_allclose(axis[:2] / axis[2], np.tan(np.radians(tilt)), atol=1e-15)
    assert right[1] == 0

    emission, d = Emission(lamp, cone_rad=0.3), directions(1000)
    d = d[:, axis @ d > -0.999]  # straight backwards the azimuth is of no meaning
    traced = np.array(emission.angles(mi.Vector3f(*(mi.Float(c) for c in d))))
    told = np.array(beam_angles(lamp, *d))
    np.testing.assert_allclose(traced, told, atol=1e-5)
    np.testing.assert_allclose(np.hypot(*told), np.arccos(np.clip(axis @ d, -1, 1)), atol=1e-7)
    back = np.array(emission.in_tank(mi.Vector3f(*(mi.Float(c) for c in axes @ d))))
    np.testing.assert_allclose(back, d, atol=SINGLE)


@pytest.mark.parametrize("radius_m", [0.0, 0.05])
def test_light_comes_from_one_point_or_from_a_disc_about_it(radius_m: float) -> None:
    """Beside the middle of the tank, and as far behind the window as the lamp says."""
    lamp = Lamp(offset_x_m=0.2, offset_y_m=-0.1, apparent_distance_m=0.3, radius_m=radius_m)
    assert source_point(lamp) == (0.2, -0.1, -0.3)
    u, turn = (mi.Float(v) for v in np.random.default_rng(2).random((2, 100)))
    traced = np.array(Emission(lamp, cone_rad=0.3).on_window(u, turn))
    away = np.broadcast_to(traced.reshape(3, -1), (3, 100)) - np.array(source_point(lamp))[:, None]
    np.testing.assert_allclose(np.hypot(*away[:2]), radius_m * np.sqrt(np.array(u)), atol=SINGLE)
    np.testing.assert_allclose(away[2], 0.0, atol=SINGLE)


#: All of them but the pencil, whose light has no width.
PROFILES = [name for name in get_args(Lamp.model_fields["profile"].annotation) if name != "pencil"]


#: Nodes of a departure, half a degree apart and more.
DEPARTURE = ((0.0, 0.2), (1.0, 0.1), (2.5, -0.3), (9.0, 0.4))


@pytest.mark.parametrize("departure", [(), DEPARTURE], ids=["plain", "departing"])
@pytest.mark.parametrize("profile", PROFILES)
def test_intensity_of_the_beam(profile: str, departure: Any, tmp_path: Path) -> None:
    """The tracer has its own formula of it: of every profile, with every number of the beam changed."""
    beam = {path: p for path, p in Scene().parameters().items() if path.startswith("lamp.")}
    given: dict[str, Any] = {
        path.removeprefix("lamp."): p.value + 0.2 * (abs(p.value) or min(1.0, p.high))
        for path, p in beam.items()
        if acts_on(path) & Acts.BEAM
    }
    if profile == "table":
        (tmp_path / "beam.csv").write_text("angle_deg,intensity\n0,1\n2,0.9\n9,0.2\n40,0\n")
        given["intensity_table"] = str(tmp_path / "beam.csv")
    if departure and profile == "isotropic":
        with pytest.raises(ValidationError, match="no angle to depart by"):
            Lamp.model_validate({"profile": profile, "profile_departure": departure})
        return
    # Of the table's nodes the tracer keeps others: a change of slope by 0.1 per degree lies between two; by
    # 0.5 of the brightest, exp(0.4), where a curve departs.
    bend = 0.5 * np.exp(0.4) if departure else 0.1
    off = bend * (90 / (TABLE - 1)) / 4 if profile == "table" or departure else SINGLE
    lamp = Lamp.model_validate({"profile": profile, "profile_departure": departure, **given})
    x, y = np.random.default_rng(3).uniform(-0.3, 0.3, (2, 2000))
    traced = np.array(Emission(lamp, cone_rad=0.3).intensity(mi.Float(x), mi.Float(y)))
    np.testing.assert_allclose(np.broadcast_to(traced, x.shape), relative_intensity(lamp, x, y), atol=off)


@pytest.mark.parametrize(("ellipticity", "diagonal"), [(1.0, 1.0), (1.4, 1.0), (1.2, 0.8)])
def test_intensity_of_a_measured_beam_that_is_not_round(
    ellipticity: float, diagonal: float, tmp_path: Path
) -> None:
    """The tracer keeps its half planes, and its angles at other steps: where these are 0.25 degrees apart the
    slope changes by 1.6 % per degree between two."""
    file = phi_table(tmp_path / "beam.csv", aside, np.array([0, 20, 50, 90, 135, 180, 210, 270, 300, 360.0]))
    beam = {"profile": "table", "intensity_table": str(file), "ellipticity": ellipticity}
    lamp = Lamp.model_validate(beam | {"ellipticity_diagonal": diagonal})
    x, y = np.random.default_rng(3).uniform(-0.3, 0.3, (2, 2000))
    traced = np.array(Emission(lamp, cone_rad=0.3).intensity(mi.Float(x), mi.Float(y)))
    off = 0.016 * (90 / (TABLE - 1)) / 4 + SINGLE
    np.testing.assert_allclose(traced, relative_intensity(lamp, x, y), atol=off)


RECEIVERS = {
    "plane": Detector(),
    "tilted": Detector(tilt_x_deg=-20.0),
    "aimed": Detector(aim="lamp"),
    "acceptance": Detector(acceptance_hwhm_deg=4.0),
    "tilted, acceptance": Detector(tilt_x_deg=5.0, acceptance_hwhm_deg=40.0),
    "cosine error": Detector(cosine_error=-0.1),
    "tilted, all errors": Detector(tilt_x_deg=25.0, cosine_error=0.2, acceptance_hwhm_deg=40.0),
    "scalar": Detector(quantity="scalar_irradiance"),
    "collimator": Detector(quantity="radiance", full_angle_deg=60.0),
    "narrow collimator, aimed": Detector(quantity="radiance", full_angle_deg=2.0, aim="lamp"),
    "collimator, tilted": Detector(quantity="radiance", full_angle_deg=30.0, tilt_x_deg=10.0),
}


@pytest.mark.parametrize("name", RECEIVERS)
def test_response_of_a_receiver(name: str) -> None:
    detector = RECEIVERS[name]
    planes = Planes(Grid(np.ones(1), np.zeros(1), np.zeros(1), 0.1, 0.1), detector)
    # The tracer lets no flight graze a plane; and light from behind reaches only what is turned to it.
    d, to_lamp = directions(2000, steepest=1e-3), np.array([0.1, -0.2, -3.0])
    d[:, 1] = -to_lamp / np.linalg.norm(to_lamp)
    axis = to_lamp / np.linalg.norm(to_lamp) if detector.aim == "lamp" else None
    told = response(detector, list(d), axis)
    traced = planes.point_response(mi.Vector3f(*(mi.Float(c) for c in d)), mi.Vector3f(*to_lamp.tolist()))
    assert np.count_nonzero(told) > 0
    np.testing.assert_allclose(np.array(traced), told, rtol=1e-4, atol=SINGLE)


WATERS = {
    "gradient": Water(gradient_per_m2=0.02, gradient_centre_m=2.0),
    "slab": Water(layer_absorption_per_m=0.5, layer_centre_m=3.0, layer_width_m=1.5),
    "slab round the window": Water(layer_absorption_per_m=0.5, layer_centre_m=0.2, layer_width_m=1.0),
    "height": Water(height_gradient_per_m2=0.05),
    "bottom": Water(bottom_layer_absorption_per_m=0.3, bottom_layer_top_m=-0.2),
    "top": Water(bottom_layer_absorption_per_m=-0.2, bottom_layer_top_m=0.4, bottom_layer_blend_m=0.5),
    "curve": Water(absorption_departure=((1.0, 0.02), (2.0, -0.01), (4.5, 0.03))),
    "curve of one node, and a slab": Water(absorption_departure=((3.0, 0.02),), layer_absorption_per_m=0.1),
    "both": Water(
        gradient_per_m2=-0.01, height_gradient_per_m2=-0.02, layer_absorption_per_m=0.2, layer_centre_m=4.0
    ),
}


@pytest.mark.parametrize("name", WATERS)
def test_depth_of_layers(name: str) -> None:
    """Of paths from the window, and of flights from anywhere: the integral along them, summed up finely."""
    water, rng = WATERS[name], np.random.default_rng(2)
    absorption = Absorption(TracedWater(0.0, 0.0, water))
    start, cosine, length = rng.uniform(-1, 6, 300), rng.uniform(-1, 1, 300), rng.uniform(0.1, 4, 300)
    start[:150], cosine[:150] = 0.0, rng.uniform(0.3, 1, 150)
    begin, climb = rng.uniform(-1, 1, 300), rng.uniform(-1, 1, 300) * np.sqrt(1 - cosine**2)
    begin[250:] *= 8.0  # from far below, or above, and back
    across = np.sqrt(np.maximum(1 - cosine**2 - climb**2, 0))
    point = mi.Point3f(mi.Float(0), mi.Float(begin), mi.Float(start))
    flight = mi.Vector3f(mi.Float(across), mi.Float(climb), mi.Float(cosine))
    traced = np.array(absorption.depth(point, flight, mi.Float(length)))

    along = length * ((np.arange(20_000) + 0.5) / 20_000)[:, None]
    z, y = start + cosine * along, begin + climb * along
    slab = np.abs(z - water.layer_centre_m) < 0.5 * water.layer_width_m
    extra = water.gradient_per_m2 * (z - water.gradient_centre_m) + water.layer_absorption_per_m * slab
    extra += water.height_gradient_per_m2 * y
    way = (water.bottom_layer_top_m - y) / water.bottom_layer_blend_m
    extra += water.bottom_layer_absorption_per_m * np.clip(way + 0.5, 0, 1)
    if water.absorption_departure:
        extra = extra + np.interp(z, *np.transpose(water.absorption_departure))
    (first, last), aside = BEYOND_M
    ends_z, ends_y = start + cosine * length, begin + climb * length
    far = (np.minimum(start, ends_z) < first) | (np.maximum(start, ends_z) > last)
    far |= np.maximum(np.abs(begin), np.abs(ends_y)) > aside
    told = extra.mean(axis=0) * length
    assert 0 < far.sum() < 120
    np.testing.assert_allclose(traced, np.where(far, np.maximum(told, 0), told), atol=2e-4)
    ends = (cosine * length)[:150]
    told = layers_depth(water, ends, length[:150], ends_y[:150], begin[:150])
    np.testing.assert_allclose(told, traced[:150], atol=SINGLE)


def test_tank_and_its_surface() -> None:
    """Walls of the trace, patches of the reflected light and the box of the tank are the same walls."""
    tank = Tank(width_m=3.0, depth_m=2.0, length_m=7.0, behind_lamp_m=0.6, lamp_depth_m=0.7)
    scene = Scene(tank=tank, detector=Detector(planes_m=(3.0,)))
    boxes = [mi.load_dict(shape).bbox() for shape in shapes(scene, 0.3, None).values()]
    assert len(boxes) == 6
    ends = [np.min([b.min for b in boxes], axis=0), np.max([b.max for b in boxes], axis=0)]
    np.testing.assert_allclose(np.transpose(ends), tank.box_m, atol=1e-6)
    patches = walls(scene, 6.0, True, 400)[0].on_both_sides()
    reach = patches.across * patches.half_across[:, None] + patches.along * patches.half_along[:, None]
    corners = np.concatenate([patches.centre - reach, patches.centre + reach])
    np.testing.assert_allclose(np.array([corners.min(axis=0), corners.max(axis=0)]).T, tank.box_m)

    cosine = np.linspace(0.01, 1, 100)
    made = mi.load_dict(shapes(scene, 0.3, 1.0)["surface"]["bsdf"])
    index = float(mi.traverse(made)["eta"])
    assert index == pytest.approx(WATER_INDEX)
    reflected, *_ = mi.fresnel(mi.Float(cosine), 1 / mi.Float(index))
    np.testing.assert_allclose(fresnel(cosine), np.array(reflected), atol=1e-4)
    found = [refractive_index([400.0, 700.0], 20.0, salinity) for salinity in (0.0, 35.0)]
    assert np.min(found) < WATER_INDEX < np.max(found)


def test_end_of_open_water() -> None:
    """The walk and a scene written for Mitsuba end at the same distance, beyond a wide plane's cells too."""
    scene = Scene(detector=Detector(planes_m=(0.5,), width_m=4.0, pixels=5))
    grid = scene_grid(scene)
    start = mi.Point3f(0.1, -0.2, 0.3)
    out = float(dr.max(Planes(grid, scene.detector).way_out(start, mi.Vector3f(0, 0, -1)))[0])
    at = np.array([0.1, -0.2, 0.3 - out])
    radius = mitsuba_dict(scene)["open_water"]["radius"]
    assert radius == pytest.approx(np.linalg.norm(at), rel=1e-5)
    assert radius >= OPEN_WATER_REACH * 1.6


def test_plugins_take_every_parameter_of_lamp_and_receiver() -> None:
    """A scene for Mitsuba says all that a trace of it needs: nothing is left at its default."""
    from lightfield.render.plugins.lamp import CURVES, PROPERTIES

    lamp = Lamp.model_validate(
        {
            name: 0.25
            for name in PROPERTIES
            if name not in ("profile", "intensity_table", "shape_exponent", *CURVES)
        }
        | {"profile": "super-gaussian", "shape_exponent": 3}
        | dict.fromkeys(CURVES, DEPARTURE)
    )
    detector = Detector(
        acceptance_hwhm_deg=30.0, tilt_x_deg=2.0, aim="lamp", full_angle_deg=3.0, cosine_error=0.1
    )
    loaded = mi.load_dict(mitsuba_dict(Scene(lamp=lamp, detector=detector)))
    (made,) = loaded.emitters()
    assert made.lamp.model_dump(include=set(PROPERTIES)) == lamp.model_dump(include=set(PROPERTIES))
    beam = {"name": "rings", "stage": "source", "formula": "1 + a*sin(theta)**2"}
    numbers = {"a": {"range": [0.0, 1.0], "neutral": 0.0, "value": 0.5}}
    own = Scene.from_dict({"effect": [{**beam, "parameters": numbers}]})
    (made,) = mi.load_dict(mitsuba_dict(own)).emitters()
    assert made.lamp.profile_departure == lit(own).lamp.profile_departure != ()
    for sensor in loaded.sensors():
        assert sensor.receiver.model_dump(include=set(RECEIVER)) == detector.model_dump(include=set(RECEIVER))
