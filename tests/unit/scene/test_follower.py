"""Array and follower of a scene: what they say, what is refused, and that the light stays the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.errors import SceneError
from lightfield.scene import DetectorArray, Follower, Scene
from lightfield.scene.parameters import acts_of
from lightfield.studies.follower.elements import elements_of

TABLE = "x_m,y_m,z_m,nx,ny,nz\n0.1,0,0,0,0,-2\n-0.1,-0.2,0.05,-1,0,-1\n"


def test_absent_is_none_and_the_light_is_the_same() -> None:
    bare = Scene.from_dict({"name": "a"})
    full = Scene.from_dict({"array": {"count": [3, 3]}, "follower": {"z_m": 5.0}})
    assert bare.array is None and bare.follower is None
    assert full.digest() == bare.digest()  # traces, and stored results, are found again
    assert full.parameters()["follower.z_m"].value == 5.0
    assert Scene.from_toml(full.to_toml()) == full
    for model in (DetectorArray, Follower):
        assert not any(acts_of(model, name) for name in model.model_fields)


def test_every_number_has_a_unit_and_a_neutral_value_or_none() -> None:
    found = Scene.from_dict({"array": {}, "follower": {}}).parameters()
    mine = {path: p for path, p in found.items() if path.startswith(("array.", "follower."))}
    assert len(mine) >= 18 and all(p.unit for p in mine.values())
    assert mine["array.noise_percent"].neutral == 0.0 and mine["follower.yaw_deg"].neutral == 0.0


def test_a_table_of_elements(tmp_path: Path) -> None:
    (tmp_path / "elements.csv").write_text(TABLE)
    scene = Scene.from_dict({"array": {"layout": "table", "table": "elements.csv"}}, folder=tmp_path)
    assert scene.array is not None
    elements = elements_of(scene.array)
    np.testing.assert_allclose(elements.place_m[1], [-0.1, -0.2, 0.05])
    np.testing.assert_allclose(elements.normal, [[0, 0, -1], [-(0.5**0.5), 0, -(0.5**0.5)]])
    scene.save(tmp_path / "scene.toml")
    assert 'table = "elements.csv"' in (tmp_path / "scene.toml").read_text()


@pytest.mark.parametrize(
    ("array", "says"),
    [
        ({"layout": "table"}, "needs a table"),
        ({"layout": "hemisphere"}, "needs a radius"),
        ({"radius_m": 0.3}, "reaches less far"),
        ({"count": [51, 50]}, "found count = .51, 50.; rule: at most 2500"),
        ({"count": 5}, "a list of values"),
        ({"size_m": -1.0}, "array.size_m"),
        ({"pitch": 1}, "unknown key"),
    ],
)
def test_what_cannot_be_built_is_refused(array: dict[str, object], says: str) -> None:
    with pytest.raises(SceneError, match=says):
        Scene.from_dict({"array": array})


def test_a_grid_reaches_as_far_as_its_corners() -> None:
    """Of 4 by 2 elements over 0.35 m 0.184 m, of 4 by 4 0.247 m."""
    wide = {"count": [4, 2], "size_m": 0.35}
    elements = elements_of(Scene.from_dict({"array": {**wide, "radius_m": 0.19}}).array)
    across = np.hypot(*elements.place_m[:, :2].T)
    assert across.max() == pytest.approx(0.5 * 0.35 * np.hypot(1, 1 / 3))
    with pytest.raises(SceneError, match=r"0\.1845 m"):
        Scene.from_dict({"array": {**wide, "radius_m": 0.18}})


@pytest.mark.parametrize("text", ["x_m,y_m,z_m,nx,ny,nz\n", "x_m,y_m\n1,2\n", TABLE + "0,0,0,nan,0,1\n"])
def test_tables_that_are_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "elements.csv").write_text(text)
    with pytest.raises(SceneError, match=r"elements\.csv"):
        Scene.from_dict({"array": {"layout": "table", "table": "elements.csv"}}, folder=tmp_path)


def test_normals_of_no_length_are_refused(tmp_path: Path) -> None:
    (tmp_path / "elements.csv").write_text("x_m,y_m,z_m,nx,ny,nz\n0,0,0,0,0,0\n")
    with pytest.raises(SceneError, match="normal"):
        Scene.from_dict({"array": {"layout": "table", "table": "elements.csv"}}, folder=tmp_path)


def test_a_table_in_millimetres_is_refused(tmp_path: Path) -> None:
    """It had run out of memory, and said so."""
    (tmp_path / "elements.csv").write_text("x_m,y_m,z_m,nx,ny,nz\n120,0,0,0,0,-1\n-120,0,0,0,0,-1\n")
    with pytest.raises(SceneError, match=r"within 10 m .* not in millimetres"):
        Scene.from_dict({"array": {"layout": "table", "table": "elements.csv"}}, folder=tmp_path)


def test_an_array_that_looks_away_from_the_lamp_is_refused(tmp_path: Path) -> None:
    """Its readings were called far brighter than the array's could be anywhere."""
    array = {"array": {"layout": "table", "table": "elements.csv"}}
    (tmp_path / "elements.csv").write_text("x_m,y_m,z_m,nx,ny,nz\n0.1,0,0,0,0,1\n-0.1,0,0,1,0,0\n")
    with pytest.raises(SceneError, match=r"faces forward: nz < 0"):
        Scene.from_dict(array, folder=tmp_path)
    (tmp_path / "elements.csv").write_text("x_m,y_m,z_m,nx,ny,nz\n0.1,0,0,0,0,1\n-0.1,0,0,1,0,-0.1\n")
    assert Scene.from_dict(array, folder=tmp_path).array is not None


def test_a_follower_stays_in_the_tank_and_a_missing_one_is_named() -> None:
    with pytest.raises(SceneError, match="follower = "):
        Scene.from_dict({"tank": {}, "follower": {"x_m": 3.0}})
    with pytest.raises(SceneError, match=r"add a \[array\] table"):
        Scene.from_dict({}).with_values({"array.size_m": 0.3})
