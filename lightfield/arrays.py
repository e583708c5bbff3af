"""The one name for an array of floating point numbers, and how numbers become JSON, which has no infinity."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]


def finite(value: float) -> float | None:
    """The number; None where it is none, or infinite."""
    return float(value) if math.isfinite(value) else None


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
