"""What runs of benchmarks share: rows on disk, one JSON line each, and many jobs on a few processes.

What is there is not done again, and what is finished is stored at once: a run can be interrupted.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

import lightfield

ROOT = Path(__file__).resolve().parents[1]
PROCESSES = 2
Row = dict[str, Any]


def reference_cases(name: str) -> list[Path]:
    """Folders NNN/{scene.toml, data.csv, truth.json} of another simulator, in order.

    They lie in LIGHTFIELD_REFERENCE or in the sibling folder `shared`, if there are any.
    """
    folder = Path(os.environ.get("LIGHTFIELD_REFERENCE", ROOT.parent / "shared")) / name
    return sorted(truth.parent for truth in folder.glob("*/truth.json"))


@lru_cache(maxsize=1)
def code_version() -> str:
    """Commit, and a digest of the package's code as it is on disk."""
    package = Path(lightfield.__file__).parent
    told = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        told.update(path.read_bytes())
    return f"{_commit(package)}-{told.hexdigest()[:8]}"


def _commit(folder: Path) -> str:
    try:
        asked = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], cwd=folder, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return asked.stdout.strip()


def read(path: Path) -> list[Row]:
    """All rows of a file; a line cut short by an interruption is dropped."""
    rows = []
    if path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                rows.append(json.loads(line))
            except json.JSONDecodeError:
                continue
    return rows


def append(path: Path, row: Row) -> None:
    """Add one row."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as stream:
        stream.write(json.dumps(row, default=float) + "\n")


def attempted(row: Row, make: Callable[..., Row], *given: Any) -> Row:
    """A row with what is made of the rest. A crash is an outcome too."""
    try:
        return row | make(*given)
    except Exception as error:  # whatever it is, it belongs in the table
        return row | {"verdict": "error", "error": repr(error), "traceback": traceback.format_exc()[-1500:]}


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
    what: str,
    work: Callable[..., Row],
    jobs: Sequence[tuple[Any, ...]],
    until: float = float("inf"),
    processes: int = PROCESSES,
) -> Iterator[Row]:
    """Rows of `work(*job)` as they come, with the code they are of.

    No new job is begun after `until` (time.monotonic).
    """
    waiting = iter(jobs)
    running: set[Future[Row]] = set()
    begun, done, version = time.monotonic(), 0, code_version()
    pool = start(processes)
    try:
        while True:
            free = 2 * processes - len(running) if time.monotonic() < until else 0
            running |= {pool.submit(work, *job) for job in islice(waiting, free)}
            if not running:
                return
            ready, running = wait(running, return_when=FIRST_COMPLETED)
            for future in ready:
                done += 1
                yield future.result() | {"code": version}
                _tell(what, done, len(jobs), time.monotonic() - begun)
    finally:
        pool.shutdown(cancel_futures=True)


def _tell(what: str, done: int, total: int, seconds: float) -> None:
    if sys.stderr.isatty() or done % 25 == 0 or done == total:
        end = "\r" if sys.stderr.isatty() and done < total else "\n"
        print(f"{what}: {done} of {total}, {seconds:.0f} s", end=end, file=sys.stderr, flush=True)


def do_missing(
    store: Path, work: Callable[..., Row], jobs: Sequence[tuple[Any, ...]], minutes: float, processes: int
) -> None:
    """Do the jobs that are left, and store and tell each set; none is begun after so long."""
    for row in results("sets", work, jobs, time.monotonic() + 60 * minutes, processes):
        append(store, row)
        print(row["key"], row["verdict"], row.get("best_set", row.get("error")), file=sys.stderr)
