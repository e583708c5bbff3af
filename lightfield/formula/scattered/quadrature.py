"""Nodes to integrate over: angles of scattering, angles of emission, plain intervals, and cells."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.profile import HALF_PI
from lightfield.scene.lamp.width import at_all_angles, half_width_rad, intensity
from lightfield.scene.water.phase.henyey_greenstein import HenyeyGreensteinPhase
from lightfield.scene.water.phase.of_scene import phase_function
from lightfield.scene.water.phase.spec import HenyeyGreenstein, TracedPhase, WithMolecules
from lightfield.storage.tables import kept_by_tables

#: Angles of emission: so many nodes, out to this angle at most.
_LAMP_NODES, _WIDEST_RAD = 200, 1.4
#: Factor between the last angles of emission that beams share.
_LAST_STEP = 1.05
#: Factors in 1 - g, and in the part that molecules scatter, within which phase functions share their angles.
_STEP_OF_G, _STEP_OF_SHARE = 1.25, 1.25
#: Intensities, relative to the axis, between which the edge of a beam is measured; a Gaussian's is this many
#: half widths wide.
_EDGE, _GAUSSIAN_EDGE = (0.75, 0.25), 0.7700
#: Angles per half width at which a beam is tabulated: a Gaussian is right to 5e-6 between them.
_PER_HALF_WIDTH = 200


class Quadrature(NamedTuple):
    """Where to evaluate an integrand, and with which weights to sum it; arrays of one shape."""

    at: Array
    weight: Array


@lru_cache(maxsize=32)
def interval(n: int, stretched: bool = False) -> Quadrature:
    """Gauss-Legendre nodes from 0 to 1; stretched, denser at both ends: s^2 (3 - 2 s)."""
    x, w = np.polynomial.legendre.leggauss(n)
    s, ws = 0.5 * (x + 1), 0.5 * w
    return Quadrature(s * s * (3 - 2 * s), 6 * ws * s * (1 - s)) if stretched else Quadrature(s, ws)


@lru_cache(maxsize=16)
def in_cell(n: int) -> Quadrature:
    """n x n Gauss-Legendre nodes of a square of side one about zero, shape (n^2, 2), with their shares."""
    x, w = np.polynomial.legendre.leggauss(n)
    return Quadrature(
        0.5 * np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2), 0.25 * np.outer(w, w).ravel()
    )


@kept_by_tables(32)
def turns(phase: TracedPhase, n: int, up_to_rad: float = math.pi) -> Quadrature:
    """Angles of scattering in rad, at quantiles of the phase function; the weights are shares of the light.

    Parameters
    ----------
    up_to_rad : float
        Largest angle; the weights sum to the share of what is scattered by less.
    """
    function, (s, weight) = phase_function(phase), interval(n, stretched=True)
    share = float(function.cdf(up_to_rad))
    u = share * s
    if isinstance(function, HenyeyGreensteinPhase):
        angle = np.arccos(np.clip(function.sample(u), -1, 1))
    else:
        known, table = function.inverse_cdf_table()
        angle = np.exp(np.interp(u, known, np.log(table)))
    return Quadrature(np.minimum(angle, up_to_rad * (1 - 1e-9)), share * weight)


def near(phase: TracedPhase) -> TracedPhase:
    """A phase function whose angles serve those near it, so that not every step of a fit makes new ones."""
    if isinstance(phase, WithMolecules):
        share = min(_STEP_OF_SHARE ** round(math.log(phase.share) / math.log(_STEP_OF_SHARE)), 1.0)
        return phase.model_copy(update={"particles": near(phase.particles), "share": share})
    if not isinstance(phase, HenyeyGreenstein) or phase.g <= 0:
        return phase
    return HenyeyGreenstein(g=1 - _STEP_OF_G ** round(math.log(1 - phase.g) / math.log(_STEP_OF_G)))


@kept_by_tables(64)
def shares_at(phase: TracedPhase, nodes_of: TracedPhase, n: int, up_to_rad: float = math.pi) -> Array:
    """Shares of the light that one phase function scatters by the `turns` of another, shape (n,)."""
    angle, share = turns(nodes_of, n, up_to_rad)
    if phase == nodes_of:
        return share
    cosine = np.cos(angle)
    return np.asarray(share * phase_function(phase).pdf(cosine) / phase_function(nodes_of).pdf(cosine))


def mean_cosine(phase: TracedPhase) -> float:
    """Mean cosine of the angle of scattering."""
    return _mean_cosine(phase)


@kept_by_tables(64)
def _mean_cosine(phase: TracedPhase) -> float:
    return phase_function(phase).mean_cosine()


class EmissionTable(NamedTuple):
    """Angles of emission at which a lamp is tabulated where its light is wanted at many others.

    Parameters
    ----------
    theta : array, shape (n_table,), rad
        At equal distances to half a turn, and one beyond, where no light is.
    """

    theta: Array

    @classmethod
    def of(cls, half_width_rad: float) -> EmissionTable:
        """For beams of about this half width."""
        return cls(_angles_of_table(half_width_rad))

    def intensity(self, lamp: Lamp) -> Array:
        """Radiant intensity over that on the axis at every angle of the table."""
        return intensity(lamp, self.theta**2)

    def between(self, theta_squared: Array) -> tuple[NDArray[np.int32], Array]:
        """The table's angle before each squared one, rad^2, and how far it is to the next."""
        at = np.minimum(np.sqrt(theta_squared) / self.theta[1], len(self.theta) - 1)
        before = np.minimum(at.astype(np.int32), len(self.theta) - 2)
        return before, at - before


@lru_cache(32)
def _angles_of_table(half_width_rad: float) -> Array:
    theta = np.linspace(0.0, HALF_PI, math.ceil(_PER_HALF_WIDTH * HALF_PI / half_width_rad) + 1)
    return np.append(theta, theta[-1] + theta[1])


@kept_by_tables(256)
def finest_rad(lamp: Lamp) -> float:
    """Standard deviation of the Gaussian beam whose edge is as sharp, rad."""
    edge = half_width_rad(lamp, _EDGE[1]) - half_width_rad(lamp, _EDGE[0])
    width = min(half_width_rad(lamp), max(edge, 1e-6) / _GAUSSIAN_EDGE)
    return width / math.sqrt(2 * math.log(2))


@kept_by_tables(256)
def emission(lamp: Lamp) -> Quadrature:
    """Angles of emission, rad, and the light in each: weights in sr, for unit intensity on the axis.

    Beams that differ little share their angles.
    """
    theta, light = at_all_angles(lamp)
    last = 1.02 * float(theta[light > 1e-6 * light.max()][-1]) + 1e-3
    top = min(_WIDEST_RAD, _LAST_STEP ** math.ceil(math.log(last) / math.log(_LAST_STEP)))
    t, w = interval(_LAMP_NODES)
    at = top * t
    return Quadrature(at, 2 * math.pi * top * w * np.sin(at) * intensity(lamp, at * at))
