"""Disk cache of transport responses: a complete key, a checksum, and rebuilding instead of trust."""

from __future__ import annotations

import errno
import hashlib
import json
import logging
import os
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.errors import OutputError
from lightfield.storage.cache import cache_dir
from lightfield.storage.files import atomic_path, remove_leftovers

FORMAT = 26  # raised whenever the walk, the tally, the light at readings or this file's layout changes
LARGEST_BYTES = 4 << 30  # the entries used longest ago make room for new ones
#: RuntimeError: it says that it is encrypted, or of a later version of zip.
_OF_DAMAGE = (ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)
log = logging.getLogger(__name__)


def digest_of(key: Mapping[str, Any]) -> str:
    """SHA-256 of a key of plain values, hex."""
    text = json.dumps({"format": FORMAT, **key}, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()


def recall(key: Mapping[str, Any]) -> dict[str, np.ndarray] | None:
    """Arrays stored under `key`, or None when there are none, or none that can be read and trusted."""
    path = _path(key)
    if not path.exists():
        return None
    try:
        arrays = read_arrays(path)
        if bytes(arrays.pop("key")).decode() != digest_of(key):
            raise ValueError("key does not match")
        with suppress(OSError):  # a cache that may be read but not written
            os.utime(path)
        return arrays
    except Exception as error:
        if is_damage(error):
            log.warning("cache entry %s is damaged (%s) and is rebuilt", path.name, error)
            with suppress(OSError):
                path.unlink(missing_ok=True)
        elif isinstance(error, OSError):  # it may be sound
            log.warning("cache entry %s cannot be read (%s) and is not used", path.name, error)
        else:
            raise
        return None


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays with their checksum, whole or not at all."""
    named: dict[str, Any] = dict(arrays)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **named, checksum=np.frombuffer(_checksum(arrays).encode(), np.uint8))


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Arrays that were written so.

    Raises
    ------
    OSError, ValueError, ...
        They cannot be read, or not be trusted: see `is_damage`.
    """
    with np.load(path, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    if bytes(arrays.pop("checksum")).decode() != _checksum(arrays):
        raise ValueError("checksum does not match")
    return arrays


def is_damage(error: Exception) -> bool:
    """Is it what a damaged archive makes zipfile and NumPy raise? No lack of memory, no fault of a disk."""
    if isinstance(error, OSError):
        return error.errno == errno.EINVAL  # a place before the beginning of the file was looked for
    return isinstance(error, _OF_DAMAGE)


def keep(key: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Store arrays under `key`; a full or read-only disk costs the cache entry, not the result."""
    kept = {**arrays, "key": np.frombuffer(digest_of(key).encode(), np.uint8)}
    try:
        write_arrays(_path(key), kept)
        _make_room(_path(key))
    except (OSError, OutputError) as error:
        log.warning("the transport response was not cached: %s", error)


def _make_room(newest: Path) -> None:
    remove_leftovers(newest.parent)
    entries = []
    for entry in newest.parent.glob("*.npz"):
        with suppress(FileNotFoundError):  # another process makes room, too
            entries.append((entry.stat().st_mtime, entry.stat().st_size, entry))
    excess = sum(size for _, size, _ in entries) - LARGEST_BYTES
    for _, size, entry in sorted(entries):
        if excess <= 0 or entry == newest:
            return
        excess -= size
        entry.unlink(missing_ok=True)


def _path(key: Mapping[str, Any]) -> Path:
    return cache_dir() / "transport" / f"{digest_of(key)}.npz"


def _checksum(arrays: Mapping[str, np.ndarray]) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name}{array.dtype}{array.shape}".encode())
        digest.update(array.data if array.ndim else array.tobytes())
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"a cache key holds plain values only, not {type(value).__name__}")
