"""What a sweep's store says is true: against traces of single cases, the formula, other readers of Zarr.

Rationale: all numbers of a sweep come from few traces, reweighted. Set-up: a small tank, waters and walls far
from the reference. Expected: agreement with independent traces (own seeds) within the stated errors, with the
closed form in clear black water; the same bits through the zarr library and in exported EXR images.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr
from sweeping import same

from lightfield.cli import main
from lightfield.maps.exr import read_spectral_exr
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.scene.bands import over_band
from lightfield.studies.compare.maps import closed_form, on_cells
from lightfield.sweep.axes import parse_axis
from lightfield.sweep.runner import SweepProgress, run_sweep
from lightfield.sweep.sweep_plan import SweepPlan, SweepSettings, make_plan

SCENE = Scene.from_toml(
    """
    name = "small tank"
    [water]
    absorption_per_m = 0.1
    [tank]
    width_m = 2.0
    depth_m = 2.0
    lamp_depth_m = 1.0
    length_m = 12.0
    [detector]
    planes_m = [2.0, 4.0]
    width_m = 1.2
    pixels = 9
    bands_nm = [[440, 460], [640, 660]]
    """
)
RANGES = ("water.scattering_per_m=0,0.1,0.4", "tank.wall_albedo=0,0.5", "water.cdom_440_per_m=0,0.2")


def swept(
    folder: Path, ranges: tuple[str, ...], photons: float, scene: Scene = SCENE
) -> tuple[SweepPlan, SweepProgress]:
    plan = make_plan(
        scene, [parse_axis(text) for text in ranges], SweepSettings(max_photons=photons, rel_error=1e-3)
    )
    return plan, run_sweep(plan, folder)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("values") / "s.zarr"
    _, done = swept(path, RANGES, 3e5)
    assert (done.cases_done, done.failed) == (12, 0)
    assert (
        done.traced < 4 and done.gain(make_plan(SCENE, [parse_axis(t) for t in RANGES], SweepSettings())) > 2
    )
    return path


@pytest.mark.parametrize("steps", [(0, 1, 0), (1, 1, 1), (2, 0, 0), (1, 0, 1)])
def test_maps_agree_with_a_trace_of_the_case_alone(store: Path, steps: tuple[int, int, int]) -> None:
    """z-scores between two independent estimates of the same light have mean 0 and variance 1."""
    data = xr.open_zarr(store)
    names = ("water.scattering_per_m", "tank.wall_albedo", "water.cdom_440_per_m")
    case = data.isel(dict(zip(names, steps, strict=True)))
    scene = SCENE.with_values({name: float(case[name]) for name in names})
    mean, stderr = render_scene(scene, rel_error=1e-3, max_photons=1e5, seed=99, cache=False).maps()
    z = (case.irradiance.values - mean) / np.hypot(case.irradiance_stderr.values, stderr)
    z = z[np.isfinite(z)]
    assert z.size > 250
    # Cells of a plane share some photons, and bands all: over twelve seeds of the render the mean scatters by
    # 0.1, and as much over those of the sweep, chi2/n by 0.2; errors from 10 batches widen it by 9/7. Four
    # standard deviations.
    assert np.mean(z**2) == pytest.approx(9 / 7, abs=0.9)
    assert abs(z.mean()) < 4 * np.hypot(0.1, 0.1)


def test_derived_quantities_follow_from_the_maps(store: Path) -> None:
    data = xr.open_zarr(store).load()
    area = (1.2 / 9) ** 2
    maps = data.irradiance.astype("f8")
    np.testing.assert_allclose(data.plane_power, maps.sum(["x_m", "y_m"]) * area, rtol=1e-6)
    assert data.plane_power.attrs["units"] == "W nm-1"


def test_in_clear_water_and_black_walls_the_formula_is_exact(store: Path) -> None:
    """To its own quadrature: 3 x 3 points of a cell of 13 cm, attenuation to its middle, a band in pieces."""
    clear = xr.open_zarr(store).isel({"water.scattering_per_m": 0, "tank.wall_albedo": 0}).load()
    for name in ("formula_error_on_axis", "formula_error_of_power"):
        assert (abs(clear[name]) < 4 * clear[f"{name}_stderr"] + 5e-4).all()
        assert (clear[f"{name}_stderr"] < 5e-4).all()


def test_on_the_axis_is_the_light_there_and_not_that_of_its_cell(store: Path) -> None:
    """Straight light itself, and scattered light as its cells tell its top; the formula is the closed form.

    The cell of 0.13 m is a little darker than its centre: (0.133 / 0.27)^2 ln2 / 6 = 3 % at 4 m.
    """
    case = xr.open_zarr(store).isel(
        {"water.scattering_per_m": 1, "tank.wall_albedo": 0, "water.cdom_440_per_m": 1}
    )
    scene = SCENE.with_values({"water.scattering_per_m": 0.1, "water.cdom_440_per_m": 0.2})
    x, y = case.x_m.values, case.y_m.values
    for k, z in enumerate((2.0, 4.0)):
        blue = over_band(scene.lamp, 440.0, 460.0)
        itself = float(closed_form(scene, np.zeros(1), np.zeros(1), np.full(1, z), blue)[0])
        cell = float(on_cells(closed_form, scene, x, y, z, blue)[4, 4])
        found, map_there = float(case.on_axis_irradiance[0, k]), float(case.irradiance[0, k, 4, 4])
        # Scattered light of the middle cell, and its top.
        below, above = map_there - cell, found - itself
        assert 1.0 < above / below < 1.3
        assert (1 + float(case.formula_error_on_axis[0, k])) * found == pytest.approx(itself, rel=1e-6)
        assert 0.02 < itself / cell - 1 < 0.2


def test_seed_and_cases_beside_it_do_not_change_a_case(tmp_path: Path) -> None:
    small = SCENE.with_values({"detector.pixels": 5})
    swept(tmp_path / "a.zarr", ("lamp.hwhm_deg=3,4",), 2e4, small)
    swept(tmp_path / "b.zarr", ("lamp.hwhm_deg=4,6", "lamp.power_w=25,50"), 2e4, small)
    a = xr.open_zarr(tmp_path / "a.zarr").irradiance[1].values
    b = xr.open_zarr(tmp_path / "b.zarr").irradiance[0, 1].values
    assert same(a, b)


def test_other_readers_see_a_store_in_cf_conventions(store: Path) -> None:
    data = xr.open_zarr(store)
    group = zarr.open_group(str(store), mode="r")
    np.testing.assert_array_equal(np.asarray(group["irradiance"][:]), data.irradiance.values)
    assert data.irradiance.dims == (
        *("water.scattering_per_m", "tank.wall_albedo", "water.cdom_440_per_m"),
        *("wavelength_nm", "z_m", "y_m", "x_m"),
    )
    assert data.attrs["Conventions"].startswith("CF-")
    assert Scene.from_toml(data.attrs["scene_toml"]).digest() == SCENE.digest() == data.attrs["scene_digest"]
    for name in data.variables:
        if name not in ("message", "status", "trace"):
            assert "units" in data[name].attrs, name
        assert "long_name" in data[name].attrs, name
    assert data["water.scattering_per_m"].attrs["units"] == "1/m"
    assert (data.photons >= 3e5).all() and data.reached_relative_error.notnull().all()


def test_exported_images_hold_the_maps_of_the_chosen_cases(
    store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", str(store), "--exr", str(tmp_path), "--case", "water.scattering_per_m=0.1"]
    assert main([*words, "--case", "tank.wall_albedo=0.5"]) == 0
    paths = capsys.readouterr().out.split()
    assert len(paths) == 4  # two waters with and without CDOM, two planes
    chosen = [path for path in paths if "cdom_440_per_m=0.2" in path and "z4.000m" in path]
    image = read_spectral_exr(chosen[0])
    np.testing.assert_array_equal(image.value, xr.open_zarr(store).irradiance.values[1, 1, 1, :, 1])
    assert '"scattering_per_m": 0.1' in str(image.attributes["water"])
    assert image.attributes["photons"] >= 3e5


def test_show_draws_three_figures_and_says_what_is_there(
    store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show", str(store), "-o", str(tmp_path)]) == 0
    output = capsys.readouterr().out
    assert "12 computed, 0 failed, 0 to do" in output
    assert sorted(f.name for f in tmp_path.iterdir()) == ["formula.png", "maps.png", "profiles.png"]
    assert all(f.stat().st_size > 20_000 for f in tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["show", "{tmp}"], "not a sweep's store"),
        (["show", "{store}", "--case", "tank.wall_albedo=2"], "no such value.*0, 0.5"),
        (["show", "{store}", "--case", "water.scattering_per_m=0.12"], "no such value.*0.1"),
        (["show", "{store}", "--case", "tank.wall_albedo=0.51"], "no such value.*0.51.*0, 0.5"),
        (
            ["export", "{store}", "--exr", "{tmp}/e", "--case", "tank.wal_albedo=0"],
            "did you mean tank.wall_albedo",
        ),
        (["export", "{store}", "--exr", "{tmp}/e", "--case", "tank.wall_albedo"], "path=value"),
        (["sweep", "{tmp}/none.toml", "--vary", "water.absorption_per_m=0,1"], "cannot read the scene"),
    ],
)
def test_wrong_use_is_one_line_and_exit_code_2(
    words: list[str], says: str, store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([word.format(tmp=tmp_path, store=store) for word in words]) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    import re

    assert re.search(says, errors), errors


def test_a_dry_run_prints_the_plan_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    SCENE.save(tmp_path / "scene.toml")
    words = ["sweep", str(tmp_path / "scene.toml"), "--vary", "water.scattering_per_m=0:0.1:50", "--dry-run"]
    assert main([*words, "-o", str(tmp_path / "s.zarr")]) == 0
    assert "traces: 1, 50 cases evaluated from each" in capsys.readouterr().out
    assert [f.name for f in tmp_path.iterdir()] == ["scene.toml"]


def test_a_dry_run_says_what_a_trace_is_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every line is another trace: the values that its cases share and others do not."""
    (tmp_path / "scene.toml").write_text("[detector]\nplanes_m = [3]\n", encoding="utf-8")
    words = ["sweep", str(tmp_path / "scene.toml"), "--vary", "lamp.hwhm_deg=5,6", "--dry-run"]
    assert main([*words, "--vary", "water.absorption_per_m=0,0.1"]) == 0
    told = [line for line in capsys.readouterr().out.splitlines() if "2 cases" in line and "a =" in line]
    assert [line.split("lamp.")[1] for line in told] == ["hwhm_deg = 5: 2 cases", "hwhm_deg = 6: 2 cases"]


def test_cells_outside_the_tank_are_unknown_in_store_and_images(tmp_path: Path) -> None:
    """A lamp that is lowered in a shallow tank: planes of one shape, the water above and below it known."""
    scene = Scene.from_dict(
        {"tank": {"width_m": 1.0, "depth_m": 0.8, "length_m": 3.0},
         "detector": {"planes_m": [1.0], "pixels": 10}}
    )  # fmt: skip
    _, done = swept(tmp_path / "s.zarr", ("tank.lamp_depth_m=0.2,0.4",), 2e4, scene)
    assert done.failed == 0
    data = xr.open_zarr(tmp_path / "s.zarr").load()
    half_cell = 0.5 * np.diff(data.y_m.values, axis=-1)[..., :1]
    for case, depth in enumerate((0.2, 0.4)):
        one = data.isel({"tank.lamp_depth_m": case})
        y, half = one.y_m.values, np.ravel(half_cell[case])[0]
        inside = (y + half < depth + 1e-6) & (y - half > depth - 0.8 - 1e-6)
        known = np.isfinite(one.irradiance.values[0, 0])
        np.testing.assert_array_equal(known, np.repeat(inside[:, None], 10, axis=1))
        assert np.isfinite(one.plane_power).all() and np.isfinite(one.formula_error_on_axis).all()
    assert main(["export", str(tmp_path / "s.zarr"), "--exr", str(tmp_path / "exr")]) == 0
    image = read_spectral_exr(next((tmp_path / "exr").glob("*0.2*/*.exr")))
    np.testing.assert_array_equal(np.isnan(image.value[0]), np.isnan(data.irradiance.values[0, 0, 0]))
