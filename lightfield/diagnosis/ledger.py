"""The ledger: one line of JSON for every diagnosis or comparison of a reading table, never rewritten.

A false-alarm rate holds for one run. Who tries twenty scenes on the same readings should see it counted.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.arrays import jsonable
from lightfield.errors import OutputError
from lightfield.readings import Readings

NAME = "ledger.jsonl"


def readings_hash(readings: Readings) -> str:
    """Hash of the readings themselves (places and values), independent of the file that holds them."""
    digest = hashlib.sha256()
    for name in ("x_m", "y_m", "z_m", "wavelength_nm", "value"):
        digest.update(np.ascontiguousarray(np.asarray(getattr(readings, name), float)).tobytes())
    return digest.hexdigest()[:16]


def entries(folder: Path) -> list[dict[str, Any]]:
    """All entries of a folder's ledger; lines that are not JSON are skipped."""
    path = folder / NAME
    if not path.is_file():
        return []
    out = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(entry, dict):
            out.append(entry)
    return out


def runs(folder: Path, readings_hash: str) -> int:
    """How many runs on these readings the ledger holds."""
    return len({entry.get("run") for entry in entries(folder) if entry.get("readings") == readings_hash})


def add_rungs(folder: Path, rows: Sequence[Mapping[str, Any]], command: str, readings_hash: str) -> int:
    """Add the rungs of one run.

    Parameters
    ----------
    rows : list of mapping
        label, effects, chi2_per_dof, error_percent, scene (file name of the stored rung).
    command : str
        What was run.

    Returns
    -------
    int
        Number of this run, from 1.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    number = runs(folder, readings_hash) + 1
    now = datetime.now(timezone.utc).isoformat(timespec="seconds")
    head = {"time": now, "command": command, "readings": readings_hash, "run": number}
    lines = [json.dumps(jsonable({**head, **row}), allow_nan=False) for row in rows]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / NAME).open("a", encoding="utf-8") as stream:
            stream.write("".join(line + "\n" for line in lines))
    except OSError as error:
        raise OutputError(
            "cannot write the ledger",
            where=str(folder / NAME),
            found=error.strerror,
            remedy="choose a writable folder",
        ) from error
    return number
