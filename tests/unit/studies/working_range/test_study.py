"""Working range: the paper's rule, the spot, and the bound on a pose, against closed forms."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest
from montecarlo import least_p
from scipy.optimize import brentq

from lightfield.errors import LightfieldError, MeasurementError, RenderError, SceneError
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.render.diffuse.source import response_for
from lightfield.render.flux.traced_field import Region, traced_field
from lightfield.report.working_range import range_page
from lightfield.scene import Scene
from lightfield.studies.working_range import smooth_light as smoothed
from lightfield.studies.working_range import study
from lightfield.studies.working_range.smooth_light import smooth_light
from lightfield.studies.working_range.study import WorkingRange, working_range
from lightfield.studies.working_range.text import as_data, as_text

HALF = np.radians(3.81)
C = 0.1


def scene(a: float = 0.05, b: float = 0.05, **parts) -> Scene:
    phase = {"type": "henyey-greenstein", "g": 0.92}
    water = {"absorption_per_m": a, "scattering_per_m": b, "phase": phase}
    return Scene.from_dict({"lamp": {"hwhm_deg": 3.81}, "water": water} | parts)


@pytest.fixture(scope="module")
def formula() -> WorkingRange:
    return working_range(scene(), None)


def reach(found: WorkingRange, name: str) -> float:
    return next(r.z_m for r in found.reaches if r.name == name)


def test_the_papers_rule_by_the_formula_alone(formula) -> None:
    """(4.5 / z)^2 exp(-0.1 (z - 4.5)) = 0.2 at 8.31 m; the same at 10 times a noise of 1 %."""
    for name, level in (("light", 0.2), ("signal", 0.1)):
        z = brentq(lambda z, level=level: (4.5 / z) ** 2 * np.exp(-C * (z - 4.5)) - level, 5, 16)
        assert reach(formula, name) == pytest.approx(z, abs=1e-3)
    assert reach(formula, "light") == pytest.approx(8.31, abs=0.01)


def test_radius_of_half_intensity_is_the_beams(formula) -> None:
    """exp(-ln2 (theta / h)^2) cos(theta) exp(-c (r - z)) z^2 / r^2 = 1/2 for a cosine receiver."""
    for z in (4.5, 8.5):

        def half(x: float, z: float = z) -> float:
            r, theta = np.hypot(x, z), np.arctan(x / z)
            beam = np.exp(-np.log(2) * (theta / HALF) ** 2)
            return beam * np.cos(theta) * np.exp(-C * (r - z)) * (z / r) ** 2 - 0.5

        expected = brentq(half, 0.05, 1.5)
        assert float(formula.dataset.half_radius_m.sel(z_m=z)) == pytest.approx(expected, rel=2e-3)


def test_the_spot_of_a_table_is_that_of_the_beam_that_is_tabulated(tmp_path) -> None:
    """Whatever lamp.hwhm_deg says, which a table does not have: here 20 degrees."""
    angle = np.linspace(0, 90, 1801)
    columns = np.column_stack([angle, np.exp(-np.log(2) * (angle / 20.0) ** 2)])
    np.savetxt(tmp_path / "beam.csv", columns, "%.9g", ",", header="angle_deg,intensity", comments="")
    table = {"profile": "table", "intensity_table": str(tmp_path / "beam.csv")}
    found, known = (working_range(scene(lamp=one), None) for one in (table, {"hwhm_deg": 20.0}))
    assert np.isfinite(found.dataset.half_radius_m).all()
    np.testing.assert_allclose(found.dataset.half_radius_m, known.dataset.half_radius_m, rtol=1e-3)


STEEP = {"profile": "super-gaussian", "shape_exponent": 50.0, "hwhm_deg": 8.0}


@pytest.mark.parametrize(
    ("parts", "half_deg"),
    [
        pytest.param({"lamp": STEEP}, 8.0, marks=pytest.mark.slow),
        ({"lamp": {"hwhm_deg": 8.0}, "detector": {"quantity": "radiance", "full_angle_deg": 2.0}}, 1.0),
    ],
)
def test_the_spot_of_what_ends_steeply_ends_there(parts: dict, half_deg: float) -> None:
    """A flat beam, and a tube that sees the lamp within 1 degree alone: no smooth curve leads to nothing."""
    base = scene(**parts)
    trace = partial(response_for, share=0.05, photons=100_000)
    for found in (working_range(base, None), working_range(base, trace, photons=1e4, to_m=6.0)):
        ratio = found.dataset.half_radius_m / found.dataset.z_m
        np.testing.assert_allclose(ratio, np.tan(np.radians(half_deg)), rtol=0.02)


def test_light_is_asked_for_in_the_water_wherever_the_lamp_is(monkeypatch) -> None:
    """Beside a wall of a tank 2 m wide, towards its middle: the radius is that of a lamp in the middle."""
    asked, of = [], study.light_at
    monkeypatch.setattr(study, "light_at", lambda s, x, *rest: asked.append(x) or of(s, x, *rest))
    tank = {"width_m": 2.0, "length_m": 12.0}
    found, known = (
        working_range(scene(lamp={"offset_x_m": x, "hwhm_deg": 3.81}, tank=tank), None) for x in (0.6, 0.0)
    )
    assert np.abs(np.concatenate(asked)).max() < 1.0
    np.testing.assert_allclose(found.dataset.half_radius_m, known.dataset.half_radius_m, rtol=2e-3)


def test_smooth_light_of_a_wide_beam_is_followed_about_its_axis(monkeypatch) -> None:
    """At 60 degrees in open water, 17 m away: not to 5 million cells; and as in a trace of its own."""
    base = scene(lamp={"hwhm_deg": 60.0}, **array(size_m=0.4, radius_m=0.32))
    regions = []
    keep = smoothed.traced_field
    monkeypatch.setattr(
        smoothed, "traced_field", lambda s, region, **more: regions.append(region) or keep(s, region, **more)
    )
    light = smooth_light(base, 1.5, 4.0, 0.3, 1.5e5)
    assert regions[0].half_width_m < 0.26 * 4.3
    place = np.array([[0.0, 0.0, 1.5], [0.2, 0.1, 2.5], [0.0, -0.3, 4.0]])
    normal = np.array([[0, 0, -1.0], [0.3, 0, -0.954], [0, 0.5, -0.866]])
    smooth, error = light.irradiance(place, normal)
    traced, noise = traced_field(base, Region(0.64, 1.3, 4.3), photons=1.5e5, seed=1).irradiance(
        place, normal
    )
    assert np.all(np.abs(smooth / traced - 1) < 3.5 * np.hypot(error, noise) / traced + 0.003)


def array(**values) -> dict:
    """Of an array and a follower that knows all but its pose; noise of 1 % of the brightest reading alone."""
    silent = {
        "read_noise_a_per_sqrt_hz": 0.0,
        "dark_current_a": 0.0,
        "adc_bits": 0,
        "responsivity_a_per_w": 1.0,
    }
    known = {"gain_drift_percent": 0.0, "gain_mismatch_percent": 0.0, "noise_percent": 1.0}
    return {"array": {**silent, **known, **values}, "follower": {"water_known_percent": 0.0}}


def test_bound_of_a_small_array_is_the_closed_form() -> None:
    """sigma_z = s / (sqrt(N) (2 / z + c)), s the noise over the reading; yaw of a flat array changes nothing.

    And with the gain unknown s z^3 h^2 / (2 ln2 sqrt(sum (rho^2 - mean)^2)).
    """
    side, count = 0.03, 5
    lamp = {"hwhm_deg": 3.81, "power_w": 1e6}  # no shot noise
    small = Scene.from_dict({**scene(**array(count=[count, count], size_m=side)).model_dump(), "lamp": lamp})
    data = working_range(small, None).dataset
    at = np.linspace(-0.5, 0.5, count) * side
    rho2 = (at[:, None] ** 2 + at**2).ravel()
    for z in (4.5, 8.5):
        along = 0.01 / (count * (2 / z + C))
        free = 0.01 * z**3 * HALF**2 / (2 * np.log(2) * np.sqrt(((rho2 - rho2.mean()) ** 2).sum()))
        row = data.sel(z_m=z)
        assert float(row.sigma_along_m) == pytest.approx(along, rel=0.02)
        assert float(row.sigma_along_relative_m) == pytest.approx(free, rel=0.03)


def by_hand(radius_m: float, z: float) -> np.ndarray:
    """Derivatives of 25 readings over 0.4 m, shape (25, 8), over a noise of 1 % of the brightest.

    By x, y, z, yaw and pitch as differences of the closed form, elements placed and turned by hand; by the
    logarithms of gain, absorption and scattering.
    """
    at = np.linspace(-0.2, 0.2, 5)
    px, py = (v.ravel() for v in np.meshgrid(at, at))
    deep = radius_m - np.sqrt(radius_m**2 - px**2 - py**2) if radius_m else 0 * px
    normal = np.stack([px, py, deep - radius_m] if radius_m else [0 * px, 0 * py, 0 * px - 1], axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    place = np.stack([px, py, deep], axis=1)

    def read(x: float, y: float, z: float, yaw: float, pitch: float) -> tuple[np.ndarray, np.ndarray]:
        # Yaw turns the forward axis -z towards +x, pitch lifts it.
        cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
        lifted = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
        turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ lifted
        there, facing = place @ turn.T + [x, y, z], normal @ turn.T
        r = np.linalg.norm(there, axis=1)
        off_axis = np.arctan2(np.hypot(there[:, 0], there[:, 1]), there[:, 2])
        beam = np.exp(-np.log(2) * (off_axis / HALF) ** 2)
        return beam * np.exp(-C * r) / r**2 * -(facing * there).sum(axis=1) / r, r

    h = 1e-4
    here = np.array([0, 0, z, 0, 0])
    value, r = read(*here)
    columns = [(read(*(here + s))[0] - read(*(here - s))[0]) / (2 * h) for s in h * np.eye(5)]
    water = [-0.05 * r * value, -0.05 * r * value]
    return np.stack([*columns, value, *water], axis=1) / (0.01 * value.max())


@pytest.mark.parametrize("radius_m", [0.0, 0.32])
@pytest.mark.parametrize("unsure", [False, True])
def test_bound_of_an_array_is_that_of_its_readings_one_by_one(radius_m, unsure) -> None:
    """Knowing all but the pose, or the gain to 5 % and absorption and scattering to 20 %."""
    parts = array(count=[5, 5], size_m=0.4, radius_m=radius_m)
    if unsure:
        parts["array"]["gain_drift_percent"], parts["follower"]["water_known_percent"] = 5.0, 20.0
    found = working_range(scene(**parts), None).dataset
    for z in (5.5, 8.5):
        J = by_hand(radius_m, z)
        prior = np.diag([0, 0, 0, 0, 0, 0.05**-2, 0.2**-2, 0.2**-2])
        whole = J.T @ J + prior
        free = J.T @ J + prior - np.diag([0, 0, 0, 0, 0, 0.05**-2, 0, 0])
        stated, relative = (whole, free) if unsure else (whole[:5, :5], free[:6, :6])
        row = found.sel(z_m=z)
        for name, used in (("", stated), ("_relative", relative)):
            bound = np.sqrt(np.diag(np.linalg.inv(used)))
            assert float(row[f"sigma_across{name}_m"]) == pytest.approx(max(bound[:2]), rel=0.02)
            assert float(row[f"sigma_along{name}_m"]) == pytest.approx(bound[2], rel=0.02)
            turned = np.degrees(max(bound[3:5]))
            assert float(row[f"sigma_turned{name}_deg"]) == pytest.approx(turned, rel=0.02)


def test_smooth_light_is_the_traced_field_with_less_noise() -> None:
    """Near the lamp, where the trace is good: what is smoothed and what is not read the same."""
    base = scene(tank={}, **array(size_m=0.4, radius_m=0.32))
    light = smooth_light(base, 4.5, 8.5, 0.3, 1.5e5)
    place = np.array([[0.0, 0.0, 4.5], [0.2, 0.1, 5.5], [0.0, -0.3, 6.5], [0.2, 0.0, 8.5]])
    normal = np.array([[0, 0, -1.0], [0.3, 0, -0.954], [0, 0.5, -0.866], [0.0, 0.0, -1.0]])
    smooth, error = light.irradiance(place, normal)
    traced, noise = traced_field(base, Region(0.64, 4.2, 9.0), photons=1.5e5, seed=1).irradiance(
        place, normal
    )
    assert np.all(np.abs(smooth / traced - 1) < 3.5 * np.hypot(error, noise) / traced + 0.003)
    assert np.all(error < noise) and np.all(error > 0)


def test_smooth_light_of_walls_alone_stays_by_the_direct_light() -> None:
    """Water that scatters nothing, walls of 0.1 and a surface, beside a narrow beam: as the trace has it.
    (Directions of almost no light, one noise over another, made it a thousand times as bright.)"""
    water = {"absorption_per_m": 0.06, "scattering_per_m": 0.0}
    tank = {"width_m": 4.0, "depth_m": 3.0, "length_m": 20.0, "wall_albedo": 0.1, "surface": "flat"}
    base = Scene.from_dict({"lamp": {"hwhm_deg": 5.0}, "water": water, "tank": tank})
    light = smooth_light(base, 1.5, 16.0, 0.3, 1.5e5)
    place = np.array([[0.0, 0.0, 1.6], [0.2, 0.1, 1.6], [0.0, -0.3, 2.5], [0.2, 0.0, 5.0], [0.0, 0.2, 9.0]])
    normal = np.array([[0, 0, -1.0], [0.3, 0, -0.954], [0, 0.5, -0.866], [0.3, 0, -0.954], [0, 0, -1.0]])
    smooth, error = light.irradiance(place, normal)
    traced, noise = traced_field(base, Region(0.64, 1.4, 16.0), photons=1.5e5, seed=1).irradiance(
        place, normal
    )
    axis = light.reading(place * [0, 0, 1], np.tile([0, 0, -1.0], (5, 1)))
    assert np.all(np.abs(smooth - traced) < 3.5 * np.hypot(error, noise) + 0.003 * axis)


def test_smooth_light_of_an_array_near_the_walls_is_in_finer_cells() -> None:
    """15 cm between them: as a trace of its own. Nearer than the finest cells it is said to be too large."""
    tank = {"width_m": 1.2, "depth_m": 1.0, "length_m": 4.0, "lamp_depth_m": 0.5, "wall_albedo": 0.3}
    base = scene(lamp={"hwhm_deg": 10.0}, tank=tank, detector={"planes_m": [0.8, 2.5]})
    light = smooth_light(base, 0.8, 2.5, 0.32, 1.5e5)
    place = np.array([[0.0, 0.0, 0.8], [0.2, 0.1, 1.5], [0.0, -0.3, 2.0], [0.3, 0.0, 2.5]])
    normal = np.tile([0.0, 0.0, -1.0], (4, 1))
    smooth, error = light.irradiance(place, normal)
    traced, noise = traced_field(base, Region(0.36, 0.7, 2.7, 0.06), photons=1.5e5, seed=1).irradiance(
        place, normal
    )
    assert np.all(np.abs(smooth / traced - 1) < 3.5 * np.hypot(error, noise) / traced + 0.005)
    with pytest.raises(RenderError, match=r"reaches into a wall.*0\.572 m"):
        smooth_light(base, 0.8, 2.5, 0.49, 1.5e5)


def test_smooth_light_of_dense_water_between_walls_in_clearer_water() -> None:
    """From b = 2.1 to 1.05 per m, 4.8 m away: as a trace there, as stated; by the mean length of the paths to
    all cells it was half too bright. Photons are not all of the error there, but in the trace's own water."""
    tank = {"width_m": 2.4, "depth_m": 1.6, "length_m": 8.0, "lamp_depth_m": 0.8, "wall_albedo": 0.5}
    dense, clear = (
        scene(b=b, lamp={"hwhm_deg": 12.0}, tank=tank, detector={"planes_m": [1.0, 4.8]}) for b in (2.1, 1.05)
    )
    traced, fresh = (smooth_light(one, 1.0, 4.8, 0.3, 4e5) for one in (dense, clear))
    place = np.array([[0.0, 0.0, 4.8], [0.1, 0.0, 4.8], [0.0, 0.1, 4.8]])
    normal = np.tile([0.0, 0.0, -1.0], (3, 1))
    other = traced.in_water_of(clear)
    (found, stated), (mine, noise) = (one.irradiance(place, normal) for one in (other, fresh))
    assert (stated < 0.15 * mine).all()
    assert least_p(found - mine, (stated, 7), (noise, 7)) > 0.001
    photons = [one.batches(place, normal).std(axis=0, ddof=1) / np.sqrt(8) for one in (other, fresh)]
    assert (stated > 1.1 * photons[0]).all() and noise == pytest.approx(photons[1])


def test_scattered_light_lengthens_the_range_and_widens_the_spot() -> None:
    """An independent Monte Carlo: 8.64 m with scattered light, 8.31 m without; half radius 0.583 m."""
    found = working_range(scene(), partial(response_for, photons=150_000), photons=2e5, to_m=10.0)
    light = found.reaches[0]
    assert 0 < light.stderr_m < 0.06
    assert light.z_m == pytest.approx(8.64, abs=3 * light.stderr_m)
    assert light.formula_m == pytest.approx(8.31, abs=0.01)
    row = found.dataset.sel(z_m=8.5)
    assert 0 < float(row.half_radius_stderr_m) < 0.02
    assert float(row.half_radius_m) == pytest.approx(0.583, abs=3 * float(row.half_radius_stderr_m))


def test_readings_stand_beside_it_with_the_error_of_the_reference(formula) -> None:
    readings = Readings.from_arrays(
        z_m=[4.5, 8.5, 8.5], x_m=[0, 0, 0.3], value=[2.0, 0.46, 0.2], stderr=[0.02, 0.01, 0.01]
    )
    shown = working_range(scene(), None, readings).readings
    assert shown.value.values.tolist() == pytest.approx([1.0, 0.23])
    assert shown.stderr.values.tolist() == pytest.approx([0.0, 0.23 * np.hypot(0.01, 0.01 / 0.46)])
    assert shown.half_radius_m.values[1] == pytest.approx(0.3 * np.sqrt(np.log(2) / np.log(2.3)))
    with pytest.raises(MeasurementError, match=r"among them at the reference, 4\.5 m"):
        working_range(scene(), None, readings.subset(readings.z_m > 5))


def test_readings_are_taken_about_the_lamps_axis_and_in_its_first_band() -> None:
    """A lamp 0.15 m aside in pure water; readings that are the closed form in blue, and in red besides."""
    base = scene(
        lamp={"hwhm_deg": 3.81, "offset_x_m": 0.15},
        water={"base": "pure"},
        detector={"planes_m": [4.5, 6.5, 8.5], "bands_nm": [[469.0, 471.0], [609.0, 611.0]]},
    )
    x, z, w = (v.ravel() for v in np.meshgrid([0.0, 0.15, 0.3], [4.5, 6.5, 8.5], [470.0, 610.0]))
    value = direct_field(base, x, 0 * x, z, w)
    table = Readings.from_arrays(x_m=x, z_m=z, wavelength_nm=w, value=value, stderr=0.01 * value)
    found = working_range(base, None, table)
    model = found.dataset.sel(z_m=found.readings.z_m)
    np.testing.assert_allclose(found.readings.value, model.formula, rtol=1e-3)
    np.testing.assert_allclose(found.readings.half_radius_m, model.half_radius_m, rtol=5e-3)


def test_it_ends_before_the_tank_does() -> None:
    found = working_range(scene(tank={"length_m": 10.0, "behind_lamp_m": 0.5}), None)
    assert float(found.dataset.z_m.max()) == pytest.approx(9.45)
    assert np.isinf(reach(found, "pose_across")) and "beyond all told" in as_text(found)
    with pytest.raises(SceneError, match="no distances"):
        working_range(scene(), None, to_m=4.6)


@pytest.mark.parametrize(
    ("a", "to_m", "words"), [(0.5, 900.0, "no light is left"), (0.06, 1e9, "at most 1000 m")]
)
def test_a_distance_without_light_is_refused_before_any_trace(a, to_m, words) -> None:
    def traced(*_, **__):
        raise AssertionError("traced")

    with pytest.raises(LightfieldError, match=rf"{words}.*remedy: ask for a nearer distance"):
        working_range(scene(a), traced, to_m=to_m)


@pytest.mark.parametrize(("water", "to_m"), [((0.05, 0.05), (30.0, 400.0)), ((0.43, 2.0), (5.0, 14.0))])
def test_how_far_is_asked_does_not_change_how_far_it_reaches(water, to_m) -> None:
    tank = scene(*water, detector={"planes_m": [3.0, 5.0]})
    near, far = (working_range(tank, None, to_m=one) for one in to_m)
    for name in ("light", "signal", "pose_across", "pose_along", "pose"):
        assert reach(far, name) == pytest.approx(reach(near, name), rel=0.01, nan_ok=True)


def test_planes_that_nobody_stated_are_called_the_default() -> None:
    with pytest.raises(
        SceneError,
        match=r"from 4.5 m, the first of detector.planes_m = .*\(its default\), to .*"
        r"3 m, as asked for.*remedy: give detector.planes_m",
    ):
        working_range(scene(), None, to_m=3.0)


@pytest.mark.parametrize(
    "wrong", [{"share": 0.0}, {"share": 1.5}, {"noise": np.nan}, {"snr": -1.0}, {"photons": 1.0}]
)
def test_numbers_that_make_no_sense(wrong) -> None:
    with pytest.raises(LightfieldError, match="impossible"):
        working_range(scene(), None, **wrong)


@pytest.mark.usefixtures("undrawn")
def test_words_data_and_page(formula) -> None:
    data = json.loads(json.dumps(as_data(formula)))
    assert data["reaches"][0]["z_m"] == pytest.approx(8.31, abs=0.01) and len(data["z_m"]) == len(
        data["light"]
    )
    assert "8.31 m" in as_text(formula)
    said = {reach["name"]: reach["rule"] for reach in data["reaches"]}
    assert said["light"] == "at least 20 % of the light at 4.5 m" and len(said) == 2 + 2 * 4
    assert said["pose_turned_relative"] == "yaw and pitch to 5 deg, relative readings only"
    page = range_page(formula)
    # Nothing was traced: nothing is called scattered light, and the formula stands once.
    assert data["traced"] is False and "By the formula alone" in as_text(formula)
    assert not [said for said in (as_text(formula), page) if "with scattered light" in said]
    assert "curved with a radius of 0.32 m" in page and page.count("<svg") == 2 * 2


@pytest.mark.usefixtures("undrawn")
def test_where_an_array_sees_nothing_of_a_direction_its_bound_is_infinite() -> None:
    """A small tank and a narrow beam: near the lamp the array is wider than all light that is known there."""
    tank = {"width_m": 1.2, "depth_m": 0.8, "length_m": 3.0, "behind_lamp_m": 0.3, "wall_albedo": 0.3}
    lamp = {"hwhm_deg": 8.0, "spectrum": "led-blue"}
    detector = {"planes_m": [0.7, 1.0, 1.4, 1.8, 2.2], "bands_nm": [[445.0, 495.0]]}
    small = Scene.from_dict({"lamp": lamp, "tank": tank, "detector": detector})
    found = working_range(small, None)
    sigma = found.dataset.sigma_along_relative_m.values
    assert (sigma > 0).all() and not np.isnan(sigma).any()
    assert as_text(found) and "</html>" in range_page(found)
    json.dumps(as_data(found), allow_nan=False)


def test_a_stretch_that_begins_away_from_the_lamp_is_told_from_its_beginning() -> None:
    """Near the lamp the light falls so fast beside the axis that a step aside looks like yaw."""
    found = working_range(scene(detector={"planes_m": [2.5, 8.5]}), None)
    yaw = next(r for r in found.reaches if r.name == "pose_turned")
    assert 2.6 < yaw.from_m < 6 and yaw.z_m > 8.5
    sigma = found.dataset.sigma_turned_deg
    assert float(sigma.interp(z_m=yaw.from_m - 0.2)) > 5 > float(sigma.interp(z_m=yaw.from_m + 0.2))
    assert f"{yaw.from_m:.2f} m to" in as_text(found)
