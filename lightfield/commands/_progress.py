"""What a long command says where there is no terminal: a line every ten seconds on standard error."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lightfield.sweep.estimate import duration

#: Seconds between two lines; what is done before the first says nothing.
EVERY_S = 10.0
#: Of less than this part done, no time that is left can be told.
TELLING = 0.01


@contextmanager
def status_lines(name: str, every_s: float = EVERY_S) -> Iterator[Callable[[str, float], None]]:
    """A line of how far the work is every so many seconds, also while the work itself says nothing.

    Yields
    ------
    callable
        Takes what has been done in words, and what part of all it is, 0 to 1.
    """
    began, over = time.monotonic(), threading.Event()
    said: list[tuple[str, float]] = [("starting", 0.0)]

    def note(words: str, done: float) -> None:
        said[0] = words, done

    def speak() -> None:
        while not over.wait(every_s):
            words, done = said[0]
            print(f"{name}: {words}; {times(time.monotonic() - began, done)}", file=sys.stderr, flush=True)

    speaker = threading.Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield note
    finally:
        over.set()
        speaker.join()


def times(passed_s: float, done: float) -> str:
    """Time since the start, and how much is left if the rest is as slow."""
    words = f"{duration(passed_s)} so far"
    if TELLING <= done < 1:
        words += f", about {duration(passed_s * (1 - done) / done)} left"
    return words


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
