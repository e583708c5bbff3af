"""What readings can tell of local unknowns."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.fitting.effects.local import local_unknowns
from lightfield.readings import Readings


@pytest.mark.parametrize(("across", "periods"), [(3, None), (9, 2.5), (81, 20)])
def test_ripples_are_no_finer_than_the_angles_that_were_read(across: int, periods: float | None) -> None:
    """Rows that grow with the distance read a few angles again: through them a ripple of 1.3 degrees
    went that changed the light by half, and was no ripple."""
    ray, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.25, 0.25, across), [1.5, 2.5, 4.0]))
    one = np.ones(len(z))
    table = Readings.from_arrays(
        x_m=ray * z, y_m=0 * z, z_m=z, value=one, stderr=0.01 * one, quantity="irradiance"
    )
    ripples = [one for one in local_unknowns(table) if one.name.startswith("ripple_")]
    if periods is None:
        assert ripples == []
    for ripple in ripples:
        low, high = ripple.parameters["period"].range
        assert high == pytest.approx(np.degrees(np.arctan(0.25))) and high / low == pytest.approx(periods)
