"""Where the explorer shows light: a square of places on every plane, as far as it is in the water."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array, Mask
from lightfield.readings import Readings
from lightfield.readings.columns import LINE_DECIMALS
from lightfield.scene import Scene
from lightfield.scene.in_tank import cells_inside

#: Places along the side of a map, odd: one is on the axis. Chosen: light bends over half a metre.
SIDE = 41
#: Planes that are shown at most; of more distances these are spread evenly. Chosen.
MOST_PLANES = 9
#: Distances closer than this, in m, are one plane.
_SAME_M = 0.02


@dataclass(frozen=True)
class MapPlaces:
    """Places of the maps, plane by plane, near to far.

    Parameters
    ----------
    z_m : tuple of float
        Distance of each plane.
    x_m, y_m : arrays, shape (SIDE,)
        The same on all planes.
    wet : array of bool, shape (SIDE, SIDE)
        Which of them are in the water; there is light to show at those alone.
    """

    z_m: tuple[float, ...]
    x_m: Array
    y_m: Array
    wet: Mask

    @classmethod
    def of(cls, scene: Scene, readings: Readings | None) -> MapPlaces:
        """Those of a scene's planes, or of the distances in water that were read."""
        if readings is not None and (np.asarray(readings.medium) != "air").any():
            z = np.asarray(readings.z_m, float)[np.asarray(readings.medium) != "air"]
        elif scene.detector.positions_m is not None:
            z = np.array(scene.detector.positions_m, float)[:, 2]
        else:
            z = np.array(scene.detector.planes_m, float)
        z = _apart(np.unique(np.round(z, LINE_DECIMALS)))
        z = spread(z, MOST_PLANES)
        width, height = scene.plane_size_m
        middles = (np.arange(SIDE) + 0.5) / SIDE - 0.5
        x, y = width * middles, height * middles
        wet = cells_inside(scene.tank, x, y, width / SIDE, height / SIDE) >= 0.5  # their middles are
        return cls(tuple(z.tolist()), x, y, wet)

    @cached_property
    def columns(self) -> Mapping[str, NDArray[np.generic]]:
        """Columns of readings at all places in the water, plane by plane, each of shape (n,)."""
        z, y, x = (v[:, self.wet] for v in np.meshgrid(self.z_m, self.y_m, self.x_m, indexing="ij"))
        n = z.size
        return {
            "x_m": x.ravel(),
            "y_m": y.ravel(),
            "z_m": z.ravel(),
            "medium": np.full(n, "water"),
            "time_s": np.zeros(n),
        }

    def rows(self, plane: int) -> Mask:
        """Which of all places in the water lie on a plane."""
        return np.repeat(np.arange(len(self.z_m)) == plane, self.wet.sum())

    def some(self, kept: Mask) -> Mask:
        """Which of all places in the water lie in kept columns and rows of a map, shape (SIDE,) each."""
        return np.tile(np.outer(kept, kept)[self.wet], len(self.z_m))

    def map_of(self, values: Array) -> Array:
        """Values at the places of a plane as a map, shape (SIDE, SIDE); NaN outside the water."""
        out = np.full(self.wet.shape, np.nan)
        out[self.wet] = values
        return out


def spread(values: Array, most: int) -> Array:
    """All values, or of more than so many these, evenly."""
    return values[np.round(np.linspace(0, len(values) - 1, min(len(values), most))).astype(int)]


def _apart(z: Array) -> Array:
    """Of ascending distances those that are another plane than the last one kept."""
    kept = [z[0]]
    for one in z[1:]:
        if one - kept[-1] > _SAME_M:
            kept.append(one)
    return np.array(kept)
