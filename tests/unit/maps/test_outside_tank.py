"""Cells outside the tank are NaN in maps, and count in no number, figure or image made of them."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from lightfield.errors import OutputError, UsageError
from lightfield.maps.dataset import plane_image, to_dataset
from lightfield.maps.exr import SpectralImage, read_spectral_exr, write_spectral_exr
from lightfield.maps.spot import Unmeasured, spot_shape
from lightfield.render.response.grid import scene_grid
from lightfield.report.compare.figures import axial_figure, maps_figure, radial_figure
from lightfield.report.light_figures import planes_figure
from lightfield.studies.compare.in_a_sentence import in_a_sentence
from lightfield.studies.compare.maps import compare
from lightfield.studies.compare.rings import excess
from lightfield.sweep.derived import derive

NEAR_THE_TOP = {"width_m": 1.0, "depth_m": 1.0, "lamp_depth_m": 0.15, "length_m": 5.0}


@pytest.fixture
def maps(make):
    """A plane of 1 m in the tank, and the same as a larger one of before planes were clipped."""

    def build(clipped: bool, **values) -> xr.Dataset:
        whole = make(pixels=40, planes=(1.0, 3.0), width=1.0 if clipped else 2.0, glow=0.02, **values)
        scene = type(whole.scene).from_dict(
            {"lamp": {"hwhm_deg": 3.81}, "water": {"absorption_per_m": 0.1}, "tank": NEAR_THE_TOP,
             "detector": {"planes_m": [1.0, 3.0], "pixels": 40 if clipped else 80}}
        )  # fmt: skip
        grid = scene_grid(scene.with_values({"detector.pixels": 40}))
        if not clipped:
            grid = make(pixels=80, planes=(1.0, 3.0), width=2.0).grid
        made = type(whole)(scene, grid, glow=0.02, noise=1e-6)
        data = to_dataset(made)
        inside = (abs(data.x_m) < 0.5) & (data.y_m < 0.15) & (data.y_m > -0.85)
        for name in data.data_vars:
            if "x_m" in data[name].dims:  # light is in the tank alone
                data[name] = data[name].where(inside, np.nan if clipped else 0.0)
        return data

    return build


def test_old_maps_wider_than_the_tank_say_what_clipped_ones_say(maps):
    """Zeros outside the tank were light that the formula had too much of: they hid what it lacks."""
    old, new = (compare(maps(clipped)) for clipped in (False, True))
    for a, b in zip(old.planes, new.planes, strict=True):
        assert a.lost == pytest.approx(b.lost, rel=0.05)
        assert 0.05 < b.lost < 0.9
        assert a.axis_error == pytest.approx(b.axis_error, rel=1e-3)
        assert np.isnan(a.formula[np.isnan(a.render)]).all()
        assert np.nanmax(a.smooth_excess()) == pytest.approx(np.nanmax(b.smooth_excess()), rel=0.05)
        assert b.profile.r_m.max() < 0.15  # rings that the surface cuts are no rings
        assert np.isfinite(b.profile.render).all()
    assert "nan" not in in_a_sentence(new)


def test_error_near_the_surface_is_not_smeared_over_it(maps):
    """Smoothing takes the mean over cells in the water: no dark rim, no contour along the surface."""
    for plane in compare(maps(True)).planes:
        raw, smooth = excess(plane.render, plane.stderr, plane.formula), plane.smooth_excess()
        assert np.isnan(smooth[np.isnan(plane.render)]).all()
        near = np.abs(plane.x_m) < 0.1
        top = np.flatnonzero(np.isfinite(plane.render).any(axis=1))[-1]
        np.testing.assert_allclose(smooth[top, near], raw[top, near], rtol=0.3, atol=0.01)


def test_a_spot_is_measured_where_its_contour_is_known():
    """NaN far off changes nothing; NaN across the half maximum leaves the width unknown, and says so."""
    x = np.linspace(-1, 1, 81)
    light = np.exp(-np.log(2) * (x[:, None] ** 2 + x**2) / 0.3**2)
    whole = spot_shape(light, x, x)
    cut = spot_shape(np.where(x[:, None] > 0.6, np.nan, light), x, x)
    assert (cut.hwhm_m, cut.centre_y_m) == (pytest.approx(whole.hwhm_m), pytest.approx(0, abs=1e-6))
    beyond = spot_shape(np.where(x[:, None] > 0.2, np.nan, light), x, x)
    assert beyond.problem is Unmeasured.BEYOND_EDGE
    assert beyond.peak == pytest.approx(1.0, rel=1e-3)


def test_numbers_of_a_sweep_leave_out_what_is_outside(maps):
    data = maps(True)
    scene = compare(data).scene
    grid = scene_grid(scene)
    mean, stderr = data.irradiance.values, data.irradiance_stderr.values
    found = derive(mean, stderr, np.nan_to_num(2 * mean, nan=1e9), grid, scene.lamp)
    area = grid.pitch_x_m * grid.pitch_y_m
    np.testing.assert_allclose(found["plane_power"], np.nansum(mean, axis=(2, 3)) * area)
    np.testing.assert_allclose(found["formula_error_power"], 1.0)
    np.testing.assert_allclose(found["formula_error_axis"], 1.0)
    assert np.isfinite(found["half_width"][0, 0])
    assert np.isnan(found["half_width"][0, 1])  # at 3 m the half width is 0.2 m, the surface at 0.15 m


def test_figures_show_the_tank_alone(maps):
    data = maps(True)
    planes = compare(data).planes
    for figure in (planes_figure(data), maps_figure(planes, "", "irradiance"), radial_figure(planes),
                   axial_figure(planes)):  # fmt: skip
        shown = [np.ma.getmaskarray(image.get_array()) for axis in figure.axes for image in axis.images]
        maps_shown = [mask for mask in shown if mask.shape == (40, 40)]
        assert all(mask[-1].all() and not mask[0].any() for mask in maps_shown)


def test_images_keep_what_is_outside_and_nothing_else_unknown(maps, tmp_path):
    image = plane_image(maps(True), 0)
    again = read_spectral_exr(write_spectral_exr(tmp_path / "plane.exr", image))
    np.testing.assert_array_equal(np.isnan(again.value), np.isnan(image.value))
    np.testing.assert_array_equal(np.isnan(again.stderr), np.isnan(image.value))
    known = image.stderr.copy()
    known[:] = 0.0
    half = SpectralImage(image.wavelength_nm, image.value, known, image.x_m, image.y_m, image.z_m)
    with pytest.raises(OutputError, match="not numbers"):
        write_spectral_exr(tmp_path / "half.exr", half)


def test_maps_of_single_positions_are_no_planes(maps):
    places = maps(True).stack(position=("z_m", "y_m", "x_m")).reset_index("position")
    with pytest.raises(UsageError, match="single positions"):
        compare(places)
