"""Run a sweep: give traces and blocks to Dask, follow them, and leave a store that can be continued at any moment."""

from __future__ import annotations

import contextlib
import errno
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lightfield.errors import LightfieldError, OutputError, RenderError
from lightfield.sweep import zarrfile
from lightfield.sweep.cluster import connected
from lightfield.sweep.plan import Block, Plan
from lightfield.sweep.store import SweepStore, quantity_of
from lightfield.sweep.work import BlockDone, Target, TraceDone, do_block, do_trace

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
TRACE, BLOCK = 0, 1  # priorities: a trace on disk is used up before the next one is made
Report = Callable[["Progress"], None]


@dataclass
class Progress:
    """How far a sweep is.

    Parameters
    ----------
    cases, cases_done, failed : int
    traces, traced : int
        Traces that this run had to make, and those made.
    photons : float
        Traced by this run.
    trace_seconds, block_seconds : float
        Computing time of all workers.
    seconds : float
        Since the start of this run.
    workers : dict of str to int
        Most memory held by every process that worked, bytes.
    """

    cases: int
    traces: int
    cases_before: int = 0
    cases_done: int = 0
    failed: int = 0
    traced: int = 0
    photons: float = 0.0
    trace_seconds: float = 0.0
    block_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)
    workers: dict[str, int] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.started

    def gain(self, plan: Plan) -> float:
        """How many times less computing than a trace for every case; 0 while nothing was traced."""
        if not self.traced or not self.cases_done:
            return 0.0
        spent = self.trace_seconds / self.traced * len(plan.traces) + self.block_seconds
        return self.trace_seconds / self.traced * plan.cases.count / spent


def run_sweep(
    plan: Plan,
    path: Path,
    *,
    workers: int = 0,
    scheduler: str | None = None,
    memory_gb: float | None = None,
    report: Report | None = None,
) -> Progress:
    """Run a plan, or what is left of it, into a store.

    Parameters
    ----------
    plan : Plan
    path : Path
        The store. A finished one is left as it is; an unfinished one is continued.
    workers, scheduler, memory_gb
        See `cluster.connected`.
    report : callable, optional
        Called with the progress whenever something is done.

    Raises
    ------
    OutputError
        The store belongs to another sweep, or the disk is full: then the same call continues later.
    UsageError, BackendError
        The workers cannot be had.
    """
    path = Path(path).resolve()
    with SweepStore(path, plan).opened() as store:
        return _run(plan, store, workers, scheduler, memory_gb, report)


def _run(
    plan: Plan, store: SweepStore, workers: int, scheduler: str | None, memory_gb: float | None, report: Report | None
) -> Progress:  # fmt: skip
    done = store.done()
    left = [block for block in plan.blocks if block.number not in done]
    before = sum(len(plan.blocks[number].cases) for number in done)
    missing = {t for block in left for t in block.traces}
    progress = Progress(plan.cases.count, len(missing), cases_before=before)
    progress.failed = sum(len(entry["failed"]) for entry in store.journal if "block" in entry)
    if not left:
        store.finish()
        return progress
    for number in set(range(len(plan.traces))) - missing:
        store.drop_trace(number)
    try:
        with _full_disk(store.path), connected(store.path, workers, scheduler, memory_gb) as client:
            for block in _without_traces(left):
                _finished(_run_here(block, plan, store), store, progress, report)
            _follow(client, plan, store, [block for block in left if block.traces], progress, report)
    except BaseException:
        with contextlib.suppress(OSError, LightfieldError):  # the disk may be full: the journal has it all
            store.summarise()
        raise
    with _full_disk(store.path):
        store.finish()
    return progress


def _without_traces(blocks: list[Block]) -> list[Block]:
    return [block for block in blocks if not block.traces]


def _run_here(block: Block, plan: Plan, store: SweepStore) -> BlockDone:
    return do_block(block, plan.cases, _traces_of(block, plan), _target(plan, store))


def _traces_of(block: Block, plan: Plan) -> list[int]:
    return [int(t) for t in plan.trace_of_case[block.cases]]


def _target(plan: Plan, store: SweepStore) -> Target:
    quantity, units, _, area_units = quantity_of(plan)
    return Target(store.path, store.variables, quantity, units, area_units, plan.bands)


def _follow(
    client: Any, plan: Plan, store: SweepStore, left: list[Block], progress: Progress, report: Report | None
) -> None:
    """Submit what can be done next, note what is done, until nothing is left."""
    from distributed import KilledWorker, as_completed

    target = _target(plan, store)
    users = {number: {b.number for b in left if number in b.traces} for number in sorted({t for b in left for t in b.traces})}
    pending = {block.number: set(block.traces) for block in left}
    broken: dict[int, str] = {}
    queue = list(users)
    running: dict[str, tuple[int, int]] = {}
    completed = as_completed([], loop=client.loop)

    def submit(kind: int, number: int) -> None:
        if kind == TRACE:
            job = client.submit(do_trace, plan.traces[number], plan.settings, store.path, pure=False, priority=0)
        else:
            block = plan.blocks[number]
            job = client.submit(
                do_block, block, plan.cases, [-1 if t in broken else t for t in _traces_of(block, plan)], target,
                pure=False, priority=10,
            )  # fmt: skip
        running[job.key] = (kind, number)
        completed.add(job)

    def more_traces() -> None:
        # Traces on disk are large: no more of them at once than keep the workers busy.
        most = max(1, len(client.scheduler_info()["workers"])) + 1
        while queue and sum(1 for n in users if n not in queue) < most:
            submit(TRACE, queue.pop(0))

    def trace_ready(number: int) -> None:
        for block in sorted(users[number]):
            pending[block].discard(number)
            if not pending[block]:
                submit(BLOCK, block)

    more_traces()
    while running:
        job = next(completed)
        kind, number = running.pop(job.key)
        try:
            result = job.result()
        except (LightfieldError, KilledWorker, ValueError, RuntimeError, MemoryError) as error:
            text = _reason(error)
            if kind == BLOCK:
                block = plan.blocks[number]
                if isinstance(error, OutputError):
                    raise
                result = BlockDone(number, {int(c): text for c in block.cases}, 0.0, "", 0)
            else:
                broken[number] = text
                trace_ready(number)
                continue
        except CancelledError as error:
            raise RenderError("the cluster gave up the sweep", remedy="the same command continues it") from error
        if isinstance(result, TraceDone):
            progress.traced += 1
            progress.photons += result.photons
            progress.trace_seconds += result.seconds
            store.record(trace=number, photons=result.photons, reached=result.reached, seconds=result.seconds)
            _note(progress, result, report)
            trace_ready(number)
        else:
            for t in plan.blocks[number].traces:
                result.failed.update({int(c): broken[t] for c in plan.blocks[number].cases
                                      if t in broken and plan.trace_of_case[c] == t})  # fmt: skip
            _finished(result, store, progress, report)
            for t in plan.blocks[number].traces:
                users[t].discard(number)
                if not users[t]:
                    del users[t]
                    store.drop_trace(t)
            more_traces()


def _finished(result: BlockDone, store: SweepStore, progress: Progress, report: Report | None) -> None:
    problems = {int(c): store.plan.problems[int(c)] for c in store.plan.blocks[result.number].cases
                if int(c) in store.plan.problems}  # fmt: skip
    failed = {**problems, **result.failed}
    store.record(block=result.number, failed={str(c): text for c, text in failed.items()}, seconds=result.seconds)
    progress.cases_done += len(store.plan.blocks[result.number].cases)
    progress.failed += len(failed)
    progress.block_seconds += result.seconds
    _note(progress, result, report)


def _note(progress: Progress, result: TraceDone | BlockDone, report: Report | None) -> None:
    if result.worker:
        progress.workers[result.worker] = max(progress.workers.get(result.worker, 0), result.peak_bytes)
    if report is not None:
        report(progress)


def _reason(error: BaseException) -> str:
    name = type(error).__name__
    if name == "KilledWorker":
        return "the worker died every time it was tried; out of memory?"
    text = " ".join(str(error).split())
    return (text if isinstance(error, LightfieldError) else f"{name}: {text}")[:240]


@contextlib.contextmanager
def _full_disk(path: Path) -> Iterator[None]:
    """Say so, in one line, when there is no room left."""
    try:
        yield
    except (OSError, OutputError) as error:
        cause = error.__cause__ if isinstance(error, OutputError) else error
        if isinstance(cause, OSError) and cause.errno in NO_ROOM:
            raise OutputError(
                "the disk is full", where=str(path), found=f"{zarrfile.size_on_disk(path)} bytes in the store",
                remedy="make room and give the same command again: it continues",
            ) from error  # fmt: skip
        raise
