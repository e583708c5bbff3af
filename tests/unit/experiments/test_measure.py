"""Readings are numbers, also at the edges, and their errors are stated."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.experiments.layouts import scan
from lightfield.experiments.measure import Instrument, LightAtReadings, in_doubt, measure
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.readings.load_warning import Remarks
from lightfield.render.at_readings import rendered_light
from lightfield.scene import Scene


def test_position_errors_where_no_light_arrives() -> None:
    """A beam of 1 degree, read up to 45 degrees off: its direct light underflows to 0; 0/0 is no reading."""
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 1.0}, "detector": {"planes_m": [1.0], "width_m": 2.0}})
    rng = np.random.default_rng(0)
    table = scan(scene, "line", "random", rng)
    light = direct_field(scene, table.x_m, table.y_m, table.z_m)
    assert (light == 0).any()
    readings, _ = measure(scene, table, LightAtReadings(light), Instrument(position_m=0.001), rng)
    assert np.isfinite(readings.value).all()


def test_what_the_render_does_not_know_is_stated_with_the_readings() -> None:
    """Light known to 1 %: the stated errors are 1 % larger in quadrature, the values the same."""
    scene = Scene.from_dict({"detector": {"planes_m": [4.5], "width_m": 1.0}})
    table = scan(scene, "line", "random", np.random.default_rng(0))
    light = direct_field(scene, table.x_m, table.y_m, table.z_m)
    known, guessed, instrument = (
        LightAtReadings(light),
        LightAtReadings(light, 0.01 * light),
        Instrument(0.001),
    )
    sure, clean = measure(scene, table, known, instrument, np.random.default_rng(1))
    unsure, _ = measure(scene, table, guessed, instrument, np.random.default_rng(1))
    assert (known.relative_error == 0).all() and guessed.relative_error == pytest.approx(0.01)
    assert unsure.value == pytest.approx(sure.value)
    assert not [w for w in sure.warnings if w.code is Remarks.NO_STDERR], "of the table without values"
    assert np.sqrt(unsure.stderr**2 - sure.stderr**2) == pytest.approx(0.01 * clean, rel=1e-6)


@pytest.mark.parametrize(("percent", "doubted"), [(0.1, 0), (0.4, 4), (2.0, 6)])
def test_a_render_worse_than_the_noise_is_told(percent: float, doubted: int) -> None:
    """Noise of 0.2 % and a floor of 0.08 % of the largest reading: light known to 0.4 % is worse than the
    noise of readings above 0.23, light known to 2 % than that of those above 0.04, light known to 0.1 % than
    none. An error falls by the root of the photons: with those that are asked for there is no doubt left."""
    shown = np.array([1.0, 0.8, 0.5, 0.3, 0.1, 0.05, 0.001])
    instrument = Instrument(0.002)
    light = LightAtReadings(7.0 * shown, percent / 100 * 7.0 * shown)
    found = in_doubt(light, instrument, shown, 1e6)
    assert (0 if found is None else found.readings) == doubted
    if found is None:
        return
    assert found.of == len(shown) and found.light_error_percent == pytest.approx(percent)
    noise = np.hypot(0.2, 0.08 / shown[:doubted])
    assert found.noise_percent == pytest.approx(float(np.median(noise)))
    better = LightAtReadings(light.value, light.stderr / np.sqrt(1.01 * found.photons / 1e6))
    assert in_doubt(better, instrument, shown, found.photons) is None
    told = str(found)
    assert f"{percent:.2g} %" in told and f"{found.noise_percent:.2g} %" in told and "more photons" in told


def test_an_error_budget_states_the_errors_that_there_are() -> None:
    """In the units of the table's head, and nothing of what the instrument does not do."""
    table = scan(Scene(), "line", "random", np.random.default_rng(0))
    budget = Instrument(plane_gain=0.003, position_m=0.002).stated(table).budget
    assert (budget.plane_gain_percent, budget.position_mm) == (pytest.approx(0.3), pytest.approx(2.0))
    assert Instrument().stated(table).budget == table.budget


def test_reflected_light_does_not_move_with_the_stage() -> None:
    """Nine tenths of the light are reflected, and vary over longer ways: a stage that is off moves a reading
    by a tenth of what it does in clear water."""
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 6.0}, "detector": {"planes_m": [1.5], "width_m": 0.8}})
    table = scan(scene, "line", "random", np.random.default_rng(0))
    direct = direct_field(scene, table.x_m, table.y_m, table.z_m)

    def read(light: np.ndarray, position_m: float) -> np.ndarray:
        instrument = Instrument(noise=1e-9, position_m=position_m)
        readings, clean = measure(scene, table, LightAtReadings(light), instrument, np.random.default_rng(1))
        return readings.value / clean

    clear, murky = (read(light, 0.001) - read(light, 1e-12) for light in (direct, 10 * direct))
    assert np.abs(clear).max() > 0.003
    np.testing.assert_allclose(murky, 0.1 * clear, atol=1e-5)


@pytest.mark.parametrize(("x", "oval"), [(0.0, False), (0.6, False), (0.0, True)])
def test_scattered_light_moves_with_the_stage(x: float, oval: bool) -> None:
    """b = 0.3 per m: three quarters of the light 6.5 m away are scattered. Places are off by 5 mm in each
    coordinate: readings scatter by the slopes of a render, of both, between places 0.3 m apart."""
    scene = Scene.from_dict({
        "lamp": {"hwhm_deg": 6.0, "ellipticity": 1.01 if oval else 1.0},
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.3},
    })  # fmt: skip
    step, n = 0.15, 2000
    around = np.array([[x, 6.5], [x + step, 6.5], [x - step, 6.5], [x, 6.5 + step], [x, 6.5 - step]])
    light, _ = rendered_light(scene, places(around[:, 0], around[:, 1]), rel_error=3e-3, max_photons=1e6)
    slopes = np.log([light[1] / light[2], light[3] / light[4]]) / (2 * step)
    table = places(np.full(n, x), np.full(n, 6.5))
    instrument, rng = Instrument(noise=1e-9, position_m=0.005), np.random.default_rng(1)
    read, clean = measure(scene, table, LightAtReadings(np.full(n, light[0])), instrument, rng)
    assert np.std(read.value / clean) == pytest.approx(0.005 * np.hypot(*slopes), rel=0.1)


def places(x_m: np.ndarray, z_m: np.ndarray) -> Readings:
    n = len(x_m)
    return Readings.from_arrays(
        x_m=x_m, y_m=np.zeros(n), z_m=z_m, value=np.ones(n), stderr=np.full(n, 0.01), time_s=np.arange(n),
        quantity="irradiance",
    )  # fmt: skip


def test_what_a_layout_says_that_bands_share_is_drawn_once_for_a_spectrum() -> None:
    """Two bands of 400 places: 2 % together and 0.5 % by itself, and both in the standard error."""
    scene = Scene.from_dict({"detector": {"bands_nm": [[500.0, 560.0]]}})
    rng, n = np.random.default_rng(1), 400
    x = rng.uniform(-0.1, 0.1, n)
    table = Readings.from_arrays(
        x_m=np.repeat(x, 2), z_m=4.5, wavelength_nm=np.tile([510.0, 550.0], n), value=np.ones(2 * n),
        time_s=np.repeat(np.arange(n), 2), common_percent=2.0,
    ).check_against(scene)  # fmt: skip
    light = direct_field(scene, table.x_m, table.y_m, table.z_m, table.wavelength_nm)
    made, clean = measure(scene, table, LightAtReadings(light), Instrument(noise=0.005), rng)
    off = (made.value / clean - 1).reshape(n, 2)
    assert np.std(off.mean(axis=1)) == pytest.approx(np.hypot(0.02, 0.005 / np.sqrt(2)), rel=0.1)
    assert np.std(off[:, 0] - off[:, 1]) == pytest.approx(0.005 * np.sqrt(2), rel=0.1)
    assert np.median(made.stderr / made.value) == pytest.approx(np.hypot(0.02, 0.005), rel=0.03)
