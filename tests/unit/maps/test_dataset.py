"""The data set of a rendering keeps numbers, units and provenance through NetCDF and EXR."""

import json
import time

import netCDF4
import numpy as np
import pytest
import xarray as xr

from lightfield.errors import OutputError
from lightfield.maps.dataset import (
    energy_units,
    lacking,
    plane_image,
    read_netcdf,
    to_dataset,
    write_exr_planes,
    write_netcdf,
)
from lightfield.maps.exr import read_spectral_exr
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.studies.compare.in_a_sentence import in_a_sentence
from lightfield.studies.compare.maps import compare


@pytest.fixture
def dataset(make):
    return to_dataset(make(pixels=9, glow=1e-4, lamp__offset_x_m=0.2))


def test_every_map_has_unit_error_and_named_axes(dataset):
    assert dict(dataset.sizes) == {"wavelength_nm": 1, "z_m": 3, "y_m": 9, "x_m": 9, "bound": 2}
    for name in ("irradiance", "irradiance_direct", "irradiance_diffuse"):
        assert dataset[name].attrs["units"] == "W m-2 nm-1"
        assert dataset[name].attrs["ancillary_variables"] == f"{name}_stderr"
        assert (dataset[f"{name}_stderr"] > 0).all()
    for name in ("x_m", "y_m", "z_m", "wavelength_nm"):
        assert dataset[name].attrs["units"] in ("m", "nm")


def test_no_coordinate_is_said_to_be_missing_somewhere(dataset, tmp_path):
    """CF conventions, section 2.5.1: none has a fill value; as NetCDF has it, not as xarray reads it."""
    with netCDF4.Dataset(write_netcdf(dataset, tmp_path / "maps.nc")) as written:
        coordinates = {name: written[name].ncattrs() for name in dataset.coords}
        assert {"x_m", "z_m", "wavelength_nm"} <= set(coordinates)
        assert [name for name, attributes in coordinates.items() if "_FillValue" in attributes] == []


def test_band_averages_say_their_band(dataset):
    np.testing.assert_array_equal(dataset.wavelength_nm, [525])
    np.testing.assert_array_equal(dataset.wavelength_bounds_nm, [[500, 550]])
    assert dataset.wavelength_nm.attrs["bounds"] == "wavelength_bounds_nm"


def test_wavelengths_rise_whatever_the_order_of_the_bands():
    """As xarray needs them to be found; of several the brightest is spoken of."""
    bands = [[600, 620], [440, 480], [500, 550]]
    scene = Scene.from_dict({"detector": {"planes_m": [2.0], "pixels": 5, "bands_nm": bands}})
    data = to_dataset(render_scene(scene, max_photons=1e4, rel_error=0.5, cache=False))
    np.testing.assert_array_equal(data.wavelength_nm, [460, 525, 610])
    np.testing.assert_array_equal(data.wavelength_bounds_nm, sorted(bands))
    assert (np.diff(data.irradiance.max(("z_m", "y_m", "x_m"))) > 0).all()  # a halogen lamp
    assert in_a_sentence(compare(data)).startswith("At 610 nm, ")


def test_provenance_brings_the_scene_back(dataset):
    attrs = dataset.attrs
    again = Scene.from_toml(attrs["scene_toml"])
    assert again.digest() == attrs["scene_digest"]
    assert (attrs["seed"], attrs["photons"]) == (3, 5_000_000_000)
    assert attrs["energy_absorbed"] == 0.011
    assert attrs["Conventions"].startswith("CF-")


def test_the_energy_balance_says_its_unit(dataset, make):
    assert dataset.attrs["energy_units"] == "sr"
    assert "W for 1 W/sr on the axis" in dataset.attrs["energy_comment"]
    pencil = Scene.from_dict({"lamp": {"profile": "pencil"}})
    unit, words = energy_units(pencil)
    assert unit == "1" and "W for 1 W of the lamp" in words


def test_what_a_rendering_needs_is_told(dataset):
    assert lacking(dataset) is None
    assert lacking(dataset.isel(z_m=[0])) is None
    assert "over wavelength_nm, z_m" in lacking(dataset.isel(z_m=0))
    assert "irradiance_stderr" in lacking(dataset.drop_vars("irradiance_stderr"))
    assert "`quantity`" in lacking(dataset.assign_attrs(quantity="heat"))


def test_netcdf_returns_the_same_data_set(dataset, tmp_path):
    xr.testing.assert_identical(read_netcdf(write_netcdf(dataset, tmp_path / "maps.nc")), dataset)


def test_equal_renderings_are_equal_files_whenever_they_are_written(make, tmp_path):
    for name in ("one", "two"):
        dataset = to_dataset(make(pixels=9))
        write_netcdf(dataset, tmp_path / name / "maps.nc")
        write_exr_planes(dataset, tmp_path / name)
        time.sleep(1.1)  # times in files have a resolution of a second
    files = sorted(file.name for file in (tmp_path / "one").iterdir())
    assert len(files) == 4
    assert all((tmp_path / "one" / f).read_bytes() == (tmp_path / "two" / f).read_bytes() for f in files)


def test_netcdf_is_readable_without_xarray(dataset, tmp_path):
    with netCDF4.Dataset(write_netcdf(dataset, tmp_path / "maps.nc")) as file:
        assert file.variables["irradiance"].dimensions == ("wavelength_nm", "z_m", "y_m", "x_m")
        np.testing.assert_array_equal(file.variables["irradiance"][:], dataset.irradiance.values)


def test_one_exr_per_plane_with_the_numbers_of_the_data_set(dataset, tmp_path):
    files = write_exr_planes(dataset, tmp_path)
    assert [f.name for f in files] == [f"irradiance_z{z:.3f}m.exr" for z in (4.5, 6.5, 8.5)]
    image = read_spectral_exr(files[1])
    np.testing.assert_array_equal(image.value, dataset.irradiance.values[:, 1].astype(np.float32))
    np.testing.assert_array_equal(image.stderr, dataset.irradiance_stderr.values[:, 1].astype(np.float32))
    np.testing.assert_allclose(image.x_m, dataset.x_m, atol=1e-12)
    assert image.z_m == 6.5
    assert image.units == "W.m^-2.nm^-1"
    # The lamp stands at +x: so does the light, in memory and in the file.
    assert image.x_m[np.unravel_index(image.value[0].argmax(), (9, 9))[1]] > 0


def test_exr_says_lamp_water_seed_and_error(dataset):
    attributes = plane_image(dataset, 0).attributes
    assert json.loads(attributes["lamp"])["hwhm_deg"] == 3.81
    assert json.loads(attributes["water"])["absorption_per_m"] == 0.1
    assert attributes["seed"] == 3
    assert attributes["monte_carlo_relative_error"] == 0.01
    assert attributes["quantity"] == "irradiance"


def test_foreign_and_broken_files_are_one_clear_error(tmp_path):
    (tmp_path / "text.nc").write_text("no data set")
    with pytest.raises(OutputError, match=r"text\.nc: cannot read this as a data set"):
        read_netcdf(tmp_path / "text.nc")
    with pytest.raises(OutputError, match="cannot read"):
        read_netcdf(tmp_path / "missing.nc")
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc")
    with pytest.raises(OutputError, match="not a rendering"):
        read_netcdf(tmp_path / "other.nc")


def test_a_failed_write_leaves_nothing(dataset, tmp_path):
    blocked = tmp_path / "maps.nc"
    blocked.mkdir()
    with pytest.raises(OutputError, match="cannot replace"):
        write_netcdf(dataset, blocked)
    assert [p.name for p in tmp_path.iterdir()] == ["maps.nc"]


def test_single_positions_keep_their_coordinates(make, tmp_path):
    """One value per place, in the order of the places."""
    of_cells = make(pixels=3)

    class AtPlaces:
        scene, rendering = of_cells.scene, of_cells
        x_m, y_m, z_m = np.array([0.3, 0.0]), np.array([0.0, 0.1]), np.array([8.5, 4.5])

        def maps(self, wavelengths_nm=None, part="all"):
            return tuple(values[:, [2, 0], 1, 1] for values in of_cells.maps(wavelengths_nm, part))

    dataset = to_dataset(AtPlaces())
    assert dataset.irradiance.dims == ("wavelength_nm", "position")
    for name in ("x_m", "y_m", "z_m"):
        np.testing.assert_array_equal(dataset[name], getattr(AtPlaces, name))
    assert dataset.irradiance[0, 1] > dataset.irradiance[0, 0]
    xr.testing.assert_identical(read_netcdf(write_netcdf(dataset, tmp_path / "maps.nc")), dataset)


@pytest.mark.parametrize("left", [0.02, 0.3, 0.7, 0.99])
def test_a_data_set_that_was_cut_short_is_said_to_be(dataset, tmp_path, left) -> None:
    file = write_netcdf(dataset, tmp_path / "maps.nc")
    file.write_bytes(file.read_bytes()[: int(left * file.stat().st_size)])
    with pytest.raises(
        OutputError, match=r"maps\.nc: this data set is damaged or cut short; .*again"
    ) as error:
        read_netcdf(file)
    assert "rrno" not in str(error.value) and "HDF" not in str(error.value)


def test_a_data_set_that_is_damaged_inside_is_said_to_be(dataset, tmp_path) -> None:
    file = write_netcdf(dataset, tmp_path / "maps.nc")
    content = bytearray(file.read_bytes())
    content[len(content) // 4 : 3 * len(content) // 4] = bytes(len(content) // 2)
    file.write_bytes(content)
    with pytest.raises(OutputError, match="damaged or cut short"):
        read_netcdf(file)


def test_where_no_diffuse_light_can_come_it_is_nothing_exactly() -> None:
    """An error without end says that no photon came where one could."""
    clear = Scene.from_dict({"detector": {"planes_m": [2.0], "pixels": 3, "width_m": 0.3}})
    turbid = clear.with_values({"water.scattering_per_m": 1e-9})
    stderr = [
        to_dataset(render_scene(scene, max_photons=1e3, cache=False)).irradiance_diffuse_stderr.values
        for scene in (clear, turbid)
    ]
    assert (stderr[0] == 0).all() and (stderr[1] > 0).all()
