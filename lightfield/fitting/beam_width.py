"""How wide a beam is, from readings alone."""

from __future__ import annotations

import numpy as np

from lightfield.readings import Readings
from lightfield.readings.columns import LINE_DECIMALS, WAVELENGTH_DECIMALS
from lightfield.scene import Scene
from lightfield.scene.lamp.frame import angle_from_axis

#: The half width that every fit of a Gaussian beam frees.
WIDTH = "lamp.hwhm_deg"
#: A reading is of the brighter half of its plane above this part of its largest. Chosen: what noise leaves of
#: the half.
_BRIGHT = 0.4
#: Ends of what a rough half width may be, deg. Chosen: a laser's, and no beam at all.
_ROUGHLY_DEG = (0.5, 60.0)


def beam_width_deg(scene: Scene, readings: Readings) -> float:
    """Half width of the beam, roughly, from the readings alone; the scene's value where they do not show it.

    Regression of ln(value r^2) on theta^2 over the brighter half of every plane, a level per plane, medium
    and wavelength.
    """
    x, y, z = (np.asarray(getattr(readings, k), float) for k in ("x_m", "y_m", "z_m"))
    value = np.asarray(readings.value, float)
    theta2 = angle_from_axis(x, y, z) ** 2
    wavelength = np.nan_to_num(np.asarray(readings.wavelength_nm, float))
    plane, colour = np.round(z, LINE_DECIMALS), np.round(wavelength, WAVELENGTH_DECIMALS)
    kinds = np.stack([plane, np.asarray(readings.medium) == "air", colour], axis=1)
    _, group = np.unique(kinds, axis=0, return_inverse=True)
    group = group.ravel()
    top = np.full(int(group.max()) + 1, -np.inf)
    np.maximum.at(top, group, value)
    lit = (value > _BRIGHT * top[group]) & (value > 0)
    left, right = 0.0, 0.0
    for k in np.unique(group[lit]):
        mine = lit & (group == k)
        t = theta2[mine] - theta2[mine].mean()
        left += float(t @ t)
        right -= float(t @ np.log(value[mine] * (x[mine] ** 2 + y[mine] ** 2 + z[mine] ** 2)))
    if left <= 0 or right <= 0:
        return float(scene.lamp.hwhm_deg)
    return float(np.clip(np.degrees(np.sqrt(np.log(2) * left / right)), *_ROUGHLY_DEG))
