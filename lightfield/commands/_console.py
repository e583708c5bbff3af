"""Tables and progress on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.segment import Segment

from lightfield.commands._terminal import printable


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
    """A line on standard error with the stage and the time since it began; nothing unless that is a terminal.

    Yields
    ------
    callable
        Takes the name of the stage that begins.
    """
    output = console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=output, disable=not output.is_terminal, transient=True) as line:
        task = line.add_task(first)
        yield lambda stage: line.reset(task, description=stage)
