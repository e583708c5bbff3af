"""Tables and progress on a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.segment import Segment

from lightfield.commands._terminal import printable

#: Between two lines of progress where there is no terminal.
EVERY_S = 10.0


class _Plain(Console):
    """Prints what the terminal obeys in text as `printable` does."""

    def render(self, *args: Any, **options: Any) -> Iterator[Segment]:
        for part in super().render(*args, **options):
            yield part if part.control else part._replace(text=printable(part.text))


def console(*, stderr: bool = False) -> Console:
    """A console for tables and progress, whose text is printable and taken as it stands."""
    return _Plain(stderr=stderr, markup=False)


@contextmanager
def stage_line(first: str) -> Iterator[Callable[[str], None]]:
    """A line on standard error with the stage and the time; where that is no terminal, one now and then.

    Yields
    ------
    callable
        Takes the name of the stage that begins, or how far it is.
    """
    output = console(stderr=True)
    if not output.is_terminal:
        with _now_and_then(first) as told:
            yield told
        return
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=output, transient=True) as line:
        task = line.add_task(first)
        yield lambda stage: line.update(task, description=stage)


@contextmanager
def _now_and_then(first: str) -> Iterator[Callable[[str], None]]:
    """A line on standard error every ten seconds: nothing of what is quick, no log of a thousand lines."""
    latest, done, begun = [first], Event(), time.monotonic()

    def tell() -> None:
        while not done.wait(EVERY_S):
            print(f"{time.monotonic() - begun:.0f} s: {latest[0]}", file=sys.stderr, flush=True)

    def told(stage: str) -> None:
        latest[0] = stage

    teller = Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield told
    finally:
        done.set()
        teller.join()
