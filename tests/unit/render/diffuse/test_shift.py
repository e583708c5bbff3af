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
    shift = Shift.on(grid, x + 0.03, 0 * x, 0 * x + 5.0)
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
    weights = [
        Shift.on(grid, k * x, 0 * x, k * z).shares.toarray() for grid, k in ((large, 1.0), (small, 0.1))
    ]
    assert weights[1] == pytest.approx(weights[0], abs=1e-9)
    assert weights[0][8, 8] < 0.6


def edged(x: np.ndarray) -> np.ndarray:
    """Light that falls by nine tenths within three decimetres."""
    return 0.1 + 0.9 / (1 + np.exp((np.abs(x) - 0.4) / 0.06))


def along_a_line() -> tuple[np.ndarray, Shift]:
    """Cells of a decimetre, and readings in their middles but for the outermost."""
    x = np.linspace(-1.0, 1.0, 21)
    grid = positions_grid(x, 0 * x, 0 * x + 4.5, 0.1)
    return grid.centres()[0].ravel(), Shift.on(grid, x, 0 * x, 0 * x + 4.5)


def test_a_lamp_aside_moves_the_edge_of_a_beam() -> None:
    """By 2 cm, to 1.5 % of the light; by a quadratic through five cells, which smooths, to 5 %."""
    x, shift = along_a_line()
    moved = shift.apply(edged(x), 0.02, 0.0) / shift.apply(edged(x))
    assert moved[3:-3] == pytest.approx((edged(x - 0.02) / edged(x))[3:-3], rel=0.015)


def test_errors_of_moved_light_are_those_of_its_cells() -> None:
    """Cells of 1 % each, 300 times: the scatter of the readings by what they share, the outermost too, whose
    light comes from beyond. Without the offset in it, its error was half of that."""
    x, shift = along_a_line()
    field = np.exp(-(x**2))
    rng = np.random.default_rng(2)
    for offset in (0.0, 0.05):
        drawn = field * (1 + 0.01 * rng.standard_normal((300, len(field))))
        scatter = (shift.apply(drawn, offset, 0.0) / shift.apply(field, offset, 0.0)).std(axis=0, ddof=1)
        stated = 0.01 * np.sqrt(shift.seen_from(offset, 0.0).shares.power(2).sum(axis=1))
        assert stated == pytest.approx(scatter, rel=0.2)


@pytest.mark.parametrize("hits", [0.4, 4.0, 400.0])
def test_cells_that_are_seldom_hit_are_not_dark(hits: float) -> None:
    """Even light of so many photons a cell and batch of ten: right on average, with its error. A mean of
    logarithms of 0.4 hits was a thousandth of it."""
    x, shift = along_a_line()
    rng, batches, draws = np.random.default_rng(1), 10, 1500
    counts = rng.poisson(hits / batches, (draws, batches, len(x))) / hits * batches
    mean, error = counts.mean(axis=1), counts.std(axis=1, ddof=1) / np.sqrt(batches)
    stderr = np.where(counts.any(axis=1), error, np.inf)
    light, stated = np.array([shift.of_traced(m, e) for m, e in zip(mean, stderr, strict=True)]).swapaxes(
        0, 1
    )
    middle = slice(3, -3)
    scatter = light.std(axis=0)
    off = ((light.mean(axis=0) - 1) / scatter)[middle]
    # A tenth of the error at most: light is never less than nothing, and so a little too bright.
    assert -4 / np.sqrt(draws) < off.min() <= off.max() < 0.1 + 4 / np.sqrt(draws)
    assert np.sqrt((stated**2).mean(axis=0))[middle] == pytest.approx(scatter[middle], rel=0.12)
