"""The page of the tow tank states numbers: they are computed here again from the formula and the scenes.

Source of the measured ones: the paper's own figures (100 % to 23 % on the axis from 4.5 to 8.5 m; radius of
half intensity 0.3 m and 0.4 m; K about 0.1 per metre; half angle 3.81 degrees).
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.formula.closed_form import direct_field, paper_model
from lightfield.readings import read_table
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.attenuation.apparent import apparent_attenuation
from lightfield.studies.attenuation.ratios import ratios_of
from lightfield.studies.attenuation.study import attenuation
from lightfield.studies.working_range.study import working_range

FOLDER = Path(__file__).resolve().parents[3] / "scenes" / "unh_tow_tank"
PAGE = (FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def scene():
    return Scene.load(FOLDER / "scene.toml")


def half_radius(light, z):
    return brentq(lambda x: light(x, z) - 0.5 * light(0.0, z), 1e-3, 1.5)


def field(scene):
    return lambda x, z: float(direct_field(scene, np.array([x]), np.array([0.0]), np.array([z]))[0])


def paper(x, z):
    return float(paper_model(np.hypot(x, z), np.arctan2(x, z)))


def test_measured_file_holds_the_papers_numbers():
    readings = read_table(FOLDER / "measured.csv")
    np.testing.assert_allclose(readings.value, [1, 0.5, 0.23, 0.115])
    np.testing.assert_allclose(readings.x_m, [0, 0.3, 0, 0.4])
    assert np.isnan(readings.stderr).all(), "the paper gives no errors, so the file has none"


def test_the_papers_model_misses_its_own_numbers():
    assert paper(0, 8.5) == pytest.approx(0.188, abs=5e-4)
    assert half_radius(paper, 4.5) == pytest.approx(0.299, abs=1e-3)
    assert half_radius(paper, 8.5) == pytest.approx(0.563, abs=1e-3)
    assert paper(0, 8.5) / 0.23 - 1 == pytest.approx(-0.18, abs=0.005)
    assert half_radius(paper, 8.5) / 0.4 - 1 == pytest.approx(0.41, abs=0.005)
    for text in ("18.8 %", "0.299 m", "0.563 m", "18 % too dark", "41 % too wide"):
        assert text in PAGE


def test_what_the_numbers_would_ask_for():
    def axis(z0):
        return ((4.5 + z0) / (8.5 + z0)) ** 2

    assert -np.log(0.23 / axis(0)) / 4 == pytest.approx(0.049, abs=5e-4)
    behind = (0.3 * 8.5 - 0.4 * 4.5) / (0.4 - 0.3)
    assert behind == pytest.approx(7.5)
    assert np.degrees(np.arctan(0.3 / (4.5 + behind))) == pytest.approx(1.43, abs=0.005)
    assert -np.log(0.23 / axis(behind)) / 4 == pytest.approx(0.22, abs=0.005)
    z0 = brentq(lambda z: axis(z) * np.exp(-0.4) - 0.23, 0, 10)
    assert z0 == pytest.approx(1.16, abs=0.005)
    assert 0.3 * (8.5 + z0) / (4.5 + z0) == pytest.approx(0.51, abs=0.005)


def test_a_parallel_collimator_cannot_see_the_lamp_at_half_intensity():
    scene = Scene.load(FOLDER / "scene_collimator.toml")
    light = field(scene)
    assert np.degrees(np.arctan2(0.3, 4.5)) == pytest.approx(3.81, abs=0.005)
    assert np.degrees(np.arctan2(0.4, 8.5)) == pytest.approx(2.69, abs=0.005)
    for x, z, edge in ((0.3, 4.5, 0.079), (0.4, 8.5, 0.148)):
        assert light(x, z) == 0.0
        assert light(edge - 1e-3, z) > 0.5 * light(0, z)
        assert light(edge + 1e-3, z) == 0.0


def test_receivers_that_can_have_seen_it(scene):
    aimed = scene.with_values({"detector.quantity": "radiance", "detector.aim": "lamp"})
    for each, expected in ((aimed, (0.299, 0.563)), (scene, (0.298, 0.563))):
        light = field(each)
        assert [half_radius(light, z) for z in (4.5, 8.5)] == pytest.approx(expected, abs=6e-4)


def test_both_scenes_differ_in_the_receiver_only(scene):
    collimated = Scene.load(FOLDER / "scene_collimator.toml")
    assert (collimated.lamp, collimated.water, collimated.tank) == (scene.lamp, scene.water, scene.tank)
    assert (collimated.detector.quantity, collimated.detector.full_angle_deg) == ("radiance", 2.0)
    assert scene.water.absorption_per_m + scene.water.scattering_per_m == pytest.approx(0.1)


def test_figure_3_is_what_the_spectra_say():
    scene, table = Scene.load(FOLDER / "spectra.toml"), read_table(FOLDER / "spectra.csv")
    found = apparent_attenuation(ratios_of(table, scene))
    mean, error = found.over(500, 550)
    assert (round(mean, 4), round(error, 4)) == (0.0974, 0.0023) and "0.0974 ± 0.0023 per m" in PAGE
    colour, ratio = found.ratios.wavelength_nm, found.K_per_m / found.K_per_m.min()
    assert colour[ratio == 1] == 490 and "least at 490 nm" in PAGE
    flat = colour[ratio < 1.25]
    assert (flat.min(), flat.max()) == (450, 540) and "from 450 to 540 nm" in PAGE
    assert found.ratios.published == ((500.0, 550.0, 0.1),)


def test_the_water_behind_a_K_of_a_tenth_attenuates_more():
    """What `spectra.csv` was made of, as its head says."""
    truth = {"chlorophyll_mg_per_m3": 0.1, "cdom_440_per_m": 0.04, "sediment_g_per_m3": 0.05}
    water = Scene.load(FOLDER / "spectra.toml").with_values({f"water.{k}": v for k, v in truth.items()}).water
    c = float(absorption_per_m(water, 520.0) + scattering_per_m(water, 520.0))
    assert c == pytest.approx(0.158, abs=5e-4) and "c = 0.158 per m" in PAGE
    source = read_table(FOLDER / "spectra.csv").metadata["source"]
    assert all(f"{amount:g}" in source for amount in truth.values()) and "measured by nobody" in source


@pytest.mark.slow
def test_figures_4_and_5_and_what_figure_3_hides(scene):
    found = working_range(scene, response_for)
    light, row = found.reaches[0], found.dataset.sel(z_m=8.5)
    for value, stderr, shown, digits in (
        (light.z_m, light.stderr_m, "8.69 ± 0.01 m", 2),
        (100 * row.light, 100 * row.light_stderr, "21.2 ± 0.1 %", 1),
        (row.half_radius_m, row.half_radius_stderr_m, "0.585 ± 0.003 m", 3),
        (
            *(found.dataset.sel(z_m=4.5)[n] for n in ("half_radius_m", "half_radius_stderr_m")),
            "0.304 ± 0.001 m",
            3,
        ),
    ):
        stated = float(shown.split()[0])
        assert abs(float(value) - stated) < 3 * float(stderr) + 0.5 * 10.0**-digits and shown in PAGE
    assert light.formula_m == pytest.approx(8.31, abs=0.005)
    spectra = attenuation(
        read_table(FOLDER / "spectra.csv"), Scene.load(FOLDER / "spectra.toml"), response_for
    ).content
    traced, plain = (m.amounts["sediment_g_per_m3"] for m in (spectra.traced, spectra.beer_lambert))
    assert traced.found and traced.low_95 <= 0.05 <= traced.high_95
    assert not plain.found and plain.high_95 == pytest.approx(0.048, abs=0.002)
    assert spectra.beer_lambert.chi2 / spectra.beer_lambert.dof == pytest.approx(0.83, abs=0.02)
