"""Drawings in axes that are given."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from lightfield.report.plots import plot_distances
from lightfield.report.style import FORMULA, GRID, SERIES


@pytest.mark.parametrize("width", [8.0, 1.0])
def test_pairs_that_are_surely_apart_are_left_blank(width: float) -> None:
    """A number in each of 19 x 19 cells could not be read."""
    names = ["lamp_drift", "water_drift", "settling", "waves"]
    sigma = np.array([[0, 2.8, 20, 9], [4.1, 0, 9, 9], [9, 9, 0, 9], [1, 1, 1, 0]], float)
    axes = plot_distances(
        Figure((width, 4)).subplots(), names, sigma, np.array([9.0, 9.0, 9.0, 1.0]), 3.0, 5.2
    )
    told = {text.get_position(): text.get_text() for text in axes.texts}
    assert told == ({(1, 0): "2.8", (0, 1): "4.1"} if width > 4 else {(1, 0): "3", (0, 1): "4"})
    shades = {(p.get_x() + 0.5, p.get_y() + 0.5): to_hex(p.get_facecolor()) for p in axes.patches}
    assert shades.pop((1, 0)) == FORMULA and shades.pop((0, 1)) == SERIES[4]
    # What is left: each effect with itself, and that one which is not seen beside any.
    assert set(shades) == {(k, k) for k in range(4)} | {(k, 3) for k in range(4)}
    assert set(shades.values()) == {GRID}
    assert [word.get_text() for word in axes.get_yticklabels()][2:4] == ["settling", "waves (not seen)"]
