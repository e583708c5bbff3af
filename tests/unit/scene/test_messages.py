"""Every wrong scene gives one clear line: key, value, rule, remedy; several problems are told at once."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from lightfield.errors import Complaint, RuleError, SceneError
from lightfield.scene import Scene
from lightfield.scene.lamp.lamp import Lamp

# What is wrong, the scene text, and words that the message has to contain.
WRONG = {
    "unknown key": ("[lamp]\nhwhm_degrees = 3", ["lamp.hwhm_degrees", "unknown key", "found 3", "hwhm_deg"]),
    "the last word alone": (
        '[lamp]\ntable = "lamp.csv"',
        ["lamp.table", "did you mean lamp.intensity_table or lamp.spectrum_table"],
    ),
    "missing unit": ("[lamp]\nhwhm = 3", ["lamp.hwhm", "did you mean lamp.hwhm_deg?"]),
    "albedo of the floor": (
        "[tank]\nfloor_albedo = 0.5",
        ["tank.floor_albedo", "did you mean tank.floor_over_walls"],
    ),
    "albedo of the far end": (
        "[tank]\nfar_end_albedo = 0.02",
        ["tank.far_end_albedo", "did you mean tank.end_over_walls"],
    ),
    "one of several": ('[tank]\npane = "all"', ["tank.pane", "did you mean tank.panes?"]),
    "glass": ("[tank]\nglass_walls = true", ["tank.glass_walls", "did you mean tank.panes (panes of glass"]),
    "turbidity": ("[water]\nturbidity_ntu = 2", ["did you mean water.scattering_per_m"]),
    "nothing like it": ("[water]\nhue = 2", ["valid here are water."]),
    "unknown section": ("[lamps]\nx = 1", ["lamps", "unknown key", "lamp"]),
    "negative absorption": (
        "[water]\nabsorption_per_m = -1",
        ["water.absorption_per_m", "found -1", ">= 0", "1/m"],
    ),
    "more light than without water": (
        '[water]\nbase = "pure"\nabsorption_per_m = -0.1\n[detector]\nbands_nm = [[440, 460], [640, 660]]',
        ["water.absorption_per_m = -0.1", "440 nm", ">= 0", "write at least -0.00"],
    ),
    "falling wavelengths": (
        "[water]\nabsorption_at = [[550.0, 0.1], [450.0, 0.1]]",
        ["water", "absorption_at", "must rise"],
    ),
    "text for a number": ('[lamp]\npower_w = "50 W"', ["lamp.power_w", "'50 W'", "without quotes"]),
    "true for a number": ("[lamp]\npower_w = true", ["lamp.power_w", "found True", "a number"]),
    "nan": ("[lamp]\nhwhm_deg = nan", ["lamp.hwhm_deg", "found nan"]),
    "inf": ("[water]\nscattering_per_m = inf", ["water.scattering_per_m", "found inf"]),
    "zero width": ("[lamp]\nhwhm_deg = 0", ["lamp.hwhm_deg", ">= 0.05"]),
    "unknown profile": ('[lamp]\nprofile = "gausian"', ["lamp.profile", "'gausian'", "'gaussian'"]),
    "super-gaussian alone": (
        '[lamp]\nprofile = "super-gaussian"',
        ["shape_exponent", "remedy: add shape_exponent"],
    ),
    "two-component alone": ('[lamp]\nprofile = "two-component"', ["skirt_fraction"]),
    "table without file": ('[lamp]\nprofile = "table"', ["intensity_table"]),
    "file not there": (
        '[lamp]\nprofile = "table"\nintensity_table = "no.csv"',
        ["lamp.intensity_table", "a file that exists"],
    ),
    "spectrum without table": ('[lamp]\nspectrum = "table"', ["spectrum_table"]),
    "unknown phase": ('[water]\nphase = { type = "hg" }', ["water.phase", "'henyey-greenstein'"]),
    "g of one": (
        '[water]\nphase = { type = "henyey-greenstein", g = 1.0 }',
        ["water.phase.g", "< 1", "found 1"],
    ),
    "key of another phase": (
        '[water]\nphase = { type = "petzold", g = 0.9 }',
        ["water.phase.g", "unknown key"],
    ),
    "unknown base": ('[water]\nbase = "jerlov-4"', ["jerlov-4", "did you mean"]),
    "base table alone": ('[water]\nbase = "table"', ["table", "remedy: add table"]),
    "section as number": ("water = 3", ["water", "found 3", "[water]"]),
    "albedo above one": ("[tank]\nwall_albedo = 1.2", ["tank.wall_albedo", "<= 1"]),
    "lamp under the floor": ("[tank]\nlamp_depth_m = 5", ["tank", "lamp_depth_m", "depth_m = 2.44"]),
    "lamp behind the tank": ("[tank]\nlength_m = 2\nbehind_lamp_m = 3", ["behind_lamp_m"]),
    "surface contradicts": (
        '[tank]\nsurface = "none"\nsurface_reflectance = 0.5',
        ["surface", 'write surface = "flat"'],
    ),
    "plane outside": ("[tank]\nlength_m = 6\n[detector]\nplanes_m = [4.5, 8.5]", ["8.5", "outside the tank"]),
    "falling planes": ("[detector]\nplanes_m = [5.5, 4.5]", ["planes_m", "rise"]),
    "plane at zero": ("[detector]\nplanes_m = [0.0, 4.5]", ["detector.planes_m.0", "greater than 0"]),
    "no planes": ("[detector]\nplanes_m = []", ["planes_m or positions_m"]),
    "one number as planes": ("[detector]\nplanes_m = 4.5", ["detector.planes_m", "found 4.5"]),
    "band of one": ("[detector]\nbands_nm = [[500]]", ["detector.bands_nm", "missing"]),
    "falling band": ("[detector]\nbands_nm = [[550, 500]]", ["band must rise"]),
    "band in metres": (
        "[detector]\nbands_nm = [[5e-7, 550]]",
        ["detector.bands_nm", "greater than or equal to 200"],
    ),
    "no band": ("[detector]\nbands_nm = []", ["a wavelength band", "remedy: give bands_nm"]),
    "two numbers for a place": ("[detector]\npositions_m = [[0, 4.5]]", ["detector.positions_m"]),
    "half a pixel": ("[detector]\npixels = 64.5", ["detector.pixels", "whole number"]),
    "unknown quantity": ('[detector]\nquantity = "flux"', ["detector.quantity", "'irradiance'"]),
    "acceptance of a collimator": (
        '[detector]\nquantity = "radiance"\nacceptance_hwhm_deg = 5',
        ["acceptance_hwhm_deg"],
    ),
    "not TOML": ("[lamp\nx = 1", ["not TOML", "line 1"]),
    "key twice": ("[lamp]\nhwhm_deg = 1\nhwhm_deg = 2", ["not TOML"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_one_clear_line(case: str, tmp_path: Path) -> None:
    """Names the file, and what has to be changed; one line for one mistake."""
    text, words = WRONG[case]
    file = tmp_path / "scene.toml"
    file.write_text(text)
    with pytest.raises(SceneError) as caught:
        Scene.load(file)
    message = str(caught.value)
    assert len(message.splitlines()) == 1, message
    assert str(file) in message and "remedy" in message
    for word in words:
        assert word in message


def test_all_problems_at_once() -> None:
    """A file is corrected in one go: each problem has its line."""
    with pytest.raises(SceneError) as caught:
        Scene.from_toml(
            '[lamp]\nhwhm = 3\nprofile = "gausian"\n[water]\nabsorption_per_m = -1\n'
            'phase = { type = "henyey-greenstein", g = 2, k = 1 }\n[tank]\nlamp_depth_m = 5\n[foo]\nx = 1\n'
        )
    assert len(caught.value.problems) == 7
    complaints = [one for one in caught.value.problems if isinstance(one, Complaint)]
    assert {one.key for one in complaints} == {
        "lamp.hwhm",
        "lamp.profile",
        "water.absorption_per_m",
        "water.phase.g",
        "water.phase.k",
        "tank",
        "foo",
    }
    assert len(complaints) == 7 and all(one.rule and one.remedy for one in complaints)
    (wrong,) = (one for one in complaints if one.key == "water.phase.g")
    assert wrong.found == 2 and (wrong.rule or "").startswith("a number > -1 and < 1 (1)")
    assert f"  {wrong.key}: wrong value; found 2; rule: {wrong.rule}; remedy: {wrong.remedy}" in str(
        caught.value
    )


def test_what_is_wrong_with_one_value_alone_is_told_as_fields() -> None:
    """A program need not read the sentence."""
    with pytest.raises(SceneError) as caught:
        Scene.from_dict({"lamp": {"hwhm_deg": -3}})
    error = caught.value
    assert (error.where, error.what, error.found) == ("scene", "lamp.hwhm_deg: wrong value", -3)
    assert error.rule == "a number >= 0.05 and <= 90 (deg): half width of the beam at half maximum"
    assert error.remedy == "write hwhm_deg = a value in that range" and error.problems == ()
    assert str(error) == (f"scene: {error.what}; found -3; rule: {error.rule}; remedy: {error.remedy}")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("angle,intensity\n0,1\n5,0.5\n", ["column angle_deg missing"]),
        ("angle_deg,intensity\n0,1\n5,x\n4,0.1\n", ["line 3: not numbers; found '5,x'"]),
        ("angle_deg,intensity\n0,1\n5,0.5\n5,0.1\n", ["line 4: angle_deg must rise above 5; found '5,0.1'"]),
        ("angle_deg,intensity\n0,1\n5,-0.5\n", ["line 3: negative"]),
        ("angle_deg,intensity\n0,1\n5,1e200\n", ["line 3: too large"]),
        ("angle_deg,intensity\n1,1\n5,0.5\n", ["starts on the axis", "1 to 5 deg"]),
        ("angle_deg,intensity\n0,0\n5,0.5\n", ["no light on the beam axis"]),
        ("angle_deg,intensity\n0,1e-310\n5,0.5\n", ["no light on the beam axis"]),
        ("angle_deg,intensity\n0,1\n", ["fewer than two rows"]),
        ("", ["column angle_deg, intensity missing"]),
    ],
)  # fmt: skip
def test_bad_tables_are_found_when_the_scene_is_read(content: str, words: list[str], tmp_path: Path) -> None:
    """Not in the middle of a render: the table is read and checked with the scene, bad lines by number."""
    (tmp_path / "lamp.csv").write_text(content)
    (tmp_path / "scene.toml").write_text('[lamp]\nprofile = "table"\nintensity_table = "lamp.csv"\n')
    with pytest.raises(SceneError) as caught:
        Scene.load(tmp_path / "scene.toml")
    assert len(str(caught.value).splitlines()) == 1
    assert all(word in str(caught.value) for word in [*words, "lamp.csv"])


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"no\.toml: cannot read"):
        Scene.load(tmp_path / "no.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match="not a text file"):
        Scene.load(tmp_path / "binary.toml")
    with pytest.raises(SceneError, match="cannot read"):
        Scene.load(tmp_path)


def test_a_rule_and_its_remedy_are_two_fields(tmp_path: Path) -> None:
    """Validators tell them apart, whatever words they use; also those of a table that a scene names."""
    assert str(RuleError("a; remedy: b", "c")) == "a; remedy: b; remedy: c" and str(RuleError("a")) == "a"
    found = [Complaint("bad", 3, lines=(1,)), Complaint("bad", 4, remedy="drop it", lines=(2,))]
    one, other = RuleError.of(
        SceneError("2 bad", where="t.csv", rule="numbers", remedy="mend it", problems=found)
    ).about
    assert str(one) == "t.csv: line 1: bad; found 3; rule: numbers; remedy: mend it"
    assert str(other) == "t.csv: line 2: bad; found 4; rule: numbers; remedy: drop it"
    with pytest.raises(ValidationError) as caught:
        Lamp(profile="two-component")
    assert caught.value.errors()[0]["ctx"]["error"].remedy == "add skirt_fraction"
    table = tmp_path / "; remedy: x"  # a name of a file is no part of the sentence
    with pytest.raises(SceneError) as missing:
        Scene.from_toml(f'[lamp]\nprofile = "table"\nintensity_table = "{table}"')
    assert f"found {str(table)!r}; rule: a file that exists; remedy: give a path" in str(missing.value)


def test_a_scene_by_hand_says_what_is_wrong_as_a_file_does() -> None:
    for parts, said in (
        ({"tank": {"width_m": -1}}, "tank.width_m: wrong value; found -1; rule: a number > 0"),
        ({"lamp": {"hwhm_dge": 3}}, "lamp.hwhm_dge: unknown key; found 3"),
    ):
        with pytest.raises(SceneError) as by_hand:
            Scene(**parts)
        with pytest.raises(SceneError) as read:
            Scene.from_dict(parts)
        assert str(by_hand.value) == str(read.value) and said in str(read.value)


def test_the_complaint_of_a_table_is_told_once_with_its_own_rule(tmp_path: Path) -> None:
    (tmp_path / "lamp.csv").write_text("angle_deg,intensity\n0,1\n10,x\n")
    scene = tmp_path / "scene.toml"
    scene.write_text('[lamp]\nprofile = "table"\nintensity_table = "lamp.csv"\n')
    with pytest.raises(SceneError) as caught:
        Scene.load(scene)
    told = str(caught.value)
    assert told.count("rule: ") == told.count("remedy: ") == 1 and "not possible" not in told
    assert "lamp.csv: line 3: not numbers; found '10,x'" in told


def test_a_water_is_known_in_small_letters_too() -> None:
    assert Scene.from_toml('[water]\nbase = "JERLOV-ia"').water.base == "jerlov-IA"


def test_a_value_that_does_not_fit_the_rest_is_named() -> None:
    """Not as "values: scene: not possible"."""
    with pytest.raises(
        SceneError,
        match=r"^tank\.length_m = 3\.0: the scene as a whole is not possible; found detector.planes_m = ",
    ):
        Scene.from_toml("[tank]\nlength_m = 12").with_values({"tank.length_m": 3.0})
