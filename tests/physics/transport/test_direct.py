"""Without scattering and walls, the traced map is the closed-form model: source, inverse square, attenuation,
receiver. The two share the table of beam profiles and nothing else.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from beams import aside, ies
from montecarlo import cell_average, chi_square_p, normal_scores

from lightfield.formula.closed_form import direct_field
from lightfield.render.backend import use_backend
from lightfield.render.direct import direct_at, points_of_disc
from lightfield.render.maps import Rendering, render_scene
from lightfield.scene import Scene

BAND = np.array([525.0])


def scores(scene: Scene, rendering: Rendering, order: int = 6) -> np.ndarray:
    """Normal scores of every lit cell; means over cells by so many nodes."""
    mean, stderr = rendering.relative_maps(BAND)
    truth = cell_average(rendering.grid, partial(direct_field, scene), order=order)
    lit = truth > 0
    return normal_scores(mean[0][lit], truth[lit], stderr[0][lit], len(rendering.response.tally))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 5))])
def test_map_equals_the_model_in_every_pixel(seed: int) -> None:
    """The paper's set-up: 3.81 deg beam, a = 0.1 per m, five planes of 65 x 65 cells, 21125 z-scores."""
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1}})
    rendering = render_scene(scene, rel_error=1e-4, max_photons=2e6, seed=seed, cache=False)
    z = scores(scene, rendering)
    assert z.size == 5 * 65 * 65
    assert 0.001 < chi_square_p(z) < 0.999
    assert np.abs(z).max() < 5.5  # of 21125 normal numbers, one in a thousand such sets goes beyond


def test_planes_are_as_good_as_independent() -> None:
    """Each plane's chi-square alone is right too: no error common to all cells hides in the sum."""
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1}, "detector": {"pixels": 41}})
    p = []
    for seed in range(10, 16):
        rendering = render_scene(scene, rel_error=1e-4, max_photons=1e6, seed=seed, cache=False)
        p += [chi_square_p(plane) for plane in scores(scene, rendering).reshape(5, -1)]
    p = np.array(p)
    assert p.min() > 0.0005 and p.max() < 0.9995
    # 30 uniform numbers have mean 0.5 +- 0.053.
    assert abs(p.mean() - 0.5) < 3 * 0.053


def test_few_large_cells() -> None:
    """Ten million photons on 25 cells: sums in single precision stay right to a part in ten thousand."""
    detector = {"pixels": 5, "width_m": 3.0, "planes_m": [4.5, 8.5]}
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1}, "detector": detector})
    rendering = render_scene(scene, rel_error=1e-5, max_photons=1e7, cache=False)
    mean, stderr = rendering.relative_maps(BAND)
    truth = cell_average(rendering.grid, partial(direct_field, scene), order=24)
    assert (stderr < 1e-4 * truth.max()).all()
    assert np.abs(mean - truth).max() < 1e-4 * truth.max()


def own(stage: str, formula: str, size: float) -> dict[str, Any]:
    """An effect of the user's own, of that size; its edges lie between cells."""
    parameters = {"a": {"range": [-1.0, 1.0], "neutral": 0.0, "value": size}}
    return {"name": "mine", "stage": stage, "formula": formula, "parameters": parameters}


SMALL = {"planes_m": [4.5, 8.5], "width_m": 1.6, "pixels": 16}
CASES: dict[str, dict[str, Any]] = {
    "super-gaussian": {"lamp": {"profile": "super-gaussian", "shape_exponent": 5.0}},
    "core and skirt": {"lamp": {"profile": "two-component", "skirt_fraction": 0.2, "skirt_hwhm_deg": 12.0}},
    "isotropic": {"lamp": {"profile": "isotropic"}},
    "moved and tilted": {"lamp": {"offset_x_m": 0.1, "offset_y_m": -0.05, "tilt_x_deg": 2, "tilt_y_deg": -1}},
    "elliptic and tilted": {"lamp": {"ellipticity": 1.5, "tilt_x_deg": 2.0}},
    "oval, turned and tilted": {"lamp": {"ellipticity": 0.8, "ellipticity_diagonal": 1.6, "tilt_y_deg": 2.0}},
    "lopsided": {"lamp": {"asymmetry_x": 0.3, "asymmetry_y": -0.2, "shape_exponent": 4.0}},
    "apparent source": {"lamp": {"apparent_distance_m": 1.5, "tilt_x_deg": 1.0}},
    "source in front of the window": {"lamp": {"apparent_distance_m": -0.4, "tilt_x_deg": 1.0}},
    "finite window": {"lamp": {"radius_m": 0.06}},
    "gradient": {"water": {"absorption_per_m": 0.2, "gradient_per_m2": 0.02}},
    "gradient in height": {
        "water": {"absorption_per_m": 0.2, "height_gradient_per_m2": 0.05},
        "lamp": {"offset_y_m": 0.1, "apparent_distance_m": 0.8},
    },
    "bottom layer": {
        "water": {"absorption_per_m": 0.2, "bottom_layer_absorption_per_m": 0.4, "bottom_layer_top_m": -0.1},
        "lamp": {"offset_y_m": 0.1, "apparent_distance_m": 0.8},
    },
    "layer": {"water": {"layer_absorption_per_m": 0.5, "layer_centre_m": 6.5, "layer_width_m": 1.0}},
    "plane inside a layer": {"water": {"layer_absorption_per_m": 0.5, "layer_centre_m": 4.5}},
    "departing profile": {"lamp": {"profile_departure": [[0, 0.1], [4, 0.4], [8, -0.5]], "tilt_x_deg": 1.0}},
    "curve of absorption": {"water": {"absorption_departure": [[3, 0.0], [5, 0.05], [8, -0.03]]}},
    "own effect on the path": {"effect": [own("path", "1 - a*(x > 0.1)*(y > 0)*z/r", 0.3)]},
    "own effect on the beam": {"effect": [own("source", "1 + a*sin(theta)**2", 0.3)]},
    "hardening": {"water": {"absorption_per_m": 0.2, "hardening_per_m": 0.06}},
    "scalar irradiance": {"detector": {"quantity": "scalar_irradiance"}},
    "acceptance": {"detector": {"acceptance_hwhm_deg": 4.0}},
    "cosine error": {
        "detector": {"cosine_error": -0.3, "planes_m": [0.6, 1.2]},
        "lamp": {"hwhm_deg": 40.0},
    },
    "tilted receiver": {"detector": {"tilt_x_deg": 20.0}},
    "tilted receiver, acceptance": {"detector": {"tilt_x_deg": 5.0, "acceptance_hwhm_deg": 4.0}},
    "aimed at the lamp": {"detector": {"aim": "lamp"}, "lamp": {"offset_x_m": 0.2}},
    "collimator, aimed": {"detector": {"aim": "lamp", "quantity": "radiance", "full_angle_deg": 4.0}},
    "collimator along the axis": {"detector": {"quantity": "radiance", "full_angle_deg": 40.0}},
}  # fmt: skip


def small_scene(case: dict[str, Any]) -> Scene:
    water = {"absorption_per_m": 0.1} | case.get("water", {})
    parts = {"lamp": case.get("lamp", {}), "effect": case.get("effect", [])}
    return Scene.from_dict({**parts, "water": water, "detector": SMALL | case.get("detector", {})})


@pytest.mark.parametrize("name", CASES)
def test_effects_equal_the_model(name: str) -> None:
    """Every effect on source, path and receiver acts on traced light as the formulas say."""
    scene = small_scene(CASES[name])
    rendering = render_scene(scene, rel_error=1e-4, max_photons=6e5, seed=3, cache=False)
    z = scores(scene, rendering)
    assert z.size == 2 * 16 * 16
    assert 0.001 < chi_square_p(z) < 0.999


def test_measured_beam_equals_the_model(tmp_path: Path) -> None:
    """A beam from a table: flat to 2 degrees, then falling linearly to nothing at 9 degrees."""
    table = tmp_path / "beam.csv"
    table.write_text("angle_deg,intensity\n0,1\n2,1\n9,0\n")
    scene = small_scene(
        {"lamp": {"profile": "table", "intensity_table": str(table)}, "detector": {"width_m": 1.0}}
    )
    rendering = render_scene(scene, rel_error=1e-4, max_photons=6e5, seed=5, cache=False)
    z = scores(scene, rendering, order=64)  # the beam has kinks in some cells
    assert 0.001 < chi_square_p(z) < 0.999


def test_luminaire_that_is_not_round_equals_the_closed_form(tmp_path: Path) -> None:
    """A Gaussian whose middle lies 1.7 degrees beside the axis, from half planes 0, 2 ... 358 of a made-up
    luminaire file: its maps against inverse square and the Gaussian itself, not its table."""
    file = ies(tmp_path / "aside.ies", lambda x, y: aside(x, -y), np.arange(0.0, 359.0, 2.0))
    scene = small_scene({"lamp": {"profile": "table", "intensity_table": str(file)}})
    rendering = render_scene(scene, rel_error=1e-4, max_photons=6e5, seed=6, cache=False)

    def truth(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        r = np.sqrt(x * x + y * y + z * z)
        theta, across = np.arctan2(np.hypot(x, y), z), np.maximum(np.hypot(x, y), 1e-12)
        return np.asarray(aside(theta * x / across, theta * y / across) * np.exp(-0.1 * r) * z / r**3)

    mean, stderr = (v[0] for v in rendering.relative_maps(BAND))
    known = cell_average(rendering.grid, truth)
    # Linear between angles 0.25 degrees and planes 2 degrees apart: 6e-4 of the axis at most.
    off = np.abs(mean - known) - 4 * stderr
    assert (off < 6e-4 * known.max()).all()
    assert np.array(np.unravel_index(known[0].argmax(), known[0].shape)).tolist() != [7, 7]


def test_collimator_parallel_to_the_axis_is_blind_to_a_lamp_aside() -> None:
    """At x = 0.8 m, z = 4.5 m the lamp stands 10 degrees off the axis of a 2 degree collimator."""
    scene = small_scene({"detector": {"quantity": "radiance", "full_angle_deg": 2.0}})
    rendering = render_scene(scene, rel_error=1e-4, max_photons=2e5, cache=False)
    mean, stderr = rendering.relative_maps(BAND)
    assert mean[0, 0, :, 0].max() == 0.0
    assert np.isinf(stderr[0, 0, :, 0]).all()


def test_points_on_the_window_lean_to_no_side() -> None:
    """A uniform disc of radius R: mean position 0, <x^2> = <y^2> = R^2/4, <xy> = 0.

    A centroid 0.2 mm aside would pass for an offset of the lamp by as much.
    """
    x, y = points_of_disc(0.02)
    assert abs(x.mean()) < 1e-9 and abs(y.mean()) < 1e-9 and abs((x * y).mean()) < 1e-12
    np.testing.assert_allclose([(x * x).mean(), (y * y).mean()], 0.02**2 / 4, rtol=1e-9)


def test_a_tilted_beam_sends_nothing_behind_it() -> None:
    """Turned by 60 degrees to +x: at x = -3, z = 1 m one is 131 degrees off its axis, at -0.5 m 87."""
    lamp = {"hwhm_deg": 60.0, "tilt_x_deg": 60.0}
    scene = Scene.from_dict({"lamp": lamp, "detector": {"quantity": "scalar_irradiance"}})
    x, z = np.array([-3.0, -1.0, -0.5, 2.0]), np.ones(4)
    degrees = np.degrees(np.arctan2(x, z)) - 60.0
    expected = np.where(np.abs(degrees) < 90, 0.5 ** ((degrees / 60.0) ** 2), 0.0) / (x * x + 1.0)
    np.testing.assert_allclose(direct_at(scene, x, 0 * x, z, 0.0), expected, rtol=1e-4)


def test_another_wavelength_lamp_and_place_in_memory_need_no_new_kernel() -> None:
    """Dr.Jit writes numbers of Python, and how an array lies in memory, into what it compiles."""
    use_backend()
    import drjit as dr

    def kernels(lamp: dict[str, float], attenuation_per_m: float, x: np.ndarray) -> set[int]:
        dr.kernel_history_clear()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            direct_at(Scene.from_dict({"lamp": lamp}), x, 0 * x, x + 2.0, attenuation_per_m)
        return {kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])}

    places = np.linspace(0.0, 1.0, 41)
    first = kernels({"radius_m": 0.02}, 0.1, places[:40])
    aside = {"radius_m": 0.03, "offset_x_m": 0.1, "apparent_distance_m": 0.2}
    assert first and kernels(aside, 0.2, places[1:]) == first
