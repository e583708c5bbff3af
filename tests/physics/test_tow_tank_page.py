"""The page of the tow tank states numbers: they are computed here again from the formula and the scenes.

Source of the measured ones: the paper's own figures (100 % to 23 % on the axis from 4.5 to 8.5 m; radius of
half intensity 0.3 m and 0.4 m; K about 0.1 per metre; half angle 3.81 degrees).
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.formula.field import direct_field, paper_model
from lightfield.readings import read_table
from lightfield.scene import Scene

FOLDER = Path(__file__).resolve().parents[2] / "scenes" / "unh_tow_tank"
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
