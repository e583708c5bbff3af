"""Places on the planes where light is tallied: their own, or of a track those before and behind each.

A vehicle reads at another distance every time. Along a ray from the lamp light changes smoothly: over few
planes the logarithm of z^2 E runs straight between neighbours.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.scene.tank import Tank, walls_m

#: From one plane to the next, as a part of the distance, and at most, as a part of the tank's width.
_STEP, _STEP_OF_TANK = 0.08, 0.25
#: Readings at so many more distances than there would be planes are between them. Chosen: planes that were
#: meant as such, 0.2 m apart, stay.
_MANY_MORE = 3


class OnPlanes(NamedTuple):
    """Where light at n places is told from, k times each.

    Parameters
    ----------
    x_m, y_m, z_m : arrays, shape (k, n), m
    weight : array, shape (k, n)
        Of the logarithm of light there.
    scale : array, shape (n,)
        What light falls by between.
    """

    x_m: Array
    y_m: Array
    z_m: Array
    weight: Array
    scale: Array

    @property
    def places(self) -> tuple[Array, Array, Array]:
        """x, y, z of all of them, shape (k n,), m."""
        return self.x_m.ravel(), self.y_m.ravel(), self.z_m.ravel()


def planes_for(z_m: Array, tank: Tank | None = None) -> Array:
    """Planes that tell of the light at some distances: these themselves, unless they are a track's.

    Parameters
    ----------
    z_m : array, shape (n,), m

    Returns
    -------
    array, shape (n_planes,), m
    """
    own = np.unique(np.round(z_m, 4))
    near, far = own[0], own[-1]
    if near <= 0:
        return own
    steps = np.log(far / near) / np.log1p(_STEP)
    if tank is not None:
        steps = max(steps, (far - near) / (_STEP_OF_TANK * min(tank.width_m, tank.depth_m)))
    count = int(np.ceil(steps)) + 1
    return own if len(own) <= _MANY_MORE * count else np.round(np.geomspace(near, far, count), 4)


def on_planes(
    planes_m: Array,
    x_m: Array,
    y_m: Array,
    z_m: Array,
    lamp_m: tuple[float, float] = (0.0, 0.0),
    tank: Tank | None = None,
) -> OnPlanes:
    """Places seen from the lamp on the planes before and behind them; on their own, if all are there.

    Parameters
    ----------
    planes_m : array, shape (n_planes,), m
        Rising.
    x_m, y_m, z_m : arrays, shape (n,), m
    lamp_m : pair of float, m
        x and y of the lamp.
    tank : Tank, optional
        Nearer to whose walls than halfway no place comes.
    """
    x, y, z = (np.asarray(v, float) for v in (x_m, y_m, z_m))
    one = np.ones_like(z)
    if np.abs(z[:, None] - planes_m).min(axis=1).max(initial=0) < 1e-3:
        return OnPlanes(x[None], y[None], z[None], one[None], one)
    before = np.clip(np.searchsorted(planes_m, z, "right") - 1, 0, len(planes_m) - 2)
    planes = np.stack([planes_m[before], planes_m[before + 1]])
    behind = (z - planes[0]) / (planes[1] - planes[0])
    along = np.log(planes / z)
    across = [
        lamp + (at - lamp) * np.exp(_straight(at, lamp, wall, along[1]) * along)
        for at, lamp, wall in zip((x, y), lamp_m, walls_m(tank)[:2], strict=True)
    ]
    weight = np.stack([1 - behind, behind])
    scale = np.exp(2 * (weight * along).sum(axis=0))
    return OnPlanes(across[0], across[1], planes, weight, scale)


def _straight(at: Array, lamp: float, wall: tuple[float, float], along: Array) -> Array:
    """How much of the ray's slope a place keeps: all, or what keeps it off the walls behind, from 0 to 1."""
    aside = at - lamp
    free = np.where(aside > 0, wall[1] - at, at - wall[0]) / 2
    away, ahead = np.abs(aside), along > 0
    kept = np.log1p(np.divide(free, away, out=np.full_like(away, np.inf), where=away > 0))
    return np.clip(np.divide(kept, along, out=np.ones_like(along), where=ahead), 0.0, 1.0)
