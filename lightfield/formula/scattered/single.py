"""Light that was scattered once, exactly.

Seen from the line between the lamp S and a place D, R long, light that leaves S at an angle chi to it and
arrives at D at psi was turned by Theta = psi + chi. All points of scattering with the same Theta lie on a
circle's arc, and along it the squares of both distances cancel (equiangular sampling; Kulla and Fajardo 2012,
doi:10.1111/j.1467-8659.2012.03148.x):

    E_1 = (b/R) int p(Theta) Theta dTheta  int_0^1 dt  int dphi  I(theta) cos(theta_D)
                exp(-c R (sin(psi) + sin(chi)) / sin(Theta)),        chi = t Theta

Of an apparent source behind the window only what is beyond the window is water: the arc ends there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, vstack

from lightfield.arrays import Array
from lightfield.formula.scattered.quadrature import EmissionTable, interval, turns
from lightfield.scene.water.phase.spec import HenyeyGreenstein, TracedPhase

#: Nodes along an arc are densest where it crosses the beam, within so many of its half widths.
_DENSE = 1.5
#: Beams of a half width less than this part of the angle that they are seen from are narrow.
_NARROW = 0.4
#: So many times a Gaussian's nodes about the line a beam may take, and what they are held against.
_TIMES, _FINEST = (1, 2, 3, 5), 8
#: Where that is asked, in half widths from the axis, and how well they have to agree there (chosen: as well
#: as polynomials of the traced ratio follow it, and where it is dim three times worse); of what scattering.
_TRIED = ((0.5, 0.8, 1.1, 1.4, 1.7, 2.0, 2.4), 2e-3), ((2.8, 3.6), 6e-3)
_TYPICAL = HenyeyGreenstein(g=0.9)


class Resolution(NamedTuple):
    """Numbers of nodes: angles of scattering, along an arc, and over half a turn about the line.

    The other half is its mirror image. Beside ones of three to seven times as many (60 beams of 1.5 to 8
    degrees half width, g of 0.88 to 0.97, sources 0 to 3 m behind the window): right to 2e-4 up to two half
    widths aside and to 6e-4 at two and a half; the finer nodes, which are taken beyond, to 1e-3 up to six.
    Beams with steeper edges, or with kinks, take so many times as many about the line (see `times_about`):
    flat tops, rings and batwings whose edges are a third or a quarter of a Gaussian's are right to 0.3 %
    then, and to 0.5 % from three half widths on; discs with an edge of 0.3 degrees, rings of 0.5 to 4 %.
    """

    turns: int
    along: int
    around: int

    @classmethod
    def for_beam(cls, half_width_rad: float, tangent: float, times: int = 1) -> Resolution:
        """What a beam takes, seen from up to this tangent of the angle to its axis."""
        wide = tangent <= seen_narrow(half_width_rad)
        return cls(22, 9, 6 * times) if wide else cls(48, 9, 9 * times)


def seen_narrow(half_width_rad: float) -> float:
    """Tangent of the angle to its axis beyond which a beam is a narrow part of what is seen."""
    return half_width_rad / _NARROW


class SinglePaths(NamedTuple):
    """Paths of light that is scattered once, to places beside the axis of a round lamp.

    Parameters
    ----------
    theta_squared : array, shape (n, n_arcs, n_along, n_around), rad^2
        Squared angle of emission from the axis. Like what follows in single precision.
    weight : array, of the same shape, m^-1
        Of the light of each path, with the receiver's cosine.
    water_m : array, of the same shape or with one for n_around, m
        Length of the path in water.
    share : array, shape (n_arcs,)
        Of the light that is scattered by the angle of each arc.
    """

    theta_squared: Array
    weight: Array
    water_m: Array
    share: Array


class TabledPaths(NamedTuple):
    """The same paths, lit by lamps that are tabulated over the angle: their light is linear in the table.

    Parameters
    ----------
    onto : sparse array, shape (n_paths, n_table), m^-1
        Light on each path, or on those of one length together, from that in the table; in single precision,
        because there are hundreds of thousands of paths.
    shape : tuple of int
        Of the paths: (n, n_arcs, n_along, n_around or 1).
    water_m, share : arrays
        As those of `SinglePaths`.
    """

    onto: csr_array
    shape: tuple[int, ...]
    water_m: Array
    share: Array

    @property
    def nbytes(self) -> int:
        """Memory that they take."""
        return sum(int(v.nbytes) for v in (self.onto.data, self.onto.indices, self.onto.indptr, self.water_m))

    @classmethod
    def of(cls, table: EmissionTable, paths: SinglePaths) -> TabledPaths:
        """Of these paths."""
        before, exact = table.between(paths.theta_squared.ravel())
        part = exact.astype(np.float32)
        weight, together = paths.weight.ravel().astype(np.float32), paths.water_m.shape[-1] == 1
        around = paths.weight.shape[-1] if together else 1
        onto = csr_array(
            (
                np.stack([weight * (1 - part), weight * part], axis=1).ravel(),
                np.stack([before, before + 1], axis=1).ravel(),
                np.arange(0, 2 * len(weight) + 1, 2 * around, dtype=np.int32),
            ),
            shape=(len(weight) // around, len(table.theta)),
        )
        onto.sum_duplicates()  # of paths of one length together
        shape = (*paths.weight.shape[:-1], paths.weight.shape[-1] // around)
        return cls(onto, shape, paths.water_m, paths.share)

    @classmethod
    def joined(cls, each: Sequence[TabledPaths]) -> TabledPaths:
        """To all places of several, by the same arcs."""
        onto, water = vstack([one.onto for one in each], "csr"), np.concatenate([one.water_m for one in each])
        return cls(onto, (len(water), *each[0].shape[1:]), water, each[0].share)

    def lit(self, intensity: Array) -> LitPaths:
        """With the light of a lamp, given its intensity at the angles of the table, relative to its axis."""
        sent = (self.onto @ intensity.astype(np.float32)).reshape(self.shape)
        return LitPaths(sent, self.water_m, self.share)

    def by_table(self, a: float, b: float) -> Array:
        """Irradiance in water of these, m^-2, for unit intensity at each angle of the table alone.

        Shape (n, n_table).
        """
        arrives = b * self.share[:, None, None] * np.exp(-(a + b) * self.water_m)
        arrives = np.broadcast_to(arrives, self.shape).reshape(len(self.water_m), -1)
        ends = np.arange(0, arrives.size + 1, arrives.shape[1])
        return np.asarray((csr_array((arrives.ravel(), np.arange(arrives.size), ends)) @ self.onto).toarray())


class LitPaths(NamedTuple):
    """Paths of light that is scattered once, with the light of a lamp.

    Parameters
    ----------
    sent : array, shape (n, n_arcs, n_along, n_around or 1), m^-1
    water_m : array, of the same shape, m
    share : array, shape (n_arcs,)
        Of the light that is scattered by the angle of each arc.
    """

    sent: Array
    water_m: Array
    share: Array

    @property
    def nbytes(self) -> int:
        """Memory that they take."""
        return int(self.sent.nbytes) + int(self.water_m.nbytes)

    def light(self, a: ArrayLike, b: ArrayLike, share: Array | None = None) -> Array:
        """Irradiance for unit intensity on the axis, m^-2, shape (n,) or (n_waters, n), in water of these.

        Parameters
        ----------
        a, b : float, or array, shape (n_waters,), m^-1
        share : array, shape (n_arcs,), optional
            Of the light on each arc in place of its own, see `shares_at`.
        """
        share = np.asarray(self.share if share is None else share, self.sent.dtype)
        lit = (self.sent * share[:, None, None]).reshape(len(self.sent), 1, -1)
        length = np.broadcast_to(self.water_m, self.sent.shape).reshape(len(lit), -1, 1)
        # A water at a time: there are tens of thousands of paths.
        each = [(lit @ np.exp(-c * length)).ravel() for c in np.atleast_1d(np.add(a, b)).tolist()]
        return np.asarray(np.atleast_1d(b)[:, None] * each).reshape(*np.shape(b), -1)


def single_paths(
    phase: TracedPhase,
    half_width_rad: float,
    radius_m: Array,
    z_m: Array,
    apparent_distance_m: float = 0.0,
    resolution: Resolution | None = None,
) -> SinglePaths:
    """The paths of light that is scattered once, for receivers that face the lamp's plane.

    Parameters
    ----------
    half_width_rad : float
        Of the beam, roughly: where nodes are dense.
    radius_m, z_m : arrays, shape (n,), m
        Distance of the places from the axis, and from the window.
    apparent_distance_m : float, m
        Of the source behind the window.
    """
    resolution = resolution or Resolution.for_beam(half_width_rad, float((radius_m / z_m).max()))
    behind = z_m + apparent_distance_m
    length = np.hypot(radius_m, behind)[:, None, None, None]
    sin_a, cos_a = (v[:, None, None, None] / length for v in (radius_m, behind))
    turn, share = turns(phase, resolution.turns)
    turn = turn[:, None, None]
    sin_t, cos_t = np.sin(turn), np.cos(turn)
    axis, dense = np.arctan2(sin_a, cos_a), _DENSE * half_width_rad
    s, around = interval(resolution.around)
    narrow = np.arcsinh(axis / half_width_rad)
    phi = math.pi * (1 - _sinh_ratio(narrow, s))
    around = math.pi * around * _sinh_slope(narrow, s)
    towards, aside = cos_a, -sin_a * np.cos(phi)  # of the lamp's axis: along the line and across it
    end = turn
    if apparent_distance_m > 0:
        # The arc meets the window where R sin(Theta - chi) (A cos(chi) + B sin(chi)) = z_0 sin(Theta).
        whole, tilt = np.hypot(towards, aside), np.arctan2(aside, towards)
        right = (2 * apparent_distance_m / length - towards) * sin_t + aside * cos_t
        met = 0.5 * (turn + tilt - np.arcsin(np.clip(right / whole, -1, 1)))
        end = np.clip(met, 0, turn)
    s, along = (v[:, None] for v in interval(resolution.along))
    first, last = np.arcsinh(-axis / dense), np.arcsinh((end - axis) / dense)
    # p(Theta) dTheta = share / (2 pi sin(Theta)); half a turn about the line stands for a whole one.
    each = (last - first) * around / (math.pi * length * sin_t)
    # From here on arrays have all dimensions.
    at = np.add(*_in_single(first, (last - first) * s))
    along, axis, each = _in_single(along * dense, axis, each)
    sin_t, cos_t, towards, aside = _in_single(sin_t, cos_t, towards, aside)
    longest, half_aside = _in_single(length / sin_t, sin_a * np.cos(0.5 * phi) ** 2)
    beside = float(dense) * np.sinh(at)
    chi = axis + beside
    sin_chi, cos_chi = np.sin(chi), np.cos(chi)
    sin_psi, cos_psi = sin_t * cos_chi - cos_t * sin_chi, cos_t * cos_chi + sin_t * sin_chi
    arrival = np.maximum(towards * cos_psi - aside * sin_psi, 0)
    weight = along * np.cosh(at) * arrival * each
    water = (sin_psi + sin_chi) * longest
    # Squared sine of half the angle of emission: nothing cancels near the axis.
    squared = np.clip(np.sin(0.5 * beside) ** 2 + half_aside * sin_chi, 0, 1)
    if apparent_distance_m:
        cosine = np.maximum(1 - 2 * squared, 1e-6)
        water = np.maximum(water - float(apparent_distance_m) / cosine, 0)
    return SinglePaths(4 * np.arcsin(np.sqrt(squared)) ** 2, weight, water, share)


@lru_cache(8)
def _trials(half_width_rad: float) -> list[Array]:
    """Light beside a beam by so many times a Gaussian's nodes, at last by `_FINEST`.

    Each of shape (n_places, n_table): it is linear in the intensity at the angles of the `EmissionTable`.
    """
    table = EmissionTable.of(half_width_rad)
    each = []
    for times in (*_TIMES, _FINEST):
        parts = []
        for places, _ in _TRIED:
            tangent = math.tan(half_width_rad) * np.array(places)
            fine = Resolution.for_beam(half_width_rad, float(tangent[-1]), times)
            paths = single_paths(_TYPICAL, half_width_rad, tangent, np.ones_like(tangent), 0.0, fine)
            parts.append(TabledPaths.of(table, paths).by_table(0.0, 1.0))
        each.append(np.concatenate(parts))
    return each


def times_about(half_width_rad: float, intensity: Array) -> int:
    """How many times a Gaussian's nodes about the line a beam takes, see `_TRIED`.

    Parameters
    ----------
    half_width_rad : float
        Of the `EmissionTable`.
    intensity : array, shape (n_table,)
        Of the beam, there.
    """
    *tried, finest = _trials(half_width_rad)
    best, within = finest @ intensity, np.concatenate([np.full(len(at), part) for at, part in _TRIED])
    for times, light in zip(_TIMES, tried, strict=True):
        if np.all(np.abs(light @ intensity - best) <= within * best):
            return times
    return _TIMES[-1]


def _in_single(*values: Array) -> list[Array]:
    """In single precision, in which sines take a tenth of the time: there are a hundred thousand paths."""
    return [np.asarray(v, np.float32) for v in values]


def _sinh_ratio(scale: Array, s: Array) -> Array:
    """sinh(scale s) / sinh(scale): from 0 to 1, denser at 0 the larger the scale."""
    small = scale < 1e-6
    safe = np.where(small, 1.0, scale)
    return np.where(small, s, np.sinh(safe * s) / np.sinh(safe))


def _sinh_slope(scale: Array, s: Array) -> Array:
    """Derivative of `_sinh_ratio` by s."""
    small = scale < 1e-6
    safe = np.where(small, 1.0, scale)
    return np.where(small, 1.0, safe * np.cosh(safe * s) / np.sinh(safe))
