"""Beside: work that takes a while, in another thread or process; it says how far it is, and can be ended."""

from __future__ import annotations

import asyncio
import multiprocessing
import signal
import threading
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Protocol, TypeVar

from threadpoolctl import threadpool_limits

from lightfield.errors import LightfieldError
from lightfield.render.diffuse.directed import Elsewhere

Made = TypeVar("Made")
#: Seconds that an ended process is waited for.
_PATIENCE_S = 5.0


class Tell(Protocol):
    """Is told what begins, and which part of it is done where that is known; what it raises ends the work."""

    def __call__(self, stage: str, part: float | None = None) -> None: ...


def silent(stage: str, part: float | None = None) -> None:
    """Where nobody follows."""


class Worker:
    """A thread that computes one thing after the other, and keeps nobody waiting at the end."""

    def __init__(self) -> None:
        self._waiting: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self.thread = threading.Thread(target=self._work, name="explorer", daemon=True)
        self.thread.start()

    def _work(self) -> None:
        # On many small matrices more BLAS threads only get in each other's way.
        with threadpool_limits(1, "blas"):
            while True:
                self._waiting.get()()

    async def do(self, what: Callable[[], Made]) -> Made:
        """What a function gives, computed in the thread."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[Made] = loop.create_future()

        def settle(value: Made | None, error: BaseException | None) -> None:
            if future.done():
                return
            if error is not None:
                future.set_exception(error)
            else:
                future.set_result(value)  # type: ignore[arg-type]

        def run() -> None:
            value, error = None, None
            try:
                value = what()
            except Exception as found:
                error = found
            if not loop.is_closed():
                loop.call_soon_threadsafe(settle, value, error)

        self._waiting.put(run)
        return await future


class Aside:
    """Work in the other thread, which is told of and ended as a job is."""

    def __init__(self, name: str) -> None:
        self.name, self.stage, self.ended = name, "starting", False
        self.part: float | None = None

    def end(self) -> None:
        """What it does ends when it next says how far it is."""
        self.ended = True


class Job:
    """Work in a process of its own.

    Parameters
    ----------
    name : str
        What is done, for people.
    work : callable
        Takes `tell`, to be called with what begins; must be importable by another process.
    """

    def __init__(self, name: str, work: Callable[..., object], *arguments: object) -> None:
        self.name, self.stage = name, "starting"
        self.part: float | None = None
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=_run, args=(theirs, partial(work, *arguments)), daemon=True)
        self._process.start()
        theirs.close()

    def end(self) -> None:
        """End it, whatever it is doing."""
        self._process.terminate()
        self._process.join(_PATIENCE_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(_PATIENCE_S)
        self.pipe.close()


def elsewhere(tell: Tell) -> Elsewhere:
    """Runs work in a process of its own, and waits; what `tell` raises ends it.

    Where it fails, nothing is said: whoever asked for it does it again by himself, and hears why.
    """

    def run(work: Callable[..., None]) -> None:
        job = Job("trace", work)
        try:
            while (heard := job.pipe.recv())[0] == "stage":
                tell(*heard[1])
        except EOFError:
            pass
        finally:
            job.end()

    return run


def _run(pipe: Connection, work: Callable[[Tell], object]) -> None:
    """In the process: the stages as text, then what was found or the error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the server's, which ends this process

    def tell(stage: str, part: float | None = None) -> None:
        pipe.send(("stage", (stage, part)))

    try:
        found = work(tell)
    except LightfieldError as error:
        pipe.send(("error", str(error)))
    else:
        pipe.send(("done", found))
