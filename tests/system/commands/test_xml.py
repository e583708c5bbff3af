"""`lightfield scene FILE --to-xml`: Mitsuba reads the scene back and its tracer finds the same light."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from lightfield import cli
from lightfield.render.maps import render_scene
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
    mean, stderr = rendering.maps(np.array([525.0]))
    z_squared = 0.0
    for number, sensor in enumerate(scene.sensors()):
        image = np.array(mi.render(scene, sensor=sensor, seed=7))[::-1]  # row 0 of an image is the top
        difference = image[..., 0] - mean[0, number]
        z_squared += float(np.sum(difference**2 / (image[..., 1] ** 2 + stderr[0, number] ** 2)))
        assert image[1, 2, 0] > image[1, 0, 0]  # the lamp is turned towards +x
        assert image[0, 1, 0] > image[2, 1, 0]  # and downwards
    assert 0.001 < chi2.sf(z_squared, 2 * 9) < 0.999


def test_a_folder_is_no_place_for_the_file(tmp_path, capsys):
    file = tmp_path / "scene.toml"
    file.write_text("[detector]\npixels = 3\n")
    assert cli.main(["scene", str(file), "--to-xml", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert len(message.splitlines()) == 1 and str(tmp_path) in message and "remedy" in message
