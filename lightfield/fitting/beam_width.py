"""How wide a beam is, from readings alone."""

from __future__ import annotations

import numpy as np

from lightfield.readings import Readings
from lightfield.scene import Scene

#: The half width that every fit of a Gaussian beam frees.
WIDTH = "lamp.hwhm_deg"


def beam_width_deg(scene: Scene, readings: Readings) -> float:
    """Half width of the beam, roughly, from the readings alone; the scene's value where they do not show it.

    Regression of ln(value r^2) on theta^2 over the brighter half of every plane, a level per plane, medium
    and wavelength.
    """
    x, y, z = (np.asarray(getattr(readings, k), float) for k in ("x_m", "y_m", "z_m"))
    value = np.asarray(readings.value, float)
    theta2 = np.arctan2(np.hypot(x, y), z) ** 2
    wavelength = np.nan_to_num(np.asarray(readings.wavelength_nm, float))
    kinds = np.stack([np.round(z, 3), np.asarray(readings.medium) == "air", np.round(wavelength, 3)], axis=1)
    _, group = np.unique(kinds, axis=0, return_inverse=True)
    group = group.ravel()
    top = np.full(int(group.max()) + 1, -np.inf)
    np.maximum.at(top, group, value)
    lit = (value > 0.4 * top[group]) & (value > 0)
    left, right = 0.0, 0.0
    for k in np.unique(group[lit]):
        mine = lit & (group == k)
        t = theta2[mine] - theta2[mine].mean()
        left += float(t @ t)
        right -= float(t @ np.log(value[mine] * (x[mine] ** 2 + y[mine] ** 2 + z[mine] ** 2)))
    if left <= 0 or right <= 0:
        return float(scene.lamp.hwhm_deg)
    return float(np.clip(np.degrees(np.sqrt(np.log(2) * left / right)), 0.5, 60.0))
