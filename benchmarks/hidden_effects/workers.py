"""Many jobs on a few processes; what is finished is handed out at once, so that a run can be interrupted."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from itertools import islice
from typing import Any

PROCESSES = 2


def start(processes: int = PROCESSES) -> ProcessPoolExecutor:
    """Fresh processes with one BLAS thread each, which end when this one does, however it ends."""
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    return ProcessPoolExecutor(
        processes, mp_context=multiprocessing.get_context("spawn"), initializer=_end_with_parent
    )


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()  # killed, it tells nobody: a worker would go on, and then wait for ever
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def results(
    pool: ProcessPoolExecutor,
    what: str,
    work: Callable[..., Any],
    jobs: Sequence[tuple[Any, ...]],
    until: float = float("inf"),
    processes: int = PROCESSES,
) -> Iterator[Any]:
    """Results of `work(*job)` as they come; no new job is begun after `until` (time.monotonic)."""
    waiting = iter(jobs)
    running: set[Future[Any]] = set()
    begun, done = time.monotonic(), 0
    while True:
        free = 2 * processes - len(running) if time.monotonic() < until else 0
        running |= {pool.submit(work, *job) for job in islice(waiting, free)}
        if not running:
            return
        ready, running = wait(running, return_when=FIRST_COMPLETED)
        for future in ready:
            done += 1
            yield future.result()
            _tell(what, done, len(jobs), time.monotonic() - begun)


def _tell(what: str, done: int, total: int, seconds: float) -> None:
    if sys.stderr.isatty() or done % 25 == 0 or done == total:
        end = "\r" if sys.stderr.isatty() and done < total else "\n"
        print(f"{what}: {done} of {total}, {seconds:.0f} s", end=end, file=sys.stderr, flush=True)
