"""A lamp that is wider in red than in blue sends scattered and reflected light by its width in each colour.

Held to renders of plain lamps whose widths are written out.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sweeping

from lightfield.fitting.forward import SceneForward
from lightfield.formula.scattered.scattered_field import ScatteredField
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.source import response_for
from lightfield.render.maps import Rendering, render_scene
from lightfield.scene import Scene
from lightfield.sweep.results import as_rendering, open_store

KAPPA, WIDTH = 0.4, 6.0
NM = (450.0, 540.0, 640.0)
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": WIDTH, "width_slope": KAPPA},
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.15},
        "tank": {"wall_albedo": 0.3},
        "detector": {
            "planes_m": [2.0, 5.0], "width_m": 1.6, "pixels": 8, "bands_nm": [[w - 2, w + 2] for w in NM],
        },
    }
)  # fmt: skip


def plain(nm: float) -> Scene:
    return SCENE.with_values({"lamp.width_slope": 0.0, "lamp.hwhm_deg": WIDTH * (nm / 550) ** KAPPA})


def maps_of(scene: Scene, seed: int) -> Rendering:
    return render_scene(scene, rel_error=0.01, max_photons=1e6, seed=seed, cache=False)


def pulls(found: np.ndarray, stderr: np.ndarray, true: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Over their errors and the half per mille to which maps of the two are one."""
    return (found - true) / np.sqrt(stderr**2 + error**2 + (1e-3 * true) ** 2)


@pytest.fixture(scope="module")
def plain_maps() -> tuple[np.ndarray, np.ndarray]:
    """Of each band from a trace of its own lamp, for unit intensity on the axis."""
    each = [maps_of(plain(nm), 2).relative_maps(np.array([nm])) for nm in NM]
    mean, stderr = (np.concatenate(v) for v in zip(*each, strict=True))
    return mean, stderr


def test_maps_are_those_of_the_lamp_of_each_colour(plain_maps: tuple[np.ndarray, np.ndarray]) -> None:
    rendering, (true, error) = maps_of(SCENE, 1), plain_maps
    found, stderr = rendering.relative_maps(np.array(NM))
    pull = pulls(found, stderr, true, error)
    assert np.sqrt(np.mean(pull**2)) < 1.3 and np.abs(pull).max() < 5
    # The lamp of 550 nm in every colour is another.
    wrong = maps_of(SCENE.with_values({"lamp.width_slope": 0.0}), 1).relative_maps(np.array(NM))[0]
    assert np.sqrt(np.mean(pulls(wrong, stderr, true, error)[[0, 2]] ** 2)) > 5
    straight, rest = (rendering.relative_maps(np.array(NM), part)[0] for part in ("direct", "diffuse"))
    assert straight + rest == pytest.approx(found, rel=1e-5)


@pytest.mark.slow
def test_a_sweep_has_the_maps_of_a_render(tmp_path: Path) -> None:
    scene, store = tmp_path / "scene.toml", tmp_path / "colours.zarr"
    scene.write_text(SCENE.to_toml())
    vary = ("--vary", "lamp.width_slope=0,0.4", "--vary", "water.absorption_per_m=0.05,0.1")
    more = ("--max-photons", "1e6", "--rel-error", "0.01")
    assert sweeping.in_process(scene, store, *more, vary=vary).returncode == 0
    with open_store(store) as data:
        case = as_rendering(data, {"lamp.width_slope": 1, "water.absorption_per_m": 1})
        found, stderr = case["irradiance"].values, case["irradiance_stderr"].values
    true, error = maps_of(SCENE, 1).maps()
    pull = pulls(found, stderr, true, error)
    assert np.sqrt(np.mean(pull**2)) < 1.3 and np.abs(pull).max() < 5


def test_the_light_of_fits_is_that_of_the_lamp_of_each_colour() -> None:
    """Traced and followed, and by quadrature where nothing is reflected."""
    grid = np.meshgrid([0.0, 0.2, 0.4, 0.6], [2.0, 3.5, 5.0], NM, indexing="ij")
    x, z, nm = (v.ravel() for v in grid)
    table = Readings.from_arrays(x_m=x, z_m=z, wavelength_nm=nm, value=np.ones(x.size), quantity="irradiance")
    light = SceneForward(SCENE, table, lambda *a, **k: response_for(*a, **k, keeper=Keeper(False))).light
    modes, smooth = light.errors({})
    own = np.hypot(np.linalg.norm(modes, axis=1), smooth)
    free, open_water = ScatteredField(x, 0 * x, z), SCENE.model_copy(update={"tank": None})
    for wavelength in NM:
        mine, alone = nm == wavelength, plain(wavelength)
        true, error = rendered_light(alone, table.subset(mine), rel_error=3e-3, max_photons=2e6, seed=3)
        found = (light.rest({}) + light.direct(SCENE, table))[mine]
        assert np.abs((found - true) / np.hypot(error, own[mine])).max() < 4
        lamp = open_water.with_values({"lamp": alone.lamp}, validate=False)
        one = free.light(lamp, [wavelength])[0]
        assert free.light(open_water, list(NM))[NM.index(wavelength)] == pytest.approx(one, rel=1e-9)
        if wavelength != NM[1]:  # the lamp of 550 nm in this colour is another
            grey = SCENE.with_values({"lamp.width_slope": 0.0})
            wrong = light.diffuse.light(grey)[mine] + light.direct(SCENE, table)[mine]
            assert np.abs((wrong - true) / np.hypot(error, own[mine])).max() > 6
