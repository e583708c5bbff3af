"""Where chi-square is least over all b of a colour, and how far the readings leave b open.

Light that comes back bends the line along which a and b stand for each other, and what a trace knows of it is
wavy: chi-square is no parabola. It may have a second valley that slopes at the bottom of one know nothing of.
The more is scattered the larger are the trace's waves, and chi-square with them, as if readings told of b
what no light does: how far b may be is asked without what waves add on average (Nakamura 1990, Biometrika 77,
127).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.studies.attenuation.stack import Stack

#: Values of b that are tried, and parts of the way from one to the next that are told between them.
_NODES, _BETWEEN = 25, 8
#: Gauss-Newton steps in a at most for each, and the change in 1/m at which they end.
_STEPS, _STILL = 20, 1e-6
#: Elements of the matrices that are held at once, and an error that counts for nothing.
_AT_ONCE, _UNREAD = 4_000_000, 1e6


@dataclass(frozen=True, eq=False)
class Valley:
    """Of every colour by itself the least chi-square for each b, and the a that it has there.

    Parameters
    ----------
    b : array, shape (n_nodes,), 1/m
    a : array, shape (n_nodes, n_colours), 1/m
    chi2 : array, shape (n_nodes, n_colours)
    waves : array, shape (n_nodes, n_colours)
        Root of what the trace's waves added to it on average; 0 where light is reflected, whose errors do not
        grow with b alone.
    """

    b: Array
    a: Array
    chi2: Array
    waves: Array

    @cached_property
    def _on_the_way(self) -> tuple[Mask, Mask]:
        """Which b are within one standard error of the best, and within two, of light without waves."""
        above = self.chi2 - self.chi2.min(axis=0)
        return above <= 1.0, above <= 4.0

    @cached_property
    def _within(self) -> tuple[Mask, Mask]:
        """The same beside waves.

        Waves that readings' errors meet tilt chi-square by 2 r times how much they grow, r of unit variance.
        With a curvature F and a tilt G the best is off by 1/F + G^2 / 4 F^2 in the mean square: where
        chi-square is u above the least, and the tilt g, one error is u = 1 + g^2 / 4 u.
        """
        told = self.chi2 - self.waves**2
        above, best = told - told.min(axis=0), told.argmin(axis=0)
        tilt = 2 * (self.waves - self.waves[best, np.arange(len(best))])
        return above <= 0.5 + np.sqrt(0.25 + 0.25 * tilt**2), above <= 2.0 + np.sqrt(4.0 + tilt**2)

    @property
    def b_stderr(self) -> Array:
        """How far b goes from its best, shape (n_colours,), 1/m; see `reach_from`."""
        at = self.chi2.argmin(axis=0)
        best = self.a[at, np.arange(len(at))], self.b[at]
        return self.reach_from(*best, np.zeros(len(at)))[1]

    def start(self, guess: Array, told: Mask) -> tuple[Array, Array]:
        """a and b where chi-square is least; where b is not told, as near to a guess as it is good.

        Parameters
        ----------
        guess : array, shape (n_colours,), 1/m
            Of b.
        told : array of bool, shape (n_colours,)
        """
        far = np.where(self._within[0], np.abs(self.b[:, None] - guess), np.inf)
        at = np.where(told, self.chi2.argmin(axis=0), far.argmin(axis=0))
        return self.a[at, np.arange(len(at))], self.b[at]

    def reach_from(self, a: Array, b: Array, kappa: Array) -> tuple[Array, Array, Array]:
        """How far a, b and a + kappa b go from a fit within one standard error, shape (n_colours,), 1/m.

        Or half as far as within two, if that is more: of a parabola both are the standard error of b,
        and what it brings with it of the others.
        """
        by_a, by_b = self.a - a, self.b[:, None] - b
        ways = ((self._within, by_a), (self._within, by_b), (self._on_the_way, by_a + kappa * by_b))
        reach = [(np.maximum(first, 0.5 * second) * np.abs(way)).max(axis=0) for (first, second), way in ways]
        return reach[0], reach[1], reach[2]


def valley_of(stack: Stack) -> Valley:
    """Try every b up to the largest, colour by colour, with gains, a and errors of stays and trace free."""
    largest = stack.excess[0].largest_b
    b = np.linspace(0.0, largest, _NODES)
    rows, colours = stack.y.shape
    some = max(1, _AT_ONCE // rows**2)
    parts = [_asked(stack, b, slice(first, first + some), largest) for first in range(0, colours, some)]
    found = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
    fine = np.linspace(0.0, largest, _BETWEEN * (_NODES - 1) + 1)
    return Valley(fine, *(np.stack([np.interp(fine, b, one) for one in each.T], axis=1) for each in found))


def _asked(stack: Stack, nodes: Array, which: slice, largest: float) -> tuple[Array, Array, Array]:
    """For each b the a of the least chi-square, that, and `waves`, each of shape (n_nodes, n_colours)."""
    H, errors = stack.shared(traced=True)
    sigma = np.nan_to_num(stack.sigma[:, which].T, nan=_UNREAD)
    y, s = np.nan_to_num(stack.y[:, which].T), stack.path_m
    covariance = (H * errors**2) @ H.T + sigma[:, :, None] ** 2 * np.eye(len(s))
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    basis = np.linalg.qr(white @ stack.alphas[:, which].transpose(1, 0, 2))[0]
    left = white - basis @ (basis.transpose(0, 2, 1) @ white)
    a, all_a, all_chi2, all_waves = np.zeros(len(y)), [], [], []
    for value in nodes:
        b = np.full(len(y), value)
        for _ in range(_STEPS):
            slope = np.einsum("lij,jl->li", left, stack.slopes(a, b)[0] - s[:, None])
            rest = np.einsum("lij,lj->li", left, y + np.multiply.outer(a + b, s) - stack.light(a, b).T)
            step = (slope * rest).sum(axis=1) / (slope**2).sum(axis=1)
            a = a + step
            if np.abs(step).max() < _STILL:
                break
        all_a.append(a)
        unit = slope / np.sqrt((slope**2).sum(axis=1, keepdims=True))
        waves = left @ stack.errors_of_light(a, b) * (not stack.reflects)
        added = (waves**2).sum(axis=(1, 2)) - (np.einsum("li,lik->lk", unit, waves) ** 2).sum(axis=1)
        chi2 = ((rest - step[:, None] * slope) ** 2).sum(axis=1)
        all_chi2.append(chi2 + (0.5 - b / largest) ** 2)
        all_waves.append(np.sqrt(np.maximum(added, 0.0)))
    return np.stack(all_a), np.stack(all_chi2), np.stack(all_waves)
