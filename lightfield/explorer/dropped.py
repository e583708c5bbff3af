"""Readings from files that were dropped into the page: their names and bytes, never their paths."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from lightfield.errors import MeasurementError
from lightfield.explorer.protocol import File
from lightfield.readings import Readings
from lightfield.readings.importing.importer import import_index
from lightfield.readings.importing.index import read_index
from lightfield.readings.problems import Problems
from lightfield.readings.table.read import table_of_text
from lightfield.readings.text import decode
from lightfield.scene import Scene


def dropped(files: Sequence[File], units: str, scene: Scene) -> Readings:
    """The readings of a dropped reading table, or of an index and the spectrometer files that it names.

    Parameters
    ----------
    units : str
        Of the numbers in spectrometer files, see `lightfield.readings.units`; empty: not said.

    Raises
    ------
    MeasurementError
        Not one table or one index with its files, or readings that do not belong to the scene.
    """
    if len(files) == 1:
        return table_dropped(files[0].content, files[0].name, scene)
    tables = [file for file in files if file.name.lower().endswith(".csv")]
    if len(tables) != 1:
        raise MeasurementError(
            "not one table of readings, and not one index",
            found=", ".join(file.name for file in files),
            rule="one reading table (CSV), or one index (CSV) with the spectrometer files that it names",
            remedy="drop them together",
        )
    with tempfile.TemporaryDirectory(prefix="lightfield-") as folder:
        for file in files:
            (Path(folder) / file.name).write_bytes(file.content)
        index = Path(folder) / tables[0].name
        _check_names(index, {file.name for file in files})
        quantity, bands = scene.detector.quantity, scene.detector.bands_nm
        readings = import_index(index, quantity=quantity, units=units or None, bands_nm=bands)
    return readings.check_against(scene)


def _check_names(index: Path, known: set[str]) -> None:
    """An index from a browser reads what came with it, and nothing else of this machine."""
    problems = Problems(index.name)
    others = [entry.file for entry in read_index(index, problems)[0] if entry.file not in known]
    problems.raise_any("not a usable index")
    if others:
        raise MeasurementError(
            "the index names files that were not dropped",
            where=index.name,
            found=", ".join(others[:5]),
            rule="names of files, without folders, that were dropped with it",
            remedy="drop them together",
        )


def table_dropped(content: bytes, name: str, scene: Scene) -> Readings:
    """A reading table from its bytes; errors call it by its name.

    Raises
    ------
    MeasurementError
        All problems of the table, each with its line.
    """
    return table_of_text(decode(content, name), name, scene)
