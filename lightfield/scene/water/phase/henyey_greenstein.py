"""Phase functions with a closed inverse: Henyey-Greenstein, of one term and of two."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import TINY, Array
from lightfield.scene.water.phase.function import FOUR_PI, PhaseFunction


class HenyeyGreensteinPhase(PhaseFunction):
    """Henyey & Greenstein (1941), Astrophys. J. 93, 70.

    Parameters
    ----------
    g : float
        Mean cosine, between -1 and 1.
    """

    def __init__(self, g: float) -> None:
        self.g = g

    def pdf(self, cos_theta: ArrayLike) -> Array:
        """(1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^1.5)."""
        g, cosine = self.g, np.asarray(cos_theta, dtype=float)
        return np.asarray((1 - g * g) / (FOUR_PI * ((1 - g) ** 2 + 2 * g * (1 - cosine)) ** 1.5))

    def cdf(self, psi_rad: ArrayLike) -> Array:
        """In closed form, without cancellation at small angles."""
        g, h = self.g, 2.0 * np.sin(0.5 * np.asarray(psi_rad, dtype=float)) ** 2
        d = np.sqrt((1 - g) ** 2 + 2 * g * h)
        return np.asarray((1 + g) * h / (d * (d + 1 - g)))

    def sample(self, u: ArrayLike) -> Array:
        """Closed-form inverse, written for 1 - cos so that small angles keep their digits."""
        g, u = self.g, np.asarray(u, dtype=float)
        rest = 1 + g - 2 * g * u
        d = (1 - g * g) / rest
        return np.asarray(1.0 - np.minimum((1 - g) * u * (d + 1 - g) / rest, 2.0))

    def mean_cosine(self) -> float:
        """g."""
        return self.g


class TwoTermHenyeyGreensteinPhase(PhaseFunction):
    """Sum alpha HG(g1) + (1 - alpha) HG(g2) (Kattawar 1975; for sea water Haltrin 2002, Appl. Opt. 41, 1022).

    Parameters
    ----------
    g1, g2 : float
        Mean cosines; g2 below 0 is a backward lobe.
    alpha : float
        Weight of the first.
    """

    def __init__(self, g1: float, g2: float, alpha: float) -> None:
        self.first, self.second, self.alpha = HenyeyGreensteinPhase(g1), HenyeyGreensteinPhase(g2), alpha

    def pdf(self, cos_theta: ArrayLike) -> Array:
        """Weighted sum."""
        return self.alpha * self.first.pdf(cos_theta) + (1 - self.alpha) * self.second.pdf(cos_theta)

    def cdf(self, psi_rad: ArrayLike) -> Array:
        """Weighted sum."""
        return self.alpha * self.first.cdf(psi_rad) + (1 - self.alpha) * self.second.cdf(psi_rad)

    def sample(self, u: ArrayLike) -> Array:
        """Chooses a term with `u`, then reuses what is left of `u`: exact, but not monotone in u."""
        u, alpha = np.asarray(u, dtype=float), self.alpha
        in_first = u < alpha
        left = np.where(in_first, u / max(alpha, TINY), (u - alpha) / max(1 - alpha, TINY))
        left = np.clip(left, 0.0, 1.0)
        return np.where(in_first, self.first.sample(left), self.second.sample(left))

    def mean_cosine(self) -> float:
        """alpha g1 + (1 - alpha) g2."""
        return self.alpha * self.first.g + (1 - self.alpha) * self.second.g
