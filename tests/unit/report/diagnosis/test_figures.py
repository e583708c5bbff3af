"""Figures of readings and what a model leaves of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from lightfield.report.diagnosis.figures import residual_map
from lightfield.report.diagnosis.single_places import place_map
from lightfield.report.diagnosis.view import DrawnReadings, Prediction, ReadingsView


@pytest.mark.parametrize("draw", [residual_map, place_map])
def test_readings_set_aside_stand_out_on_the_map(draw: Callable[[ReadingsView], Figure]) -> None:
    """In the colour of their misfit: a strut's shadow, which was the finding, was tiny dots."""
    x, out = np.linspace(-1, 1, 9), np.arange(9) == 4
    one = np.ones(9)
    readings = DrawnReadings(x, 0 * x, 2 * one, 525 * one, one - 0.5 * out, 0.1 * one, ["water"] * 9, out)
    dots = draw(ReadingsView(readings, [Prediction("base", one)])).axes[0].collections[0]
    sizes, rings = dots.get_sizes(), np.asarray(dots.get_linewidths())
    assert sizes[out].min() > sizes[~out].max() and rings[out].min() > 3 * rings[~out].max()
    assert dots.get_array()[out] == pytest.approx(-5.0)
