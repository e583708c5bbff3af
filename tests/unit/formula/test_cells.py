"""What a model shows in a cell, and which cells are on the axis."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.formula.cells import along_a_side, axis_cells, cell_mean, pitch_m
from lightfield.formula.closed_form import direct_field
from lightfield.formula.scattered.quadrature import in_cell
from lightfield.scene import Scene


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


@pytest.mark.parametrize(
    ("lamp", "width_m", "pixels"),
    [
        ({}, 2.0, 1),
        ({}, 2.0, 3),
        ({"hwhm_deg": 0.3}, 1.0, 8),
        ({"hwhm_deg": 0.1}, 1.0, 1),
        ({"ellipticity": 0.2}, 2.0, 5),
        ({"asymmetry_x": 0.5, "asymmetry_y": 0.3}, 2.0, 3),
        ({"profile": "super-gaussian", "shape_exponent": 6.0}, 2.0, 2),
        ({"apparent_distance_m": 3.0, "tilt_x_deg": 4.0}, 2.0, 2),
        ({"profile": "isotropic"}, 8.0, 1),
    ],
)
def test_a_cell_larger_than_the_spot_has_its_mean(
    lamp: dict[str, object], width_m: float, pixels: int
) -> None:
    """Beside middles of 1200 x 1200 equal parts of the plane: three points of a cell were up to 340 % off."""
    scene = Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 0.2}})
    fine, pitch = (np.arange(1200) + 0.5) * (width_m / 1200) - 0.5 * width_m, width_m / pixels
    at = (np.arange(pixels) + 0.5) * pitch - 0.5 * width_m
    parts = direct_field(scene, *np.meshgrid(fine, fine), 1.0)
    right = parts.reshape(pixels, 1200 // pixels, pixels, -1).mean(axis=(1, 3))
    side = along_a_side(scene, 1.0, pitch, pixels * pixels)
    mean = cell_mean(lambda x, y: direct_field(scene, x, y, 1.0), at, at, pitch, pitch, side)
    assert np.abs(mean - right).max() < 5e-4 * right.max()
