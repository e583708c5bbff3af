"""Memory that is free goes back to the system."""

from __future__ import annotations

import ctypes


def give_back() -> None:
    """Give back what glibc keeps of arrays that are gone: after five diagnoses 385 of 590 MB."""
    try:
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc alone
    except (OSError, TypeError):  # of a system whose program is no library
        return
    if trim is not None:
        trim(0)
