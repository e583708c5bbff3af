"""A stop while workers are being started: what was begun is closed, in its order. So are waits in vain."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import distributed
import pytest

from lightfield.errors import BackendError
from lightfield.sweep.cluster import connected


@pytest.fixture
def another_thread() -> Iterator[None]:
    """One from before, which the kernel may give the stop to."""
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    yield
    done.set()
    thread.join()


@pytest.mark.usefixtures("another_thread")
@pytest.mark.parametrize("what", ["LocalCluster", "Client"])
def test_a_stop_while_it_is_made_closes_it(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A client that is left open waits half a minute for its cluster when it is deleted, and complains."""
    made: list[Any] = []

    class Stopped(getattr(distributed, what)):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            made.append(self)
            os.kill(os.getpid(), signal.SIGINT)
            super().__init__(*args, **kwargs)

    monkeypatch.setattr(distributed, what, Stopped)
    with pytest.raises(KeyboardInterrupt), connected(tmp_path):
        pytest.fail("stopped before")
    (one,) = made
    assert one.status in ("closed", distributed.core.Status.closed)


@pytest.mark.parametrize("silent", [True, False])
def test_what_stopped_workers_leave_is_cleared_away_in_silence(silent: bool) -> None:
    """A semaphore that nobody gives back, as of a worker that was killed: Python complains, we do not."""
    begin = "cluster._begin_clearing_away()" if silent else "resource_tracker.ensure_running()"
    program = f"""
import os
from multiprocessing import get_context, resource_tracker
from lightfield.sweep import cluster
{begin}
left = get_context("spawn").Semaphore()
os._exit(0)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert ("leaked semaphore" in done.stderr) == (not silent), done.stderr


class Alone:
    """A client whose scheduler has no worker, and gets none."""

    def wait_for_workers(self, count: int, timeout: float) -> None:
        raise distributed.TimeoutError(f"{count} after {timeout} s")

    def scheduler_info(self) -> dict[str, Any]:
        return {"workers": {}}


def test_workers_that_never_come_are_one_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At a scheduler of one's own, and here: nobody waits for ever."""

    @contextmanager
    def client(*_: object, **__: object) -> Iterator[Alone]:
        yield Alone()

    monkeypatch.setattr(distributed, "Client", client)
    with (
        pytest.raises(BackendError, match=r"scheduler tcp://h:1: 0 of 1 workers have begun.*dask worker"),
        connected(tmp_path, scheduler="tcp://h:1"),
    ):
        pytest.fail("no worker")
    with pytest.raises(BackendError, match="local workers: 0 of 1 workers have begun"), connected(tmp_path):
        pytest.fail("no worker")
