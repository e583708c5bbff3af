"""Figures of readings and what a model leaves of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from lightfield.fitting.fitted_curves import FittedCurve
from lightfield.report.diagnosis.curves import curve_figure
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


def test_a_band_that_is_wide_leaves_its_curve_to_be_seen() -> None:
    """Of a lamp that was not read on its axis, to which intensities are told, it was four times the curve."""
    at = np.linspace(0, 12, 40)
    lost = FittedCurve(
        "lamp.profile_departure", "angle (deg)", "", at, 1 - 0.05 * at, 3.0 * at, 0.9 + 0 * at, 1.0
    )
    upper, lower = curve_figure((lost,)).axes
    assert upper.get_ylim() == pytest.approx((0.4 - 0.3, 1.0 + 0.3))
    assert lower.get_ylim()[1] > 2 * 36.0
