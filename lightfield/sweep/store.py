"""The store of a sweep: its variables, its journal, its lock, and whether it may be continued.

    STORE.zarr/               xarray opens it: maps, errors, derived quantities, over the varied parameters
    STORE.zarr/.lightfield/   plan.json: what it is for; journal.jsonl: blocks on disk; traces/: while needed

A block counts as done once its line is in the journal, which is written after the block's chunks are on disk.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from lightfield import __version__
from lightfield.errors import OutputError
from lightfield.render.response.store import FORMAT as TRANSPORT_FORMAT
from lightfield.scene import Scene
from lightfield.storage.files import atomic_path
from lightfield.sweep import zarrfile
from lightfield.sweep.plan import Plan
from lightfield.sweep.schema import MESSAGE, attributes, axes_as_plain, coordinates, layout

FORMAT = 1  # of the store; raised whenever the same plan would give other numbers


class SweepStore:
    """A store on disk.

    Parameters
    ----------
    path : Path
    plan : Plan
    """

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path, self.plan = path, plan
        self.variables = layout(plan)
        self.inner = path / ".lightfield"
        self.traces = self.inner / "traces"
        self.journal: list[dict[str, Any]] = []

    @contextmanager
    def opened(self) -> Iterator[SweepStore]:
        """Create the store, or take up what is there; nobody else may write to it meanwhile.

        Raises
        ------
        OutputError
            Something else is there, another sweep runs on it, or it was made for another sweep.
        """
        started = (self.inner / "plan.json").exists()
        # Without a plan, our own folder is what a killed process left before it had begun.
        ours = started or self.inner.is_dir() or not self.path.exists()
        if not ours and (not self.path.is_dir() or any(self.path.iterdir())):
            raise OutputError(
                "there is something else here",
                where=str(self.path),
                rule="a new or an unfinished store",
                remedy="choose another name with -o",
            )
        try:
            self.traces.mkdir(parents=True, exist_ok=True)
            with (self.inner / "lock").open("w") as lock:
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError:
                    raise OutputError(
                        "another sweep is writing to this store",
                        where=str(self.path),
                        remedy="wait for it, or choose another name with -o",
                    ) from None
                self._take_up() if started else self._create()
                yield self
        except PermissionError as error:
            raise OutputError(
                "cannot write here",
                where=str(self.path),
                found=error.strerror,
                remedy="choose a writable folder with -o",
            ) from error

    def done(self) -> set[int]:
        """Numbers of the blocks that are on disk."""
        return {entry["block"] for entry in self.journal if "block" in entry}

    def traced(self) -> dict[int, dict[str, Any]]:
        """What is known of every finished trace, by number."""
        return {entry["trace"]: entry for entry in self.journal if "trace" in entry}

    def record(self, **entry: Any) -> None:
        """Append a line to the journal; it is on disk when this returns."""
        with (self.inner / "journal.jsonl").open("ab") as file:
            file.write(json.dumps(entry).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
        self.journal.append(entry)

    def drop_trace(self, number: int) -> None:
        """Remove a trace that no block needs any more."""
        trace_file(self.path, number).unlink(missing_ok=True)

    def summarise(self) -> None:
        """Write what is known of every case: status, message, trace, photons, error reached."""
        cases, traced = self.plan.cases, self.traced()
        status, message = np.zeros(cases.count, "i1"), np.zeros(cases.count, MESSAGE)
        photons, reached = np.zeros(cases.count, "i8"), np.full(cases.count, np.nan)
        for entry in self.journal:
            if "block" in entry:
                status[self.plan.blocks[entry["block"]].cases] = 1
                for number, text in entry["failed"].items():
                    status[int(number)], message[int(number)] = 2, text
        for number, entry in traced.items():
            which = self.plan.trace_of_case == number
            photons[which], reached[which] = entry["photons"], entry["reached"]
        trace = self.plan.trace_of_case
        for name, values in (
            ("status", status),
            ("message", message),
            ("trace", trace),
            ("photons", photons),
            ("reached_relative_error", reached),
        ):
            zarrfile.write_whole(self.path, name, self.variables[name], values.reshape(cases.shape))

    def finish(self) -> None:
        """Mark the store as complete and remove the traces."""
        zarrfile.remove_leftovers(self.path)  # of workers that died
        self.summarise()
        shutil.rmtree(self.traces, ignore_errors=True)
        zarrfile.set_attrs(self.path, {"complete": "yes"})

    def _create(self) -> None:
        zarrfile.create(self.path, self.variables, attributes(self.plan))
        for name, values in coordinates(self.plan).items():
            zarrfile.write_whole(self.path, name, self.variables[name], values)
        self.summarise()
        # Last: without a plan there is no store to continue.
        _write(self.inner / "plan.json", fingerprint(self.plan))

    def _take_up(self) -> None:
        refuse_another_sweep(
            json.loads((self.inner / "plan.json").read_text()), fingerprint(self.plan), self.path
        )
        zarrfile.remove_leftovers(self.path)
        journal = self.inner / "journal.jsonl"
        lines = journal.read_bytes().split(b"\n") if journal.exists() else [b""]
        if lines[-1]:  # a line that was cut off: what it said did not happen
            _write_bytes(journal, b"".join(line + b"\n" for line in lines[:-1]))
        self.journal = [json.loads(line) for line in lines[:-1]]


def trace_file(store: Path, number: int) -> Path:
    """Where the response of a trace is kept while blocks need it."""
    return store / ".lightfield" / "traces" / f"{number:06d}.npz"


def fingerprint(plan: Plan) -> dict[str, Any]:
    """All that the numbers of a store depend on."""
    texts = [
        i
        for i, a in enumerate(plan.cases.axes)
        if any(isinstance(v, str) for vs in a.values.values() for v in vs)
    ]
    return {
        "scene": plan.cases.scene.model_dump(mode="json", exclude={"name", "description"}),
        "scene_digest": plan.cases.scene.digest(),
        "axes": axes_as_plain(plan),
        "order": [axis.name for axis in plan.cases.axes],
        # Text may name a table, whose content counts as well.
        "contents": [_digest(scene) for i in texts for _, scene in plan.cases.subset([i])],
        "settings": asdict(plan.settings),
        "blocks": {
            "chunks": list(plan.chunks),
            "traces": [[*asdict(trace.reference).values(), trace.seed] for trace in plan.traces],
        },
        "software": {
            "lightfield": __version__,
            "mitsuba": version("mitsuba"),
            "drjit": version("drjit"),
            "store format": str(FORMAT),
            "transport format": str(TRANSPORT_FORMAT),
        },
    }


def refuse_another_sweep(found: Mapping[str, Any], wanted: Mapping[str, Any], path: Path) -> None:
    """Raise when a store was made for another sweep, naming what differs.

    Raises
    ------
    OutputError
    """
    found, wanted = json.loads(json.dumps(found)), json.loads(json.dumps(wanted))
    if found == wanted:
        return
    before, now = _flat(found), _flat(wanted)
    changed = [
        f"{key} {before.get(key, 'absent')} -> {now.get(key, 'absent')}"
        for key in sorted(before.keys() | now.keys())
        if before.get(key) != now.get(key)
        and key.partition(".")[0] not in ("scene_digest", "contents", "blocks")
    ]
    text = "; ".join(change if len(change) < 100 else change[:97] + "..." for change in changed[:4])
    if len(changed) > 4:
        text += f"; and {len(changed) - 4} more"
    raise OutputError(
        f"this store belongs to another sweep ({text or 'the content of a table, or the grouping, differs'})",
        where=str(path),
        rule="one store, one scene, one plan, one version",
        remedy="choose another name with -o, or remove the store",
    )


def _digest(scene: Scene) -> str:
    try:
        return scene.digest()
    except OSError as error:
        return str(error)


def _flat(value: Any, prefix: str = "") -> dict[str, str]:
    if isinstance(value, dict):
        return {
            k: v
            for key, part in value.items()
            for k, v in _flat(part, f"{prefix}.{key}" if prefix else key).items()
        }
    if isinstance(value, list) and len(value) > 4:
        return {
            prefix: f"{len(value)} values, {json.dumps(value[0])} to {json.dumps(value[-1])} ({_hash(value)})"
        }
    return {prefix.removeprefix("scene."): json.dumps(value)}


def _hash(value: Any) -> str:
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()[:6]


def _write(path: Path, content: Any) -> None:
    _write_bytes(path, json.dumps(content, indent=1).encode())


def _write_bytes(path: Path, content: bytes) -> None:
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)
