"""What a long command is doing, on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def stage_line(first: str) -> Iterator[Callable[[str], None]]:
    """A line on standard error with the stage and the time since it began; nothing unless that is a terminal.

    Yields
    ------
    callable
        Takes the name of the stage that begins.
    """
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as line:
        task = line.add_task(first)
        yield lambda stage: line.reset(task, description=stage)
