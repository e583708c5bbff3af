"""The console that tables and progress are printed on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.console import Console
from rich.segment import Segment

from lightfield.commands.shared.terminal import printable


class PlainConsole(Console):
    """Prints what the terminal obeys in text as `printable` does."""

    def render(self, *args: Any, **options: Any) -> Iterator[Segment]:
        for part in super().render(*args, **options):
            yield part if part.control else part._replace(text=printable(part.text))


def console(*, stderr: bool = False) -> Console:
    """A console for tables and progress, whose text is printable and taken as it stands."""
    return PlainConsole(stderr=stderr, markup=False)
