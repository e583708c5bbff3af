"""What a phase function is: density, cumulative distribution, exact sampler and moments."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import TINY, Array

_SMALLEST_RAD = 1e-7
GAUSS_X, GAUSS_W = np.polynomial.legendre.leggauss(8)
FOUR_PI = 4.0 * math.pi


@lru_cache(maxsize=1)
def angle_grid() -> Array:
    """Scattering angles in rad, 1e-7 to pi, that resolve a forward peak, the middle and a backward peak."""
    forward = np.geomspace(_SMALLEST_RAD, math.pi, 3000)
    middle = np.linspace(0.02, math.pi, 2000)
    backward = math.pi - np.geomspace(1e-4, 1.0, 400)
    grid = np.unique(np.concatenate([forward, middle, backward]))
    return grid[np.concatenate([[True], np.diff(grid) > 1e-9])]


class PhaseFunction(ABC):
    """Angular distribution of one scattering; its integral over the sphere is 1."""

    @abstractmethod
    def pdf(self, cos_theta: ArrayLike) -> Array:
        """Phase function in 1/sr at the cosine of the scattering angle."""

    @abstractmethod
    def cdf(self, psi_rad: ArrayLike) -> Array:
        """Probability of scattering by at most `psi_rad`."""

    def sample(self, u: ArrayLike) -> Array:
        """Cosine of the scattering angle for uniform numbers `u`, from the tabulated inverse.

        Parameters
        ----------
        u : array, in [0, 1)
            Probability of a smaller angle.
        """
        u = np.asarray(u, dtype=float)
        known, psi = self._inverse()
        # Below the first node the distribution is a power of the angle.
        power = math.log(psi[1] / psi[0]) / math.log(known[1] / known[0])
        below = psi[0] * np.power(np.maximum(u, TINY) / known[0], power)
        return np.cos(np.where(u < known[0], below, np.interp(u, known, psi)))

    def inverse_cdf_table(self) -> tuple[Array, Array]:
        """Probability `u` from 0 to 1 and angle in rad, both rising: linear in log angle."""
        u, psi = self._inverse()
        return np.concatenate([[0.0], u[1:]]), psi

    def mean_cosine(self) -> float:
        """Mean cosine of the scattering angle, 1 - integral of sin(psi) (1 - F(psi))."""
        grid = np.concatenate([[0.0], angle_grid()])
        half, middle = 0.5 * np.diff(grid), 0.5 * (grid[1:] + grid[:-1])
        at = middle[:, None] + half[:, None] * GAUSS_X
        return 1.0 - float(half @ ((np.sin(at) * (1.0 - self.cdf(at))) @ GAUSS_W))

    def _inverse(self) -> tuple[Array, Array]:
        psi = angle_grid()
        u = np.asarray(self.cdf(psi))
        u[-1] = 1.0
        keep = np.concatenate([[True], np.diff(np.maximum.accumulate(u)) > 0])
        return u[keep], psi[keep]
