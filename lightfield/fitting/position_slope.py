"""How steeply readings change with their place: what errors of position make of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.fitting.forward import SceneForward

#: Places are moved so far for a slope, m. Chosen: next to nothing beside a beam.
_STEP_M = 1e-3


def position_slope(forward: SceneForward, values: Mapping[str, float]) -> Array:
    """|gradient| of the readings with respect to position, per metre, shape (n,).

    That of scattered and reflected light is `LightSource.slopes_of_rest`: right to 10 % in water that
    scatters 0.4 per metre, to a third where it scatters 2 (tests/unit/fitting/test_position_slope.py).
    """
    light, r, square = forward.light, forward.readings, np.zeros(forward.size)
    scene = light.scenes.at(values, validate=False)
    here, rest = light.direct(scene, r), light.slopes_of_rest(values)
    for axis, slope in zip(("x_m", "y_m", "z_m"), rest, strict=True):
        moved: dict[str, Any] = {axis: getattr(r, axis) + _STEP_M}
        square += ((light.direct(scene, replace(r, **moved)) - here) / _STEP_M + slope) ** 2
    return np.asarray(np.sqrt(square) * forward.reader.per_light(values))
