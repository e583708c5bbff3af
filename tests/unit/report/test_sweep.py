"""Figures of a sweep: the scale of its maps, and the colour that stands for all."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from lightfield.report.sweep import _first_of, _hold, _scale_of


@pytest.mark.parametrize(
    ("values", "low", "top"),
    [
        ([2.0, 8.0, np.nan], 2.0, 8.0),  # within a decade: not four of them for one
        ([1e-9, 0.0, -1.0, 8.0], 8e-4, 8.0),  # four decades at most
        ([8.0, 8.0], 4.0, 8.0),
        ([np.nan, 0.0], 0.5, 1.0),
    ],
)
def test_a_scale_spans_what_is_there(values: list[float], low: float, top: float) -> None:
    assert _scale_of(np.array(values)) == pytest.approx((low, top))


def test_of_several_colours_the_brightest_is_drawn() -> None:
    """That of 460 nm of a green lamp is 350 times fainter, and came first."""
    power = (("a", "wavelength_nm"), [[0.003, 1.0, 0.5], [0.002, 0.9, np.nan]])
    data = xr.Dataset({"plane_power": power}, {"wavelength_nm": [460.0, 520.0, 590.0]})
    data["wavelength_nm"].attrs["units"] = "nm"
    held, _ = _hold(data.assign_attrs(sweep_axes='["a"]'), {"a", "wavelength_nm"})
    assert held.wavelength_nm.values.tolist() == [520.0, 460.0, 590.0]
    assert _first_of(held) == ["wavelength_nm (nm) = 520 alone, of 3"]
