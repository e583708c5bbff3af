"""Cells around places enough to know the light at each: of every layout, in every beam, beside every wall."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lightfield.render.bending import Cells, surrounded
from lightfield.render.diffuse import CELL_M
from lightfield.render.diffuse_response import SCATTERED_ERROR
from lightfield.render.grid import Grid, cell_of, positions_grid
from lightfield.render.shift import Shift
from lightfield.scene_parts import Tank

LENGTH = st.integers(-600, 600).map(lambda mm: mm / 1000)
PLACES = st.lists(st.tuples(LENGTH, LENGTH), min_size=1, max_size=6, unique=True)
PLANES = st.lists(st.integers(1, 12).map(lambda n: 0.75 * n), min_size=1, max_size=3, unique=True)


def glow(x: np.ndarray, y: np.ndarray, z: np.ndarray, hwhm_deg: float) -> np.ndarray:
    """Something like scattered light: a little wider than the beam, with a halo that falls as 1/r^3."""
    q = (x * x + y * y) / (np.radians(hwhm_deg) * z) ** 2
    return np.asarray(np.exp(-np.log(2) * q / 1.44) + 0.3 / (1 + q / 4) ** 1.5)


def means(grid: Grid, hwhm_deg: float) -> np.ndarray:
    """Of the glow over every tallied cell, by Gauss-Legendre quadrature."""
    node, weight = np.polynomial.legendre.leggauss(8)
    x, y, z = grid.centres()
    u, v = 0.5 * grid.pitch_x_m * node, 0.5 * grid.pitch_y_m * node
    inside = glow(x[:, None, None] + u[:, None], y[:, None, None] + v, z[:, None, None], hwhm_deg)
    return np.einsum("cij,i,j->c", inside, 0.5 * weight, 0.5 * weight)


def spread_out(places: list[tuple[float, float]], planes: list[float]) -> np.ndarray:
    return np.array([(x, y, z) for z in planes for x, y in places], float).T


@given(PLACES, PLANES, st.sampled_from([1.0, 3.81, 15.0]))
@example([(0.0, 0.0)], [4.5, 5.5, 6.5], 3.81)
@example([(-0.3, 0.1), (0.02, 0.0), (0.17, 0.33)], [4.5], 3.81)
@example([(x, 0.3) for x in (-0.4, -0.2, 0.0, 0.2, 0.4)], [3.0, 6.0], 3.81)
@example([(0.0, 0.0), (0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3)], [4.5], 3.81)
def test_the_light_at_a_place_is_known_to_the_stated_error(
    places: list[tuple[float, float]], planes: list[float], hwhm_deg: float
) -> None:
    """From noiseless means over cells: the error stated beside Monte Carlo noise covers what is left."""
    x, y, z = spread_out(places, planes)
    grid = surrounded(positions_grid(x, y, z, CELL_M, hwhm_deg))
    found = Shift(grid, x, y, z).apply(means(grid, hwhm_deg))
    np.testing.assert_allclose(found, glow(x, y, z, hwhm_deg), rtol=SCATTERED_ERROR)
