"""A scene survives TOML unchanged, is addressed by dotted paths, and its digest knows what the physics
depends on.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lightfield.errors import SceneError
from lightfield.scene import Detector, Lamp, Scene, Tank, Water
from lightfield.scene.parameters import Part, bounds
from lightfield.scene.water.coefficients import absorption_per_m

PAPER = """
name = "tow tank"
[lamp]
profile = "gaussian"
hwhm_deg = 3.81
[water]
absorption_per_m = 0.10
phase = { type = "henyey-greenstein", g = 0.924 }
[tank]
width_m = 3.66
surface = "none"
[detector]
quantity = "irradiance"
planes_m = [4.5, 5.5, 6.5, 7.5, 8.5]
bands_nm = [[500, 550]]
"""


def numbers(model: type) -> st.SearchStrategy[dict[str, float]]:
    """Any values inside the declared ranges of a part's numbers."""
    choices = {}
    for name, field in model.model_fields.items():
        if field.annotation is not float or not isinstance(field.json_schema_extra, dict):
            continue
        low, high = bounds(model, name)
        strict = any(hasattr(rule, "gt") or hasattr(rule, "lt") for rule in field.metadata)
        choices[name] = st.floats(max(low, -1e6), min(high, 1e6), exclude_min=strict, exclude_max=strict)
    return st.fixed_dictionaries({}, optional=choices)


@given(numbers(Lamp), numbers(Water), numbers(Detector), st.text(max_size=20))
def test_toml_round_trip(lamp: dict, water: dict, detector: dict, name: str) -> None:
    """Every float survives exactly, and so does any text that UTF-8 can hold."""
    name = name.encode("utf-8", "replace").decode()
    if "absorption_per_m" in water:
        water["absorption_per_m"] = abs(water["absorption_per_m"])  # there is no base to be clearer than
    scene = Scene(name=name, lamp=Lamp(**lamp), water=Water(**water), detector=Detector(**detector))
    again = Scene.from_toml(scene.to_toml())
    assert again == scene
    assert again.digest() == scene.digest()


def test_hidden_effect_scenes_load(reference: Path) -> None:
    """The independent cases are written for the scene format of the design: they load unchanged."""
    files = sorted((reference / "hidden_effects").glob("*/scene.toml"))
    assert files
    for file in files:
        scene = Scene.load(file)
        assert Scene.from_toml(scene.to_toml()) == scene


def test_bare_scene_is_the_neutral_one() -> None:
    """Every effect is off unless it is named: each number with a neutral value starts there."""
    scene = Scene(tank=Tank())
    off = {p.path: p for p in scene.parameters().values() if p.neutral is not None}
    assert {p.path for p in off.values() if p.value != p.neutral} == set()
    assert {
        "lamp.apparent_distance_m", "lamp.tilt_x_deg", "lamp.skirt_fraction", "lamp.ellipticity",
        "water.gradient_per_m2", "water.scattering_per_m", "tank.wall_albedo", "detector.background",
        "detector.acceptance_hwhm_deg",
    } <= set(off)  # fmt: skip


def test_every_number_has_unit_meaning_and_range() -> None:
    """Plots and reports print unit and meaning; fits need the range to contain the default."""
    for parameter in Scene(tank=Tank()).parameters().values():
        assert parameter.unit and parameter.meaning, parameter.path
        assert parameter.low <= parameter.value <= parameter.high, parameter.path


def test_json_schema_has_units() -> None:
    """Other programs validate scene files with it: unit and neutral value of each number are there."""
    schema = Scene.json_schema()
    json.dumps(schema)
    albedo = schema["$defs"]["Tank"]["properties"]["wall_albedo"]
    assert (albedo["unit"], albedo["neutral"], albedo["maximum"]) == ("1", 0.0, 1.0)
    assert schema["additionalProperties"] is False


def test_dotted_paths() -> None:
    scene = Scene.from_toml(PAPER)
    assert scene.get("water.phase.g") == 0.924
    assert scene.get("tank.width_m") == 3.66
    for validate in (True, False):
        changed = scene.with_values(
            {"water.phase.g": 0.9, "lamp.hwhm_deg": np.float64(4.0), "tank.wall_albedo": 0.2},
            validate=validate,
        )
        assert (changed.water.phase.g, changed.lamp.hwhm_deg, changed.tank.wall_albedo) == (0.9, 4.0, 0.2)
        assert changed.water.absorption_per_m == 0.10
    assert scene.get("water.phase.g") == 0.924, "the scene itself never changes"


@pytest.mark.parametrize("validate", [True, False])
def test_surface_reflectance_makes_the_surface_flat(validate: bool) -> None:
    """A fit frees the reflectance alone; the geometry has to follow."""
    scene = Scene.from_toml(PAPER)
    lit = scene.with_values({"tank.surface_reflectance": 0.5}, validate=validate)
    assert (lit.tank.surface, lit.tank.surface_reflectance) == ("flat", 0.5)
    full = scene.with_values({"tank.surface": "flat"}, validate=validate)
    assert full.tank.surface_reflectance == 1.0
    assert full.with_values({"tank.surface": "none"}, validate=validate).tank.surface_reflectance == 0.0
    assert Scene(tank=Tank(surface_reflectance=0.3)).tank.surface == "flat"


@pytest.mark.parametrize("validate", [True, False])
@pytest.mark.parametrize(
    "path", ["lamp.hwhm", "water.phase.n", "nothing", "tank.wall_albedo", "lamp.hwhm_deg.x"]
)
def test_wrong_paths(path: str, validate: bool) -> None:
    """A misspelt parameter is never ignored, not even in the inner loop of a fit."""
    with pytest.raises(SceneError, match=path.split(".")[0]):
        Scene().with_values({path: 1.0}, validate=validate)
    with pytest.raises(SceneError, match="remedy"):
        Scene().get(path)


def test_digest_follows_physics_and_tables(tmp_path: Path) -> None:
    """Results are cached by digest: names and places do not matter, numbers and table contents do."""
    table = tmp_path / "lamp.csv"
    table.write_text("angle_deg,intensity\n0,1\n5,0.5\n10,0\n")
    text = '[lamp]\nprofile = "table"\nintensity_table = "lamp.csv"\n'
    scene = Scene.from_toml(text, folder=tmp_path)
    assert scene.lamp.intensity_table == str(table)
    digest = scene.digest()
    assert Scene.from_toml('name = "x"\n' + text, folder=tmp_path).digest() == digest
    assert scene.with_values({"water.absorption_per_m": 0.1}).digest() != digest
    elsewhere = tmp_path / "other"
    elsewhere.mkdir()
    (elsewhere / "lamp.csv").write_text(table.read_text())
    assert Scene.from_toml(text, folder=elsewhere).digest() == digest
    table.write_text("angle_deg,intensity\n0,1\n5,0.6\n10,0\n")
    assert scene.digest() != digest
    assert Scene(water=Water(gradient_per_m2=-0.0)).digest() == Scene().digest()


#: A scene with each table there is, of which the light knows, and two contents of it.
_ROWS = "angle_deg,intensity\n0,1\n90,{}\n", "wavelength_nm,power\n400,1\n700,{}\n"
WITH_TABLE = {
    "Lamp.intensity_table": ('[lamp]\nprofile = "table"\nintensity_table = "t.csv"', _ROWS[0]),
    "Lamp.spectrum_table": ('[lamp]\nspectrum = "table"\nspectrum_table = "t.csv"', _ROWS[1]),
    "Water.table": (
        '[water]\nbase = "table"\ntable = "t.csv"',
        "wavelength_nm,absorption_per_m,scattering_per_m\n400,1,1\n700,{},1\n",
    ),
    "MeasuredPhase.file": (
        '[water]\nphase = { type = "table", file = "t.csv" }',
        "angle_deg,phase_per_sr\n0,9\n180,{}\n",
    ),
    "Detector.response_table": (
        '[detector]\nresponse = "table"\nresponse_table = "t.csv"',
        _ROWS[1].replace("power", "response"),
    ),
}
#: Tables of where a follower is and what it carries: the light is the same.
LIGHTLESS_TABLES = {"DetectorArray.table", "Mission.leader_table"}


@pytest.mark.parametrize("field", WITH_TABLE)
def test_digest_knows_what_is_in_every_table(field: str, tmp_path: Path) -> None:
    text, rows = WITH_TABLE[field]
    digests = []
    for number in ("0.5", "0.7"):
        (tmp_path / "t.csv").write_text(rows.format(number))
        digests.append(Scene.from_toml(text, folder=tmp_path).digest())
    assert digests[0] != digests[1]


def test_every_table_is_asked_whether_the_digest_knows_it() -> None:
    """Fields of a table's path are told by their type, here as it is written."""
    found = {
        f"{part.__name__}.{name}"
        for part in [Scene, *Part.__subclasses__()]
        for name in part.model_fields
        if part.__module__.startswith("lightfield") and "TablePath" in part.__annotations__.get(name, "")
    }
    assert found == {*WITH_TABLE, *LIGHTLESS_TABLES}


def test_saved_scene_finds_its_tables(tmp_path: Path) -> None:
    """A scene saved beside its table still works after the folder is moved."""
    first = tmp_path / "first"
    first.mkdir()
    (first / "lamp.csv").write_text("angle_deg,intensity\n0,1\n5,0.5\n10,0\n")
    scene = Scene.from_toml('[lamp]\nprofile = "table"\nintensity_table = "lamp.csv"\n', folder=first)
    scene.save(first / "scene.toml")
    assert 'intensity_table = "lamp.csv"' in (first / "scene.toml").read_text()
    first.rename(tmp_path / "second")
    assert (
        Scene.load(tmp_path / "second" / "scene.toml").digest()
        == scene.with_values({"lamp.intensity_table": str(tmp_path / "second" / "lamp.csv")}).digest()
    )


@pytest.mark.parametrize(
    ("table", "name"), [("lamp", "hwhm_deg"), ("water", "absorption_per_m"), ("detector", "width_m")]
)
def test_scene_is_immutable(table: str, name: str) -> None:
    with pytest.raises(ValueError, match="frozen"):
        setattr(getattr(Scene(), table), name, 5.0)


def test_water_may_be_clearer_than_its_base_but_not_than_nothing() -> None:
    """Pure water absorbs 0.34 per m at 650 nm and 0.006 at 440 (Pope and Fry 1997): one grey number below
    zero is possible where only red is measured."""
    text = '[water]\nbase = "pure"\nabsorption_per_m = -0.1\n[detector]\nbands_nm = [[640, 660]]'
    red = Scene.from_toml(text)
    assert absorption_per_m(red.water, [650.0])[0] == pytest.approx(0.24, abs=0.01)
    assert red.parameters()["water.absorption_per_m"].low < 0
    with pytest.raises(SceneError, match="440 nm"):
        red.with_values({"detector.bands_nm": ((440.0, 460.0), (640.0, 660.0))})
    with pytest.raises(SceneError, match=r"found -0\.1"):
        red.with_values({"water.base": "none"})
    assert Scene().parameters()["water.absorption_per_m"].low == 0.0


@pytest.mark.parametrize("validate", [True, False])
def test_absorption_at_single_wavelengths(validate: bool) -> None:
    """Each point is a parameter with a path of its own; linear between the points, constant beyond."""
    scene = Scene.from_toml("[water]\nabsorption_at = [[450.0, 0.1], [550.5, 0.2]]")
    assert (scene.get("water.absorption_at.450nm"), scene.get("water.absorption_at.550.5nm")) == (0.1, 0.2)
    changed = scene.with_values({"water.absorption_at.550.5nm": 0.3}, validate=validate)
    assert changed.water.absorption_at == ((450.0, 0.1), (550.5, 0.3))
    assert absorption_per_m(changed.water, [400.0, 500.25, 600.0]) == pytest.approx([0.1, 0.2, 0.3])
    assert Scene.from_toml(changed.to_toml()) == changed
    assert changed.parameters()["water.absorption_at.450nm"].unit == "1/m"
    assert changed.digest() != scene.digest()
    with pytest.raises(SceneError, match=r"absorption_at\.500nm"):
        scene.with_values({"water.absorption_at.500nm": 0.3}, validate=validate)
