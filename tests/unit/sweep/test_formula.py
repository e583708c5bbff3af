"""A sweep computes its formula from geometry once and attenuation per case, `compare` in one piece: alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from perturbed import FIELDS, changed, scenes_of_every_field

from lightfield.formula.closed_form import direct_field
from lightfield.render.response.grid import scene_grid
from lightfield.scene import Scene
from lightfield.scene.bands import over_band, over_bands, pieces
from lightfield.scene.parameters import Parameter
from lightfield.studies.compare.maps import closed_form, on_cells
from lightfield.sweep.derived import GridFormula
from lightfield.sweep.work import _formula

EVERYTHING_ON = Scene.from_dict(
    {
        "lamp": {
            "profile": "two-component", "skirt_fraction": 0.1, "ellipticity": 1.2, "offset_x_m": 0.05,
            "tilt_x_deg": 1.0, "tilt_y_deg": -0.5, "apparent_distance_m": 0.3,
        },
        "water": {
            "base": "pure", "absorption_per_m": 0.05, "scattering_per_m": 0.1, "chlorophyll_mg_per_m3": 0.5,
            "cdom_440_per_m": 0.1, "sediment_g_per_m3": 0.2, "absorption_at": [[480, 0.1], [580, 0.2]],
            "gradient_per_m2": 0.01, "layer_absorption_per_m": 0.1, "layer_centre_m": 1.5,
            "hardening_per_m": 0.02, "height_gradient_per_m2": 0.01, "settling_per_m": 0.03,
            "temperature_c": 15.0,            "salinity_psu": 10.0,
        },
        "tank": {"wall_albedo": 0.2, "surface": "flat"},
        "detector": {
            "planes_m": [2.0], "width_m": 0.03, "pixels": 3, "bands_nm": [[500, 550]],
            "acceptance_hwhm_deg": 20.0, "tilt_x_deg": 2.0, "cosine_error": 0.05, "wavelength_shift_nm": 3.0,
        },
    }
)  # fmt: skip
NUMBERS = EVERYTHING_ON.parameters()
WORDS: dict[str, dict[str, Any]] = {
    "plain": {},
    "grey": {"water.base": "none", "water.absorption_at": ()},
    "points alone": {"water.base": "none"},
    "preset": {"water.base": "petzold-coastal"},
    "isotropic": {"lamp.profile": "isotropic"},
    "cie-a": {"lamp.spectrum": "cie-a"},
    "two bands": {"detector.bands_nm": ((450.0, 470.0), (600.0, 700.0))},
    "scalar": {
        "detector.quantity": "scalar_irradiance",
        "detector.acceptance_hwhm_deg": 0.0,
        "detector.cosine_error": 0.0,
    },
    "aimed": {"detector.aim": "lamp"},
}


def elsewhere(parameter: Parameter) -> float:
    """Another value of a parameter, near its own, inside its range."""
    step = 0.2 * (abs(parameter.value) or min(1.0, parameter.high))
    return parameter.value + (step if parameter.value + step <= parameter.high else -step)


def both(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Maps by the sweep's formula and by `compare`'s, shape (n_bands, n_planes, n_y, n_x)."""
    grid = scene_grid(scene)
    formula = GridFormula.of(scene, grid)
    assert formula is not None
    whole = []
    for low, high in np.array(scene.detector.bands_nm) + scene.detector.wavelength_shift_nm:
        at = over_band(scene.lamp, low, high, scene.detector, pieces(scene))
        whole.append([on_cells(closed_form, scene, grid.x_m, grid.y_m, z, at) for z in grid.z_m])
    return formula.bands(scene), np.array(whole)


@pytest.mark.parametrize("path", NUMBERS)
def test_formula_of_a_sweep_is_that_of_compare_whatever_changes(path: str) -> None:
    """Cells of 1 cm: over one of them the path changes by 0.1 mm, the transmission by less than 1e-5."""
    value = elsewhere(NUMBERS[path])
    scene = EVERYTHING_ON.with_values({path: round(value) if path == "detector.pixels" else value})
    sweep, compare = both(scene)
    np.testing.assert_allclose(sweep, compare, rtol=1e-5)


@pytest.mark.parametrize("change", WORDS.values(), ids=WORDS)
def test_formula_of_a_sweep_is_that_of_compare_in_other_words(change: dict[str, Any]) -> None:
    sweep, compare = both(EVERYTHING_ON.with_values(change))
    np.testing.assert_allclose(sweep, compare, rtol=1e-5)


@pytest.fixture(scope="module")
def bases(tmp_path_factory: pytest.TempPathFactory) -> list[Scene]:
    """With tables, and without; cells so small that the narrowest acceptance is the same all over one."""
    small = {
        "detector.planes_m": (2.0,), "detector.width_m": 1e-3, "detector.height_m": 1e-3,
        "detector.pixels": 3, "detector.quantity": "irradiance",
    }  # fmt: skip
    return [s.with_values(small) for s in scenes_of_every_field(tmp_path_factory.mktemp("tables"))[:2]]


@pytest.mark.parametrize("path", FIELDS)
def test_formula_of_a_sweep_is_that_of_compare_whatever_field_is_another(
    path: str, bases: list[Scene]
) -> None:
    for scene in bases:
        other = changed(scene, path)
        if not other.detector.positions_m:
            sweep, compare = both(other)
            np.testing.assert_allclose(sweep, compare, rtol=1e-5)


def test_points_of_absorption_are_counted_once() -> None:
    """0.2 per m at 4.5 m on the axis: exp(-0.9) / 4.5^2, not exp(-1.8) / 4.5^2."""
    detector = {"planes_m": [4.5], "width_m": 0.003, "pixels": 3}
    scene = Scene.from_dict({"water": {"absorption_at": [[500, 0.2]]}, "detector": detector})
    clear = scene.with_values({"water.absorption_at": ()})
    with_points, without = (both(s)[0][0, 0, 1, 1] for s in (scene, clear))
    assert with_points / without == pytest.approx(np.exp(-0.2 * 4.5), rel=1e-5)


@pytest.mark.parametrize(
    ("lamp", "pixels", "width_m"),
    [
        ({"hwhm_deg": 40.0}, 1, 2.0),
        ({"hwhm_deg": 40.0, "offset_x_m": 0.4}, 3, 3.0),
        ({"radius_m": 0.1}, 2, 2.0),
    ],
)
def test_light_in_a_coarse_cell_is_dimmed_along_its_ways(
    lamp: dict[str, Any], pixels: int, width_m: float
) -> None:
    """Beside 600 x 600 points: to the middle of a cell of 2 m at 0.8 m it is 0.8 m, to a corner 1.6."""
    detector = {"planes_m": [0.8], "width_m": width_m, "pixels": pixels}
    water = {"absorption_per_m": 1.5, "gradient_per_m2": 0.1, "height_gradient_per_m2": 0.2}
    scene = Scene.from_dict({"lamp": lamp, "water": water, "detector": detector})
    fine = (np.arange(600) + 0.5) * (width_m / 600) - 0.5 * width_m
    light = direct_field(scene, *np.meshgrid(fine, fine), 0.8)
    right = light.reshape(pixels, 600 // pixels, pixels, -1).mean(axis=(1, 3))
    formula = GridFormula.of(scene, scene_grid(scene))
    assert formula is not None
    found = formula.bands(scene)[0, 0] / over_bands(scene).intensity.mean()
    np.testing.assert_allclose(found, right, rtol=1e-3)


def test_a_lamp_whose_table_is_written_anew_has_a_formula_of_its_own(tmp_path: Path) -> None:
    """0.42 m aside at 1.5 m are 16 degrees: in a beam that ends at 20, dark beside one that ends at 10."""
    table, aside = tmp_path / "lamp.csv", []
    detector = {"planes_m": [1.5], "width_m": 1.2, "pixels": 24}
    for ends_deg in (20, 10):
        table.write_text(f"angle_deg,intensity\n0,1\n{ends_deg},1\n", encoding="utf-8")
        now = Scene.from_dict({"lamp": {"intensity_table": str(table)}, "detector": detector})
        formula, _ = _formula(now, scene_grid(now))
        assert formula is not None and formula[0, 0, 11, 11] > 0
        aside.append(formula[0, 0, 11, 20])
    assert aside[0] > 0 == aside[1]
