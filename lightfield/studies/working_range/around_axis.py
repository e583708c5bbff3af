"""Light around the axis, smooth in distance and radius."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev
from scipy.interpolate import RectBivariateSpline

from lightfield.arrays import TINY, Array
from lightfield.studies.light_at import LightAt

#: Radii at which light is asked for, in widths of the field.
RADII = np.array([0.0, 0.35, 0.7, 1.05, 1.5, 2.0])
#: Steps on which the radius of half intensity is looked for.
_SCAN = 600
#: Polynomials that smooth scattered light in distance and squared radius; the least relative error they weigh
#: by (that of the response's interpolation), so that near light does not outweigh all other.
_DEGREES, _LEAST_ERROR = (4, 3), 1e-3
#: Light whose error is more than this part of it is not told by its trace. Chosen.
_TOLD = 0.5
#: Beside a beam that ends steeply all is scattered, and no factor on direct light: from this part of that on
#: the axis on. A Gaussian has six times as much at the last radius. Chosen.
_BESIDE = 0.01


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
        """Radius at which half of the brightest light on the plane is left, m; NaN beyond the last one."""
        there = np.linspace(0, RADII[-1], _SCAN) ** 2
        at = np.full(len(there), z_m)
        log = np.log(np.maximum(self.at(there * (self.width(at) * z_m) ** 2, at), TINY))
        brightest = int(log.argmax())
        fall = log[brightest] - log[brightest:]
        below = np.flatnonzero(fall > np.log(2))
        if not below.size:
            return float("nan")
        k = int(below[0])
        u2 = np.interp(np.log(2), fall[k - 1 : k + 1], there[brightest:][k - 1 : k + 1])
        return float(np.sqrt(u2) * self.width(at[:1])[0] * z_m)


def told_to_m(light: LightAt, z: Array) -> float:
    """Up to where the photons tell the light on the axis: the first distance with an error that is too large.

    Where none arrives no error is known. Beyond, polynomials through what few say have no end.
    """
    total, diffuse = (v.reshape(len(z), -1)[:, 0] for v in (light.total, light.diffuse))
    error = np.linalg.norm(light.modes.reshape(len(z), len(RADII), -1)[:, 0], axis=1)
    dark = (diffuse <= 0) & (np.maximum.accumulate(diffuse) > 0)
    beyond = np.flatnonzero(dark | (error > _TOLD * total))
    return float(z[max(int(beyond[0]), 1)]) if beyond.size else float(z[-1])


def smooth_excess(light: LightAt, z: Array, radius: Array) -> Array:
    """ln(all light / direct light) without photon noise, shape (n,): a polynomial in z and radius squared.

    Derivatives of the noise would pass for information about the range.
    """
    if not light.diffuse.any():
        return np.zeros(len(z))
    terms = chebyshev.chebvander2d(
        2 * (z - z.min()) / np.ptp(z) - 1, 2 * (radius / RADII[-1]) ** 2 - 1, _DEGREES
    )
    rows = light.direct.reshape(-1, len(RADII))
    lit_up = (rows > _BESIDE * rows[:, :1]).ravel()
    error = np.linalg.norm(light.modes, axis=1) / np.where(lit_up, light.total, 1.0)
    weight = np.where(lit_up, 1.0 / np.maximum(error, _LEAST_ERROR), 0.0)
    excess = np.where(lit_up, np.log(np.maximum(light.total, TINY) / np.maximum(light.direct, TINY)), 0.0)
    coefficients = np.linalg.lstsq(weight[:, None] * terms, weight * excess, rcond=None)[0]
    return np.asarray(terms @ coefficients)
