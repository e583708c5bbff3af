"""Photons walked in NumPy: scattered light on the axis of a round lamp in unbounded water, by other means.

The lamp is a point, so a photon's whole history may be turned about it: every photon that crosses the sphere
through a receiver counts at the receiver, as one that had been emitted at that angle to the axis,

    E = 1/z^2  sum over crossings  f(theta) W,

with f the beam's relative intensity and W the photon's weight. No cells, no planes, no histories in classes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array

#: Photons farther out than this many times the farthest receiver do not come back; orders of scattering.
FAR, ORDERS = 2.0, 40


class Arrived(NamedTuple):
    """Scattered light at the receivers, crossing by crossing.

    Parameters
    ----------
    receiver, batch : array of int, shape (n,)
    weight : array, shape (n,), m^-2
        Its share in plane irradiance facing the lamp, for unit intensity on the axis.
    angle_rad, excess_m : array, shape (n,)
        Off the receiver's axis; path beyond the straight line.
    batches : int
    """

    receiver: Array
    batch: Array
    weight: Array
    angle_rad: Array
    excess_m: Array
    batches: int

    def irradiance(self, receiver: int) -> tuple[float, float]:
        """Value and standard error, m^-2."""
        return self._sum(self.receiver == receiver, self.weight)

    def radiance(self, receiver: int, full_angle_deg: float) -> tuple[float, float]:
        """Mean over a cone, and standard error, m^-2 sr^-1."""
        half = np.radians(0.5 * full_angle_deg)
        inside = (self.receiver == receiver) & (self.angle_rad < half)
        return self._sum(inside, self.weight / np.cos(self.angle_rad) / (4 * np.pi * np.sin(half / 2) ** 2))

    def _sum(self, some: Array, values: Array) -> tuple[float, float]:
        each = np.bincount(self.batch[some], values[some], self.batches) * self.batches
        return float(each.mean()), float(each.std(ddof=1) / np.sqrt(self.batches))


def walk(
    a: float, b: float, g: float, z_m: Array, hwhm_deg: float, photons: int, seed: int = 0, batches: int = 8
) -> Arrived:
    """Henyey-Greenstein scattering in water of these coefficients, 1/m; a Gaussian beam."""
    rng = np.random.default_rng(seed)
    n = photons // batches * batches
    place, way, batch = np.zeros((n, 3)), np.tile([0.0, 0.0, 1.0], (n, 1)), np.arange(n) % batches
    path = np.zeros(n)
    found = []
    for order in range(ORDERS):
        for k, z in enumerate(z_m if order else ()):
            along = (place * way).sum(axis=1)
            root = along**2 - (place**2).sum(axis=1) + z**2
            left = np.sqrt(np.maximum(root, 0)) - along
            hit = (root > 0) & (left > 0)
            outward = (place[hit] + left[hit, None] * way[hit]) / z
            length = path[hit] + left[hit]
            theta = np.arccos(np.clip(outward[:, 2], -1, 1))
            beam = 0.5 ** ((theta / np.radians(hwhm_deg)) ** 2)
            weight = beam * np.exp(-a * length - b * left[hit]) / (n * z**2)
            angle = 2 * np.arcsin(np.minimum(0.5 * np.linalg.norm(way[hit] - outward, axis=1), 1))
            found.append((np.full(len(weight), k), batch[hit], weight, angle, length - z))
        step = rng.exponential(1 / b, len(place))
        place, path = place + step[:, None] * way, path + step
        inside = (place**2).sum(axis=1) < (FAR * max(z_m)) ** 2
        place, path, batch = place[inside], path[inside], batch[inside]
        way = _turned(way[inside], g, rng)
    return Arrived(*(np.concatenate(column) for column in zip(*found, strict=True)), batches)


def _turned(way: Array, g: float, rng: np.random.Generator) -> Array:
    """Directions after a scattering (Henyey and Greenstein 1941)."""
    u, turn = rng.random(len(way)), 2 * np.pi * rng.random(len(way))
    cosine = (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * u)) ** 2) / (2 * g)
    sine = np.sqrt(1 - cosine**2)
    # Two vectors across, by the axis that the flight is farthest from.
    helper = np.eye(3)[np.abs(way).argmin(axis=1)]
    first = np.cross(helper, way)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(way, first)
    new = sine[:, None] * (np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second)
    new += cosine[:, None] * way
    return np.asarray(new / np.linalg.norm(new, axis=1, keepdims=True))
