"""How far long work is: told by what does it, heard by whoever waits.

A trace may lie five calls below who waits for it. So the listener belongs to a `with` and to one thread, and
the functions between need not hand it on; where nobody listens, nothing is told.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: Set by who stops the work: while it is cleared away nobody asks how far it was.
stopped = threading.Event()
#: Takes words, and what part of the work is done, 0 to 1.
Listener = Callable[[str, float], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def heard_by(listener: Listener) -> Iterator[None]:
    """Let a listener hear what is told within."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


def tell(words: str, part: float) -> None:
    """Say how far the piece of work is that surrounds this call.

    Parameters
    ----------
    part : float
        What is done of it, 0 to 1.
    """
    listener = _listener.get()
    if listener is not None:
        listener(words, part)


@contextmanager
def step(number: int, of: int, name: str = "") -> Iterator[None]:
    """One of so many steps of like length: what is told within is that part of the work around it.

    Parameters
    ----------
    number : int
        From 0.
    """
    outer = _listener.get()
    if outer is None:
        yield
        return

    def inner(words: str, part: float) -> None:
        outer(": ".join(filter(None, (name, words))), (number + part) / of)

    with heard_by(inner):
        inner("", 0.0)
        yield
    outer(name, (number + 1) / of)


def duration(seconds: float) -> str:
    """A time in the unit that suits it."""
    if seconds < 120:
        return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def part_of_trace(photons: float, reached: float, requested: float, max_photons: float) -> float:
    """What part of a trace is done: its error falls with the root of the photons, unless they run out.

    Parameters
    ----------
    photons, max_photons : float
        So far, and at most.
    reached, requested : float
        Relative errors.
    """
    by_error = (requested / reached) ** 2 if 0 < reached < float("inf") else 0.0
    return min(1.0, max(by_error, photons / max_photons))
