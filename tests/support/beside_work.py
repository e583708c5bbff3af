"""Work for another process that takes no time, in place of a diagnosis or a trace."""

from __future__ import annotations

import time
from types import SimpleNamespace

from lightfield.errors import RenderError


def a_verdict(*given: object) -> SimpleNamespace:
    """As `diagnosed` gives it, after a moment."""
    time.sleep(0.3)
    return SimpleNamespace(verdict={"kind": "of the first readings"}, report="of the first readings")


def a_trace(*given: object) -> None:
    """As `trace_maps` leaves it."""


def an_error(*given: object) -> None:
    raise RenderError("no light")
