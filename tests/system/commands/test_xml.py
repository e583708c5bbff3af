"""`lightfield scene FILE --to-xml`: Mitsuba reads the scene back and its tracer finds the same light."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from lightfield import cli
from lightfield.render.maps import render_scene
from lightfield.render.xml import mitsuba_dict
from lightfield.scene import Scene

# Asymmetric, so that a map that is turned or taken from another plane is found out.
SCENE = """
[lamp]
tilt_x_deg = 2.0
tilt_y_deg = -1.0
[water]
absorption_per_m = 0.1
scattering_per_m = 0.05
phase = PHASE
[tank]
wall_albedo = 0.4
surface = "flat"
[detector]
planes_m = [4.5, 5.5]
pixels = 3
"""


@pytest.mark.parametrize(
    "phase",
    [
        '{ type = "petzold", water = "coastal" }',
        pytest.param('{ type = "henyey-greenstein", g = 0.9 }', marks=pytest.mark.slow),
    ],
)
def test_mitsuba_renders_the_written_scene_like_lightfield(tmp_path, phase):
    """Both are Monte Carlo estimates with stated errors: their differences add up to chi-square."""
    file, xml = tmp_path / "scene.toml", tmp_path / "scene.xml"
    file.write_text(SCENE.replace("PHASE", phase))
    assert cli.main(["scene", str(file), "--to-xml", str(xml)]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.toml", "scene.xml"]
    import mitsuba as mi

    scene = mi.load_file(str(xml))
    rendering = render_scene(Scene.load(file), max_photons=1e6, rel_error=0.001, seed=5, cache=False)
    mean, stderr = rendering.maps()  # over the band
    z_squared = 0.0
    for number, sensor in enumerate(scene.sensors()):
        image = np.array(mi.render(scene, sensor=sensor, seed=7))[::-1]  # row 0 of an image is the top
        difference = image[..., 0] - mean[0, number]
        z_squared += float(np.sum(difference**2 / (image[..., 1] ** 2 + stderr[0, number] ** 2)))
        assert image[1, 2, 0] > image[1, 0, 0]  # the lamp is turned towards +x
        assert image[0, 1, 0] > image[2, 1, 0]  # and downwards
    assert 0.001 < chi2.sf(z_squared, 2 * 9) < 0.999


def test_a_line_within_the_band_is_as_bright_as_its_mean_and_what_is_left_out_is_said(tmp_path, capsys):
    """A laser off the middle of 50 nm: all its power over the band's width."""
    scene = Scene.from_dict({
        "lamp": {"spectrum": {"peak_nm": 505.0, "fwhm_nm": 1.0}, "power_w": 2.0, "profile": "isotropic"},
        "water": {"layer_absorption_per_m": 0.1},
        "detector": {"planes_m": [4.0], "pixels": 3, "bands_nm": [[500, 550], [550, 600]]},
    })  # fmt: skip
    assert mitsuba_dict(scene)["lamp"]["intensity"] == pytest.approx(2.0 / 50 / (4 * np.pi), rel=1e-3)
    file = tmp_path / "scene.toml"
    scene.save(file)
    assert cli.main(["scene", str(file), "--to-xml", str(tmp_path / "scene.xml")]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == [
        "note: it holds 500-550 nm, as at 505 nm, and no other band",
        "note: without absorption that changes within the water",
    ]


def test_a_folder_is_no_place_for_the_file(tmp_path, capsys):
    file = tmp_path / "scene.toml"
    file.write_text("[detector]\npixels = 3\n")
    assert cli.main(["scene", str(file), "--to-xml", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert len(message.splitlines()) == 1 and str(tmp_path) in message and "remedy" in message
