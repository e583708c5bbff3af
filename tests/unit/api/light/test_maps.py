"""Maps as Python gives them: planes in numbers beside the beam written out, the plane that is asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.api.light.maps import Maps, nearest_index
from lightfield.maps.dataset import to_dataset

#: A plane in the middle of which the light is exp(-c z) / z^2, with an error of a hundredth everywhere.
PLANES, C, NOISE = (4.5, 6.5, 8.5), 0.1, 1e-2


@pytest.fixture
def maps(make) -> Maps:
    return Maps(to_dataset(make(pixels=9, planes=PLANES, noise=NOISE, water__absorption_per_m=C)))


def test_a_plane_is_told_by_its_brightest_cell_and_its_error(maps: Maps) -> None:
    """Brightest in the middle; a deviate of the noise is on it, of four errors at most."""
    told = maps.summary()
    z = np.array(PLANES)
    assert told["z_m"].tolist() == list(PLANES)
    largest = next(name for name in told.columns if name.startswith("largest"))
    assert told[largest].to_numpy() == pytest.approx(np.exp(-C * z) / z**2, rel=4 * NOISE)
    assert told["median_error_percent"].to_numpy() == pytest.approx(100 * NOISE * np.ones(3), rel=0.01)


def test_positions_are_told_where_they_are(maps: Maps) -> None:
    """Also those at one distance."""
    cells = maps.details.isel(z_m=[0]).stack(position=("z_m", "y_m", "x_m"))
    places = cells.reset_index("position").isel(position=[3, 4, 40])
    told = Maps(places).summary()
    for name in ("x_m", "y_m", "z_m"):
        np.testing.assert_array_equal(told[name], places[name])
    assert told["x_m"][0] != told["x_m"][1] and told["z_m"].nunique() == 1


def test_every_cell_is_a_row(maps: Maps) -> None:
    table, data = maps.to_pandas(), maps.to_xarray()
    assert len(table) == 3 * 9 * 9
    some = table[(table.z_m == 6.5) & (table.x_m == float(data.x_m[2])) & (table.y_m == float(data.y_m[7]))]
    there = data[maps.quantity].sel(z_m=6.5).isel(wavelength_nm=0, x_m=2, y_m=7)
    assert some[maps.quantity].tolist() == [float(there)]


def test_what_is_saved_is_loaded_again(maps: Maps, tmp_path: Path) -> None:
    again = Maps.load(maps.save(tmp_path / "maps.nc"))
    assert again.headline == maps.headline and again.scene == maps.scene
    np.testing.assert_allclose(again.details[again.quantity], maps.details[maps.quantity], rtol=1e-6)


def test_the_plane_that_is_nearest_is_drawn(maps: Maps) -> None:
    assert [nearest_index(np.array(PLANES), z) for z in (-1.0, 5.4, 5.6, 99.0)] == [0, 0, 1, 2]
    assert maps.plot(z_m=8.0).get_title().startswith("z = 8.5 m")
    assert maps.plot().get_title().startswith("z = 4.5 m")
