"""The top of a spot, from means over cells about it."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.formula.cells import cell_mean
from lightfield.formula.scattered.quadrature import Quadrature, interval
from lightfield.maps.sharper import at_the_axis

#: Places along a side of a cell.
SIDE = Quadrature(interval(12)[0] - 0.5, interval(12)[1])


def spot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Of scattered light: a sharp top on a wide skirt; 1 in the middle."""
    r = np.hypot(x, y)
    return np.asarray(0.3 * np.exp(-r / 0.3) + 0.7 * np.exp(-((r / 0.6) ** 2)))


@pytest.mark.parametrize("count", [11, 20, 31])
@pytest.mark.parametrize("aside", [0.0, 0.3])
def test_the_top_of_scattered_light_is_told_within_its_error(count: int, aside: float) -> None:
    """Cells of 0.18 to 0.06 m, with the axis in the middle of one, on a corner, or elsewhere."""
    pitch = 2.0 / count
    x = pitch * (np.arange(count) - 0.5 * (count - 1) + aside)
    cells = cell_mean(spot, x, x, pitch, pitch, SIDE)
    top, error = at_the_axis(cells, np.zeros_like(cells), x, x, (0, 0))
    assert abs(top - 1) < error < 0.1
    assert abs(top - 1) < 0.5 * (1 - cells.max())


def test_noise_of_the_cells_is_noise_of_the_top() -> None:
    rng, x = np.random.default_rng(0), 0.1 * (np.arange(9) - 4)
    flat, found = np.ones((9, 9)), []
    for _ in range(400):
        found.append(at_the_axis(flat + 0.01 * rng.standard_normal((9, 9)), 0.01 * flat, x, x, (0, 0)))
    tops, errors = np.array(found).T
    assert tops.mean() == pytest.approx(1, abs=0.002)
    assert 0.8 < tops.std() / np.sqrt((errors**2).mean()) < 1.05


def test_too_few_cells_tell_no_top() -> None:
    x = np.array([-0.5, 0.5])
    assert np.isnan(at_the_axis(np.ones((2, 2)), np.zeros((2, 2)), x, x, (0, 0))).all()


@pytest.mark.parametrize("aside", [0.0, 0.3])
def test_a_slope_across_the_plane_is_no_part_of_the_top(aside: float) -> None:
    """As of light from one wall, about an axis that is not in the middle of a cell."""
    x = 0.1 * (np.arange(15) - 7 + aside)
    cells = cell_mean(lambda x, y: 1 + 0.4 * x - 0.2 * y, x, x, 0.1, 0.1, SIDE)
    assert at_the_axis(cells, 1e-9 * cells, x, x, (0, 0)) == pytest.approx((1.0, 0.0), abs=1e-6)
