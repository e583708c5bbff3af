"""What the small-angle solution of light that was scattered more than once leaves out: a factor near one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array

#: Beyond these the fit was not made, and is held: optical depth of what is not scattered forward, distance
#: from the axis over z, and 1 - g.
_MOST_DEPTH, _MOST_TANGENT, _MOST_LOSS = 1.6, 1.2, 0.3


def closure(
    b: ArrayLike, loss: float, tangent: Array, half_width_rad: float, z_m: Array, apparent_distance_m: float
) -> Array:
    """Light of traces that was scattered more than once over that of the small-angle solution.

    Fitted to 120 traced fields in unbounded water of Henyey-Greenstein scattering, drawn at random (g 0.7 to
    0.98, b 0.05 to 1 per m, half widths 2 to 35 degrees, 0.6 to 10 m). In 60 others all scattered light is
    then right to 2.1 % rms (without this factor 5.6 %); up to b = 0.4 and with g from 0.92 to 0.6 %. It need
    not be better: traces tell the rest.

    Parameters
    ----------
    b : float or array, m^-1
        Scattering coefficient.
    loss : float
        1 - g, g the mean cosine of a scattering.
    tangent : array
        Distance from the axis over z.
    half_width_rad : float
        Of the beam.
    z_m : array, m
    apparent_distance_m : float, m
    """
    depth = np.minimum(np.asarray(b) * loss * z_m, _MOST_DEPTH)
    aside = np.minimum(tangent, _MOST_TANGENT)
    seen = half_width_rad**2 / (1 + apparent_distance_m / z_m)
    on_axis = 0.0655 + 0.1201 * depth + 1.1651 * seen
    beside = (0.4904 * depth - 1.1444) * aside
    return np.asarray(np.exp(0.3656 * min(loss, _MOST_LOSS) + depth * (on_axis + beside)))
