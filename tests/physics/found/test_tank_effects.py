"""Effects of real tanks, each against a value worked out here, and found where it is hidden."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.formula.closed_form import direct_field, predict
from lightfield.readings import Readings
from lightfield.render.at_readings import render_positions, rendered_light
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m


def places(**columns: Any) -> Any:
    """Readings on the axis, as `predict` takes them."""
    n = max(np.size(v) for v in columns.values())
    given = {"x_m": 0.0, "y_m": 0.0, "z_m": 4.0} | columns
    return SimpleNamespace(**{k: np.broadcast_to(v, n) for k, v in given.items()})


def diagnosed(hidden: dict[str, float], **how: Any) -> Verdict:
    table, scene = readings(hidden, **how)
    return diagnose(table, scene, diffuse=None, advise=False).verdict


def noisy(truth: Scene, x_m: np.ndarray, z_m: np.ndarray) -> Readings:
    """Readings of a scene to 0.3 % and 1e-5 of the largest."""
    bare = Readings.from_arrays(x_m=x_m, z_m=z_m, value=np.ones(x_m.size))
    clean = predict(truth, bare)
    stderr = np.hypot(0.003 * clean, 1e-5 * clean.max())
    value = clean + stderr * np.random.default_rng(1).standard_normal(x_m.size)
    return Readings.from_arrays(x_m=x_m, z_m=z_m, value=value, stderr=stderr)


def found(verdict: Verdict, hidden: dict[str, float]) -> None:
    """The first explanation has the hidden values within four of its errors."""
    parameters = verdict.explanations[0].parameters
    for path, value in hidden.items():
        assert parameters[path].stderr is not None
        assert abs(parameters[path].value - value) < 4 * parameters[path].stderr, path


# -- immersion -----------------------------------------------------------------------------------------


def test_a_collector_in_water_reads_less_by_its_immersion_factor() -> None:
    """4 m from the lamp: in air 1/16, in water of 0.1 per m exp(-0.4)/16 / 1.38; then the background."""
    scene = Scene.from_dict(
        {"water": {"absorption_per_m": 0.1}, "detector": {"immersion_factor": 1.38, "background": 0.001}}
    )
    air, water = predict(scene, places(medium=np.array(["air", "water"])))
    assert air == pytest.approx(1 / 16 + 0.001, rel=1e-12)
    assert water == pytest.approx(np.exp(-0.4) / 16 / 1.38 + 0.001, rel=1e-12)


def test_immersion_is_found_from_readings_in_air_and_water_only() -> None:
    hidden = {"detector.immersion_factor": 1.38}
    verdict = diagnosed(hidden, seed=2, layout="air")
    assert (verdict.verdict, verdict.effects) == ("identified", ["immersion"])
    found(verdict, hidden)
    assert "air" in diagnosed({}, seed=2).untestable["immersion"]


def test_immersion_is_told_from_the_window_beside_it() -> None:
    """A tank has both; the window widens the beam in air, immersion dims all that is in water."""
    hidden = {"detector.immersion_factor": 1.35, "lamp.window_index": 1.336}
    verdict = diagnosed(hidden, seed=3, layout="air")
    assert set(verdict.effects) == {"immersion", "window_refraction"}
    found(verdict, hidden)


# -- water that changes in time ------------------------------------------------------------------------


def test_water_that_drifts_dims_by_time_and_path() -> None:
    """0.006 per m and hour: after half an hour 4 m away exp(-0.012) of the light, in air all of it."""
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1, "drift_per_m_per_hour": 0.006}})
    media = np.array(["water", "water", "water", "air"])
    read = predict(scene, places(time_s=np.array([0.0, 1800.0, np.nan, 1800.0]), medium=media))
    assert read * 16 == pytest.approx(np.exp([-0.4, -0.412, -0.4, 0.0]), rel=1e-12)


def test_particles_that_settle_leave_clear_water() -> None:
    """b = 0.2 exp(-t / 1000 s): at 0, 1000 s and the end -ln of the light's loss is 0.8, 0.8/e and 0."""
    scene = Scene.from_dict({"water": {"settling_per_m": 0.2, "settling_time_s": 1000.0}})
    read = predict(scene, places(time_s=np.array([0.0, 1000.0, 1e6])))
    assert -np.log(read * 16) == pytest.approx([0.8, 0.8 / np.e, 0.0], abs=1e-9)


def test_drifts_of_water_and_lamp_are_told_by_near_and_far() -> None:
    """From 2.7 to 9.8 m they are; of the layout's usual five planes a drift of 5 % per hour is either."""
    hidden = {"water.drift_per_m_per_hour": 0.011}
    verdict = diagnosed(hidden, seed=5, noise=0.003, layout="fine")
    assert verdict.effects == ["water_drift"]
    found(verdict, hidden)
    weak = diagnosed({"water.drift_per_m_per_hour": 0.006}, seed=5)
    assert weak.verdict == "ambiguous"
    assert {name for one in weak.explanations for name in one.effects} >= {"water_drift", "lamp_drift"}
    still, scene = readings(seed=5)
    bare = Readings.from_arrays(x_m=still.x_m, z_m=still.z_m, value=still.value, stderr=still.stderr)
    untestable = diagnose(bare, scene, diffuse=None, advise=False).verdict.untestable
    assert "times" in untestable["water_drift"] and "times" in untestable["settling"]


def test_water_beyond_what_tanks_do_is_not_called_a_drift() -> None:
    """A lamp that fades by 15 % per hour: water of 0.12 per m would have to change by 20 %."""
    verdict = diagnosed({"lamp.drift_per_hour": -0.15}, seed=6)
    assert (verdict.verdict, verdict.effects) == ("identified", ["lamp_drift"])


# -- spectrometers -------------------------------------------------------------------------------------

COLOURS = (450.0, 500.0, 550.0, 575.0, 600.0, 650.0)


def spectral_scene() -> Scene:
    bands = [[c - 5, c + 5] for c in COLOURS]
    water = {"base": "pure", "absorption_per_m": 0.03}
    return Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": water, "detector": {"bands_nm": bands}})


def spectra_of(truth: Scene, seed: int, x_m: Any = (0.0,)) -> Readings:
    """Spectra from 1 to 9 m, read to 0.4 % and 1e-6 of the largest; a gain of its own for each wavelength."""
    rng = np.random.default_rng(seed)
    z, x, colour = (v.ravel() for v in np.meshgrid(np.linspace(1, 9, 17), x_m, COLOURS, indexing="ij"))
    gain = dict(zip(COLOURS, rng.uniform(0.5, 1.0, len(COLOURS)), strict=True))
    columns = {"x_m": x, "y_m": np.zeros_like(x), "z_m": z, "wavelength_nm": colour}
    value = predict(truth, SimpleNamespace(**columns), gain=np.array([gain[c] for c in colour]))
    stderr = np.hypot(0.004 * value, 1e-6 * value.max())
    return Readings.from_arrays(**columns, value=value + stderr * rng.standard_normal(x.size), stderr=stderr)


def test_stray_light_is_a_part_of_the_mean_over_a_spectrum() -> None:
    """1 % of two wavelengths that read 1/4 and 1/16; the third is read by itself, at another place."""
    scene = Scene.from_dict({"detector": {"stray_light": 0.01, "background": 0.001}})
    where = {"z_m": np.array([2.0, 2.0, 4.0]), "wavelength_nm": np.array([500.0, 600.0, 500.0])}
    read = predict(scene, places(**where), gain=np.array([1.0, 0.25, 1.0]))
    assert read == pytest.approx(np.array([0.2490625, 0.0634375, 0.0625]) + 0.001, rel=1e-12)


def test_second_order_is_a_part_of_what_half_the_wavelength_reads() -> None:
    """2 % of 410 nm, half way between 400 and 420 nm, is read at 820 nm; nothing at 780 nm, whose half is not
    read, nor in the spectrum at another place."""
    scene = Scene.from_dict({"detector": {"second_order": 0.02, "background": 0.001}})
    wavelength = np.array([820.0, 400.0, 420.0, 780.0, 820.0, 600.0])
    where = {"z_m": np.array([2.0, 2.0, 2.0, 2.0, 4.0, 4.0]), "wavelength_nm": wavelength}
    read = predict(scene, places(**where), gain=np.array([0.1, 1.0, 0.5, 0.2, 0.1, 1.0]))
    more = np.array([0.02 * (1.0 + 0.5) / 2, 0, 0, 0, 0, 0])
    clear = np.array([0.1, 1.0, 0.5, 0.2, 0.1, 1.0]) + more
    assert read == pytest.approx(clear / where["z_m"] ** 2 + 0.001, rel=1e-12)


def test_second_order_is_found_where_wavelengths_overlap() -> None:
    """Spectra into the infrared, which pure water takes within metres, while it lets violet light pass."""
    colours = np.array([350.0, 365.0, 380.0, 500.0, 600.0, 650.0, 700.0, 730.0, 760.0])
    bands = [[w - 5, w + 5] for w in colours.tolist()]
    known = {"water": {"base": "pure"}, "lamp": {"hwhm_deg": 6.0}, "detector": {"bands_nm": bands}}
    scene = Scene.from_dict(known)
    truth = scene.with_values({"detector.second_order": 0.01})
    grid = np.meshgrid(np.linspace(0.5, 2.5, 9), [-0.1, 0.0, 0.1], colours, indexing="ij")
    z, x, colour = (v.ravel() for v in grid)
    columns = {"x_m": x, "y_m": np.zeros_like(x), "z_m": z, "wavelength_nm": colour}
    value = predict(truth, SimpleNamespace(**columns), gain=1.0)
    stderr = np.hypot(0.004 * value, 1e-5 * value.max())
    noise = stderr * np.random.default_rng(2).standard_normal(x.size)
    table = Readings.from_arrays(**columns, value=value + noise, stderr=stderr)
    verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
    assert verdict.effects == ["second_order"]
    found(verdict, {"detector.second_order": 0.01})


def test_a_shifted_scale_reads_the_water_of_another_wavelength() -> None:
    """Pure water takes 0.0058 per m and nm more at 575 to 600 nm (Pope & Fry 1997: 0.0772 and 0.2224 per m):
    5 % per nm over 8.5 m. The stated bands stay what they are."""
    scene = Scene.from_dict({"water": {"base": "pure"}})
    off = scene.with_values({"detector.wavelength_shift_nm": 1.0})
    where = places(z_m=np.full(6, 8.5), wavelength_nm=np.linspace(575, 599, 6))
    loss = 1 - predict(off, where) / predict(scene, where)
    assert loss.mean() == pytest.approx(8.5 * (0.2224 - 0.0772) / 25, rel=0.05)
    stated = places(z_m=8.5, wavelength_nm=np.array([586.0]))
    shifted = places(z_m=8.5, wavelength_nm=np.array([585.0]))
    assert predict(scene, stated) == pytest.approx(predict(off, shifted), rel=1e-12)
    np.testing.assert_allclose(middles_nm(off), middles_nm(scene) + 1.0)


def test_the_render_reads_with_the_same_shifted_scale() -> None:
    scene = spectral_scene().with_values({"detector.wavelength_shift_nm": 2.0, "detector.stray_light": 0.1})
    table = Readings.from_arrays(z_m=np.full(2, 5.0), value=np.ones(2), wavelength_nm=[575.0, 600.0])
    light, _ = rendered_light(scene, table, max_photons=2e4)
    c = [absorption_per_m(scene.water, w) + scattering_per_m(scene.water, w) for w in (577.0, 602.0)]
    assert light == pytest.approx(np.exp(-5.0 * np.array(c)) / 25, rel=5e-3)  # and little that is scattered


def test_the_render_sees_the_colour_of_water_and_lamp() -> None:
    """Over a base of 0.1 per m: 0.05 more at 500 nm, 0.02 less at 600; the lamp 20 % brighter at 600 nm."""
    scene = Scene.from_dict(
        {
            "lamp": {"spectrum_departure": [[500.0, 0.0], [600.0, math.log(1.2)]]},
            "water": {"absorption_per_m": 0.1, "colour_departure": [[500.0, 0.05], [600.0, -0.02]]},
            "detector": {"positions_m": [[0.0, 0.0, 5.0]]},
        }
    )
    table = Readings.from_arrays(z_m=np.full(2, 5.0), value=np.ones(2), wavelength_nm=[500.0, 600.0])
    light, _ = rendered_light(scene, table, max_photons=2e4)
    assert light == pytest.approx(np.exp(-5.0 * np.array([0.15, 0.08])) / 25, rel=1e-6)
    plain = scene.with_values({"lamp.spectrum_departure": ()})
    at = np.array([500.0, 600.0])
    bright, before = (render_positions(s, max_photons=2e4).maps(at)[0] for s in (scene, plain))
    np.testing.assert_allclose((bright / before).ravel(), [1.0, 1.2], rtol=1e-6)


@pytest.mark.parametrize("hidden", [{"detector.stray_light": 0.005}, {"detector.wavelength_shift_nm": -0.8}])
def test_a_spectrometer_shows_its_errors(hidden: dict[str, float]) -> None:
    scene = spectral_scene()
    table = spectra_of(scene.with_values(hidden), seed=1)
    verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
    name = next(iter(hidden)).removeprefix("detector.").removesuffix("_nm")
    assert (verdict.verdict, verdict.effects) == ("identified", [name])
    found(verdict, hidden)
    grey = diagnosed({}, seed=2).untestable
    assert "three wavelengths" in grey[name]


def test_many_spectra_with_stray_light_are_diagnosed() -> None:
    """612 readings, whose unknowns once made a singular value decomposition fail."""
    scene = spectral_scene()
    hidden = {"detector.stray_light": 0.004}
    table = spectra_of(scene.with_values(hidden), seed=3, x_m=np.linspace(-0.4, 0.4, 6))
    verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
    assert verdict.effects == ["stray_light"]
    found(verdict, hidden)


# -- collectors ----------------------------------------------------------------------------------------


def test_error_of_the_cosine_is_that_at_60_degrees() -> None:
    """Light from an isotropic lamp 2 m away: 0, 60 and 80 degrees aside with an error of -5 %."""
    scene = Scene.from_dict({"lamp": {"profile": "isotropic"}, "detector": {"cosine_error": -0.05}})
    angle = np.radians([0.0, 60.0, 80.0])
    read = predict(scene, places(x_m=2 * np.sin(angle), z_m=2 * np.cos(angle)))
    more = np.array([0.0, -0.05, -0.1 * (1 - np.cos(angle[2]))])
    assert read == pytest.approx(np.cos(angle) / 4 * (1 + more), rel=1e-12)


def test_a_narrow_beam_does_not_show_the_cosine_and_a_known_wide_one_does() -> None:
    hidden = {"detector.cosine_error": -0.08}
    narrow = diagnosed(hidden, seed=2)
    assert narrow.verdict == "none"
    assert "absorbed" in narrow.untestable["cosine_error"]
    wide = Scene.from_dict({"lamp": {"profile": "isotropic"}, "water": {"absorption_per_m": 0.1}})
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-3, 3, 25), [0.5, 1.0, 2.0]))
    verdict = diagnose(noisy(wide.with_values(hidden), x, z), wide, diffuse=None, advise=False).verdict
    assert "cosine_error" in verdict.effects, verdict.sentence
    found(verdict, hidden)


# -- the lamp ------------------------------------------------------------------------------------------


def test_a_wide_window_smears_the_beam_by_its_own_spread() -> None:
    """Points of a disc of radius R have <x^2> = R^2/4, and a Gaussian beam of width s has (s z)^2: the light
    has the sum."""
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 4.0, "radius_m": 0.05}})
    x, z, s = np.linspace(-1.5, 1.5, 3001), 3.0, np.radians(4.0) / np.sqrt(2 * np.log(2))
    light = direct_field(scene, x, 0 * x, np.full_like(x, z))
    point = direct_field(scene.with_values({"lamp.radius_m": 0.0}), x, 0 * x, np.full_like(x, z))
    spread = [(x**2 * v).sum() / v.sum() for v in (light, point)]
    assert spread[0] - spread[1] == pytest.approx(0.05**2 / 4, rel=0.02)
    assert spread[1] == pytest.approx((s * z) ** 2, rel=0.02)


def test_a_wide_window_is_found() -> None:
    """From 1 to 3 m. From farther away it is like a source behind the window."""
    hidden = {"lamp.radius_m": 0.06}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.1}})
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.3, 0.3, 21), [1.0, 1.5, 2.0, 3.0]))
    table = noisy(scene.with_values(hidden), x, z)
    verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
    assert (verdict.verdict, verdict.effects) == ("identified", ["lamp_size"])
    found(verdict, hidden)
    far = diagnosed({"lamp.radius_m": 0.09}, seed=2, noise=0.003)
    assert {name for one in far.explanations for name in one.effects} >= {"lamp_size", "apparent_source"}
