"""Figures of a comparison hold what they show, however far off the formula is."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.maps.dataset import to_dataset
from lightfield.report.compare.figures import axial_figure, maps_figure, radial_figure
from lightfield.studies.compare.maps import compare


@pytest.mark.parametrize(("part", "ends"), [(0.2, 1.0), (0.95, 0.5)])
def test_errors_lie_within_their_axes_and_colours(make, light, part: float, ends: float) -> None:
    """Of a fifth of the light an empty panel looked like no error, and its map was one blue."""
    dim = lambda scene, x, y, z, wavelength: part * light(scene, x, y, z)  # noqa: E731
    planes = compare(to_dataset(make(pixels=17)), dim).planes
    for panel in radial_figure(planes).axes[len(planes) :]:
        errors = panel.lines[-1].get_ydata()
        low, high = panel.get_ylim()
        assert np.nanmin(errors) == pytest.approx(part - 1, abs=0.1)
        assert low < np.nanmin(errors) and np.nanmax(errors) < high
    drawn = maps_figure(planes, "W m-2 nm-1", "irradiance")
    scales = {image.get_clim() for axis in drawn.axes for image in axis.images if image.get_clim()[0] < 0}
    assert scales == {(-ends, ends)}


def test_panels_along_the_tank_have_one_scale_of_distance(make) -> None:
    axis, width, lost = axial_figure(compare(to_dataset(make(pixels=17))).planes).axes
    assert axis.get_xlim() == width.get_xlim() == lost.get_xlim()
