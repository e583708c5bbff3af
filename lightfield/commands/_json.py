"""Results for programs."""

from __future__ import annotations

import json
from pathlib import Path

from lightfield.arrays import jsonable
from lightfield.storage.files import atomic_path


def write_json(data: object, path: Path) -> None:
    """Indented, whole or not at all; what is no finite number is null."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(jsonable(data), indent=2, allow_nan=False) + "\n", encoding="utf-8")
