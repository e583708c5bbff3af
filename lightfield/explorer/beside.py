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
from typing import Any, Protocol, TypeVar

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


class EndedError(LightfieldError):
    """Somebody ended what was under way."""


class Underway:
    """Something that takes a while: how far it is, and whether somebody ended it.

    Parameters
    ----------
    name : str
        What is done, for people.
    heard : callable
        Called in the loop with this, whenever it has said how far it is.

    Attributes
    ----------
    work : Future, optional
        What it waits for, which nobody needs any more once it is ended.
    """

    def __init__(self, name: str, heard: Callable[[Underway], None]) -> None:
        self.name, self.stage, self.ended = name, "starting", False
        self.part: float | None = None
        self.work: asyncio.Future[Any] | None = None
        self._heard, self._loop = heard, asyncio.get_running_loop()

    def tell(self, stage: str, part: float | None = None) -> None:
        """Say, in any thread, how far it is.

        Raises
        ------
        EndedError
        """
        if self.ended:
            raise EndedError("cancelled", found=stage, remedy="nothing has changed")
        self.stage, self.part = stage, part
        self._loop.call_soon_threadsafe(self._heard, self)

    def end(self) -> None:
        """A process ends at once; a thread when it next says how far it is."""
        self.ended = True
        if self.work is not None:
            self.work.cancel()


class Worker:
    """A thread that computes one thing after the other, and keeps nobody waiting at the end.

    Attributes
    ----------
    tell : Tell
        Of what is computed now.
    """

    def __init__(self) -> None:
        self.tell: Tell = silent
        self._waiting: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self.thread = threading.Thread(target=self._work, name="explorer", daemon=True)
        self.thread.start()

    def _work(self) -> None:
        # On many small matrices more BLAS threads only get in each other's way.
        with threadpool_limits(1, "blas"):
            while True:
                self._waiting.get()()

    async def do(self, what: Callable[[], Made], tell: Tell = silent) -> Made:
        """What a function gives, computed in the thread; `tell` hears how far it is."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[Made] = loop.create_future()

        def settle(give: Callable[[], None]) -> None:
            if not future.done():
                give()

        def run() -> None:
            self.tell = tell
            give: Callable[[], None]
            try:
                give = partial(future.set_result, what())
            except Exception as error:
                give = partial(future.set_exception, error)
            if not loop.is_closed():
                loop.call_soon_threadsafe(settle, give)

        self._waiting.put(run)
        return await future


class _Process:
    """Work in a process of its own, and the pipe by which it says how far it is.

    Parameters
    ----------
    work : callable
        Takes `tell`, to be called with what begins; must be importable by another process.
    """

    def __init__(self, work: Callable[..., object]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=_run, args=(theirs, work), daemon=True)
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


async def in_process(work: Callable[..., Made], tell: Tell) -> Made:
    """What a function gives, computed in a process of its own, which ends if nobody waits for it any more.

    Parameters
    ----------
    work : callable
        As `_Process` takes it.

    Raises
    ------
    LightfieldError
        What `work` raised, or the process ended without a word.
    """
    process, heard, loop = _Process(work), asyncio.Event(), asyncio.get_running_loop()
    loop.add_reader(process.pipe.fileno(), heard.set)
    try:
        while True:
            await heard.wait()
            heard.clear()
            kind, what = process.pipe.recv()
            if kind == "done":
                return what
            if kind == "error":
                raise what
            tell(*what)
    except (EOFError, OSError) as error:
        raise LightfieldError("its process ended unexpectedly", remedy="what it printed says why") from error
    finally:
        loop.remove_reader(process.pipe.fileno())
        process.end()


def elsewhere(tell: Tell) -> Elsewhere:
    """Runs work in a process of its own, and waits; what `tell` raises ends it.

    Where it fails, nothing is said: whoever asked for it does it again by himself, and hears why.
    """

    def run(work: Callable[..., None]) -> None:
        process = _Process(work)
        try:
            while (heard := process.pipe.recv())[0] == "stage":
                tell(*heard[1])
        except EOFError:
            pass
        finally:
            process.end()

    return run


def _run(pipe: Connection, work: Callable[[Tell], object]) -> None:
    """In the process: the stages as text, then what was found, or the error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the server's, which ends this process

    def tell(stage: str, part: float | None = None) -> None:
        pipe.send(("stage", (stage, part)))

    try:
        found = work(tell)
    except LightfieldError as error:
        pipe.send(("error", error))
    else:
        pipe.send(("done", found))
