"""A layout is a reading table whose values do not exist yet."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from lightfield.errors import MeasurementError
from lightfield.readings import Readings
from lightfield.readings.text import read_text


def load_layout(path: str | Path, scene: Any = None) -> Any:
    """Read a layout: a reading table that may lack the column "value". With a scene, also check against it.

    Raises
    ------
    MeasurementError
        All problems of the file, each with its line.
    """
    lines = read_text(str(path)).lines
    head = next(
        (i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None
    )
    names = [] if head is None else [name.strip().lower() for name in lines[head].split(",")]
    if head is None or "value" in names:
        return Readings.load(path, scene)
    filled = [
        line if i < head or not line.strip() else f"{line},{'value' if i == head else '1'}"
        for i, line in enumerate(lines)
    ]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / Path(path).name
        copy.write_text("\n".join(filled) + "\n", encoding="utf-8")
        try:
            return replace(Readings.load(copy, scene), source=str(path))
        except MeasurementError as error:
            raise MeasurementError(
                error.what, where=str(path), found=error.found, rule=error.rule, remedy=error.remedy,
                problems=error.problems,
            ) from None  # fmt: skip
