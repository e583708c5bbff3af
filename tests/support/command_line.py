"""The command, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def lightfield(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run it to its end, at the root of the repository."""
    return subprocess.run(
        [sys.executable, "-m", "lightfield.cli", *map(str, arguments)],
        capture_output=True, text=True, timeout=120, check=False, cwd=ROOT, env={**os.environ, **environment},
    )  # fmt: skip
