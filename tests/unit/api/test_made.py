"""Riddles, pictures and imported tables in Python are those of the commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from analytic_readings import scene
from campaign import ROWS, two_exposures, write_index

import lightfield as lf
from lightfield import cli
from lightfield.api.light.picture import Picture
from lightfield.render.picture import Picture as Taken
from lightfield.render.picture import exposure
from lightfield.render.shown_as import Shown, ShownAs


@pytest.fixture(scope="module")
def riddle() -> lf.Riddle:
    return lf.hide(scene(), effect=["background"], size={"detector.background": 0.03}, max_photons=1e4)


def test_a_riddle_does_not_give_its_secret_away(riddle):
    for told in (repr(riddle), str(riddle), riddle._repr_html_()):
        assert "background" not in told
    assert riddle.as_data()["scene_toml"] == scene().to_toml() and riddle.scene == scene()
    assert riddle.truth["parameters"] == {"detector.background": 0.03}
    axes = riddle.plot()
    assert axes.has_data() and len(riddle.to_pandas()) == len(riddle.readings)


def test_a_saved_riddle_is_that_of_the_command_and_is_found(riddle, tmp_path):
    asked = ["--effect", "background", "--size", "detector.background=0.03", "--max-photons", "1e4"]
    scene().save(tmp_path / "believed.toml")
    by_command = tmp_path / "command"
    assert cli.main(["hide", str(tmp_path / "believed.toml"), *asked, "-o", str(by_command)]) == 0
    saved = riddle.save(tmp_path / "python")
    for name in ("data.csv", "truth.json"):
        assert (saved / name).read_bytes() == (by_command / name).read_bytes()
    found = lf.diagnose(saved / "data.csv", saved / "scene.toml", effects=["background"], trace=False)
    assert found.effects == ["background"]


def test_a_render_worse_than_the_noise_is_warned_of(tmp_path, capsys):
    """Scattered light of a thousand photons beside readings that are right to 1e-4: in words and in JSON,
    with both figures and the remedy; of more, beside noise of a half, there is nothing to say."""
    murky = scene().with_values({"water.scattering_per_m": 0.3})
    made = lf.hide(murky, noise=1e-4, max_photons=1e3)
    doubt = made.truth["light_in_doubt"]
    assert made.as_data()["light_in_doubt"] == doubt
    assert doubt["light_error_percent"] > doubt["noise_percent"] >= 0.01 and doubt["photons"] > 1e3
    (warned,) = [line for line in made.as_text().splitlines() if line.startswith("warning: ")]
    assert f"{doubt['light_error_percent']:.2g} %" in warned and f"{doubt['noise_percent']:.2g} %" in warned
    assert warned.endswith(f"remedy: more photons, about {doubt['photons']:.0e} (max_photons)")
    murky.save(tmp_path / "murky.toml")
    by_command = warned.replace("max_photons", "--max-photons")
    for noise, photons, told in (("1e-4", "1e3", by_command), ("0.5", "2e4", None)):
        words = ["hide", str(tmp_path / "murky.toml"), "--noise", noise, "--max-photons", photons]
        assert cli.main([*words, "-o", str(tmp_path / noise)]) == 0
        lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("warning: ")]
        assert lines == ([told] if told else [])
        truth = json.loads((tmp_path / noise / "truth.json").read_text())
        assert truth["light_in_doubt"] == (doubt if told else None)


def test_a_riddle_that_a_full_disk_left_half_is_written_anew(riddle, tmp_path, monkeypatch):
    """What was hidden is written first: without it nothing of a folder is replaced."""

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("lightfield.experiments.hide.write_table", full)
        with pytest.raises(OSError):
            riddle.save(tmp_path / "half")
    assert (riddle.save(tmp_path / "half") / "data.csv").exists()


def test_a_riddle_replaces_a_riddle_and_no_readings(riddle, tmp_path):
    riddle.save(tmp_path)
    riddle.save(tmp_path)
    (tmp_path / "truth.json").unlink()
    with pytest.raises(lf.LightfieldError, match="files of an experiment"):
        riddle.save(tmp_path)


@pytest.mark.parametrize(
    "asked",
    [
        {"noise": 0.0},
        {"strength": 0.0},
        {"plane_gain": -1.0},
        {"position": 1e4},
        {"effect": ["background"] * 2},
    ],
)
def test_a_riddle_of_impossible_numbers_is_refused(asked):
    with pytest.raises(lf.LightfieldError, match=next(iter(asked))):
        lf.hide(scene(), **asked)


def test_a_picture_is_drawn_tabled_and_saved(tmp_path):
    rgb = np.random.default_rng(1).uniform(0, 1e-4, (20, 30, 3))
    seen = Picture(Taken(rgb, (ShownAs(Shown.ALBEDO, 0.0, 0.15),), np.array([640.0, 540.0, 450.0])))
    assert "30 x 20" in repr(seen) and "note: walls" in str(seen)
    data = json.loads(json.dumps(seen.as_data()))
    assert data["notes"] == ["walls shown with albedo 0.15 instead of 0"]
    assert data["shown_as"] == [{"what": "wall_albedo", "own": 0.0, "shown": 0.15}]
    table = seen.to_pandas()
    assert table.loc[(table.row == 7) & (table.column == 11), "green"].item() == rgb[7, 11, 1]
    np.testing.assert_array_equal(seen.to_xarray().rgb.sel(colour="blue"), rgb[..., 2])
    assert seen.plot().images and "<svg" in seen.report(tmp_path / "p.html").read_text(encoding="utf-8")
    written = seen.save(tmp_path / "p.png")
    with OpenEXR.File(str(written.with_suffix(".exr"))) as opened:
        light = opened.channels()["RGB"].pixels
    np.testing.assert_allclose(light / exposure(rgb), rgb, rtol=1e-6)
    with pytest.raises(lf.LightfieldError, match=r"\.png"):
        seen.save(tmp_path / "p.jpg")


def test_a_picture_of_impossible_numbers_is_refused():
    for asked in ({"size": (8, 100)}, {"samples": 1}):
        with pytest.raises(lf.LightfieldError, match="rule: "):
            lf.picture(scene(), **asked)


def test_imported_files_are_those_of_the_command(tmp_path):
    two_exposures(tmp_path)
    index = write_index(tmp_path, ROWS)
    found = lf.import_(index, quantity="irradiance", units="counts", band=[(500, 550)], position_mm=1.0)
    asked = "--quantity irradiance --units counts --band 500:550 --position-mm 1"
    assert cli.main(["import", str(index), *asked.split(), "-o", str(tmp_path / "command.csv")]) == 0
    written = lf.save(found, tmp_path / "python.csv")
    assert written.read_bytes() == (tmp_path / "command.csv").read_bytes()
    again = lf.load(written)
    np.testing.assert_array_equal(again.value, found.value)
    assert again.budget == found.budget and again.budget.position_mm == 1.0


def test_a_fit_without_the_renderer_is_the_commands(riddle, tmp_path: Path):
    saved, page = riddle.save(tmp_path / "riddle"), tmp_path / "fit.json"
    asked = [
        "--scene",
        str(saved / "scene.toml"),
        "--with",
        "background",
        "--no-trace",
        "--fit-json",
        str(page),
    ]
    assert cli.main(["compare", str(saved / "data.csv"), *asked]) == 0
    found = lf.compare(riddle.readings, riddle.scene, with_=["background"], trace=False)
    told = json.loads(page.read_text())
    assert found.as_data()["chi2"] == pytest.approx(told["chi2"])
    with pytest.raises(lf.LightfieldError, match="traces nothing"):
        lf.compare(riddle.readings, riddle.scene, trace=False, solver="render")
    with pytest.raises(lf.LightfieldError, match="belong to readings"):
        lf.compare(riddle.scene, trace=False)
