"""What it would cost a fit that its water must not amplify.

A gradient of the absorption follows many a curved decay, with water that gives light back at one end of the
tank; and so does water that ages, at one end of the scan. How much worse the readings are met by water that
attenuates everywhere is told by the fit: the square of what is lacking, in standard errors (Wald 1943,
doi:10.1090/S0002-9947-1943-0012401-3). No real water follows a straight line to the end of a tank, though:
what readings insist on stays, however far the line goes below zero there.
"""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array
from lightfield.fitting.curves import field_of
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.formula.path import least_attenuation_per_m
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import acts_on
from lightfield.scene.water.ageing import ages
from lightfield.scene.water.layers import is_layered

#: Part of its standard error by which a parameter is moved to see what the water does. Chosen: a slope.
_MOVED = 0.01
#: What amplifying costs at most: odds of 150, where evidence is called very strong (Kass and Raftery 1995,
#: doi:10.1080/01621459.1995.10476572). Without an end a gradient of 37 sigma that goes 0.036 per m below zero
#: at the far wall gave way to gains of planes.
_MOST = 10.0


def lowest_attenuation_per_m(fit: Fit) -> float:
    """Least attenuation that light meets on its way, 1/m, in water that changes along the tank or in time."""
    forward = fit.model.forward
    if not isinstance(forward, SceneForward) or not any(map(_adds_to_water, fit.paths)):
        return 0.0
    return _least(forward, fit, fit.u)


def cost_of_amplifying(fit: Fit) -> float:
    """Chi-square, in units of the whitening, that water would add which attenuates everywhere: 10 at most."""
    forward, lowest = fit.model.forward, lowest_attenuation_per_m(fit)
    if not isinstance(forward, SceneForward) or lowest >= 0:
        return 0.0
    covariance = np.nan_to_num(fit.covariance())
    steps, slopes = _MOVED * np.sqrt(np.diag(covariance)), np.zeros(len(fit.u))
    for i in np.flatnonzero(steps):
        moved = fit.u.copy()
        moved[i] += steps[i]
        slopes[i] = (_least(forward, fit, moved) - lowest) / steps[i]
    variance = float(slopes @ covariance @ slopes)
    return min(lowest**2 / variance, _MOST) if variance > 0 else _MOST


def _adds_to_water(path: str) -> bool:
    """May it make water amplify?"""
    return bool(acts_on(field_of(path)) & (Acts.LAYERS | Acts.AGEING))


def _least(forward: SceneForward, fit: Fit, u: Array) -> float:
    water = forward.scenes.at(fit.model.values(u), validate=False).water
    if not (is_layered(water) or ages(water)):
        return 0.0
    readings = forward.readings
    wet = np.asarray(readings.medium) != "air"
    y_m, z_m, time_s = (np.asarray(x)[wet] for x in (readings.y_m, readings.z_m, readings.time_s))
    return least_attenuation_per_m(water, forward.light.diffuse.wavelengths_nm, y_m, z_m, time_s)
