"""render, compare, picture and regime as a user runs them, on small scenes with the real renderer.

Rationale: files, exit codes and messages are the contract with users; and in water without scattering,
without walls, render and formula are the same light by construction, in absolute units.
"""

import json
import re

import numpy as np
import pytest
from matplotlib.image import imread

from lightfield.api.light.maps import render
from lightfield.cli import main
from lightfield.errors import LightfieldError, RenderError
from lightfield.maps.dataset import read_netcdf
from lightfield.maps.exr import read_spectral_exr
from lightfield.render.backend import use_backend
from lightfield.render.picture import take_picture
from lightfield.render.shown_as import Shown, ShownAs
from lightfield.scene import Scene

SCENE = """
name = "small"
[water]
absorption_per_m = 0.1
scattering_per_m = {scattering}
[detector]
planes_m = [3.0, 5.0]
width_m = 1.0
pixels = 9
"""
FAST = ("--rel-error", "0.2", "--max-photons", "2e5", "--no-cache")


@pytest.fixture
def scene(tmp_path):
    def write(scattering=0.0, extra=""):
        path = tmp_path / "scene.toml"
        path.write_text(SCENE.format(scattering=scattering) + extra)
        return str(path)

    return write


@pytest.fixture
def undrawn(monkeypatch):
    """Figures of a comparison are made, and not drawn: `unit/report` draws them."""
    monkeypatch.setattr("lightfield.report.page.to_svg", lambda drawing, name: f"<svg>{name}</svg>")
    monkeypatch.setattr("lightfield.report.compare.page.save_png", lambda drawing, path: path)


def test_render_writes_netcdf_exr_and_figure(scene, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["render", scene(0.05), "-o", str(out), *FAST]) == 0
    printed = capsys.readouterr().out
    balance = re.search("energy: (.*), closure", printed)
    assert balance is not None
    spent = [float(part.split()[1]) for part in balance[1].split(", ")]
    assert sum(spent) == pytest.approx(100, abs=0.02), "what is printed adds up"
    assert {p.name for p in out.iterdir()} == {
        "maps.nc", "maps.png", "irradiance_z3.000m.exr", "irradiance_z5.000m.exr",
    }  # fmt: skip
    dataset = read_netcdf(out / "maps.nc")
    image = read_spectral_exr(out / "irradiance_z5.000m.exr")
    np.testing.assert_array_equal(image.value, dataset.irradiance.values[:, 1].astype(np.float32))
    both = dataset.irradiance_direct + dataset.irradiance_diffuse
    np.testing.assert_allclose(both, dataset.irradiance, rtol=1e-6)
    emitted = dataset.attrs["energy_emitted"]
    spent = sum(dataset.attrs[f"energy_{k}"] for k in ("absorbed", "walls", "escaped", "unfinished"))
    assert spent - dataset.attrs["energy_roulette"] == pytest.approx(emitted, rel=1e-5)
    # Maps become images again, the same ones.
    assert main(["export", str(out / "maps.nc"), "--exr", str(tmp_path / "images")]) == 0
    again = read_spectral_exr(tmp_path / "images" / "irradiance_z5.000m.exr")
    np.testing.assert_array_equal(again.value, image.value)
    assert main(["export", str(out / "maps.nc"), "--exr", str(tmp_path / "no"), "--case", "a=1"]) == 2


PLACES = [
    [0.0, 0.0, 4.5],
    [1.0, 0.0, 4.5],
    [0.99, -0.003, 4.5],
    [0.2, 0.1, 4.5],
    [0.0, 0.0, 8.5],
    [0.0, 0.0, 4.5],
]


def test_images_of_another_render_are_named_and_kept(scene, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    assert main(["render", scene(0.0), "-o", str(out), "--no-figures", *FAST]) == 0
    assert "another render" not in capsys.readouterr().out
    (out / "irradiance_z4.000m.exr").write_bytes(b"older")
    assert main(["render", scene(0.0), "-o", str(out), "--no-figures", *FAST]) == 0
    assert "of another render, not touched: irradiance_z4.000m.exr\n" in capsys.readouterr().out
    assert (out / "irradiance_z4.000m.exr").read_bytes() == b"older"


def test_single_positions_are_rendered_where_they_are_and_in_their_order(tmp_path):
    """Among them two closer than a cell, one on a wall, and one twice."""
    path, out = tmp_path / "points.toml", tmp_path / "out"
    path.write_text(
        f"[water]\nabsorption_per_m = 0.1\n[tank]\nwidth_m = 2.0\n[detector]\npositions_m = {PLACES}\n"
    )
    assert main(["render", str(path), "-o", str(out), *FAST]) == 0
    dataset = read_netcdf(out / "maps.nc")
    assert dataset.irradiance.dims == ("wavelength_nm", "position")
    x, y, z = np.array(PLACES).T
    for name, given in (("x_m", x), ("y_m", y), ("z_m", z)):
        np.testing.assert_array_equal(dataset[name], given)
    # Clear water and black walls: the closed form, which shares no code with the render.
    off = np.degrees(np.arctan(np.hypot(x, y) / z))
    r2 = x**2 + y**2 + z**2
    expected = 2 ** -((off / 3.81) ** 2) * z / r2**1.5 * np.exp(-0.1 * np.sqrt(r2))
    light = dataset.irradiance.values[0]
    np.testing.assert_allclose(light / light[0], expected / expected[0], rtol=1e-4)


def test_scattered_light_at_single_positions_is_that_of_fine_maps(tmp_path):
    water = "[water]\nabsorption_per_m = 0.1\nscattering_per_m = 0.2\n"
    places = [[0.0, 0.0, 2.0], [0.31, 0.0, 2.0], [0.31, 0.17, 2.0]]
    (tmp_path / "points.toml").write_text(f"{water}[detector]\npositions_m = {places}\n")
    (tmp_path / "planes.toml").write_text(
        f"{water}[detector]\nplanes_m = [2.0]\nwidth_m = 1.0\npixels = 101\n"
    )
    for name in ("points", "planes"):
        args = [
            "render",
            str(tmp_path / f"{name}.toml"),
            "-o",
            str(tmp_path / name),
            "--no-exr",
            "--no-figures",
        ]
        assert main([*args, "--max-photons", "2e6", "--rel-error", "0.002"]) == 0
    points, planes = (read_netcdf(tmp_path / name / "maps.nc") for name in ("points", "planes"))
    for i, (x, y, _) in enumerate(places):
        cells = planes.isel(wavelength_nm=0, z_m=0).sel(
            x_m=slice(x - 0.036, x + 0.036), y_m=slice(y - 0.036, y + 0.036)
        )
        near, error = (
            float(cells.irradiance_diffuse.mean()),
            float(np.sqrt((cells.irradiance_diffuse_stderr**2).mean() / cells.irradiance_diffuse.size)),
        )
        found, its = float(points.irradiance_diffuse[0, i]), float(points.irradiance_diffuse_stderr[0, i])
        assert found == pytest.approx(near, abs=4 * np.hypot(error, its) + 0.01 * near)
        assert its < 0.03 * found


def test_wavelengths_of_the_command_line(scene, tmp_path):
    out = tmp_path / "out"
    args = [
        "render",
        scene(),
        "-o",
        str(out),
        "--wavelengths",
        "450:650:100",
        "--no-exr",
        "--no-figures",
        *FAST,
    ]
    assert main(args) == 0
    np.testing.assert_array_equal(read_netcdf(out / "maps.nc").wavelength_nm, [450, 550, 650])
    assert [p.name for p in out.iterdir()] == ["maps.nc"]


@pytest.mark.parametrize("asked", ["500:400:10", "500,400", "-1", "100:300:10"])
def test_wavelengths_of_which_there_are_no_maps(asked, scene, capsys):
    """Refused alike by the command and from Python; of a falling range the first alone was rendered."""
    assert main(["render", scene(), "--wavelengths", asked]) == 2
    assert "impossible wavelengths" in capsys.readouterr().err
    if ":" not in asked:
        with pytest.raises(LightfieldError, match="impossible wavelengths"):
            render(scene(), wavelengths=[float(w) for w in asked.split(",")])


@pytest.mark.usefixtures("undrawn")
def test_formula_and_render_agree_where_they_must(scene, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["compare", scene(), "-o", str(out), *FAST]) == 0
    assert "within 5 % on every plane" in " ".join(capsys.readouterr().out.split())
    summary = json.loads((out / "compare.json").read_text())
    for plane in summary["planes"]:
        assert abs(plane["axis_error"]) < 4 * plane["axis_error_stderr"] + 1e-3  # 1e-3: binning of the path
        assert abs(plane["lost"]) < 4 * plane["lost_stderr"] + 1e-3
    assert (out / "index.html").is_file()


@pytest.mark.usefixtures("undrawn")
def test_compare_finds_the_scattered_light_and_takes_maps_too(scene, tmp_path):
    out = tmp_path / "out"
    assert main(["render", scene(0.1), "-o", str(out), *FAST]) == 0
    assert main(["compare", str(out / "maps.nc"), "-o", str(out)]) == 0
    planes = json.loads((out / "compare.json").read_text())["planes"]
    dataset = read_netcdf(out / "maps.nc")
    diffuse, everything = (
        dataset.irradiance_diffuse.sum(("x_m", "y_m")),
        dataset.irradiance.sum(("x_m", "y_m")),
    )
    share = (diffuse / everything).values[0]
    assert [p["lost"] for p in planes] == pytest.approx(list(share), abs=0.01)
    assert planes[1]["lost"] > 0.1


def test_picture_shows_the_beam(scene, tmp_path, capsys):
    target = tmp_path / "view.png"
    tank = "[tank]\nwidth_m = 3.0\ndepth_m = 2.0\nlength_m = 8.0\nlamp_depth_m = 1.0\n"
    assert main(["picture", scene(0.1, tank), "-o", str(target), "--size", "64x36", "--samples", "16"]) == 0
    assert "walls shown with albedo" in capsys.readouterr().out
    pixels = imread(target)
    assert pixels.shape[:2] == (36, 64)
    assert pixels[..., :3].mean(axis=2).max() > 0.5
    assert target.with_suffix(".exr").is_file()


def test_a_colour_that_the_lamp_lacks_is_black_and_not_traced(monkeypatch):
    """A narrow green lamp: red and blue are nothing, and the time they would take is saved."""
    use_backend()
    import mitsuba as mi

    rendered = []
    render = mi.render
    monkeypatch.setattr(mi, "render", lambda *a, **k: rendered.append(1) or render(*a, **k))
    lamp = {"spectrum": {"peak_nm": 545.0, "fwhm_nm": 20.0}}
    scene = Scene.from_dict({"lamp": lamp, "water": {"scattering_per_m": 0.1}})
    said: list[str] = []
    taken = take_picture(scene, width=16, height=16, samples=2, progress=said.append)
    assert (taken.rgb[..., [0, 2]] == 0).all() and taken.rgb[..., 1].max() > 0
    assert len(rendered) == 2 and said == ["image 1 of 2", "image 2 of 2"]


def test_a_water_whose_table_ends_before_red_is_shown_and_said_so():
    """Jerlov 5C is known from 300 to 575 nm."""
    scene = Scene.from_dict({"water": {"base": "jerlov-5C"}})
    taken = take_picture(scene, width=16, height=16, samples=2)
    red = round(float(taken.wavelength_nm[0]), 1)
    assert 640 < red < 650 and taken.notes == (ShownAs(Shown.WAVELENGTH, red, 575.0),)
    assert str(taken.notes[0]) == f"water at {red:g} nm shown as at 575 nm, where its table ends"


def test_a_narrow_lamp_lights_the_colour_that_it_has_in_water_of_its_own_wavelength():
    """Of 505 nm, which is neither green nor blue alone on a screen; and none that is infrared."""
    lamp = {"spectrum": {"peak_nm": 505.0, "fwhm_nm": 2.0}}
    water = {"scattering_per_m": 0.1, "gradient_per_m2": 0.01}
    scene = Scene.from_dict({"lamp": lamp, "water": water, "detector": {"planes_m": [5.0]}})
    taken = take_picture(scene, width=16, height=16, samples=2)
    assert taken.wavelength_nm[1] == pytest.approx(505.0, abs=0.1) and taken.rgb[..., 1].max() > 0
    assert taken.notes == (ShownAs(Shown.LAYERS, pytest.approx(0.05), 0.0),)
    with pytest.raises(RenderError, match="between 400 and 700 nm"):
        take_picture(
            scene.with_values({"lamp.spectrum": {"peak_nm": 900.0, "fwhm_nm": 20.0}}),
            width=16,
            height=16,
            samples=2,
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["render", "missing.toml"], "missing.toml: cannot read the scene"),
        (["render", "{scene}", "--wavelengths", "red"], "--wavelengths: not wavelengths"),
        (["render", "{scene}", "--wavelengths", "600,500"], "--wavelengths: impossible wavelengths"),
        (["render", "{scene}", "--rel-error", "0"], "impossible relative error"),
        (["render", "{scene}", "--max-photons", "1"], "--max-photons: found '1'; rule: a number, 1e3"),
        (["render", "{scene}", "--seed", "-1"], "--seed"),
        (["render", "{scene}", "-o", "{scene}"], "cannot write here"),
        (["compare", "{scene}", "-o", "{scene}/deeper"], "cannot write here"),
        (["compare", "readings.csv"], "readings need the scene"),
        (["compare", "missing.nc"], "missing.nc: cannot read the rendering"),
        (["picture", "{scene}", "--size", "big"], "--size: not a size"),
        (["picture", "{scene}", "--samples", "0"], "--samples: impossible number of samples"),
        (["picture", "{scene}", "-o", "view.jpg"], "the picture is a PNG file"),
        (["regime", "missing.toml"], "missing.toml: cannot read the scene"),
        (["regime", "--seed", "-1"], "--seed"),
    ],
)
def test_wrong_commands_give_one_line_and_exit_code_2(
    arguments, message, scene, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    path = scene()
    before = sorted(tmp_path.iterdir())
    assert main([word.format(scene=path) for word in arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
    left = [
        p for p in tmp_path.iterdir() if p not in before and p.name not in ("render", "compare", "regime")
    ]
    assert left == [], "nothing half-done stays"


def test_what_a_scene_states_without_effect_is_told(scene, tmp_path, capsys) -> None:
    (tmp_path / "lamp.csv").write_text("angle_deg,intensity\n0,2\n5,1\n")
    file = scene(extra='[lamp]\nprofile = "gaussian"\nintensity_table = "lamp.csv"\n')
    assert main(["render", str(file), *FAST, "--no-figures", "--no-exr", "-o", str(tmp_path / "maps")]) == 0
    assert "not used: lamp.intensity_table (profile is gaussian)" in capsys.readouterr().out
