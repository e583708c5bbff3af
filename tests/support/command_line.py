"""The command, in a process of its own or in this one."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys

from repository import ROOT

from lightfield.cli import main


def lightfield(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run it to its end, at the root of the repository."""
    return subprocess.run(
        [sys.executable, "-m", "lightfield.cli", *map(str, arguments)],
        capture_output=True, text=True, timeout=120, check=False, cwd=ROOT, env={**os.environ, **environment},
    )  # fmt: skip


def in_process(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run it to its end here, where another process is not what is asked about."""
    words, output, errors = [*map(str, arguments)], io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        code = main(words)
    return subprocess.CompletedProcess(words, code, output.getvalue(), errors.getvalue())
