"""From cells to readings, for several fields at once."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.render.diffuse.shift import Shift
from lightfield.render.response.grid import positions_grid


def test_a_dark_colour_leaves_the_others_moved() -> None:
    """Readings 3 cm beside their cells: a field without light stays so, the other is moved as it is alone."""
    x = np.linspace(-1.0, 1.0, 21)
    grid = positions_grid(x, 0 * x, 0 * x + 5.0, 0.2)
    shift = Shift(grid, x + 0.03, 0 * x, 0 * x + 5.0)
    field = np.exp(-(grid.centres()[0] ** 2))
    bright, dark = shift.apply(np.stack([field, 0 * field]))
    np.testing.assert_allclose(bright, shift.apply(field), rtol=1e-12)
    np.testing.assert_allclose(bright, np.exp(-((x + 0.03) ** 2)), rtol=0.01)
    assert (dark == 0).all()


def test_cells_and_smoothing_shrink_with_a_small_tank() -> None:
    """Ten times nearer and ten times closer together: cells of a tenth, the same weights between them."""
    x = np.tile(np.linspace(-0.8, 0.8, 17), 2)
    z = np.repeat([2.0, 5.0], 17)
    large, small = (positions_grid(k * x, 0 * x, k * z) for k in (1.0, 0.1))
    assert (small.pitch_x_m, small.pitch_y_m) == pytest.approx((0.1 * large.pitch_x_m, 0.1 * large.pitch_y_m))
    weights = [Shift(grid, k * x, 0 * x, k * z).shares.toarray() for grid, k in ((large, 1.0), (small, 0.1))]
    assert weights[1] == pytest.approx(weights[0], abs=1e-9)
    assert weights[0][8, 8] < 0.6
