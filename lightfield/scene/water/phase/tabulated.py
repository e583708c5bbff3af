"""Phase functions without a closed inverse: Fournier-Forand, Petzold, and measured tables."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.errors import SceneError
from lightfield.scene.water.library import columns_of
from lightfield.scene.water.phase.function import FOUR_PI, GAUSS_W, GAUSS_X, PhaseFunction, angle_grid
from lightfield.storage.inputs import kept_by_file
from lightfield.storage.tables import read_columns

_PETZOLD_COLUMNS = {
    "average": "average_per_sr",
    "clear": "clear_per_m_sr",
    "coastal": "coastal_per_m_sr",
    "harbor": "harbor_per_m_sr",
}


class FournierForandPhase(PhaseFunction):
    """Fournier & Forand (1994), form of Fournier & Jonasz (1999), Proc. SPIE 3761, 62.

    Parameters
    ----------
    n : float
        Refractive index of the particles relative to water.
    mu : float
        Slope of their Junge size distribution, 3 to 5.
    """

    def __init__(self, n: float, mu: float) -> None:
        self.n, self.mu, self.nu = n, mu, 0.5 * (3.0 - mu)
        self.scale = 4.0 / (3.0 * (n - 1.0) ** 2)
        power = self.scale**self.nu
        self.tail = (1.0 - power) / ((self.scale - 1.0) * power)

    def _delta(self, s2: Array) -> Array:
        delta = self.scale * s2
        # The formulas are 0/0 at delta = 1, where the function is smooth.
        return np.where(np.abs(delta - 1.0) < 1e-5, 1.0 - 1e-5, delta)

    def pdf(self, cos_theta: ArrayLike) -> Array:
        """Closed form; diverges, integrably, as the angle goes to 0."""
        cosine, nu = np.asarray(cos_theta, dtype=float), self.nu
        s2 = np.maximum(0.5 * (1.0 - cosine), 1e-18)
        d = self._delta(s2)
        power = d**nu
        bracket = nu * (1 - d) - (1 - power) + (d * (1 - power) - nu * (1 - d)) / s2
        main = bracket / (FOUR_PI * (1 - d) ** 2 * power)
        return np.asarray(main + self.tail / (4 * FOUR_PI) * (3 * cosine**2 - 1))

    def cdf(self, psi_rad: ArrayLike) -> Array:
        """Closed form (Fournier & Jonasz 1999)."""
        psi = np.maximum(np.asarray(psi_rad, dtype=float), 1e-12)
        s2 = np.sin(0.5 * psi) ** 2
        d = self._delta(s2)
        power = d**self.nu
        main = ((1 - d * power) - (1 - power) * s2) / ((1 - d) * power)
        return np.clip(main + self.tail / 8.0 * np.cos(psi) * np.sin(psi) ** 2, 0.0, 1.0)


class TabulatedPhase(PhaseFunction):
    """Table of a phase function: log-log between angles, a power law below the first one, normalised to 1.

    Integrated this way, Petzold's three tables give the scattering coefficients that he printed (0.037,
    0.219, 1.82 per m) within 0.6 %; the trapezoidal rule in angle is 1 % high, because the forward peak is
    convex.

    Parameters
    ----------
    angle_rad : array, shape (n,)
        Rising, above 0.
    density : array, shape (n,)
        Above 0, any scale.
    """

    def __init__(self, angle_rad: Array, density: Array) -> None:
        self.log_angle, self.log_density = np.log(angle_rad), np.log(density)
        self.slope = float(np.diff(self.log_density[:2])[0] / np.diff(self.log_angle[:2])[0])
        if self.slope <= -2.0:
            raise SceneError(
                "the phase table cannot be normalised", found=f"angle^{self.slope:.3g} at its first angles",
                rule="flatter than angle^-2 there", remedy="correct the first two rows",
            )  # fmt: skip
        grid = np.unique(np.concatenate([angle_grid(), angle_rad[angle_rad < math.pi]]))
        half, middle = 0.5 * np.diff(grid), 0.5 * (grid[1:] + grid[:-1])
        at = middle[:, None] + half[:, None] * GAUSS_X
        parts = 2 * math.pi * half * ((self._shape(at) * np.sin(at)) @ GAUSS_W)
        first = 2 * math.pi * grid[0] ** 2 * float(self._shape(grid[0])) / (2.0 + self.slope)
        cumulative = first + np.concatenate([[0.0], np.cumsum(parts)])
        self.integral = float(cumulative[-1])
        self.grid, self.cumulative = grid, cumulative / self.integral

    def _shape(self, psi: ArrayLike) -> Array:
        log_psi = np.log(np.maximum(psi, 1e-12))
        below = np.minimum(log_psi - self.log_angle[0], 0.0) * self.slope
        return np.asarray(np.exp(np.interp(log_psi, self.log_angle, self.log_density) + below))

    def pdf(self, cos_theta: ArrayLike) -> Array:
        """Interpolated in log-log."""
        cosine = np.asarray(cos_theta, dtype=float)
        psi = 2.0 * np.arcsin(np.sqrt(np.clip(0.5 * (1.0 - cosine), 0.0, 1.0)))
        return self._shape(psi) / self.integral

    def cdf(self, psi_rad: ArrayLike) -> Array:
        """Integral of the density, tabulated on a fine grid."""
        psi = np.asarray(psi_rad, dtype=float)
        below = self.cumulative[0] * (np.maximum(psi, 0.0) / self.grid[0]) ** (2.0 + self.slope)
        return np.where(psi < self.grid[0], below, np.interp(psi, self.grid, self.cumulative))


@lru_cache(maxsize=8)
def petzold(water: str = "average") -> TabulatedPhase:
    """Phase function measured by Petzold (1972).

    Parameters
    ----------
    water : str
        "average" (Mobley et al. 1993), "clear", "coastal" or "harbor".
    """
    angle, density = columns_of("petzold_phase.csv", "angle_deg", _PETZOLD_COLUMNS[water])
    return TabulatedPhase(np.radians(angle), density)


@kept_by_file(8)
def measured(path: str) -> TabulatedPhase:
    """Phase function from a CSV file with columns angle_deg and phase_per_sr.

    Parameters
    ----------
    path : str
        File; a first row at 0 deg is held up to the next angle.

    Raises
    ------
    SceneError
        Not such a table.
    """
    angle, density = read_columns(path, ("angle_deg", "phase_per_sr"))
    if angle[-1] > 180.0 or angle[-1] < 90.0 or not np.all(density > 0):
        raise SceneError(
            "not a phase function", where=path, found=f"up to {angle[-1]:g} deg, smallest {density.min():g}",
            rule="values above 0, up to at least 90 and at most 180 deg", remedy="complete the table",
        )  # fmt: skip
    start = np.where(angle > 0, angle, 1e-3 * angle[1])
    return TabulatedPhase(np.radians(start), density)
