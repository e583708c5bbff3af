"""How far long work is, where a notebook runs it: one line, replaced now and then, empty at the end."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from lightfield.progress import duration, heard_by

#: Seconds before the line appears, and from one text to the next.
FIRST_S, EVERY_S = 3.0, 1.0


@contextmanager
def told_in_notebook(name: str) -> Iterator[Callable[[str], None]]:
    """Show in a notebook's cell how far what is done within is; elsewhere stay silent.

    Yields
    ------
    callable
        Takes the name of the stage that begins, where the work within does not tell it.
    """
    display = _display()
    if display is None:
        yield lambda stage: None
        return
    began = time.monotonic()
    due, shown = began + FIRST_S, None

    def show(words: str) -> None:
        nonlocal due, shown
        now = time.monotonic()
        if now < due:
            return
        due = now + EVERY_S
        text = {"text/plain": f"{name}: {words + '; ' if words else ''}{duration(now - began)} so far"}
        if shown is None:
            shown = display(text, raw=True, display_id=True)
        else:
            shown.update(text, raw=True)

    try:
        with heard_by(lambda words, part: show(", ".join(filter(None, (words, f"{100 * part:.0f} % done"))))):
            yield show
    finally:
        if shown is not None:
            shown.update({"text/plain": ""}, raw=True)


def _display() -> Callable[..., Any] | None:
    """IPython's `display` where a notebook runs this, not a terminal; IPython is there then."""
    ipython: Any = sys.modules.get("IPython")  # need not be installed
    shell = None if ipython is None else ipython.get_ipython()
    return None if getattr(shell, "kernel", None) is None else ipython.display.display
