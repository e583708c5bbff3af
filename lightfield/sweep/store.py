"""The store of a sweep: its variables, its journal, its lock, and whether it may be continued.

    STORE.zarr/               xarray opens it: maps, errors, derived quantities, over the varied parameters
    STORE.zarr/.lightfield/   plan.json: what it is for; journal.jsonl: blocks on disk; traces/: while needed

A block counts as done once its line is in the journal, which is written after the block's chunks are on disk,
and as long as its chunks have the digests of that line: `journal` says how damage is told.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.errors import OutputError
from lightfield.render.response.response_cache import FORMAT as TRANSPORT_FORMAT
from lightfield.scene import Scene
from lightfield.storage.files import atomic_path
from lightfield.sweep import journal, zarrfile
from lightfield.sweep.schema import MESSAGE, SweepKind, axes_as_plain
from lightfield.sweep.sweep_plan import SweepPlan
from lightfield.version import __version__

_FORMAT = 5  # of the store; raised whenever the same plan would give other numbers


class SweepStore:
    """A store on disk.

    Attributes
    ----------
    repaired : list of str
        Files that were found damaged when the store was taken up; they are written again.
    """

    def __init__(self, path: Path, plan: SweepPlan, kind: SweepKind) -> None:
        self.path, self.plan, self.kind = path, plan, kind
        self.variables = kind.variables(plan)
        self.inner = path / ".lightfield"
        self.traces = self.inner / "traces"
        self.journal: list[journal.Entry] = []
        self.repaired: list[str] = []

    @contextmanager
    def opened(self) -> Iterator[SweepStore]:
        """Create the store, or take up what is there; nobody else may write to it meanwhile.

        Raises
        ------
        OutputError
            Something else is there, another sweep runs on it, or it was made for another sweep.
        """
        ours = self.inner.is_dir() or not self.path.exists()
        if not ours and (not self.path.is_dir() or any(self.path.iterdir())):
            raise OutputError(
                "there is something else here",
                where=str(self.path),
                rule="a new or an unfinished store",
                remedy="choose another name",
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
                        remedy="wait for it, or choose another name",
                    ) from None
                self.journal, lost = journal.journal_entries(self.path)
                # Without a plan, our own folder is what a killed process left before it had begun.
                started = (self.path / journal.PLAN).exists() or self._plans()
                self._take_up(lost) if started else self._create()
                yield self
        except PermissionError as error:
            raise OutputError(
                "cannot write here",
                where=str(self.path),
                found=error.strerror,
                remedy="choose a writable folder",
            ) from error

    def blocks(self) -> dict[int, journal.Entry]:
        """What is known of every block on disk, by number."""
        return {entry["block"]: entry for entry in self.journal if "block" in entry}

    def traced(self) -> dict[int, journal.Entry]:
        """What is known of every finished trace, by number."""
        return {entry["trace"]: entry for entry in self.journal if "trace" in entry}

    def record(self, **entry: Any) -> None:
        """Append a line to the journal; it is on disk when this returns."""
        journal.add_entry(self.path, entry)
        self.journal.append(entry)

    def drop_trace(self, number: int) -> None:
        """Remove a trace that no block needs any more."""
        trace_file(self.path, number).unlink(missing_ok=True)

    def summarise(self) -> None:
        """Write what is known of every case: status, message, trace, photons, error reached."""
        cases, trace = self.plan.cases, self.plan.trace_of_case
        status, message = np.zeros(cases.count, "i1"), np.zeros(cases.count, MESSAGE)
        for number, entry in self.blocks().items():
            status[self.plan.blocks[number].cases] = 1
            for case, text in entry["failed"].items():
                status[int(case)], message[int(case)] = 2, text
        # One more than there are traces: the last stands for no trace, which is number -1.
        photons = np.zeros(len(self.plan.traces) + 1, "i8")
        reached = np.full(len(self.plan.traces) + 1, np.nan)
        for number, entry in self.traced().items():
            photons[number], reached[number] = entry["photons"], entry["reached"]
        self._write(
            self._whole(
                {
                    "status": status,
                    "message": message,
                    "trace": trace,
                    "photons": photons[trace],
                    "reached_relative_error": reached[trace],
                }
            )
        )

    def finish(self) -> None:
        """Mark the store as complete, unless blocks are to be done again, and remove the traces."""
        zarrfile.remove_unfinished_chunks(self.path)  # of workers that died
        self.summarise()
        shutil.rmtree(self.traces, ignore_errors=True)
        if any(entry.get("again") for entry in self.blocks().values()):
            return
        self._write(self._metadata("yes"), complete=len(self.plan.blocks))

    def _create(self) -> None:
        self.journal = []
        journal.rewrite(self.path, [])  # it may be of a process that was killed at this place
        self._lay_out()
        self.summarise()
        # Last: without a plan there is no store to continue.
        self._write({journal.PLAN: zarrfile.as_json(fingerprint(self.plan, self.kind))})

    def _lay_out(self) -> None:
        self._write({**self._metadata("no"), **self._whole(self.kind.coordinates(self.plan))})

    def _take_up(self, lost: int) -> None:
        """Check all that is there, and forget what is damaged: it is done again."""
        zarrfile.remove_unfinished_chunks(self.path)
        bad = set(journal.damaged_files(self.path, self.journal))
        self.journal = [entry for entry in self.journal if not entry.get("again")]
        self._check_plan(journal.PLAN in bad)
        if lost or bad or not self._plans():
            # The lines of traces may be among the lost ones.
            known = self.traced().keys() if lost else range(len(self.plan.traces))
            self.journal = [entry for entry in self.journal if self._stands(entry, bad, set(known))]
            self.repaired = sorted(bad) if self._plans() and not lost else [journal.NAME, *sorted(bad)]
        journal.rewrite(self.path, self.journal)  # without a last line that was cut off
        if self.repaired:
            self._lay_out()
            self._write({journal.PLAN: zarrfile.as_json(fingerprint(self.plan, self.kind))})

    def _stands(self, entry: journal.Entry, bad: set[str], traces: set[int]) -> bool:
        """Whether what a line says is still true beside damaged files, and with these traces known."""
        if "block" in entry:
            return not bad.intersection(entry["files"]) and traces.issuperset(
                self.plan.blocks[entry["block"]].traces
            )
        return "complete" not in entry

    def _check_plan(self, damaged: bool) -> None:
        """Raise unless the store is for this plan; its digest in the journal is as good as the plan."""
        wanted = fingerprint(self.plan, self.kind)
        if journal.digest(zarrfile.as_json(wanted)) in self._plans():
            return
        try:
            if damaged:
                raise ValueError("not as it was written")
            found = json.loads((self.path / journal.PLAN).read_bytes())
        except (OSError, ValueError, RecursionError) as error:
            raise OutputError(
                "the plan of this store is damaged",
                where=str(self.path / journal.PLAN),
                found=str(error),
                rule="what a store is for is known before it is continued",
                remedy="choose another name, or remove the store",
            ) from error
        refuse_another_sweep(found, wanted, self.path)

    def _plans(self) -> list[str]:
        """Digests of the plan in the journal."""
        files = [entry.get("files", {}) for entry in self.journal]
        return [told[journal.PLAN] for told in files if journal.PLAN in told]

    def _metadata(self, complete: str) -> dict[str, bytes]:
        return zarrfile.metadata_files(
            self.variables, self.kind.attributes(self.plan) | {"complete": complete}
        )

    def _whole(self, arrays: Mapping[str, np.ndarray]) -> dict[str, bytes]:
        """Files of arrays that are one chunk each."""
        files = {}
        for name, values in arrays.items():
            variable = self.variables[name]
            file = zarrfile.chunk_name(name, [0] * len(variable.shape))
            files[file] = zarrfile.encoded(variable, values.reshape(variable.shape))
        return files

    def _write(self, files: Mapping[str, bytes], **entry: Any) -> None:
        """Write what is not there, or not noted; the digests come first: a kill in between is no damage."""
        noted = {pair for known in self.journal for pair in known.get("files", {}).items()}
        digests = {name: journal.digest(content) for name, content in files.items()}
        there = {
            name for name in files if (name, digests[name]) in noted and _holds(self.path / name, files[name])
        }
        if len(there) == len(files):
            return
        self.record(**entry, files={name: told for name, told in digests.items() if name not in there})
        for name, content in files.items():
            if name not in there:
                with atomic_path(self.path / name) as temporary:
                    temporary.write_bytes(content)


def trace_file(store: Path, number: int) -> Path:
    """Where the response of a trace is kept while blocks need it."""
    return store / ".lightfield" / "traces" / f"{number:06d}.npz"


def fingerprint(plan: SweepPlan, kind: SweepKind) -> dict[str, Any]:
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
        "settings": asdict(plan.settings) | kind.told,
        "blocks": {
            "chunks": list(plan.chunks),
            "traces": [[*asdict(trace.reference).values(), trace.seed] for trace in plan.traces],
        },
        "software": {
            "lightfield": __version__,
            "mitsuba": version("mitsuba"),
            "drjit": version("drjit"),
            "store format": str(_FORMAT),
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
    before, now = _flat(_by_path(found)), _flat(_by_path(wanted))
    silent = {"scene_digest", "contents", "blocks"} | (
        {"order"} if found["axes"] != wanted["axes"] else set()
    )
    changed = [
        f"{key}: there {before.get(key, 'not')}, asked for {now.get(key, 'not')}"
        for key in sorted(before.keys() | now.keys())
        if before.get(key) != now.get(key) and key.partition(".")[0] not in silent
    ]
    text = "; ".join(change if len(change) < 100 else change[:97] + "..." for change in changed[:4])
    if len(changed) > 4:
        text += f"; and {len(changed) - 4} more"
    raise OutputError(
        f"this store belongs to another sweep ({text or 'the content of a table, or the grouping, differs'})",
        where=str(path),
        rule="one store, one scene, one plan, one version",
        remedy="choose another name, or remove the store",
    )


def _by_path(plan: Mapping[str, Any]) -> dict[str, Any]:
    """What a sweep is of, with the values of every path that is varied under the path itself."""
    varied = {f"varied {path}": steps for paths in plan["axes"].values() for path, steps in paths.items()}
    return {**varied, **{key: value for key, value in plan.items() if key != "axes"}}


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
        told = hashlib.sha256(json.dumps(value).encode()).hexdigest()[:6]
        return {prefix: f"{len(value)} values, {json.dumps(value[0])} to {json.dumps(value[-1])} ({told})"}
    return {prefix.removeprefix("scene."): json.dumps(value)}


def _holds(file: Path, content: bytes) -> bool:
    """Whether a file is there and has this content."""
    return file.is_file() and file.stat().st_size == len(content) and file.read_bytes() == content
