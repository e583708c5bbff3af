"""Rows on disk, one JSON line each: what is there is not done again."""

from __future__ import annotations

import hashlib
import json
import subprocess
from functools import lru_cache
from pathlib import Path
from typing import Any

import lightfield

Row = dict[str, Any]


@lru_cache(maxsize=1)
def code_version() -> str:
    """Commit, and a digest of the package's code as it is on disk."""
    package = Path(lightfield.__file__).parent
    told = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        told.update(path.read_bytes())
    return f"{_commit(package)}-{told.hexdigest()[:8]}"


def _commit(folder: Path) -> str:
    try:
        asked = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], cwd=folder, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return asked.stdout.strip()


def read(path: Path) -> list[Row]:
    """All rows of a file; a line cut short by an interruption is dropped."""
    rows = []
    if path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                rows.append(json.loads(line))
            except json.JSONDecodeError:
                continue
    return rows


def append(path: Path, row: Row) -> None:
    """Add one row."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as stream:
        stream.write(json.dumps(row, default=float) + "\n")
