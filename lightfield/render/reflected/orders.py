"""Light between walls, by number of reflections: what patches and readings exchange, and the sum of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

#: Reflections followed one by one; the rest is what a recurrence makes of the last four. In a closed tow tank
#: of walls of 0.9 and water that takes nothing, whose light has the longest ways, 96 change light by 0.06 %
#: (16 by 2.2 %; elsewhere by 0.08 % at most, `benchmarks/constants`).
REFLECTIONS = 32
DARKEST = 1e-40  # 1/m^2: below it single precision has no logarithm to interpolate


class AtOnce(NamedTuple):
    """What reaches the readings from the patches, every number of reflections in one product.

    Parameters
    ----------
    first : array, shape (n, k * n_terms)
        From the k patches before the readings, by terms of their light (see `terms_of_light`).
    later : array, shape ((REFLECTIONS - 1) * n, n_patches)
        From all patches by two reflections, by three, and so on.
    """

    first: np.ndarray
    later: np.ndarray

    def apply(self, terms: np.ndarray, patches: np.ndarray) -> np.ndarray:
        """As `Operators.apply`."""
        once = self.first @ terms.ravel()
        return np.vstack([once, (self.later @ patches).reshape(-1, len(once))]).astype(float)


class Operators(NamedTuple):
    """What patches and readings exchange, for unit albedo of the brightest.

    Parameters
    ----------
    first : array, shape (n, k * n_terms)
        To the readings from the k patches before them, by terms of their light (see `terms_of_light`).
    whole : array, shape (n, k)
        To the readings from patches with the same light all over.
    before : array of int, shape (k,)
        Which of all patches are before the readings.
    among : array, shape (n_patches, n_patches)
        From patch to patch.
    """

    first: np.ndarray
    whole: np.ndarray
    before: np.ndarray
    among: np.ndarray

    @classmethod
    def of(
        cls, among: np.ndarray, parts: np.ndarray, terms: np.ndarray, before: np.ndarray, albedo: np.ndarray
    ) -> Operators:
        """Of the exchange between patches, and of their parts with the readings.

        Parameters
        ----------
        among : array, shape (n_patches, n_patches)
        parts : array, shape (n, k * parts^2)
        terms : array, shape (parts^2, n_terms)
        before : array of int, shape (k,)
        albedo : array, shape (n_patches,)
            Of each patch over the unit.
        """
        n = len(parts)
        seen = parts.reshape(n, len(before), len(terms)) * albedo[before, None]
        return cls((seen @ terms).reshape(n, -1), seen.sum(axis=2), before, among * albedo)

    def apply(self, terms: np.ndarray, patches: np.ndarray) -> np.ndarray:
        """Light at the readings by number of reflections, for unit albedo, shape (REFLECTIONS, n).

        Parameters
        ----------
        terms : array, shape (k, n_terms)
            Of the light on the patches before the readings.
        patches : array, shape (n_patches,)
            Mean irradiance of all patches.
        """
        reflected = []
        for _ in range(REFLECTIONS - 1):
            patches = self.among @ patches
            reflected.append(patches[self.before])
        more = self.whole @ np.stack(reflected, axis=1)
        return np.vstack([self.first @ terms.ravel(), more.T]).astype(float)

    def at_once(self) -> AtOnce:
        """The same in one product: as much work as `apply` for some ten lamps, and then a tenth of it."""
        later = np.empty((REFLECTIONS - 1, len(self.whole), len(self.among)), np.float32)
        later[0] = self.whole @ self.among[self.before]
        for i in range(1, len(later)):
            later[i] = later[i - 1] @ self.among
        return AtOnce(self.first, later.reshape(-1, len(self.among)))


def terms_of_light(parts: int) -> np.ndarray:
    """Orthonormal biquadratic polynomials over parts x parts, the constant first, shape (parts^2, n_terms).

    Light varies within a patch, but smoothly: up to 3 x 3 parts are told without loss, 16 by nine numbers.
    """
    at = (2 * np.arange(parts) + 1) / parts - 1
    u, v = (g.ravel() for g in np.meshgrid(at, at, indexing="ij"))
    few = range(min(parts, 3))
    powers = [u**i * v**j for i, j in product(few, few)]
    terms = np.linalg.qr(np.stack(powers, axis=1))[0]
    return np.asarray(terms * np.sign(terms[0]), np.float32)


class Orders(NamedTuple):
    """Light at the readings for unit albedo, by number of reflections.

    Parameters
    ----------
    log_light : array, shape (REFLECTIONS, n)
        Its logarithm.
    one, two : float
        What comes next: one times the last and two times the last but one, at all readings.
    """

    log_light: np.ndarray
    one: float
    two: float

    @classmethod
    def of(cls, light: np.ndarray) -> Orders:
        """With the recurrence that the last four tell of, by least squares over the readings.

        Two terms: light runs along the tank, and one ratio does not tell how.
        """
        lit = light[-4:, light[-1] > 0] / light[-1, light[-1] > 0]
        products = lit @ lit.T
        normal = products[1:3, 1:3] + products[:2, :2]
        normal += 1e-9 * np.trace(normal) * np.eye(2) + 1e-300 * np.eye(2)
        two, one = np.linalg.solve(normal, products[1:3, 3] + products[:2, 2]).tolist()
        return cls(np.log(np.maximum(light, DARKEST)), one, two)

    @classmethod
    def between(cls, several: Sequence[Orders], weights: np.ndarray) -> Orders:
        """Between several waters: ways of one order are much alike, so its logarithm is nearly linear."""
        log_light, one, two = zip(*several, strict=True)
        return cls(np.tensordot(weights, np.stack(log_light), axes=1), weights @ one, weights @ two)

    def for_albedo(self, albedo: float) -> np.ndarray:
        """Light of all reflections, shape (n,)."""
        shares = albedo ** np.arange(1.0, REFLECTIONS + 1)
        beyond = shares[-1] * albedo / max(1 - self.one * albedo - self.two * albedo**2, 1e-4)
        shares[-1] += beyond * (self.one + self.two * albedo)
        shares[-2] += beyond * self.two
        return np.asarray(shares @ np.exp(self.log_light))
