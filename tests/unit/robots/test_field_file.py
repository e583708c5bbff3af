"""A field for simulators: what is read from the file is what a receiver reads in the scene."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import RegularGridInterpolator

from lightfield import cli
from lightfield.errors import RenderError, UsageError
from lightfield.formula.closed_form import direct_field
from lightfield.maps.dataset import write_netcdf
from lightfield.render.flux.traced_field import Region, traced_field
from lightfield.robots.field_file import Asked, field_dataset
from lightfield.scene import Scene

SCENE = {
    "lamp": {"hwhm_deg": 3.81, "power_w": 50.0},
    "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.1},
    "detector": {"planes_m": [4.5, 6.5]},
}


@pytest.fixture(scope="module")
def stored(tmp_path_factory) -> xr.Dataset:
    found = field_dataset(Scene.from_dict(SCENE), Asked(0.4, 4.5, 6.5), photons=3e5)
    path = write_netcdf(found, tmp_path_factory.mktemp("field") / "field.nc")
    with xr.open_dataset(path) as data:
        return data.load()


def read(data: xr.Dataset, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """As a simulator would: F z^2 between the places of the grid, and a cosine receiver."""
    axes = tuple(data[name].values.astype(float) for name in ("z", "y", "x"))
    total = np.zeros(len(place))
    for part in ("direct", "diffuse"):
        flux = np.stack(
            [
                RegularGridInterpolator(axes, data[f"flux_{part}_{a}"].values * axes[0][:, None, None] ** 2)(
                    place[:, ::-1]
                )
                for a in "xyz"
            ],
            axis=1,
        )
        total += np.maximum(-(flux * normal).sum(axis=1), 0) / place[:, 2] ** 2
    back = RegularGridInterpolator(axes, data.backward.values * axes[0][:, None, None] ** 2)(place[:, ::-1])
    return total + back / place[:, 2] ** 2 * (1 + np.abs(normal[:, 2])) / 2


def test_a_receiver_reads_from_the_file_what_it_reads_in_the_field(stored) -> None:
    scene = Scene.from_dict(SCENE)
    place = np.array([[0.0, 0.0, 4.6], [0.17, -0.12, 5.3], [-0.3, 0.2, 6.4]])
    normal = np.array([[0, 0, -1.0], [0.2, 0.1, -0.97], [-0.4, 0.0, -0.917]])
    expected = traced_field(scene, Region(0.4, 4.5, 6.5), photons=3e5).reading(place, normal)
    assert read(stored, place, normal) == pytest.approx(expected, rel=0.02)


def test_direct_light_is_the_closed_form(stored) -> None:
    at = stored.sel(x=0.2, y=-0.1, z=6.5, method="nearest")
    closed = direct_field(Scene.from_dict(SCENE), float(at.x), float(at.y), float(at.z))
    assert float(at.flux_direct_z) == pytest.approx(float(np.ravel(closed)[0]), rel=1e-5)


def test_every_number_says_what_it_is(stored) -> None:
    """CF: units and a name for every variable, errors as ancillary variables, conventions and source."""
    for name, variable in stored.variables.items():
        assert variable.attrs["units"] in ("m", "m-2") and variable.attrs["long_name"], name
    for name in ("flux_diffuse_x", "flux_diffuse_y", "flux_diffuse_z", "backward"):
        assert stored[name].ancillary_variables == f"{name}_stderr"
        assert 0 < float(stored[f"{name}_stderr"].max()) < float(stored.flux_diffuse_z.max())
    assert stored.Conventions.startswith("CF-1") and "lightfield" in stored.source
    assert stored.attrs["absorption_per_m"] == 0.05 and stored.attrs["scattering_per_m"] == 0.1
    assert stored.attrs["radiant_intensity_on_axis_w_per_sr"] > 0
    assert Scene.from_toml(stored.attrs["scene"]) == Scene.from_dict(SCENE)


def test_the_width_of_a_table_is_that_of_the_beam_that_is_tabulated(tmp_path) -> None:
    (tmp_path / "beam.csv").write_text("angle_deg,intensity\n0,1\n20,0.6\n25,0.5\n30,0.4\n90,0\n")
    table = {"profile": "table", "intensity_table": str(tmp_path / "beam.csv")}
    found = field_dataset(Scene.from_dict({**SCENE, "lamp": table}), Asked(0.4, 4.5, 6.5), photons=0)
    assert found.attrs["lamp_half_width_deg"] == pytest.approx(25.0, abs=0.01)


def test_errors_are_those_of_another_seed(stored) -> None:
    """Diffuse light of a second trace differs by the stated error: chi-square per place near 1."""
    other = field_dataset(Scene.from_dict(SCENE), Asked(0.4, 4.5, 6.5), photons=3e5, seed=9)
    error = np.hypot(stored.flux_diffuse_z_stderr, other.flux_diffuse_z_stderr)
    z = ((stored.flux_diffuse_z - other.flux_diffuse_z) / error).values
    assert 0.5 < float(np.mean(z**2)) < 2.0


@pytest.mark.parametrize(
    "wrong", [(0.4, 6.5, 4.5), (0.4, 0.0, 4.5), (0.05, 4.5, 6.5), (0.4, 4.5, np.inf), (np.nan, 4.5, 6.5)]
)
def test_grids_that_make_no_sense(wrong) -> None:
    with pytest.raises(UsageError, match="impossible grid"):
        Asked(*wrong).axes()


@pytest.mark.parametrize("asked", [Asked(1.1, 4.5, 6.5), Asked(0.6, 4.5, 6.5), Asked(0.4, 4.5, 9.8)])
def test_a_grid_that_leaves_the_water_is_refused_without_photons_too(asked: Asked) -> None:
    """A tank of 2 x 1 x 10 m, the lamp in its middle: walls at 1 m, floor and top at 0.5, end at 9.5 m."""
    tank = {"width_m": 2.0, "depth_m": 1.0, "length_m": 10.0, "behind_lamp_m": 0.5}
    scene = Scene.from_dict({**SCENE, "tank": tank, "detector": {"planes_m": [4.5, 6.5], "width_m": 1.0}})
    with pytest.raises(RenderError, match="out of the water") as refused:
        field_dataset(scene, asked, photons=0)
    assert ("half width of 0.5 m" in str(refused.value)) == (asked.far_m == 6.5)
    found = field_dataset(scene, Asked(0.5, 4.5, 9.5), photons=0)
    assert "nothing traced" in found.attrs["source"]


def test_the_half_width_that_a_refusal_names_is_one_that_is_taken() -> None:
    """Beside the same walls, with photons, whose cells reach a step and a half beyond."""
    tank = {"width_m": 2.0, "depth_m": 1.0, "length_m": 10.0, "behind_lamp_m": 0.5}
    scene = Scene.from_dict({**SCENE, "tank": tank, "detector": {"planes_m": [4.5, 6.5], "width_m": 1.0}})
    with pytest.raises(RenderError, match=r"a half width of 0\.3 m at most"):
        field_dataset(scene, Asked(0.4, 4.5, 6.5, 0.1), photons=1e3)
    assert field_dataset(scene, Asked(0.3, 4.5, 6.5, 0.1), photons=1e3).sizes["x"] == 7


def test_a_grid_of_gigabytes_is_refused() -> None:
    with pytest.raises(UsageError, match="too many places"):
        Asked(5.0, 1.0, 100.0, 0.01).axes()
    with pytest.raises(UsageError, match="begin farther from the lamp"):  # planes lie ever closer there
        Asked(2.0, 0.001, 10.0, 0.1).axes()


def test_the_command_writes_it(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(Scene.from_dict(SCENE).to_toml())
    words = ["field", "export", "scene.toml", "--no-trace", "-o"]
    assert cli.main([*words, "field.nc", "--step", "0.2"]) == 0
    assert "5 x 5 x 4 places" in capsys.readouterr().out
    with xr.open_dataset("field.nc") as data:
        assert float(data.flux_diffuse_z.max()) == 0 < float(data.flux_direct_z.max())
    assert cli.main([*words, "scene.toml"]) == 2
    capsys.readouterr()
    assert cli.main([*words, "field.txt"]) == 2
    assert "end it in .nc" in capsys.readouterr().err and not (tmp_path / "field.txt").exists()
    traced = [
        "field",
        "export",
        "scene.toml",
        "--max-photons",
        "1e4",
        "-o",
        "near.nc",
        "--step",
        "0.2",
        "--to",
        "4",
    ]
    assert cli.main([*traced, "--from", "1"]) == 0
    # A beam of 3.81 degrees is 0.2 m wide at 3.0 m.
    assert "nearer than 3 m steps of 0.2 m are coarser than the beam" in capsys.readouterr().out
    assert cli.main([*traced, "--from", "3.2"]) == 0
    assert "coarser" not in capsys.readouterr().out


def test_the_first_plane_is_as_right_as_one_within() -> None:
    """At 2 m light is the same where the file begins there as where it begins at 1.2 m: splines were 2 % off
    at their ends. From where on the beam is as wide as the steps is said."""
    scene = Scene.from_dict(SCENE)
    first, within = (
        field_dataset(scene, Asked(0.4, near, 4.0, 0.1), photons=1e6, seed=seed)
        for seed, near in ((1, 2.0), (2, 1.2))
    )
    at = {"x": [0.0, 0.1, 0.2, 0.3], "y": 0.0, "z": 2.0}
    light, again = (data.flux_diffuse_z.interp(at).values for data in (first, within))
    noise = np.hypot(*(data.flux_diffuse_z_stderr.interp(at).values / light for data in (first, within)))
    off = float((light / again - 1) @ noise**-2.0 / (noise**-2.0).sum())
    assert abs(off) < 3 * (noise**-2.0).sum() ** -0.5 < 0.014
    half_deg = float(first.attrs["lamp_half_width_deg"])
    assert first.attrs["resolved_from_m"] == pytest.approx(0.1 / np.tan(np.radians(half_deg)))
