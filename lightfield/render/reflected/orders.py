"""Light between walls, by number of reflections: what patches and readings exchange, and the sum of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from lightfield.arrays import TINY

#: Reflections followed one by one; the rest is what a recurrence makes of the last four. In a closed tow tank
#: of walls of 0.9 and water that takes nothing, whose light has the longest ways, 96 change light by 0.06 %
#: (16 by 2.2 %); in the tanks of `benchmarks/constants` by less than 0.005 % (16 by 0.08 %).
REFLECTIONS = 32
#: Of dark walls fewer are followed: what is left of an albedo by so many reflections is less than this. With
#: the recurrence it changes the light by 2e-5 at most (four tanks, lamps of 4 to 40 degrees).
FEWER, _NOTHING = (8, 16), 1e-4
DARKEST = 1e-40  # 1/m^2: below it single precision has no logarithm to interpolate


class AtOnce(NamedTuple):
    """What reaches the readings from the patches, every number of reflections in one product.

    Parameters
    ----------
    first : array, shape (n, k * n_terms)
        From the k patches before the readings, by terms of their light (see `terms_of_light`).
    later : array, shape ((reflections - 1) * n, n_patches)
        From all patches by two reflections, by three, and so on.
    """

    first: np.ndarray
    later: np.ndarray

    def apply(self, terms: np.ndarray, patches: np.ndarray, reflections: int) -> np.ndarray:
        """As `Operators.apply`, of no more reflections than it was made for."""
        once = self.first @ terms.ravel()
        later = self.later[: (reflections - 1) * len(once)] @ patches
        return np.vstack([once, later.reshape(-1, len(once))]).astype(float)


class Operators(NamedTuple):
    """What patches and readings exchange, where all patches reflect all light.

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
    def of(cls, among: np.ndarray, parts: np.ndarray, terms: np.ndarray, before: np.ndarray) -> Operators:
        """Of the exchange between patches, and of their parts with the readings.

        Parameters
        ----------
        among : array, shape (n_patches, n_patches)
        parts : array, shape (n, k * parts^2)
        terms : array, shape (parts^2, n_terms)
        before : array of int, shape (k,)
        """
        n = len(parts)
        seen = parts.reshape(n, len(before), len(terms))
        return cls((seen @ terms).reshape(n, -1), seen.sum(axis=2), before, among)

    def apply(
        self, terms: np.ndarray, patches: np.ndarray, albedo: np.ndarray, reflections: int
    ) -> np.ndarray:
        """Light at the readings by number of reflections, shape (reflections, n).

        Parameters
        ----------
        terms : array, shape (k, n_terms)
            Of the light on the patches before the readings.
        patches : array, shape (n_patches,)
            Mean irradiance of all patches.
        albedo : array, shape (n_patches,)
            Of each patch, over that of the brightest.
        """
        own, radiosity = albedo[self.before], albedo * patches
        reflected = []
        for _ in range(reflections - 1):
            radiosity = albedo * (self.among @ radiosity)
            reflected.append(radiosity[self.before])
        once = self.first @ (own[:, None] * terms).ravel()
        return np.vstack([once, np.array(reflected) @ self.whole.T]).astype(float)

    def at_once(self, albedo: np.ndarray, reflections: int) -> AtOnce:
        """The same in one product, of patches of some albedo, shape (n_patches,): as much work as `apply` for
        some ten lamps, and then a tenth of it."""
        own, among = albedo[self.before], self.among * albedo
        n, later = len(self.whole), np.empty((reflections - 1, len(self.whole), len(among)), np.float32)
        later[0] = (self.whole * own) @ among[self.before]
        for i in range(1, len(later)):
            later[i] = later[i - 1] @ among
        first = (self.first.reshape(n, len(own), -1) * own[:, None]).reshape(n, -1)
        return AtOnce(first, later.reshape(-1, len(among)))


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


def reflections_of(albedo: float) -> int:
    """How many reflections of walls are followed one by one."""
    return next((n for n in FEWER if albedo**n < _NOTHING), REFLECTIONS)


class Orders(NamedTuple):
    """Light at the readings in several waters for unit albedo, by number of reflections.

    Parameters
    ----------
    log_light : array, shape (n_waters, reflections, n)
        Its logarithm.
    one, two : array, shape (n_waters,)
        What comes next: one times the last and two times the last but one, at all readings.
    """

    log_light: np.ndarray
    one: np.ndarray
    two: np.ndarray

    @classmethod
    def of(cls, light: np.ndarray) -> Orders:
        """With the recurrence that the last four tell of, by least squares over the readings.

        Two terms: light runs along the tank, and one ratio does not tell how.

        Parameters
        ----------
        light : array, shape (n_waters, reflections, n)
        """
        last = light[:, -1:]
        lit = light[:, -4:] * np.divide(1.0, last, out=np.zeros_like(last), where=last > 0)
        products = lit @ lit.transpose(0, 2, 1)
        normal = products[:, 1:3, 1:3] + products[:, :2, :2]
        trace = np.trace(normal, axis1=1, axis2=2)
        normal += (1e-9 * trace + TINY)[:, None, None] * np.eye(2)
        two, one = np.linalg.solve(normal, (products[:, 1:3, 3] + products[:, :2, 2])[..., None])[..., 0].T
        return cls(np.log(np.maximum(light, DARKEST)), one, two)

    def at(self, water: int) -> Orders:
        """In one of the waters."""
        return Orders(*(each[water : water + 1] for each in self))

    @classmethod
    def between(cls, several: Sequence[Orders], weights: np.ndarray) -> Orders:
        """Between several waters: ways of one order are much alike, so its logarithm is nearly linear.

        Parameters
        ----------
        several : sequence of Orders
            k waters together.
        weights : array, shape (n_waters, k)
        """
        log_light, one, two = (np.concatenate(each) for each in zip(*several, strict=True))
        flat = weights @ log_light.reshape(len(log_light), -1)
        return cls(flat.reshape(-1, *log_light.shape[1:]), weights @ one, weights @ two)

    def for_albedo(self, albedo: float) -> np.ndarray:
        """Light of all reflections, shape (n_waters, n)."""
        count = self.log_light.shape[1]
        shares = np.tile(albedo ** np.arange(1.0, count + 1), (len(self.one), 1))
        left = np.maximum(1 - self.one * albedo - self.two * albedo**2, 1e-4)
        beyond = shares[:, -1] * albedo / left
        shares[:, -1] += beyond * (self.one + self.two * albedo)
        shares[:, -2] += beyond * self.two
        return np.asarray((shares[:, None] @ np.exp(self.log_light))[:, 0])
