"""The one name for an array of floating point numbers, a few of many, and numbers as JSON holds them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]

#: Keeps quotients by nothing, and logarithms of it, finite: below the square of any reading.
TINY = 1e-300


def finite(value: float) -> float | None:
    """The number; None where it is none, or infinite."""
    return float(value) if math.isfinite(value) else None


def evenly(count: int, most: int) -> list[int]:
    """Indices of at most so many, evenly chosen, the first and the last among them."""
    return [int(i) for i in np.unique(np.linspace(0, count - 1, min(count, most)).round())]


def jackknife_stderr(parts: Array) -> Array:
    """Standard error of a number by its values without one of n independent batches (Efron 1982, section 3).

    Parameters
    ----------
    parts : array, shape (n, ...)
    """
    off = parts - parts.mean(axis=0)
    return np.asarray(np.sqrt((len(parts) - 1) / len(parts) * (off**2).sum(axis=0)))


def jsonable(value: object) -> object:
    """The same as JSON may hold it: what is no finite number is null."""
    if isinstance(value, dict):
        return {str(key): jsonable(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(inner) for inner in value]
    if isinstance(value, np.ndarray):
        return jsonable(value.tolist())
    if isinstance(value, float | np.floating):
        return finite(float(value))
    if isinstance(value, np.integer):
        return int(value)
    return bool(value) if isinstance(value, np.bool_) else value
