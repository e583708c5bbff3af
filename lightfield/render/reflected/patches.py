"""Patches on the walls of a tank, and the light that they send to each other and to receivers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil, pi, sqrt
from typing import NamedTuple

import numpy as np

from lightfield.scene import Scene

_NEAR, _SUBDIVIDED = 2.5, 4  # pairs nearer than 2.5 patch lengths: the patch is seen as 4 x 4 parts
AT_ONCE = 1 << 18  # pairs that are worked out at a time
#: Patches beyond what readings see: so much larger across; rows along begin at this part of the reach and
#: grow by this factor, to half of it. Three times as many change light in a white tow tank by 0.5 % at most.
_COARSER, _ROW, _GROWTH = 2.0, 0.06, 1.4

AngularResponse = Callable[[Sequence[np.ndarray], np.ndarray], np.ndarray]


class Patches(NamedTuple):
    """Rectangles on the walls: centres and inward normals, (k, 3); half edges across and along, (k,)."""

    centre: np.ndarray
    normal: np.ndarray
    half_across: np.ndarray
    half_along: np.ndarray

    @property
    def across(self) -> np.ndarray:
        """Unit vectors of the first edge, (k, 3); the second one runs along z, or along y on an end."""
        n = self.normal
        return np.stack([np.abs(n[:, 1]) + np.abs(n[:, 2]), np.abs(n[:, 0]), np.zeros(len(n))], axis=1)

    @property
    def along(self) -> np.ndarray:
        """Unit vectors along the second edge, shape (k, 3)."""
        end = np.abs(self.normal[:, 2:])
        return np.hstack([np.zeros_like(end), end, 1 - end])

    @property
    def area(self) -> np.ndarray:
        """m^2, shape (k,)."""
        return np.asarray(4 * self.half_across * self.half_along)

    def divided(self, parts: int) -> Patches:
        """Every patch in parts x parts equal ones, those of a patch in a row."""
        at = (2 * np.arange(parts) + 1) / parts - 1
        u, v = (g.ravel() for g in np.meshgrid(at, at, indexing="ij"))
        move = self.across[:, None] * (self.half_across[:, None] * u)[..., None]
        move = move + self.along[:, None] * (self.half_along[:, None] * v)[..., None]
        repeated = [np.repeat(a, parts**2, axis=0) for a in (self.normal, self.half_across, self.half_along)]
        centre = (self.centre[:, None] + move).reshape(-1, 3)
        return Patches(centre, repeated[0], repeated[1] / parts, repeated[2] / parts)

    def mirrored(self, top_m: float) -> Patches:
        """Mirror images in the water surface y = top."""
        flip = np.array([1.0, -1.0, 1.0])
        return self._replace(
            centre=self.centre * flip + np.array([0.0, 2 * top_m, 0.0]), normal=self.normal * flip
        )

    def on_both_sides(self) -> Patches:
        """These, and then their mirror images at -x in the same order."""
        flip = np.array([-1.0, 1.0, 1.0])
        return _together([self, self._replace(centre=self.centre * flip, normal=self.normal * flip)])

    def some(self, which: np.ndarray) -> Patches:
        """A selection."""
        return Patches(*(a[which] for a in self))


class Transfer(NamedTuple):
    """Irradiance at receivers from unit radiosity of patches, and distance; (n, k), single precision."""

    factor: np.ndarray
    distance: np.ndarray

    def through(self, attenuation_per_m: float) -> np.ndarray:
        """Factors in water of this attenuation."""
        return np.asarray(self.factor * np.exp(np.float32(-attenuation_per_m) * self.distance))


def closed(found: Transfer, whole: np.ndarray) -> Transfer:
    """Factors in a closed room, where light that is the same all over stays the same.

    The factors are those of patches' middles, a per cent off near corners; bright walls would raise that to
    the power of the reflections.

    Parameters
    ----------
    whole : array, shape (n,)
        Sum of the factors of all that a cosine receiver sees, which should be 1; 0 outside of the room.
    """
    inside = np.where(whole > 0, whole, 1.0).astype(np.float32)
    return found._replace(factor=found.factor / inside[:, None])


def transfer(places: np.ndarray, response: AngularResponse, patches: Patches) -> Transfer:
    """Irradiance at places from unit radiosity of patches.

    Parameters
    ----------
    places : array, shape (n, 3), m
    response : callable
        Of the receivers with these numbers to light that flies along x, y and z components of directions.
    patches : Patches
        k of them.
    """
    # A block of places at a time: what is worked out on the way is ten times as large.
    step = max(AT_ONCE // max(len(patches.centre), 1), 1)
    blocks = [_block(places, response, patches, slice(i, i + step)) for i in range(0, len(places), step)]
    factor, distance = (np.concatenate(column) for column in zip(*blocks, strict=True))
    return Transfer(factor, distance)


def _block(places: np.ndarray, response: AngularResponse, patches: Patches, some: slice) -> Transfer:
    every, here = np.arange(len(places))[some, None], places[some]
    factor, distance = _exchange(here[:, None], patches.centre, patches.normal, response, every)
    factor *= patches.area
    size = 2 * np.maximum(patches.half_across, patches.half_along)
    near, mine = np.nonzero(distance < _NEAR * size)
    if len(near):
        parts = patches.some(mine).divided(_SUBDIVIDED)
        shape = (len(near), _SUBDIVIDED**2, 3)
        centre, normal = parts.centre.reshape(shape), parts.normal.reshape(shape)
        close, _ = _exchange(here[near][:, None], centre, normal, response, every[near])
        factor[near, mine] = close.mean(axis=1) * patches.area[mine]
    return Transfer(factor.astype(np.float32), distance.astype(np.float32))


def _exchange(
    places: np.ndarray, centre: np.ndarray, normal: np.ndarray, response: AngularResponse, which: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lambert's cosines over pi d^2, per area of the patch, and d."""
    # One array for each component: sums over a last axis of three are slow.
    way = [places[..., i] - centre[..., i] for i in range(3)]
    distance = np.sqrt(sum(w * w for w in way))
    inverse = 1 / np.maximum(distance, 1e-6)
    direction = [w * inverse for w in way]
    leaving = sum(d * normal[..., i] for i, d in enumerate(direction))
    seen = np.maximum(leaving, 0) * response(direction, which)
    return np.where(distance > 1e-6, seen * inverse**2 / pi, 0.0), distance


def walls(scene: Scene, farthest_m: float, lid: bool, count: float) -> tuple[Patches, Patches]:
    """Patches of all walls: roughly so many of about equal size where readings see them, larger ones beyond.

    Returns
    -------
    walls : Patches
        Those at positive x; their mirror images at -x are the others.
    openings : Patches
        All of the opening (no lid) that makes the walls a closed box.
    """
    tank = scene.tank
    assert tank is not None
    x_side, y_side, (front, back) = tank.box_m
    floor, top = y_side
    # What goes past the readings, or behind the lamp, comes back from there by many reflections: smooth.
    reach = 2 * max(tank.width_m, tank.depth_m)
    start, end = max(front, -reach), min(back, farthest_m + reach)
    around = 2 * tank.depth_m + (2 if lid else 1) * tank.width_m
    step = sqrt((around * (end - start) + 2 * tank.width_m * tank.depth_m) / count)
    made: list[Patches] = []
    left: list[Patches] = []
    for low, high, along in [(start, end, None), *_beyond(start, front, reach), *_beyond(end, back, reach)]:
        z, across = (low, high), step if along is None else _COARSER * step
        made += [
            _rectangle((x, None, None), (y_side, z), (-sign, 0, 0), across, along)
            for x, sign in zip(x_side, (-1, 1), strict=True)
        ]
        made.append(_rectangle((None, floor, None), (x_side, z), (0, 1, 0), across, along))
        (made if lid else left).append(_rectangle((None, top, None), (x_side, z), (0, -1, 0), across, along))
    for at, sign in ((front, 1), (back, -1)):
        made.append(_rectangle((None, None, at), (x_side, y_side), (0, 0, sign), step))
    every = _together(made)
    return every.some(every.centre[:, 0] > 0), _together(left) if left else every.some(np.zeros(0, int))


def _beyond(begin: float, wall: float, reach: float) -> list[tuple[float, float, float]]:
    """Stretches of the side walls from where patches are small to an end of the tank, ever longer, in rows.

    Returns
    -------
    list of (float, float, float), m
        Low and high z, and the length of a row.
    """
    out, length = [], _ROW * reach
    at, way = begin, abs(wall - begin)
    sign = 1.0 if wall > begin else -1.0
    while way > 1e-9:
        length = min(length * _GROWTH, 0.5 * reach, way)
        if way - length < 0.5 * length:
            length = way
        low, high = sorted((at, at + sign * length))
        out.append((low, high, high - low))
        at, way = at + sign * length, way - length
    return out


def _together(several: list[Patches]) -> Patches:
    return Patches(*(np.concatenate(column) for column in zip(*several, strict=True)))


def _rectangle(
    at: tuple[float | None, ...],
    sides: tuple[tuple[float, float], ...],
    normal: tuple[float, ...],
    step: float,
    row: float | None = None,
) -> Patches:
    """Equal patches of a wall; `at` holds its fixed coordinate and None for the two that vary.

    Where a length of rows is given, one row. None lies across x = 0.
    """
    first = _midpoints(*sides[0], step, even=at[0] is None)
    second = _midpoints(*sides[1], step) if row is None else np.array([0.5 * sum(sides[1])])
    u, v = (g.ravel() for g in np.meshgrid(first, second, indexing="ij"))
    varying = iter((u, v))
    centre = np.stack([next(varying) if c is None else np.full(len(u), c) for c in at], axis=1)
    edges = [0.5 * (high - low) / n for (low, high), n in zip(sides, (len(first), len(second)), strict=True)]
    return Patches(
        centre,
        np.tile(np.array(normal, float), (len(u), 1)),
        np.full(len(u), edges[0]),
        np.full(len(u), edges[1]),
    )


def _midpoints(low: float, high: float, step: float, even: bool = False) -> np.ndarray:
    count = max(2, ceil((high - low) / step))
    count += count % 2 if even else 0
    return low + (np.arange(count) + 0.5) * ((high - low) / count)
