"""A tank of one's own: what is asked, and that scene and table follow and belong together."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lightfield as lf
from lightfield.errors import LightfieldError, MeasurementError, OutputError, UsageError
from lightfield.experiments.new_tank import LAYOUT, READINGS, SCENE, new_tank
from lightfield.experiments.questions import QUESTIONS
from lightfield.readings import read_table
from lightfield.readings.columns import LAYOUT as COLUMNS
from lightfield.scene import Scene


def test_defaults_make_a_scene_and_a_table_that_can_be_planned_with(tmp_path: Path) -> None:
    made = new_tank({})
    files = made.save(tmp_path)
    scene = Scene.load(files[SCENE])
    assert scene == made.scene and scene.tank is not None
    layout = read_table(files[LAYOUT], scene, COLUMNS)
    assert len(layout) == made.rows == len(scene.detector.planes_m) * 12 + 1
    repeated = (layout.x_m == 0) & (layout.y_m == 0) & (layout.z_m == scene.detector.planes_m[0])
    assert repeated.sum() == len(scene.detector.planes_m) + 2
    assert (np.diff(layout.time_s) > 0).all(), "or drifts could not be planned for"
    limits = lf.plan(layout, scene, trace=False).details.limits
    assert {"lamp_drift", "beam_ellipticity", "stratification"} <= set(limits)


def test_places_are_read_in_random_order_and_the_first_again_and_again() -> None:
    """As the first hour advises: distances mixed, one place often; equal tanks, equal tables."""
    made = new_tank({"planes": "1,2,3,4,5", "points": "11"})
    rows = [line.split(",") for line in made.layout_text.splitlines() if line.startswith("water")]
    x, y, z = ([float(row[k]) for row in rows] for k in (1, 2, 3))
    assert all((x[k], z[k]) == (0.0, 1.0) for k in (0, 12, 24, 36, 48, 60))
    assert all(len(set(z[k + 1 : k + 12])) > 2 for k in (0, 12, 24, 36, 48))
    assert len(set(zip(x, y, z, strict=True))) == 55
    assert new_tank({"planes": "1,2,3,4,5", "points": "11"}).layout_text == made.layout_text


def test_some_places_lie_below_and_above_the_axis() -> None:
    """With all readings at one height no beam is oval and no water in layers."""
    made = new_tank({"tank": "2x1x6", "lamp_depth": "0.3", "points": "11"})
    rows = np.array(
        [line.split(",")[1:4] for line in made.layout_text.splitlines() if line.startswith("water")], float
    )
    planes = made.scene.detector.planes_m
    for z in planes:
        up = np.sort(rows[rows[:, 2] == z][:, 1])
        assert (up[up != 0] == ([-0.63, -0.315, 0.135, 0.27] if z in (planes[0], planes[-1]) else [])).all()
    assert len(rows) == 12 * len(planes) + 1


def test_a_table_is_refused_until_it_is_filled_in(tmp_path: Path) -> None:
    made = new_tank({"points": "3"})
    readings = made.save(tmp_path)[READINGS]
    with pytest.raises(MeasurementError, match="value is missing"):
        read_table(readings, made.scene)
    filled = re.sub(r",,,$", ",1.5,,", readings.read_text(encoding="utf-8"), flags=re.MULTILINE)
    readings.write_text(filled, encoding="utf-8")
    assert (read_table(readings, made.scene).value == 1.5).all()


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ({"tank": "12,5,2.2"}, "write numbers with 'x' between"),
        ({"water": "0.1"}, "such as 0.1,0"),
        ({"tank": "2000x1000x6000"}, "2x1x6 if these are millimetres or 20x10x60 if these are centimetres"),
        ({"tank": "none", "planes": "1000,2000"}, "millimetres over 1000"),
        ({"tank": "none", "walls": "0.7", "surface": "no"}, "walls, surface: open water has no walls"),
        ({"panes": "yes"}, "panes: no such panes; found 'yes'; rule: no, all or sides"),
    ],
)
def test_millimetres_are_not_taken_for_metres(answers: dict[str, str], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        new_tank(answers)


def test_answers_stand_in_the_scene() -> None:
    made = new_tank(
        {
            "tank": "1.2 x 0.8 x 3", "lamp_depth": "0.2", "walls": "0.3", "surface": "no", "lamp": "470/25",
            "beam": "6.5", "power": "3", "water": "0.05,0.2", "planes": "0.5, 1",
            "quantity": "scalar_irradiance", "points": "1",
        },
        "Jörg's \"pool\" \N{GRINNING FACE}",
    )  # fmt: skip
    scene = made.scene
    assert scene.name.startswith("Jörg") and scene.tank is not None and scene.detector.planes_m == (0.5, 1.0)
    assert scene.tank.box_m[1] == (pytest.approx(-0.6), pytest.approx(0.2))
    assert (scene.tank.wall_albedo, scene.tank.surface) == (0.3, "none")
    assert scene.lamp.spectrum.peak_nm == 470 and scene.lamp.hwhm_deg == 6.5 and scene.lamp.power_w == 3
    assert (scene.water.absorption_per_m, scene.water.scattering_per_m) == (0.05, 0.2)
    assert scene.detector.bands_nm == ((445.0, 495.0),)
    assert made.rows == 5


def test_words_and_spaces_that_people_write_are_understood() -> None:
    scene = new_tank({"lamp": "halogen", "water": "0.1 0.3"}).scene
    assert scene.lamp.spectrum == "planck"
    assert (scene.water.absorption_per_m, scene.water.scattering_per_m) == (0.1, 0.3)
    assert new_tank({"lamp": "white"}).scene == new_tank({"lamp": "led-white"}).scene


def test_a_lamp_of_two_peaks_and_a_tube_are_written_as_they_may_be_changed() -> None:
    made = new_tank({"lamp": "450/20+525/35", "quantity": "radiance"})
    assert [(p.peak_nm, p.fwhm_nm) for p in made.scene.lamp.spectrum] == [(450, 20), (525, 35)]
    assert made.scene.detector.bands_nm == ((430.0, 470.0), (490.0, 560.0))
    assert "height = 1.0" in made.scene_text and "full_angle_deg = 2.0" in made.scene_text
    assert "full_angle_deg" not in new_tank({}).scene_text
    rows = [line.split(",") for line in made.layout_text.splitlines() if line.startswith("water")]
    beside = max(abs(float(row[1])) / float(row[3]) for row in rows)
    assert 0.5 * math.tan(math.radians(1.0)) < beside < math.tan(math.radians(1.0))


@pytest.mark.parametrize(
    ("answers", "bands"),
    [
        # Three peaks made one band from 430 to 640 nm.
        ({"lamp": "450/20+525/35+630/15"}, ((430, 470), (490, 560), (615, 645))),
        ({"lamp": "450/20+480/20"}, ((430, 500),)),
        ({"lamp": "led-white"}, ((430, 690),)),
        ({"lamp": "halogen", "band": "440:460,520:560"}, ((440, 460), (520, 560))),
    ],
)
def test_each_peak_has_a_band_and_each_band_a_row(
    answers: dict[str, str], bands: tuple, tmp_path: Path
) -> None:
    made = new_tank(answers)
    assert made.scene.detector.bands_nm == bands
    files = made.save(tmp_path)
    assert len(read_table(files[LAYOUT], made.scene, COLUMNS)) == made.rows * len(bands)
    filled = re.sub(r",,,$", ",1.5,,", files[READINGS].read_text(encoding="utf-8"), flags=re.MULTILINE)
    files[READINGS].write_text(filled, encoding="utf-8")
    readings = read_table(files[READINGS], made.scene)
    assert len(readings) == made.rows * len(bands)
    assert set(readings.wavelength_nm) == {(low + high) / 2 for low, high in bands}


def test_what_is_no_band_is_refused() -> None:
    with pytest.raises(UsageError, match="several: 430:470,500:560"):
        new_tank({"band": "430:470:500"})


@pytest.mark.parametrize(
    ("answer", "base"), [("pure", "pure"), ("petzold-coastal", "petzold-coastal"), ("Jerlov-5c", "jerlov-5C")]
)
def test_waters_have_names(answer: str, base: str) -> None:
    assert new_tank({"water": answer, "tank": "none"}).scene.water.base == base
    assert new_tank({"tank": "none"}).scene.tank is None


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    made = new_tank({})
    (tmp_path / "readings.csv").write_text("mine")
    with pytest.raises(OutputError, match=r"readings\.csv"):
        made.save(tmp_path)
    assert (tmp_path / "readings.csv").read_text() == "mine" and not (tmp_path / "scene.toml").exists()


def test_a_start_that_was_cut_short_is_taken_up_again(tmp_path: Path) -> None:
    """On a disk that was full the scene was written and no table was."""
    made = new_tank({})
    files = made.save(tmp_path)
    files["readings.csv"].unlink()
    assert made.save(tmp_path) == files and files["readings.csv"].read_text() == made.table_text
    files["readings.csv"].write_text(made.table_text.replace("\n", ",1\n"))
    with pytest.raises(OutputError, match=r"readings\.csv"):
        made.save(tmp_path)


@given(
    st.floats(0.1, 50), st.floats(0.05, 20), st.floats(0.2, 200), st.sampled_from(["1", "5", "11"])
)  # fmt: skip
def test_the_proposed_places_fit_any_tank(width: float, depth: float, length: float, points: str) -> None:
    made = new_tank({"tank": f"{width:.3g}x{depth:.3g}x{length:.3g}", "points": points})
    assert made.scene.tank is not None
    x, y, z = made.scene.tank.box_m
    rows = [line.split(",") for line in made.table_text.splitlines() if line.startswith("water")]
    for row in rows:
        assert all(low <= float(v) <= high for v, (low, high) in zip(row[1:4], (x, y, z), strict=True))


@given(st.sampled_from([q.name for q in QUESTIONS]), st.text(max_size=12))
def test_whatever_is_answered_there_is_a_scene_or_a_clear_error(name: str, answer: str) -> None:
    try:
        made = new_tank({name: answer})
    except LightfieldError as error:
        assert str(error)
    else:
        assert Scene.from_toml(made.scene_text) == made.scene


@pytest.mark.parametrize(("said", "faces"), [("no", "none"), ("All", "all"), ("sides", "sides")])
def test_walls_of_glass_are_asked_for(said: str, faces: str) -> None:
    made = new_tank({"panes": said, "walls": "0"}, "glass")
    assert made.scene.tank is not None and made.scene.tank.panes == faces
    assert made.scene.reflects and made.scene.pane_reflectance == (0.0 if said == "no" else 1.0)
