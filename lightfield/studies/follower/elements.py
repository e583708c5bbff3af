"""The elements of an array, in its own frame: origin in the middle, axis along -z, x horizontal, y up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.scene import DetectorArray
from lightfield.scene.follower import COLUMNS
from lightfield.storage.tables import read_rows

#: Angle, rad, between neighbours of a spiral that fills a sphere evenly: pi (3 - sqrt 5) (Gonzalez 2010,
#: Math. Geosci. 42, 49, doi:10.1007/s11004-009-9257-x).
_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5.0))


@dataclass(frozen=True)
class Elements:
    """Cosine receivers.

    Parameters
    ----------
    place_m, normal : array, shape (n, 3)
        Places, m, and outward unit normals, in the array's frame.
    """

    place_m: Array
    normal: Array

    def __len__(self) -> int:
        return len(self.place_m)

    def as_csv(self) -> str:
        """The table that a scene reads with layout = "table"."""
        rows = np.concatenate([self.place_m, self.normal], axis=1)
        return "\n".join([",".join(COLUMNS), *(",".join(f"{v:.6g}" for v in row) for row in rows), ""])

    @property
    def tilts_deg(self) -> Array:
        """Towards +x and +y, of the normals (tan tx, tan ty, -1), degrees, shape (n, 2)."""
        return np.asarray(np.degrees(np.arctan2(self.normal[:, :2], -self.normal[:, 2:])))

    @property
    def reach_m(self) -> float:
        """Distance of the element that is farthest from the middle, m."""
        return float(np.linalg.norm(self.place_m, axis=1).max())

    @property
    def spacing_m(self) -> float:
        """Distance of the two elements that are nearest to each other, m; infinite for one alone."""
        apart = np.linalg.norm(self.place_m[:, None] - self.place_m[None], axis=2)
        return float(np.min(apart[~np.eye(len(self), dtype=bool)], initial=np.inf))


def elements_of(array: DetectorArray) -> Elements:
    """Elements of the array that a scene describes."""
    if array.layout == "table":
        columns = np.stack(read_rows(str(array.table), COLUMNS), axis=1)
        length = np.linalg.norm(columns[:, 3:], axis=1, keepdims=True)
        return Elements(columns[:, :3], columns[:, 3:] / length)
    if array.layout == "hemisphere":
        return _hemisphere(array.count[0] * array.count[1], array.radius_m)
    flat = grid(array.count, array.size_m) if array.layout == "grid" else rings(array.count, array.size_m)
    return on_sphere(flat, array.radius_m) if array.radius_m else flat


def grid(count: tuple[int, int], size_m: float) -> Elements:
    """Columns and rows in a plane; the longer side is `size_m`."""
    pitch = size_m / max(1, max(count) - 1)
    x, y = (pitch * (np.arange(n) - 0.5 * (n - 1)) for n in count)
    across, up = np.meshgrid(x, y, indexing="ij")
    return _flat(across.ravel(), up.ravel())


def rings(count: tuple[int, int], size_m: float) -> Elements:
    """So many elements on each of so many rings in a plane; `size_m` is the largest diameter."""
    per_ring, n_rings = count
    radius = 0.5 * size_m * (np.arange(n_rings) + 1) / n_rings
    turn = 2 * np.pi * np.arange(per_ring) / per_ring
    r, t = (v.ravel() for v in np.meshgrid(radius, turn, indexing="ij"))
    return _flat(r * np.cos(t), r * np.sin(t))


def _flat(x: Array, y: Array) -> Elements:
    place = np.stack([x, y, np.zeros_like(x)], axis=1)
    return Elements(place, np.tile([0.0, 0.0, -1.0], (len(x), 1)))


def on_sphere(flat: Elements, radius_m: float) -> Elements:
    """Elements of a plane moved back along z onto a sphere that touches it, facing outwards."""
    x, y, _ = flat.place_m.T
    deep = np.sqrt(radius_m**2 - x**2 - y**2)
    return Elements(np.stack([x, y, radius_m - deep], axis=1), np.stack([x, y, -deep], axis=1) / radius_m)


def _hemisphere(n: int, radius_m: float) -> Elements:
    """Elements that share a half sphere evenly, on a spiral."""
    forward = 1 - (np.arange(n) + 0.5) / n
    turn = _GOLDEN_ANGLE * np.arange(n)
    across = np.sqrt(1 - forward**2)
    normal = np.stack([across * np.cos(turn), across * np.sin(turn), -forward], axis=1)
    return Elements(radius_m * (normal + np.array([0.0, 0.0, 1.0])), normal)
