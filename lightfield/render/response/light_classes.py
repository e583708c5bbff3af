"""Classes of light: by whether it was scattered, and what reflected it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Classes of reflected light that was never scattered, see `light_classes`; all from walls, and from mirrors.
NEVER_SCATTERED = (1, 3)
FROM_WALLS, FROM_MIRRORS = (1, 2), (3, 4)
CLASSES = 5


def light_classes(histories: NDArray[np.integer[Any]]) -> NDArray[np.integer[Any]]:
    """Class of each history: -1 direct; 0 scattered; 1 walls, 2 walls and scattered; 3, 4 mirrors alike.

    A mirror is the surface. Panes are mirrors too, and where there are any, 1 and 2 are all light from walls:
    what mirrors alone sent is known without a trace, and what walls sent by way of them is not.
    """
    n, m, k, *j = histories.T
    if j:
        k = np.where(m > 0, 0, k + j[0])
    return np.where(k > 0, 3 + (n > 0), np.where(m > 0, 1 + (n > 0), np.where(n > 0, 0, -1)))
