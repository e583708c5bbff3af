"""Ranges of a sweep: what the command line and a plan file may say; one clear error for what they may not."""

from __future__ import annotations

from pathlib import Path

import pytest

from lightfield.errors import LightfieldError, SceneError, UsageError
from lightfield.scene import Scene
from lightfield.sweep.axes import (
    ALBEDO,
    ATTENUATION,
    Axis,
    apply,
    axis_of,
    checked_axes,
    parse_axis,
    read_plan,
)
from lightfield.sweep.runner import run_sweep
from lightfield.sweep.schema import variables_of
from lightfield.sweep.sweep_plan import SweepSettings, make_plan

SCENE = Scene.from_toml("[water]\nabsorption_per_m = 0.1\nscattering_per_m = 0.3\n[tank]\n")


def test_linear_log_and_list_ranges_include_both_ends() -> None:
    assert parse_axis("water.scattering_per_m=0:0.5:6").at(5) == {"water.scattering_per_m": 0.5}
    linear = parse_axis("water.scattering_per_m=0:0.3:4").values["water.scattering_per_m"]
    assert linear == (0.0, 0.1, 0.2, 0.3)  # and not 0.30000000000000004
    assert parse_axis("p=0.01:1:3:log").values["p"] == (0.01, 0.1, 1.0)
    assert parse_axis("tank.wall_albedo=0,0.2,0.4").values["tank.wall_albedo"] == (0, 0.2, 0.4)
    assert parse_axis("lamp.profile=gaussian,isotropic").values["lamp.profile"] == ("gaussian", "isotropic")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("water.scattering_per_m", "path=range"),
        ("=0:1:3", "path=range"),
        ("p=", "path=range"),
        ("p=0:1", "start:stop:count"),
        ("p=0:1:2.5", "start:stop:count"),
        ("p=0:1:3:log:5", "start:stop:count"),
        ("p=a:b:3", "start:stop:count"),
        ("p=0:1:1", "impossible count"),
        ("p=0:1:-2", "impossible count"),
        ("p=0:inf:3", "finite"),
        ("p=0:1:3:log", "above 0"),
        ("p=0:1:3:cubic", "linear or log"),
        ("p=1,2,1", "stands twice"),
        ("p=1,2,1.0", "stands twice"),
    ],
)
def test_a_wrong_range_is_one_line_that_says_the_rule(text: str, says: str) -> None:
    with pytest.raises(UsageError, match=says) as error:
        parse_axis(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("ranges", "says"),
    [
        ([], "nothing is varied"),
        (["water.scatering_per_m=0,1"], "no such parameter.*scattering_per_m"),
        (["water.scattering_per_m=0,-1"], "impossible value.*0 to 100.*remedy: vary it in that range"),
        (["detector.width_m=0:1:3"], "impossible value; found 0.0; rule: above 0 to 10000"),
        (["tank.wall_albedo=0,1.5"], "impossible value.*0 to 1"),
        (["water.scattering_per_m=0,1", "water.scattering_per_m=2,3"], "varied twice"),
        (["lamp=1,2"], "not a parameter; found 'lamp'; rule: the path of one parameter"),
        (["effect=1,2"], "not a parameter; found 'effect'"),
        ([f"{ALBEDO}=0,2"], "impossible value.*0 to 1"),
        ([f"{ATTENUATION}=1,2", "water.absorption_per_m=0,1"], "both set absorption and scattering"),
        (["lamp.profile=round,square"], "lamp.profile"),
        (["detector.pixels=few"], "not a number; found .few.; rule: 1 to"),
    ],
)
def test_wrong_axes_are_refused_before_any_work(ranges: list[str], says: str) -> None:
    with pytest.raises(LightfieldError, match=says):
        checked_axes([parse_axis(text) for text in ranges], SCENE)


def test_an_axis_does_not_have_the_name_of_what_another_one_sets() -> None:
    """Both would be the same coordinate."""
    named = Axis("water.scattering_per_m", {"lamp.power_w": (10.0, 20.0)})
    both = Axis("both", {"water.scattering_per_m": (0.0, 1.0), "lamp.hwhm_deg": (3.0, 4.0)})
    with pytest.raises(UsageError, match=r"varied twice; found 'water\.scattering_per_m'"):
        checked_axes([named, both], SCENE)


@pytest.mark.parametrize("name", ["z_m", "irradiance", "half_width_m", "status", "wavelength_nm"])
def test_an_axis_does_not_have_the_name_of_a_variable_of_the_store(name: str, tmp_path: Path) -> None:
    """One of the two would be lost; nothing is written."""
    plan = make_plan(SCENE, [Axis(name, {"lamp.power_w": (10.0, 20.0)})], SweepSettings())
    with pytest.raises(UsageError, match=f"this name is taken; found '{name}'"):
        run_sweep(plan, tmp_path / "s.zarr")
    assert not list(tmp_path.iterdir())


def test_an_axis_does_not_have_the_name_of_a_dimension_of_the_store() -> None:
    """Where the bands vary, they are counted along `band`."""
    bands = Axis("detector.bands_nm", {"detector.bands_nm": (((400.0, 450.0),), ((500.0, 550.0),))})
    plan = make_plan(SCENE, [bands, Axis("band", {"lamp.power_w": (10.0, 20.0)})], SweepSettings())
    with pytest.raises(UsageError, match="this name is taken; found 'band'"):
        variables_of(plan)


def test_a_scene_without_a_tank_has_no_walls_to_vary() -> None:
    with pytest.raises(SceneError, match="has no tank"):
        checked_axes([parse_axis("tank.wall_albedo=0,0.5")], Scene())


def test_attenuation_and_single_scattering_albedo_set_absorption_and_scattering() -> None:
    """c = a + b and omega = b / c, so a = c (1 - omega), b = c omega; what is not varied keeps its value."""
    both = apply(SCENE, {ATTENUATION: 0.5, ALBEDO: 0.8})
    assert both.water.absorption_per_m == pytest.approx(0.1)
    assert both.water.scattering_per_m == pytest.approx(0.4)
    one = apply(SCENE, {ATTENUATION: 0.8})  # the scene's own albedo is 0.75
    assert (one.water.absorption_per_m, one.water.scattering_per_m) == pytest.approx((0.2, 0.6))


def test_a_plan_file_holds_ranges_coupled_parameters_and_settings(tmp_path: Path) -> None:
    file = tmp_path / "plan.toml"
    file.write_text(
        """
        [settings]
        rel_error = 0.1
        [[vary]]
        path = "water.scattering_per_m"
        start = 0.01
        stop = 1
        count = 3
        scale = "log"
        [[vary]]
        path = "detector.planes_m"
        values = [[1.0, 2.0], [3.0, 4.0]]
        [[vary]]
        name = "tank size"
        together = { "tank.width_m" = [2.0, 4.0], "tank.length_m" = [20.0, 40.0] }
        """
    )
    axes, settings = read_plan(file)
    assert [axis.size for axis in axes] == [3, 2, 2]
    assert axes[2].at(1) == {"tank.width_m": 4.0, "tank.length_m": 40.0}
    assert settings == {"rel_error": 0.1}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[[vary]\n", "not TOML"),
        ("[[vari]]\npath = 'a'\n", "not a plan.*vari"),
        ("[[vary]]\npath = 'a'\n", "not a range"),
        ("[[vary]]\npath = 'a'\nstart = 0\nstop = 'b'\ncount = 2\n", "not a range"),
        ("[[vary]]\nname = 'n'\ntogether = { a = [1, 2], b = [1] }\n", "unequal length"),
        ("[[vary]]\npath = 'a'\nvalues = []\n", "unequal length, or none"),
        ("[[vary]]\npath = 'a'\nvalues = [[[1]], [[2]], [[1]]]\n", "stands twice"),
        ("[[vary]]\nname = '../n'\ntogether = { a = [1, 2] }\n", "not a name of a dimension"),
        ("[[vary]]\npath = 1979-05-27\nvalues = [1]\n", "not a range.*path or a name, in quotes"),
        ("vary = [1, 2]\n", "not a range.*path or a name, in quotes"),
        ("settings = 3\n", "not a plan"),
    ],
)
def test_a_wrong_plan_file_names_file_and_table(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "plan.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=says) as error:
        read_plan(file)
    assert "plan.toml" in str(error.value)


def test_a_missing_plan_file_is_an_error_of_one_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot read the sweep plan"):
        read_plan(tmp_path / "none.toml")


def test_a_word_that_no_scene_has_is_refused_before_anything_is_traced() -> None:
    """And not, beside others that work, when its case is evaluated."""
    with pytest.raises(LightfieldError, match="gausian"):
        checked_axes([parse_axis("lamp.profile=gaussian,gausian")], Scene())
    with pytest.raises(LightfieldError, match="jerlov-9"):
        checked_axes([parse_axis("water.base=pure,jerlov-9")], Scene())
    # What another axis may yet give is no such word.
    assert checked_axes([parse_axis("lamp.profile=gaussian,table")], Scene())[0].size == 2


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("detector.planes_m", [[2.0, 3.0], [2.5, 3.0]]),
        ("detector.bands_nm", [[[500.0, 520.0]], [[510.0, 540.0]]]),
        ("water.phase", [{"type": "henyey-greenstein", "g": 0.8}, {"type": "petzold"}]),
        ("lamp.spectrum", [[{"peak_nm": 510.0, "fwhm_nm": 20.0}], "planck"]),
    ],
)
def test_lists_and_tables_vary_as_numbers_do(path: str, values: list[object]) -> None:
    """Each case has in its scene what that scene would have by itself."""
    scene = Scene.from_dict({"water": {"scattering_per_m": 0.1}})
    plan = make_plan(scene, [axis_of(path, {path: values}, "test")], SweepSettings(max_photons=2e4))
    for step, value in enumerate(values):
        alone = scene.with_values({path: value})
        assert plan.cases.build(step).digest() == alone.digest()
        assert apply(scene, plan.cases.axes[0].at(step), validate=False).get(path) == alone.get(path)
    with pytest.raises(LightfieldError, match="hg"):
        checked_axes(
            [axis_of("water.phase", {"water.phase": [{"type": "petzold"}, {"type": "hg"}]}, "test")], scene
        )


def test_decimal_commas_of_a_range_are_told_to_be_points() -> None:
    """What was given was told as its own remedy."""
    with pytest.raises(UsageError, match=r"found '0,1:0,2:11'.*a point, as in 0\.1:0\.2:11"):
        parse_axis("water.absorption_per_m=0,1:0,2:11", "--vary")
