"""Light that patches of walls exchange, and what is interpolated of it: against closed forms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from lightfield.render.reflected.patches import Patches, closed, transfer
from lightfield.render.reflected.room import between_attenuations, lagrange


def wall(axis: int, at: float, normal: float, edge: int = 16) -> Patches:
    """A wall of a cube from 0 to 1 in x, y and z, in so many equal squares along an edge."""
    middles = (np.arange(edge) + 0.5) / edge
    u, v = (g.ravel() for g in np.meshgrid(middles, middles, indexing="ij"))
    centre = np.insert(np.stack([u, v], axis=1), axis, at, axis=1)
    facing = np.zeros_like(centre)
    facing[:, axis] = normal
    half = np.full(len(u), 0.5 / edge)
    return Patches(centre, facing, half, half)


def of_wall(seen: Patches, from_wall: Patches) -> float:
    """Mean irradiance of a wall by another one of unit radiosity: its view factor."""

    def cosine(direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        return np.maximum(-sum(d * from_wall.normal[which, i] for i, d in enumerate(direction)), 0.0)

    return float(transfer(from_wall.centre, cosine, seen).factor.sum(axis=1).mean())


def opposite_squares() -> float:
    """Of a cube (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, C-11)."""
    far = np.sqrt(2.0)
    return float(2 / np.pi * (np.log(2 / np.sqrt(3)) + 2 * far * np.arctan(1 / far) - 2 * np.arctan(1.0)))


def test_opposite_and_adjacent_walls_of_a_cube_see_each_other() -> None:
    """0.1998 and, because a wall sees nothing else than five others, (1 - 0.1998) / 4 = 0.2000.

    Of middles, which err by the square of a patch's size: of two sizes what they err by cancels. Near corners
    they are a per cent off (`closed`).
    """
    across = opposite_squares()
    assert across == pytest.approx(0.19982, abs=1e-5)
    coarse, fine = (of_wall(wall(2, 1.0, -1.0, n), wall(2, 0.0, 1.0, n)) for n in (8, 16))
    assert (4 * fine - coarse) / 3 == pytest.approx(across, rel=1e-4)
    beside = (1 - across) / 4
    assert of_wall(wall(0, 0.0, 1.0), wall(2, 0.0, 1.0)) == pytest.approx(beside, rel=0.01)
    assert of_wall(wall(1, 1.0, -1.0), wall(2, 0.0, 1.0)) == pytest.approx(beside, rel=0.01)


def test_a_wall_does_not_see_what_turns_its_back() -> None:
    assert of_wall(wall(2, 1.0, 1.0), wall(2, 0.0, 1.0)) == 0.0
    assert of_wall(wall(2, 1.0, -1.0), wall(2, 0.0, -1.0)) == 0.0


def test_water_dims_by_its_way() -> None:
    """From a small patch on the axis, two metres away: A / (pi d^2) exp(-c d)."""
    half = np.array([0.01])
    small = Patches(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), half, half)

    def facing(direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        return np.asarray(direction[2])

    sent = transfer(np.array([[0.0, 0.0, 2.0]]), facing, small).through(0.7)
    assert sent[0, 0] == pytest.approx(4e-4 / (4 * np.pi) * np.exp(-1.4), rel=1e-4)


def test_in_a_closed_room_nothing_is_lost() -> None:
    """Factors over all that a place sees sum to one; on average to a per cent before they are closed."""
    cube = [wall(a, at, n) for a in range(3) for at, n in ((0.0, 1.0), (1.0, -1.0))]
    every = Patches(*(np.concatenate(column) for column in zip(*cube, strict=True)))
    floor = wall(1, 0.0, 1.0)

    def up(direction: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        return np.maximum(-direction[1], 0.0)

    found = transfer(floor.centre, up, every)
    seen = found.factor.sum(axis=1)
    assert seen.mean() == pytest.approx(1.0, abs=0.01)
    assert np.ptp(seen) > 1e-3
    assert closed(found, seen).factor.sum(axis=1) == pytest.approx(np.ones(len(seen)), rel=1e-5)


def test_cubics_are_interpolated_exactly() -> None:
    """In steps of the attenuation, and by one polynomial through the reflectances."""

    def curve(c: np.ndarray) -> np.ndarray:
        return 1.0 - 2.0 * c + 30.0 * c**2 - 100.0 * c**3

    at = np.array([0.0, 0.013, 0.14, 0.15, 0.16, 0.1875, 0.9])
    nodes, weights = between_attenuations(at)
    assert nodes == sorted(set(nodes)) and {0.125, 0.15, 0.2}.issubset(nodes) and 0.175 not in nodes
    assert weights @ curve(np.array(nodes)) == pytest.approx(curve(at), rel=1e-9)
    mirrors = np.array([0.0, 0.5, 1.0, 1.5])
    assert lagrange(mirrors, 0.8) @ curve(mirrors) == pytest.approx(curve(np.array(0.8)), rel=1e-9)
