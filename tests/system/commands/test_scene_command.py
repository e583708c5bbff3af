"""`lightfield scene`: every way of looking at a scene file gives the same values."""

from __future__ import annotations

import json

import pytest

from lightfield import cli
from lightfield.scene import Scene

TOML = """
[lamp]
profile = "gaussian"
hwhm_deg = 3.5
[water]
absorption_per_m = 0.125
scattering_per_m = 0.25
[detector]
planes_m = [4.5, 8.5]
"""


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "my scene.toml"
    path.write_text(TOML)
    return path


def run(capsys, *arguments: object) -> str:
    assert cli.main(["scene", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_listing_shows_values_and_marks_what_departs_from_neutral(capsys, scene_file):
    lines = {
        line[1:].split()[0]: line for line in run(capsys, scene_file).splitlines() if line[2:3].islower()
    }
    assert "0.25" in lines["water.scattering_per_m"]
    assert lines["water.scattering_per_m"].startswith("*")
    assert lines["lamp.tilt_x_deg"].startswith(" ")
    assert "gaussian" in lines["lamp.profile"] and "super-gaussian" in lines["lamp.profile"]
    assert "[4.5, 8.5]" in lines["detector.planes_m"]
    fields = Scene.load(scene_file).model_dump(mode="json", exclude_none=True)
    stated = {
        f"{part}.{name}" for part in ("lamp", "water", "tank", "detector") for name in fields.get(part, {})
    }
    assert stated - {"water.phase"} <= set(lines)


def test_get_prints_the_number(capsys, scene_file):
    assert float(run(capsys, scene_file, "--get", "water.absorption_per_m")) == 0.125
    assert json.loads(run(capsys, scene_file, "--get", "detector.planes_m")) == [4.5, 8.5]


def test_set_changes_a_value_and_keeps_the_rest(capsys, scene_file):
    changed = run(capsys, scene_file, "--set", "water.scattering_per_m=0.5", "--set", "detector.planes_m=[6]")
    scene = Scene.from_toml(changed)
    assert scene.get("water.scattering_per_m") == 0.5
    assert list(scene.get("detector.planes_m")) == [6.0]
    assert scene.get("lamp.hwhm_deg") == 3.5
    assert run(capsys, scene_file, "--set", "lamp.hwhm_deg=5", "--get", "lamp.hwhm_deg").strip() in (
        "5",
        "5.0",
    )


def test_to_toml_is_the_same_scene(capsys, scene_file):
    assert Scene.from_toml(run(capsys, scene_file, "--to-toml")).digest() == Scene.load(scene_file).digest()


def test_to_toml_says_what_was_said_and_no_defaults_as_its_help_has_it(capsys, scene_file):
    told = Scene.from_toml(run(capsys, scene_file, "--to-toml", "--set", "lamp.power_w=5")).to_dict()
    assert told["lamp"] == {"profile": "gaussian", "hwhm_deg": 3.5, "power_w": 5.0}
    assert "tank" not in told
    with pytest.raises(SystemExit):
        cli.main(["scene", "--help"])
    assert "without defaults" in " ".join(capsys.readouterr().out.split())


def test_schema_needs_no_file(capsys):
    assert json.loads(run(capsys, "--schema")) == Scene.json_schema()


@pytest.mark.parametrize(
    "arguments",
    [
        ["--set", "water.scattering_per_m"],
        ["--set", "=1"],
        ["--set", "water.nonsense=1"],
        ["--set", "water.scattering_per_m=-1"],
        ["--set", "water.scattering_per_m=much"],
        ["--set", "lamp.profile=square"],
        ["--get", "water.nonsense"],
        ["--get", "nonsense"],
    ],
)
def test_wrong_values_give_exit_code_2(capsys, scene_file, arguments):
    assert cli.main(["scene", str(scene_file), *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("lightfield: ")
    assert "defect" not in captured.err


@pytest.mark.parametrize(
    ("lamp", "profile", "said"),
    [
        ("", "table", "ends at 50 % of the light on its axis"),
        ('profile = "table"\nhwhm_deg = 8', "table", "not used: lamp.hwhm_deg (profile is table)"),
        ('profile = "gaussian"', "gaussian", "not used: lamp.intensity_table (profile is gaussian)"),
    ],
)
def test_a_table_that_is_named_is_meant_and_what_counts_for_nothing_is_told(
    capsys, tmp_path, lamp: str, profile: str, said: str
) -> None:
    (tmp_path / "lamp.csv").write_text("angle_deg,intensity\n0,2\n5,1\n")
    scene = tmp_path / "scene.toml"
    scene.write_text(f'[lamp]\nintensity_table = "lamp.csv"\n{lamp}\n')
    assert Scene.load(scene).lamp.profile == profile
    assert said in run(capsys, scene)


def test_every_table_that_is_named_is_used(tmp_path) -> None:
    (tmp_path / "t.csv").write_text(
        "wavelength_nm,power,response,absorption_per_m,scattering_per_m\n400,1,1,0.1,0\n700,1,1,0.1,0\n"
    )
    tables = {"lamp": "spectrum_table", "water": "table", "detector": "response_table"}
    data = {part: {name: str(tmp_path / "t.csv")} for part, name in tables.items()}
    scene = Scene.from_dict(data)
    assert (scene.lamp.spectrum, scene.water.base, scene.detector.response) == ("table",) * 3


@pytest.mark.parametrize(
    ("tank", "told"),
    [
        ("floor_over_walls = 5.0", ["tank.floor_over_walls = 5 is of black walls: nothing"]),
        (
            "wall_albedo = 0.5\nend_over_walls = 4.0",
            ["tank.end_over_walls = 4 is more than all light: it counts as 2"],
        ),
        ("surface_slope_deg = 3.0", ["tank.surface_slope_deg = 3 is of a lid: nothing"]),
        ('wall_albedo = 0.5\nfloor_over_walls = 1.5\nsurface = "flat"\nsurface_slope_deg = 3.0', []),
    ],
)
def test_what_a_tank_says_in_vain_is_told(capsys, tmp_path, tank, told):
    path = tmp_path / "scene.toml"
    path.write_text(f"[tank]\n{tank}\n[detector]\nplanes_m = [4.5]\n")
    lines = run(capsys, path).splitlines()
    last = lines[lines.index("* departs from its neutral value") + 1 :]
    assert len(last) == len(told) and all(
        line.startswith(said) for line, said in zip(last, told, strict=True)
    )
