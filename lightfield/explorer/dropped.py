"""Readings from files that were dropped into the page: their names and texts, never their paths."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from lightfield.errors import MeasurementError
from lightfield.explorer.protocol import File
from lightfield.readings import Readings, read_table
from lightfield.scene import Scene


def dropped(files: Sequence[File], scene: Scene) -> Readings:
    """The readings of a dropped reading table.

    Raises
    ------
    MeasurementError
        Not one table, or not one that belongs to the scene.
    """
    if len(files) != 1:
        raise MeasurementError(
            "one reading table at a time",
            found=", ".join(file.name for file in files),
            remedy="make one of instrument files first: `lightfield import`",
        )
    return readings_of(files[0].text, files[0].name, scene)


def readings_of(text: str, name: str, scene: Scene) -> Readings:
    """A reading table from its text; errors call it by its name.

    Raises
    ------
    MeasurementError
        All problems of the table, each with its line.
    """
    with tempfile.TemporaryDirectory(prefix="lightfield-") as folder:
        path = Path(folder) / name
        path.write_text(text, encoding="utf-8", newline="")
        return read_table(path, scene)
