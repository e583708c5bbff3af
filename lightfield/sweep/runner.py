"""Run a sweep: give traces and blocks to Dask, follow them, leave a store that can always be continued."""

from __future__ import annotations

import contextlib
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lightfield.errors import BackendError, LightfieldError, OutputError, RenderError, one_line
from lightfield.storage.files import NO_ROOM
from lightfield.sweep import zarrfile
from lightfield.sweep.cluster import check_workers, connected
from lightfield.sweep.schema import LONGEST_MESSAGE, SweepKind, attributes, coordinates, variables_of
from lightfield.sweep.store import SweepStore
from lightfield.sweep.sweep_plan import Block, SweepPlan
from lightfield.sweep.work import BlockDone, TraceDone, do_block, do_trace, map_target, topic_of

Report = Callable[["SweepProgress"], None]
#: Maps of light and what is derived from them.
MAPS = SweepKind(variables_of, coordinates, attributes, map_target, do_block, {})


@dataclass
class SweepProgress:
    """How far a sweep is.

    Parameters
    ----------
    traces, traced, found : int
        Traces that this run had to make, those there are by now, and how many of these lay there already.
    again : int
        Cases that failed for the machine's sake: the same sweep tries them again.
    photons : float
        Traced by this run.
    trace_seconds, block_seconds : float
        Computing time of all workers.
    seconds : float
        Since the start of this run.
    workers : dict of str to int
        Most memory held by every process that worked, bytes.
    repaired : list of str
        Damaged files of the store that are written again.
    underway : dict of int to float
        Part that is done of every trace that a worker has told of and not finished.
    """

    cases: int
    traces: int
    cases_before: int = 0
    cases_done: int = 0
    failed: int = 0
    again: int = 0
    traced: int = 0
    found: int = 0
    photons: float = 0.0
    trace_seconds: float = 0.0
    block_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)
    workers: dict[str, int] = field(default_factory=dict)
    repaired: list[str] = field(default_factory=list)
    underway: dict[int, float] = field(default_factory=dict)

    @property
    def part(self) -> float:
        """What is done of what this run has to do, each case and each trace one piece of it."""
        todo = self.cases - self.cases_before + self.traces
        return (self.cases_done + self.traced + sum(self.underway.values())) / max(todo, 1)

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.started

    def gain(self, plan: SweepPlan) -> float:
        """How many times less computing than a trace for every case; 0 while this run has traced nothing.

        Each case is evaluated once either way.
        """
        made = self.traced - self.found
        if not made or not self.cases_done:
            return 0.0
        each, cases = self.trace_seconds / made, int((plan.trace_of_case >= 0).sum())
        evaluated = self.block_seconds / self.cases_done * cases
        return (each * cases + evaluated) / (each * len(plan.traces) + evaluated)


def run_sweep(
    plan: SweepPlan,
    path: Path,
    *,
    kind: SweepKind = MAPS,
    workers: int = 0,
    scheduler: str | None = None,
    memory_gb: float | None = None,
    report: Report | None = None,
) -> SweepProgress:
    """Run a plan, or what is left of it, into a store.

    Parameters
    ----------
    plan : SweepPlan
    path : Path
        The store. A finished one is left as it is; an unfinished or a damaged one is continued.
    kind : SweepKind
        What is computed of the cases.
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
    check_workers(workers, scheduler, memory_gb)
    path = Path(path).resolve()
    with _full_disk(path), SweepStore(path, plan, kind).opened() as store:
        return _run(plan, store, workers, scheduler, memory_gb, report)


def _run(
    plan: SweepPlan,
    store: SweepStore,
    workers: int,
    scheduler: str | None,
    memory_gb: float | None,
    report: Report | None,
) -> SweepProgress:
    done = store.blocks()
    left = [block for block in plan.blocks if block.number not in done]
    needed = {t for block in left for t in block.traces}
    progress = SweepProgress(
        plan.cases.count, len(needed), cases_before=sum(len(plan.blocks[number].cases) for number in done)
    )
    progress.repaired = store.repaired
    progress.failed = sum(len(entry["failed"]) for entry in done.values())
    for number in set(range(len(plan.traces))) - needed:
        store.drop_trace(number)
    try:
        if left:
            with connected(store.path, workers, scheduler, memory_gb) as client:
                dispatch = _Dispatch(client, plan, store, progress, report)
                client.subscribe_topic(topic_of(store.path), dispatch.heard)
                dispatch.follow(left)
        store.finish()
    except BaseException:
        with contextlib.suppress(OSError, LightfieldError):  # the disk may be full: the journal has it all
            store.summarise()
        raise
    return progress


class _Dispatch:
    """Submits what can be done next and notes what is done."""

    def __init__(
        self, client: Any, plan: SweepPlan, store: SweepStore, progress: SweepProgress, report: Report | None
    ) -> None:
        from distributed import as_completed

        self.client, self.plan, self.store = client, plan, store
        self.progress, self.report = progress, report
        self.target = store.kind.target(plan, store.path, store.variables)
        self.completed = as_completed([], loop=client.loop)
        self.running: dict[str, tuple[bool, int]] = {}  # is it a trace, and its number
        self.telling = threading.Lock()  # held where `running` or the progress change, or are told of
        self.users: dict[int, set[int]] = {}  # blocks that still need a trace
        self.pending: dict[int, set[int]] = {}  # traces that a block still waits for
        self.broken: dict[int, str] = {}  # traces that failed, and why
        self.unlucky: set[int] = set()  # of these for the machine's sake
        self.queue: list[int] = []

    def heard(self, event: tuple[float, dict[str, Any]]) -> None:
        """A worker says how far a trace is; in the client's own thread."""
        _, told = event
        with self.telling:
            if (True, told["trace"]) in self.running.values():
                self.progress.underway[told["trace"]] = told["part"]
                self._report()

    def follow(self, left: list[Block]) -> None:
        """Work until no block is left."""
        self.queue = sorted({t for block in left for t in block.traces})
        self.users = {t: set() for t in self.queue}
        for block in left:
            for t in block.traces:
                self.users[t].add(block.number)
        self.pending = {block.number: set(block.traces) for block in left}
        for block in left:
            if not block.traces:
                self._submit_block(block.number)
        self._submit_traces()
        while self.running:
            job = next(self.completed)
            is_trace, number = self._finished(job.key)
            result = self._result(job, is_trace, number)
            if isinstance(result, TraceDone):
                self._traced(result)
            elif is_trace:
                self._release(number)
            elif result is not None:
                self._written(result)
            self._submit_traces()

    def _finished(self, key: str) -> tuple[bool, int]:
        """Forget a job: is it a trace, and its number."""
        with self.telling:
            is_trace, number = self.running.pop(key)
            if is_trace:
                self.progress.underway.pop(number, None)
        return is_trace, number

    def _result(self, job: Any, is_trace: bool, number: int) -> TraceDone | BlockDone | None:
        """Report of a job; one that failed is noted, unless it says that nothing can be written."""
        from distributed import KilledWorker

        try:
            result: TraceDone | BlockDone = job.result()
            return result
        except (OSError, OutputError, CancelledError) as error:
            if isinstance(error, CancelledError):
                raise RenderError(
                    "the cluster gave up", remedy="run the sweep again: it continues"
                ) from error
            raise
        except (LightfieldError, KilledWorker, ValueError, RuntimeError, TypeError, MemoryError) as error:
            # What another machine, or fewer workers, may do is no answer about a case.
            again = isinstance(error, KilledWorker | MemoryError | RuntimeError | BackendError)
            if is_trace:
                self.broken[number] = _reason(error)
                self.unlucky |= {number} if again else set()
                return None
            failed = {int(c): _reason(error) for c in self.plan.blocks[number].cases}
            return BlockDone(number, failed, {}, 0.0, "", 0, again)

    def _traced(self, result: TraceDone) -> None:
        self.store.record(
            trace=result.number, photons=result.photons, reached=result.reached, seconds=result.seconds
        )
        with self.telling:
            self.progress.traced += 1
            self.progress.found += result.found
            self.progress.photons += 0 if result.found else result.photons
            self.progress.trace_seconds += 0.0 if result.found else result.seconds
            self._note(result)
        self._release(result.number)

    def _release(self, trace: int) -> None:
        """Submit the blocks that waited for a trace alone."""
        for block in sorted(self.users[trace]):
            self.pending[block].discard(trace)
            if not self.pending[block]:
                self._submit_block(block)

    def _written(self, result: BlockDone) -> None:
        block = self.plan.blocks[result.number]
        for case in map(int, block.cases):
            trace = int(self.plan.trace_of_case[case])
            if trace in self.broken:
                result.failed[case] = self.broken[trace]
            elif case in self.plan.problems:
                result.failed[case] = self.plan.problems[case]
        again = result.again or not self.unlucky.isdisjoint(block.traces)
        self.store.record(
            block=result.number,
            failed={str(c): text for c, text in result.failed.items()},
            seconds=result.seconds,
            files=result.files,
            **({"again": True} if again else {}),
        )
        with self.telling:
            self.progress.again += len(result.failed) if again else 0
            self.progress.cases_done += len(block.cases)
            self.progress.failed += len(result.failed)
            self.progress.block_seconds += result.seconds
            self._note(result)
        for trace in block.traces:
            self.users[trace].discard(result.number)
            if not self.users[trace]:
                del self.users[trace]
                self.store.drop_trace(trace)

    def _submit_traces(self) -> None:
        # Traces on disk are large: no more of them at once than keep the workers busy, or than a block needs.
        most = max(1, len(self.client.scheduler_info()["workers"])) + 1
        while self.queue and (len(self.users) - len(self.queue) < most or not self.running):
            trace = self.plan.traces[self.queue.pop(0)]
            scene = trace.scene(self.plan.cases)
            self._submit(True, trace.number, do_trace, trace, scene, self.plan.settings, self.store.path)

    def _submit_block(self, number: int) -> None:
        block = self.plan.blocks[number]
        traces = [int(t) for t in self.plan.trace_of_case[block.cases]]
        traces = [-1 if t in self.broken else t for t in traces]
        self._submit(False, number, self.store.kind.block, block, self.plan.cases, traces, self.target)

    def _submit(self, is_trace: bool, number: int, work: Callable[..., Any], *args: Any) -> None:
        # Blocks first: a trace on disk is used up before the next one is made.
        job = self.client.submit(work, *args, pure=False, priority=0 if is_trace else 10)
        with self.telling:
            self.running[job.key] = (is_trace, number)
        self.completed.add(job)

    def _note(self, result: TraceDone | BlockDone) -> None:
        if result.worker:
            workers = self.progress.workers
            workers[result.worker] = max(workers.get(result.worker, 0), result.peak_bytes)
        self._report()

    def _report(self) -> None:
        if self.report is not None:
            self.report(self.progress)


def _reason(error: BaseException) -> str:
    name = type(error).__name__
    if name == "KilledWorker":
        return "the worker died every time it was tried; out of memory? The same sweep tries again"
    text = one_line(error)
    return (text if isinstance(error, LightfieldError) else f"{name}: {text}")[:LONGEST_MESSAGE]


@contextlib.contextmanager
def _full_disk(path: Path) -> Iterator[None]:
    """Say so, in one line, when there is no room left."""
    try:
        yield
    except (OSError, OutputError) as error:
        cause = error.__cause__ if isinstance(error, OutputError) else error
        if isinstance(cause, OSError) and cause.errno in NO_ROOM:
            room = shutil.disk_usage(path if path.exists() else path.parent).free
            raise OutputError(
                "the disk is full",
                where=str(path),
                found=f"{room / 1e6:.1f} MB free, {zarrfile.size_on_disk(path) / 1e6:.1f} MB in the store",
                remedy="make room and run the sweep again: it continues",
            ) from error
        raise
