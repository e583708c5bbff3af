"""Dask: in this process, as a cluster of local processes, or an existing scheduler."""

from __future__ import annotations

import contextlib
import logging
import multiprocessing.resource_tracker
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lightfield.errors import BackendError, UsageError
from lightfield.render.backend import use_backend
from lightfield.version import __version__

if TYPE_CHECKING:
    from distributed import Client

CONNECT_SECONDS = 15
#: In which workers begin, and one second more for each of them; a busy machine takes half a minute.
_WORKER_SECONDS = 150
_WARNINGS = "PYTHONWARNINGS"
_LOOPBACK = "127.0.0.1"  # whoever reaches a scheduler or a worker can run code in it: nobody from outside


def check_workers(workers: int, scheduler: str | None, memory_gb: float | None) -> None:
    """Complain, before anything is written, about workers that cannot be.

    Raises
    ------
    UsageError
        Both workers and a scheduler, or an impossible number, limit or address.
    """
    if workers and scheduler:
        raise UsageError(
            "local workers and a scheduler exclude each other",
            remedy="leave the number of workers out: an existing scheduler has its own",
        )
    if not 0 <= workers <= 1024:
        raise UsageError(
            "impossible number of workers", where="workers", found=workers, rule="0 (this process) to 1024"
        )
    if memory_gb is not None and not memory_gb > 0:
        raise UsageError(
            "impossible memory limit", where="memory of a worker", found=memory_gb, rule="gigabytes, above 0"
        )
    if scheduler is not None and not re.search(r":\d+$", scheduler):
        raise UsageError(
            "not the address of a scheduler",
            where="scheduler",
            found=scheduler,
            rule="tcp://HOST:PORT, or tls://HOST:PORT",
            remedy="start one with `dask scheduler`, which says its address",
        )


@contextmanager
def connected(
    store: Path, workers: int = 0, scheduler: str | None = None, memory_gb: float | None = None
) -> Iterator[Client]:
    """A Dask client whose workers have their backend ready and see the store.

    Parameters
    ----------
    store : Path
        Folder that every worker must reach under the same path.
    workers : int
        Local processes; 0 computes in this process.
    scheduler : str, optional
        Address of a running scheduler, such as tcp://10.0.0.1:8786.
    memory_gb : float, optional
        Limit of a local worker; Dask restarts one that goes beyond. Default: an equal share of the machine.

    Raises
    ------
    UsageError
        Nobody answers at that address.
    BackendError
        A worker cannot compute, or none comes.
    """
    import dask
    from distributed import Client

    # A trace holds the interpreter for seconds: that is no reason to warn, or to give a worker up.
    quiet = {
        "distributed.admin.tick.limit": "1h",
        "distributed.scheduler.allowed-failures": 2,
        "distributed.scheduler.worker-ttl": "30 minutes",
        "distributed.comm.timeouts.connect": f"{CONNECT_SECONDS}s",
    }
    for name in (
        "asyncio",
        "distributed",
        "distributed.client",
        "distributed.nanny",
        "distributed.worker",
        "distributed.scheduler",
        "tornado",
        "tornado.application",
    ):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(quiet))
        if scheduler is not None:
            _check_keys(scheduler)
            try:
                client = stack.enter_context(Client(scheduler, timeout=CONNECT_SECONDS, set_as_default=False))
            except (OSError, TimeoutError, ValueError) as error:
                raise UsageError(
                    "no Dask scheduler answers",
                    where=f"scheduler {scheduler}",
                    found=str(error),
                    remedy="start one with `dask scheduler`",
                ) from error
            if not client.scheduler_info()["workers"]:
                _wait_for_workers(
                    client, 1, f"scheduler {scheduler}", f"start one: `dask worker {scheduler}`"
                )
        else:
            client = stack.enter_context(_local(workers, memory_gb))
        client.register_plugin(_plugin(store.resolve()))
        yield client


@contextmanager
def _local(workers: int, memory_gb: float | None) -> Iterator[Client]:
    """Workers in this process or as processes of their own, out of reach for other machines."""
    from distributed import Client, LocalCluster

    limit: Any = 0 if not workers else f"{memory_gb}GB" if memory_gb else "auto"
    with contextlib.ExitStack() as stack:
        with _deaf_to(signal.SIGINT):
            cluster = LocalCluster(
                n_workers=0,
                threads_per_worker=1,
                processes=workers > 0,
                memory_limit=limit,
                host=_LOOPBACK if workers else None,  # None: nothing listens for work, all is one process
                dashboard_address=f"{_LOOPBACK}:0",
                worker_dashboard_address=f"{_LOOPBACK}:0",
                silence_logs=logging.CRITICAL,
            )
            stack.enter_context(cluster)
        # Stopped while it connects it would never be closed, and wait half a minute for a cluster that has
        # gone before it says so.
        with _deaf_to(signal.SIGINT, signal.SIGTERM):
            client = stack.enter_context(Client(cluster, set_as_default=False))
        # Also later: a worker that ends is replaced.
        stack.enter_context(_script_left_alone())
        cluster.scale(max(1, workers))
        _wait_for_workers(client, max(1, workers), "local workers", "fewer of them, or a machine less busy")
        yield client


def _wait_for_workers(client: Client, count: int, where: str, remedy: str) -> None:
    """Return once so many workers are there.

    Raises
    ------
    BackendError
        They are not, after a while.
    """
    from distributed import TimeoutError as TooLate

    limit_s = _WORKER_SECONDS + count
    try:
        client.wait_for_workers(count, timeout=limit_s)
    except TooLate as error:
        there = len(client.scheduler_info()["workers"])
        raise BackendError(
            f"{there} of {count} workers have begun", where=where, rule=f"all of them within {limit_s} s",
            remedy=remedy,
        ) from error  # fmt: skip


@contextmanager
def _script_left_alone() -> Iterator[None]:
    """Processes begun within it do not run the script that began them, which may have no `__main__` guard.

    A new process imports the file of `__main__`, if it has one, for what the script defines; no work of ours
    is defined there.
    """
    main = sys.modules["__main__"]
    known = {name: getattr(main, name) for name in ("__file__", "__spec__") if hasattr(main, name)}
    try:
        main.__spec__ = None
        if "__file__" in known:
            del main.__file__
        yield
    finally:
        for name, value in known.items():
            setattr(main, name, value)


@contextmanager
def _deaf_to(*stops: signal.Signals) -> Iterator[None]:
    """Threads begun within it, and all processes that they begin, never see the Ctrl-C of the terminal, or
    another stop.

    The main thread hears of it afterwards, and ends the workers.
    """
    _begin_clearing_away()
    heard: list[int] = []
    # A thread from before may still take the stop, and Python would pass it on to the main thread at once.
    is_main = threading.current_thread() is threading.main_thread()
    usual = {stop: signal.signal(stop, lambda number, _: heard.append(number)) for stop in stops if is_main}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, stops)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for stop, handler in usual.items():
            signal.signal(stop, handler)
        for number in heard[:1]:
            signal.raise_signal(number)


def _begin_clearing_away() -> None:
    """Start the process that clears away what others leave, in silence.

    It would be begun with the first worker, and let Ctrl-C in again. What workers that were stopped have left
    is nobody's mistake, and gone when it would say so.
    """
    before = os.environ.get(_WARNINGS)
    os.environ[_WARNINGS] = "ignore"
    try:
        multiprocessing.resource_tracker.ensure_running()
    finally:
        if before is None:
            del os.environ[_WARNINGS]
        else:
            os.environ[_WARNINGS] = before


def _check_keys(scheduler: str) -> None:
    """TLS needs a certificate and a key, which Dask's configuration names."""
    from distributed.security import Security

    if scheduler.startswith("tls://") and Security().get_connection_args("client")["ssl_context"] is None:
        raise UsageError(
            "no keys for TLS",
            where=f"scheduler {scheduler}",
            rule="ca-file, client.cert and client.key of distributed.comm.tls",
            remedy="set DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ..__CLIENT__CERT and ..__CLIENT__KEY",
        )


def prepare_worker(store: str, version: str) -> None:
    """Make a worker ready: same version, sees the store, backend started once.

    Raises
    ------
    BackendError
        Something of that is missing.
    """
    where = f"worker {os.uname().nodename}:{os.getpid()}"
    if version != __version__:
        raise BackendError(
            "the worker has another version of lightfield", where=where, found=__version__, rule=version
        )
    if not Path(store, ".lightfield").is_dir():
        raise BackendError(
            "the worker does not see the store",
            where=where,
            found=store,
            rule="a folder that all machines share",
            remedy="put the store on a shared disk",
        )
    use_backend()


def _plugin(store: Path) -> Any:
    from distributed import WorkerPlugin

    class Ready(WorkerPlugin):
        """Prepares every worker, also one that joins or is restarted later."""

        name = f"lightfield {store}"

        def __init__(self, *told: str) -> None:
            self.told = told

        def setup(self, worker: Any) -> None:
            prepare_worker(*self.told)

    return Ready(str(store), __version__)
