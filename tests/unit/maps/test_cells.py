"""What a model shows in a cell, and which cells are on the axis."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.formula.scattered.quadrature import in_cell
from lightfield.maps.cells import axis_cells, cell_mean, pitch_m


def test_mean_over_a_cell() -> None:
    """Three Gauss points integrate polynomials up to the fifth power exactly: of x^4 y^2 + x + 3, by hand."""
    x, y, hx, hy = np.array([0.0, 0.4, 0.8]), np.array([-0.3, 0.3]), 0.4, 0.6

    def of_x(power: int) -> np.ndarray:
        return ((x + hx / 2) ** (power + 1) - (x - hx / 2) ** (power + 1)) / (power + 1) / hx

    y_squared = ((y + hy / 2) ** 3 - (y - hy / 2) ** 3) / 3 / hy
    mean = cell_mean(lambda u, v: u**4 * v**2 + u + 3, x, y, hx, hy)
    np.testing.assert_allclose(mean, of_x(4) * y_squared[:, None] + of_x(1) + 3, rtol=1e-13)
    planes = cell_mean(lambda u, v: np.array([1.0, 2.0])[:, None, None] * u, x, y, hx, hy)
    np.testing.assert_allclose(planes, np.broadcast_to([[[1.0]], [[2.0]]] * x, (2, 2, 3)), atol=1e-15)


@pytest.mark.parametrize("n", [2, 3, 8])
def test_nodes_of_a_cell(n: int) -> None:
    """Exact up to the power 2 n - 1 each way: of x^(2 n - 2) y^2 over a cell of side one, by hand."""
    nodes, weight = in_cell(n)
    x, y = nodes.T
    assert weight @ (x ** (2 * n - 2) * y**2) == pytest.approx(0.25 ** (n - 1) / (2 * n - 1) / 12, rel=1e-12)


def test_cells_on_the_axis() -> None:
    odd, even = np.array([-0.1, 0.0, 0.1]), np.array([-0.15, -0.05, 0.05, 0.15])
    assert np.argwhere(axis_cells(odd, odd)).tolist() == [[1, 1]]
    assert np.argwhere(axis_cells(odd, even)).tolist() == [[1, 1], [2, 1]]
    assert axis_cells(even, even).sum() == 4
    assert np.isclose(pitch_m(even), 0.1) and pitch_m(odd[:1]) == 0
