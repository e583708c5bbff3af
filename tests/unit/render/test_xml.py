"""What a Mitsuba scene leaves out of ours is said: to who writes it, and in the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from lightfield import cli
from lightfield.render.xml import left_out
from lightfield.scene import Scene

PLAIN = {"detector": {"planes_m": [2.0], "pixels": 5}}
PLACES = {"detector": {"positions_m": [[0.0, 0.0, 2.0], [0.1, 0.0, 3.0]]}}


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        (PLACES, "the planes of the positions that the detector lists, not the positions"),
        ({**PLAIN, "array": {"count": [3, 3]}}, "without the follower and its array"),
        ({**PLAIN, "follower": {"z_m": 2.0}}, "without the follower and its array"),
        ({"detector": {"planes_m": [2.0], "bands_nm": [[500, 520], [520, 550]]}}, "and no other band"),
        (PLAIN, ""),
    ],
)
def test_what_an_xml_leaves_out_is_said(
    tables: dict[str, object], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a line on the terminal, and as a comment in front of a scene that Mitsuba reads as before."""
    file, xml = tmp_path / "scene.toml", tmp_path / "scene.xml"
    scene = Scene.from_dict(tables)
    file.write_text(scene.to_toml())
    assert cli.main(["scene", str(file), "--to-xml", str(xml)]) == 0
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    import mitsuba as mi

    assert mi.load_file(str(xml)) is not None
    first = xml.read_text().splitlines()[0]
    assert notes == [f"note: {line}" for line in left_out(scene)]
    if not says:
        assert notes == [] and first.startswith("<scene")
        return
    (note,) = notes
    assert says in note and first == f"<!-- {note.removeprefix('note: ')} -->"
