"""How steeply readings change with their place: what errors of position make of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.fitting.forward import SceneForward
from lightfield.scene.water.coefficients import absorption_per_m


def position_slope(forward: SceneForward, values: Mapping[str, float]) -> Array:
    """|gradient| of the readings with respect to position, per metre, shape (n,).

    Scattered and reflected light moves aside with the lamp, as in `DiffuseResponse`, and falls with the
    square of the distance and by absorption: right to 10 % in water that scatters 0.4 per metre, to a
    third where it scatters 2 (tests/unit/fitting/test_position_slope.py).
    """
    light, r, step_m = forward.light, forward.readings, 1e-3
    scene, square = light.scenes.at(values, validate=False), np.zeros(forward.size)
    here, rest = light.direct(scene, r), light.rest(values)
    absorption = absorption_per_m(scene.water, light.diffuse.wavelengths_nm)[light.diffuse.channels[1]]
    falling = rest * (2 / np.maximum(np.abs(r.z_m), step_m) + absorption)
    for axis, offset in (("x_m", "lamp.offset_x_m"), ("y_m", "lamp.offset_y_m"), ("z_m", None)):
        moved: dict[str, Any] = {axis: getattr(r, axis) + step_m}
        change = light.direct(scene, replace(r, **moved)) - here
        if offset is None:
            change -= step_m * falling
        elif rest.any():
            aside = float(scene.get(offset)) - step_m
            change += light.rest({**values, offset: aside}) - rest
        square += (change / step_m) ** 2
    return np.asarray(np.sqrt(square) * forward.reader.per_light(values))
