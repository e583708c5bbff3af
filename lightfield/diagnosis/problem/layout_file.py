"""A layout is a reading table whose values do not exist yet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from lightfield.readings import read_table
from lightfield.readings.text import read_text
from lightfield.storage.inputs import READINGS


def load_layout(path: str | Path, scene: Any = None) -> Any:
    """Read a layout: a reading table that may lack the column "value". With a scene, also check against it.

    Raises
    ------
    MeasurementError
        All problems of the file, each with its line.
    """
    content = read_text(path, READINGS)
    lines = content.lines
    head = next(
        (i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None
    )
    names = [] if head is None else [name.strip().lower() for name in lines[head].split(",")]
    if head is None or "value" in names:
        return read_table(path, scene, content)
    filled = tuple(
        line if i < head or not line.strip() else f"{line},{'value' if i == head else '1'}"
        for i, line in enumerate(lines)
    )
    return read_table(path, scene, replace(content, lines=filled))
