"""How far long work is, on standard error: a bar on a terminal, else a line every ten seconds."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from lightfield.commands.shared.console import console
from lightfield.progress import duration, heard_by, stopped

#: Seconds between two lines; what is done before the first says nothing.
_EVERY_S = 10.0
#: Of less than this part done, no time that is left can be told.
_TELLING = 0.01


@contextmanager
def status_lines(name: str, every_s: float = _EVERY_S) -> Iterator[Callable[[str, float], None]]:
    """A line of how far the work is every so many seconds, also while the work itself says nothing.

    Yields
    ------
    callable
        Takes what has been done in words, and what part of all it is, 0 to 1.
    """
    began, over = time.monotonic(), threading.Event()
    stopped.clear()
    said: list[tuple[str, float]] = [("", 0.0)]

    def note(words: str, done: float) -> None:
        said[0] = words, done

    def speak() -> None:
        while not over.wait(every_s) and not stopped.is_set():
            words, done = said[0]
            told = "; ".join(filter(None, (words, times(time.monotonic() - began, done))))
            print(f"{name}: {told}", file=sys.stderr, flush=True)

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
    if _TELLING <= done < 1:
        words += f", about {duration(passed_s * (1 - done) / done)} left"
    return words


@contextmanager
def progress_of(name: str) -> Iterator[None]:
    """Say on standard error how far what is done within is: a bar on a terminal, else a line now and then."""
    output = console(stderr=True)
    if not output.is_terminal:
        with status_lines(name) as note, heard_by(note):
            yield
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Bar(*columns, console=output, transient=True) as bar:
        task = bar.add_task(name, total=1.0)
        with heard_by(
            lambda words, part: bar.update(
                task, completed=part, description=f"{name}: {words}" if words else name
            )
        ):
            yield


@contextmanager
def stage_line(first: str) -> Iterator[Callable[[str], None]]:
    """The stage of work whose end nobody knows, and the time, on a terminal; else a line now and then.

    What traces light within a stage is heard too.

    Yields
    ------
    callable
        Takes the name of the stage that begins, or how far it is.
    """
    output = console(stderr=True)
    if not output.is_terminal:
        with status_lines(first) as note, _stages(lambda words: note(words, 0.0)) as begin:
            yield begin
        return
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Bar(*columns, console=output, transient=True) as line:
        task = line.add_task(first)
        with _stages(lambda words: line.update(task, description=words or first)) as begin:
            yield begin


@contextmanager
def _stages(show: Callable[[str], None]) -> Iterator[Callable[[str], None]]:
    """What takes the name of a stage, and shows it with what is told within."""
    stage = ""

    def begin(name: str) -> None:
        nonlocal stage
        stage = name
        show(name)

    def hear(words: str, part: float) -> None:
        going_on = f"{words}, {100 * part:.0f} %" if words and part < 1 else ""
        show("; ".join(filter(None, (stage, going_on))))

    with heard_by(hear):
        yield begin
