"""Memory that is free goes back to the system, and what is kept to be quick is no more than so much."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

Key = TypeVar("Key")
Value = TypeVar("Value")


def give_back() -> None:
    """Give back what glibc keeps of arrays that are gone: after five diagnoses 385 of 590 MB. Takes five
    milliseconds."""
    try:
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc alone
    except (OSError, TypeError):  # of a system whose program is no library
        return
    if trim is not None:
        trim(0)


def free_bytes() -> float:
    """Memory that programs may still take, as Linux estimates it; infinite where nothing tells."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return next(1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError, StopIteration):
        return float("inf")


def byte_size(count: float) -> str:
    """A number of bytes in the unit that suits it."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


class Latest(dict[Key, Value]):
    """What was put in or taken last, so many at most; whoever asks for what is gone makes it again.

    Parameters
    ----------
    most : int
        So many are kept.
    """

    most = 1 << 30  # until a copy, or what was pickled, has its own

    def __init__(self, most: int) -> None:
        super().__init__()
        self.most = most

    def __getitem__(self, key: Key) -> Value:
        value = super().__getitem__(key)
        self[key] = value
        return value

    def __setitem__(self, key: Key, value: Value) -> None:
        self.pop(key, None)
        super().__setitem__(key, value)
        while len(self) > self.most:
            del self[next(iter(self))]


def kept_within(
    bytes_: float, fewest: int, size_of: Callable[[Value], int]
) -> Callable[[Callable[..., Value]], Callable[..., Value]]:
    """`functools.lru_cache` of values that are unlike in size: the latest, in so many bytes together.

    Parameters
    ----------
    fewest : int
        So many are kept whatever their size.
    size_of : callable
        Bytes of a value.
    """

    def of(function: Callable[..., Value]) -> Callable[..., Value]:
        kept: dict[tuple[Any, ...], tuple[Value, int]] = {}
        held = 0

        @wraps(function)
        def asked(*given: Any) -> Value:
            nonlocal held
            if given in kept:
                kept[given] = kept.pop(given)
                return kept[given][0]
            value = function(*given)
            kept[given] = value, size_of(value)
            held += kept[given][1]
            while held > bytes_ and len(kept) > fewest:
                held -= kept.pop(next(iter(kept)))[1]
            return value

        return asked

    return of
