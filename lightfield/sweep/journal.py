"""The journal of a store: what is on disk, one line of JSON each, and a digest of every file and every line.

A line that was damaged is told by its own digest: what it said then counts as never done. A file is as it was
written when it has one of the digests in the journal. Chunks of results are noted after they are on disk,
what is written more than once (summary, metadata) before: a process may be killed in between.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from lightfield.errors import OutputError
from lightfield.storage.files import atomic_path

NAME = ".lightfield/journal.jsonl"
PLAN = ".lightfield/plan.json"
_CHECK = "check"
_PART_BYTES = 1 << 22

Entry = dict[str, Any]


def digest(content: bytes) -> str:
    """BLAKE2b with 128 bits, hex: no accident keeps it, and it is as fast as a disk reads."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def add_entry(store: Path, entry: Entry) -> None:
    """Add a line; it is on disk when this returns."""
    with (store / NAME).open("ab") as file:
        file.write(_line(entry))
        file.flush()
        os.fsync(file.fileno())


def rewrite(store: Path, entries: Iterable[Entry]) -> None:
    """Replace the journal as a whole."""
    with atomic_path(store / NAME) as temporary:
        temporary.write_bytes(b"".join(map(_line, entries)))


def journal_entries(store: Path) -> tuple[list[Entry], int]:
    """Entries, and how many lines are damaged.

    A last line without its end is no damage: the process was killed, and what the line said did not happen.

    Raises
    ------
    OutputError
        It cannot be read.
    """
    try:
        *lines, _ = (store / NAME).read_bytes().split(b"\n")
    except FileNotFoundError:
        return [], 0
    except OSError as error:
        raise OutputError(
            "cannot read the journal of this store", where=str(store), found=error.strerror,
            remedy="check the permissions of its folder .lightfield",
        ) from error  # fmt: skip
    found = [_entry(line) for line in lines]
    entries = [entry for entry in found if entry is not None]
    return entries, len(found) - len(entries)


def damaged_files(store: Path, entries: Iterable[Entry]) -> list[str]:
    """Names of files in the journal that are missing, or have none of the digests noted for them."""
    known: dict[str, set[str]] = {}
    for entry in entries:
        for name, told in entry.get("files", {}).items():
            known.setdefault(name, set()).add(told)
    return sorted(name for name, told in known.items() if _digest_of_file(store / name) not in told)


def _line(entry: Mapping[str, Any]) -> bytes:
    text = json.dumps(entry)
    return json.dumps({**entry, _CHECK: digest(text.encode())}).encode() + b"\n"


def _entry(line: bytes) -> Entry | None:
    try:
        entry = json.loads(line)
        told = entry.pop(_CHECK)
        files = entry.get("files", {})
        inside = all(".." not in PurePosixPath(name).parts and name[0] != "/" for name in files)
        return entry if inside and told == digest(json.dumps(entry).encode()) else None
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def _digest_of_file(file: Path) -> str | None:
    """Digest of a regular file, read in parts; None when there is none, or none that can be read."""
    found = hashlib.blake2b(digest_size=16)
    try:
        if not file.is_file():
            return None
        with file.open("rb") as content:
            while part := content.read(_PART_BYTES):
                found.update(part)
    except (OSError, ValueError):  # ValueError: a name that no file can have
        return None
    return found.hexdigest()
