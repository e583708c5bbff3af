"""Files that nobody could read to their end, and files that are too large for what they are said to be."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import pytest

from lightfield.errors import MeasurementError, OutputError, SceneError, UsageError
from lightfield.maps.dataset import read_netcdf
from lightfield.readings import read_table
from lightfield.scene import Scene
from lightfield.storage import inputs
from lightfield.storage.tables import read_columns
from lightfield.sweep.axes import read_plan

READERS = {
    "scene": (Scene.load, SceneError),
    "readings": (read_table, MeasurementError),
    "plan": (read_plan, UsageError),
    "maps": (read_netcdf, OutputError),
    "table": (lambda path: read_columns(str(path), ("a", "b")), SceneError),
}


@pytest.mark.parametrize("kind", READERS)
def test_a_device_is_not_read(kind: str) -> None:
    """/dev/zero has no end."""
    read, error = READERS[kind]
    with pytest.raises(error, match=r"/dev/zero: cannot read .*a device or a pipe.*regular file"):
        read(Path("/dev/zero"))


@pytest.mark.parametrize("kind", READERS)
def test_a_pipe_without_a_writer_is_not_waited_for(kind: str, tmp_path: Path) -> None:
    read, error = READERS[kind]
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(error, match="a device or a pipe"):
        read(tmp_path / "pipe")


@pytest.mark.parametrize("kind", [inputs.SCENE, inputs.SPECTRUM, inputs.READINGS], ids=lambda k: k.name)
def test_a_file_may_be_as_large_as_its_kind_and_no_larger(kind: inputs.FileKind, tmp_path: Path) -> None:
    file = tmp_path / "file"
    with file.open("wb") as content:
        content.truncate(kind.most_bytes)  # a hole: takes no room on the disk
    assert len(inputs.read_bytes(file, kind)) == kind.most_bytes
    os.truncate(file, kind.most_bytes + 1)
    with pytest.raises(
        kind.error, match=f"too large for a {kind.name}.*at most {kind.most_bytes // 10**6} MB"
    ):
        inputs.read_bytes(file, kind)


@pytest.mark.parametrize("name", ["-", "/dev/stdin"])
def test_standard_input_is_read_up_to_the_limit(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text = b"[water]\nabsorption_per_m = 0.1\n"
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text)))
    assert Scene.load(name).water.absorption_per_m == 0.1
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text + b" " * inputs.SCENE.most_bytes)))
    with pytest.raises(SceneError, match="too large"):
        Scene.load(name)


def test_what_is_not_there_or_a_folder_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="No such file"):
        inputs.read_bytes(tmp_path / "none", inputs.SCENE)
    with pytest.raises(SceneError, match="Is a directory"):
        inputs.read_bytes(tmp_path, inputs.SCENE)
    with pytest.raises(SceneError, match="null byte"):
        inputs.read_bytes("a\0b", inputs.SCENE)
