"""The console that tables and progress are printed on."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from typing import Any

from rich.console import Console
from rich.segment import Segment

from lightfield.commands.shared.terminal import printable

#: Columns where no terminal says how many: no table is cut to fit. Chosen: that of `compare` has 82.
_WIDE = 100


class PlainConsole(Console):
    """Prints what the terminal obeys in text as `printable` does."""

    def render(self, *args: Any, **options: Any) -> Iterator[Segment]:
        for part in super().render(*args, **options):
            yield part if part.control else part._replace(text=printable(part.text))


def console(*, stderr: bool = False) -> Console:
    """A console for tables and progress, whose text is printable and taken as it stands."""
    told = (sys.stderr if stderr else sys.stdout).isatty() or "COLUMNS" in os.environ
    return PlainConsole(stderr=stderr, markup=False, width=None if told else _WIDE)
