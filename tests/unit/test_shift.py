"""From cells to readings, for several fields at once."""

from __future__ import annotations

import numpy as np

from lightfield.render.grid import positions_grid
from lightfield.render.shift import Shift


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
