"""Results for programs."""

from __future__ import annotations

import json
from pathlib import Path

from lightfield.storage.files import atomic_path


def write_json(data: object, path: Path) -> None:
    """Indented, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
