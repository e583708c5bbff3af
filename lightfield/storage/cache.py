"""The folder for what can be computed again: transport responses and compiled kernels."""

from __future__ import annotations

import atexit
import functools
import os
import shutil
import sys
import tempfile
from pathlib import Path

from lightfield.errors import OutputError

_VARIABLE = "LIGHTFIELD_CACHE"
#: What the compiled kernels of a command take at most, about (a hundred of 40 kB, as renders leave them).
LEAST_ROOM_BYTES = 4_000_000


def cache_dir() -> Path:
    """Folder of the cache, made when missing.

    LIGHTFIELD_CACHE, else the platform's place (`~/.cache/lightfield`, XDG_CACHE_HOME honoured, on macOS
    `~/Library/Caches/lightfield`). Where that cannot be written, a folder that lives as long as the process.

    Raises
    ------
    OutputError
        LIGHTFIELD_CACHE names a folder that cannot be made or written.
    """
    named = os.environ.get(_VARIABLE)
    if named:
        folder = Path(named).expanduser().absolute()
        if problem := _problem(folder):
            raise OutputError(
                "the cache folder cannot be used",
                where=f"{_VARIABLE}={named}",
                found=problem,
                remedy="name a writable one",
            )
        return folder
    try:
        folder = _platform_default()
    except RuntimeError:  # no HOME, and the user is not in the password file
        return _temporary()
    return _temporary() if _problem(folder) else folder


def _platform_default() -> Path:
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "lightfield"
    # The XDG specification: a relative path is to be ignored.
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "lightfield"


def _problem(folder: Path) -> str:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return error.strerror or str(error)


def with_room(folder: Path) -> Path:
    """A folder in the cache, made when missing; where the disk has no room, one for this process alone."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(folder).free >= LEAST_ROOM_BYTES:
            return folder
    except OSError:
        pass
    return _temporary()


@functools.cache
def _temporary() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="lightfield-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
