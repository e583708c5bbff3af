"""How far the readings leave b open: a parabola, and water between walls by light of its own."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.stats import chi2

from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene
from lightfield.studies.attenuation.excess import NODES_A, NODES_B, Excess
from lightfield.studies.attenuation.ratios import ratios_of
from lightfield.studies.attenuation.scattered import Scattered
from lightfield.studies.attenuation.stack import Stack
from lightfield.studies.attenuation.study import attenuation
from lightfield.studies.attenuation.valley import Valley, valley_of

Z = np.array([1.0, 2.0, 3.0, 4.0, 5.5, 7.0])


def test_of_a_parabola_the_reach_is_the_standard_error() -> None:
    b = np.linspace(0, 1, 2001)[:, None]
    lone, twice = ((b - 0.5) / 0.1) ** 2, np.minimum(((b - 0.2) / 0.05) ** 2, ((b - 0.8) / 0.05) ** 2 + 3.0)
    both = np.hstack([lone, twice])
    found = Valley(b[:, 0], 0.3 - 0.4 * b + 0 * both, both, 0 * both)
    assert found.b_stderr == pytest.approx([0.1, 0.325], abs=1e-3)  # half of the way to 0.8 + 0.05
    of_a, of_b, bend = found.reach_from(np.array([0.1, 0.22]), np.array([0.5, 0.2]), np.array([0.4, 0.4]))
    assert of_b == pytest.approx([0.1, 0.325], abs=1e-3) and of_a == pytest.approx(0.4 * of_b)
    assert bend == pytest.approx(0, abs=1e-12)


def test_waves_of_a_trace_do_not_speak_for_clear_water() -> None:
    """Light that adds 0.6 b z tells of a + 0.4 b alone. Its waves, 0.4 % at b = 0.25, grew with b, and so did
    chi-square: b of 0.4 was more than two of its errors away in 27 of 40."""
    away, there = [], scene(0.0, 6.0, 0.0, 0.0).model_copy(update={"tank": None})
    z, b = np.linspace(1.0, 7.0, 9), 0.4
    for seed in range(40):
        rng = np.random.default_rng(seed)
        value = np.exp(-0.4 * (z - 0.6 * b * z / 0.4)) * (1 + 0.003 * rng.standard_normal(9))
        table = Readings.from_arrays(
            z_m=np.r_[z, z], value=np.r_[value, np.ones(9)], stderr=0.003 * np.r_[value, np.ones(9)],
            medium=np.repeat(["water", "air"], 9), quantity="irradiance",
        )  # fmt: skip
        exact = replace(table.budget, plane_gain_percent=0.0, position_mm=0.0)
        ratios = ratios_of(replace(table, budget=exact), there)
        coefficients = np.zeros((NODES_A, NODES_B, 9))
        coefficients[0, :2] = 0.5 * (0.6 * z + 0.004 * rng.standard_normal(9) / 0.25)
        excess = Excess(1.0, 1.0, coefficients, 0.004 * np.eye(9), (0.1, 0.25))
        found = valley_of(Stack([ratios], [excess]))
        away.append(abs(found.b[found.chi2.argmin()] - b) / found.b_stderr[0])
    assert np.sum(np.array(away) > 2) < 8


def scene(albedo: float, hwhm_deg: float, a: float, b: float) -> Scene:
    tank = {"width_m": 3.0, "depth_m": 2.4, "lamp_depth_m": 1.2, "length_m": 12.0, "surface": "flat"}
    water = {"absorption_per_m": a, "scattering_per_m": b}
    return Scene.from_dict(
        {"lamp": {"hwhm_deg": hwhm_deg}, "water": water, "tank": tank | {"wall_albedo": albedo}}
    )


def found_from(there: Scene, water: np.ndarray, error: np.ndarray | float) -> Scattered:
    """The answer to readings in water beside exact ones in air, with 0.3 % of error in each."""
    value = np.r_[water, direct_field(there, 0 * Z, 0 * Z, Z, medium=np.ones(len(Z), bool))]
    table = Readings.from_arrays(
        x_m=np.zeros(12), y_m=np.zeros(12), z_m=np.r_[Z, Z], value=value,
        stderr=np.hypot(0.003 * value, np.r_[error * np.ones(6), np.zeros(6)]),
        medium=np.repeat(["water", "air"], 6), time_s=10.0 * np.arange(12), quantity="irradiance",
    )  # fmt: skip
    exact = replace(table.budget, plane_gain_percent=0.0, position_mm=0.0)
    found = attenuation(replace(table, budget=exact), there, partial(response_for, photons=300_000)).scattered
    assert found is not None
    return found


def rendered(there: Scene, seed: int, photons: float) -> tuple[np.ndarray, np.ndarray]:
    """Light of a full render, and its error."""
    readings = Readings.from_arrays(
        x_m=0 * Z, y_m=0 * Z, z_m=Z, value=np.ones(6), stderr=np.ones(6), quantity="irradiance"
    )
    return rendered_light(there, readings, seed=seed, rel_error=0.002, max_photons=photons)


@pytest.mark.parametrize("seed", [5, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (6, 7))])
def test_between_walls_b_of_another_valley_is_not_taken_for_the_truth(seed: int) -> None:
    """White walls: of light of the very trace absorption was 0.082 ± 0.011 for 0.05, and b 0 ± 0.05 for 0.3,
    at the bottom of a valley of chi-square 3.9 above that of the truth."""
    there = scene(0.6, 20.0, 0.05, 0.3)
    found = found_from(there, *rendered(there, seed, 8e6))
    assert found.chi2 < chi2.isf(0.001, 6)
    assert abs(found.a[0] - 0.05) < 2 * found.a_stderr[0] and abs(found.b[0] - 0.3) < 2 * found.b_stderr[0]


def test_light_of_a_full_render_is_explained_within_the_errors() -> None:
    """Walls of 0.2 and a beam of 6°: a of 0.3 per m was 0.203 ± 0.010, and b of 0.1 was 0.405 ± 0.035."""
    there = scene(0.2, 6.0, 0.3, 0.1)
    found = found_from(there, *rendered(there, 5, 4e6))
    assert abs(found.a[0] - 0.3) < 2 * found.a_stderr[0] and abs(found.b[0] - 0.1) < 2 * found.b_stderr[0]
    assert abs(found.combined[0] - 0.3 - found.kappa[0] * 0.1) < 2 * found.combined_stderr[0]
    assert found.a_stderr[0] < 0.1
