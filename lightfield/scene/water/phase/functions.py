"""Phase functions, each with its density, cumulative distribution, exact sampler and moments."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from pydantic import TypeAdapter, ValidationError

from lightfield.arrays import Array
from lightfield.errors import SceneError
from lightfield.scene.water.phase import spec

SMALLEST_RAD = 1e-7
GAUSS_X, GAUSS_W = np.polynomial.legendre.leggauss(8)
FOUR_PI = 4.0 * math.pi


@lru_cache(maxsize=1)
def angle_grid() -> Array:
    """Scattering angles in rad, 1e-7 to pi, that resolve a forward peak, the middle and a backward peak."""
    forward = np.geomspace(SMALLEST_RAD, math.pi, 3000)
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
        below = psi[0] * np.power(np.maximum(u, 1e-300) / known[0], power)
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

    def backscatter_ratio(self) -> float:
        """Part scattered by more than 90 degrees."""
        return 1.0 - float(self.cdf(0.5 * math.pi))

    def _inverse(self) -> tuple[Array, Array]:
        psi = angle_grid()
        u = np.asarray(self.cdf(psi))
        u[-1] = 1.0
        keep = np.concatenate([[True], np.diff(np.maximum.accumulate(u)) > 0])
        return u[keep], psi[keep]


class HenyeyGreenstein(PhaseFunction):
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


class TwoTermHenyeyGreenstein(PhaseFunction):
    """Sum alpha HG(g1) + (1 - alpha) HG(g2) (Kattawar 1975; for sea water Haltrin 2002, Appl. Opt. 41, 1022).

    Parameters
    ----------
    g1, g2 : float
        Mean cosines; g2 below 0 is a backward lobe.
    alpha : float
        Weight of the first.
    """

    def __init__(self, g1: float, g2: float, alpha: float) -> None:
        self.first, self.second, self.alpha = HenyeyGreenstein(g1), HenyeyGreenstein(g2), alpha

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
        left = np.where(in_first, u / max(alpha, 1e-300), (u - alpha) / max(1 - alpha, 1e-300))
        left = np.clip(left, 0.0, 1.0)
        return np.where(in_first, self.first.sample(left), self.second.sample(left))

    def mean_cosine(self) -> float:
        """alpha g1 + (1 - alpha) g2."""
        return self.alpha * self.first.g + (1 - self.alpha) * self.second.g


def phase_function(chosen: spec.PhaseSpec) -> PhaseFunction:
    """The phase function that a scene asks for.

    Parameters
    ----------
    chosen : PhaseSpec
        `water.phase` of a scene.
    """
    # Deferred: the tabulated ones build on this module.
    from lightfield.scene.water.phase import tables as phase_tables

    if isinstance(chosen, spec.HenyeyGreenstein):
        return HenyeyGreenstein(chosen.g)
    if isinstance(chosen, spec.TwoTermHenyeyGreenstein):
        return TwoTermHenyeyGreenstein(chosen.g1, chosen.g2, chosen.alpha)
    if isinstance(chosen, spec.FournierForand):
        return phase_tables.FournierForand(chosen.n, chosen.mu)
    if isinstance(chosen, spec.Petzold):
        return phase_tables.petzold(chosen.water)
    return phase_tables.measured(chosen.file)


def parse_phase(text: str) -> PhaseFunction:
    """The phase function for a JSON object such as {"type": "fournier-forand", "n": 1.1, "mu": 3.5835}.

    Parameters
    ----------
    text : str
        JSON of the `phase` section of a scene.

    Raises
    ------
    SceneError
        Not a phase function.
    """
    try:
        return phase_function(TypeAdapter(spec.PhaseSpec).validate_json(text))
    except ValidationError as error:
        first = error.errors()[0]
        raise SceneError(
            "not a phase function", where="phase", found=text, rule=str(first["msg"]),
            remedy='write for example {"type": "henyey-greenstein", "g": 0.924}',
        ) from error  # fmt: skip
