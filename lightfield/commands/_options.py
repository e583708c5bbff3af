"""Kinds of option values that several sub-commands take; argparse turns the complaints into errors."""

from __future__ import annotations

from argparse import ArgumentTypeError

LARGEST_SEED = 2**31 - 1


def seed_number(text: str) -> int:
    """Seed of random numbers."""
    return _whole(text, 0, LARGEST_SEED)


def thread_count(text: str) -> int:
    """Threads of the processor."""
    return _whole(text, 1, 1024)


def _whole(text: str, low: int, high: int) -> int:
    try:
        number = int(text)
    except ValueError:
        number = low - 1
    if not low <= number <= high:
        raise ArgumentTypeError(f"found {text!r}; rule: a whole number, {low} to {high}")
    return number
