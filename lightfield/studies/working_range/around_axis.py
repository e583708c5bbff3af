"""Light around the axis, smooth in distance and radius."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RectBivariateSpline

from lightfield.arrays import Array

#: Radii at which light is asked for, in widths of the field.
RADII = np.array([0.0, 0.35, 0.7, 1.05, 1.5, 2.0])
#: Steps on which the radius of half intensity is looked for.
_SCAN = 600
#: No light, for logarithms.
DARK = 1e-300


@dataclass(frozen=True, eq=False)
class SmoothField:
    """Light around the axis, round about it: direct light, and a smooth factor for what was scattered.

    Parameters
    ----------
    z_m : array, shape (n_z,), m
    width : callable
        What radii over distances are told in, at distances: the tangent of the beam's half width, less where
        a tank is narrower.
    excess : array, shape (n_z, n_radii)
        ln(all light / direct light) at the radii `RADII` width z.
    direct : callable
        Direct light, 1/m^2, at radii and distances, m: a beam may end as steeply as it likes.
    """

    z_m: Array
    width: Callable[[Array], Array]
    excess: Array
    direct: Callable[[Array, Array], Array]

    @cached_property
    def _spline(self) -> RectBivariateSpline:
        return RectBivariateSpline(self.z_m, RADII**2, self.excess, kx=3, ky=3)

    def at(self, rho2_m2: Array, z_m: Array) -> Array:
        """Light at squared radii and distances, 1/m^2."""
        u2 = rho2_m2 / (self.width(z_m) * z_m) ** 2
        return self.direct(np.sqrt(rho2_m2), z_m) * np.exp(self._spline.ev(z_m, u2))

    def half_radius(self, z_m: float) -> float:
        """Radius at which half of the light on the axis is left, m; NaN beyond the last one."""
        there = np.linspace(0, RADII[-1], _SCAN) ** 2
        at = np.full(len(there), z_m)
        log = np.log(np.maximum(self.at(there * (self.width(at) * z_m) ** 2, at), DARK))
        below = np.flatnonzero(log < log[0] - np.log(2))
        if not below.size:
            return float("nan")
        k = int(below[0])
        u2 = np.interp(np.log(2), log[0] - log[k - 1 : k + 1], there[k - 1 : k + 1])
        return float(np.sqrt(u2) * self.width(at[:1])[0] * z_m)
