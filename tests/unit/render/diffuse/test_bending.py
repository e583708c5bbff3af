"""Cells around places are enough to know the light at each: in every layout and beam, and beside walls."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from lightfield.render.diffuse.bending import NEIGHBOURS_2D, TalliedCells, surrounded
from lightfield.render.diffuse.diffuse_response import SCATTERED_ERROR
from lightfield.render.diffuse.shift import Shift
from lightfield.render.diffuse.source import CELL_M
from lightfield.render.response.grid import Grid, positions_grid
from lightfield.scene.tank import Tank

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
    """From noiseless means over cells, within twice the standard error stated beside that of Monte Carlo."""
    x, y, z = spread_out(places, planes)
    grid = surrounded(positions_grid(x, y, z, CELL_M, hwhm_deg))
    found = Shift.on(grid, x, y, z).apply(means(grid, hwhm_deg))
    np.testing.assert_allclose(found, glow(x, y, z, hwhm_deg), rtol=2 * SCATTERED_ERROR)


SHARE = st.integers(0, 100).map(lambda n: n / 100)


@given(
    st.lists(st.tuples(SHARE, SHARE), min_size=1, max_size=6, unique=True),
    st.integers(5, 40).map(lambda n: n / 10), st.integers(5, 40).map(lambda n: n / 10), st.just(15.0),
)  # fmt: skip
@example([(0.5, 0.6)], 0.5, 0.5, 15.0)
@example([(0.98, 0.6), (0.5, 0.002)], 0.5, 0.5, 15.0)
@example([(0.98, 0.98)], 3.2, 2.5, 15.0)
@example([(0.02, 0.02), (0.98, 0.98)], 2.0, 1.0, 6.0)
@example([(0.02, 0.97), (0.3, 0.99)], 2.0, 1.0, 6.0)
def test_no_cell_is_cut_by_a_wall(
    places: list[tuple[float, float]], width_m: float, depth_m: float, hwhm_deg: float
) -> None:
    """Tanks of 0.5 to 4 m, places up to walls and corners: light of a smooth field is known there too."""
    tank = Tank(width_m=width_m, depth_m=depth_m, lamp_depth_m=0.4 * depth_m)
    high = tank.lamp_depth_m
    x, y, z = spread_out(places, [4.5])
    x, y = (x - 0.5) * width_m, high - (1 - y) * depth_m
    grid = surrounded(positions_grid(x, y, z, CELL_M, hwhm_deg, tank), tank)
    for centre, pitch, low, top in (
        (grid.x_m, grid.pitch_x_m, -width_m / 2, width_m / 2),
        (grid.y_m, grid.pitch_y_m, high - depth_m, high),
    ):
        assert low - 1e-5 <= centre[0] - pitch / 2 and centre[-1] + pitch / 2 <= top + 1e-5
    found = Shift.on(grid, x, y, z).apply(means(grid, hwhm_deg))
    np.testing.assert_allclose(found, glow(x, y, z, hwhm_deg), rtol=2 * SCATTERED_ERROR)


def test_even_layouts_that_tell_of_themselves_need_no_more_cells() -> None:
    """Lines through the axis and grids all over the beam, 4.5 m away and beyond, cost what they did."""
    line, seven = np.linspace(-1, 1, 21), np.linspace(-0.81, 0.81, 7)
    grids = ([(x, 0.0) for x in line], [(0.0, y) for y in line[::2]], [(x, y) for x in seven for y in seven])
    for places in grids:
        x, y, z = spread_out(places, [4.5, 6.5])
        occupied = surrounded(positions_grid(x, y, z, CELL_M, 3.81)).occupied
        assert occupied is not None and occupied.sum() == len(x)


@given(PLACES, PLANES, st.sampled_from([1.0, 3.81, 15.0]))
@example([(0.1 * i, 0.1 * j) for i in range(-4, 5) for j in range(-4, 5)], [4.5, 5.5], 3.81)
def test_a_cell_is_known_by_the_nearest_of_its_plane(
    places: list[tuple[float, float]], planes: list[float], hwhm_deg: float
) -> None:
    """Of as many that are equally far the first; looked for among all."""
    x, y, z = spread_out(places, planes)
    cells = TalliedCells(surrounded(positions_grid(x, y, z, CELL_M, hwhm_deg)))
    for i in range(cells.size):
        apart = np.hypot(np.round(cells.x - cells.x[i], 9), np.round(cells.y - cells.y[i], 9))
        nearest = np.argsort(np.where(cells.z == cells.z[i], apart, np.inf), kind="stable")
        count = min(NEIGHBOURS_2D, np.count_nonzero(cells.z == cells.z[i]))
        found = cells.bending(i)
        assert found is None or set(found.near) <= set(nearest[:count])
        assert list(cells._nearest[i][:count]) == list(nearest[:count])
