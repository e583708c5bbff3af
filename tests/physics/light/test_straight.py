"""Direct light by straight lines and first flights together is that of photons which cross the cells.

And never known worse than by these alone, however narrow the beam; of wide ones much better.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from montecarlo import cell_average, chi_square_p, normal_scores

from lightfield.formula.closed_form import direct_field
from lightfield.render.backend import use_backend
from lightfield.render.maps import render_scene
from lightfield.scene import Scene

BATCHES, PHOTONS = 10, 40_000
TANK = {"width_m": 1.6, "depth_m": 1.0, "length_m": 6.0}
DETECTOR = {"planes_m": [1.5, 4.0], "width_m": 1.2, "height_m": 0.8, "pixels": 8}
WATER = {"absorption_per_m": 0.1, "scattering_per_m": 0.2}
FINE = {"planes_m": [2.0], "width_m": 1.0, "pixels": 33}
#: What is changed, and how many times smaller the error is at least than that of photons.
CASES: dict[str, tuple[dict[str, Any], float]] = {
    "open water": ({}, 1.5),
    "an apparent source": ({"lamp": {"radius_m": 0.02, "apparent_distance_m": 1.0}}, 1.5),
    "a wide window": ({"lamp": {"radius_m": 0.1}}, 0.9),
    "tilted beside a wall": ({"lamp": {"tilt_x_deg": 9.0, "offset_x_m": 0.7}, "tank": TANK}, 1.5),
    "layers": ({"water": WATER | {"gradient_per_m2": 0.05, "height_gradient_per_m2": 0.1}}, 1.5),
    "scalar irradiance": ({"detector": DETECTOR | {"quantity": "scalar_irradiance"}, "tank": TANK}, 1.5),
    "a receiver that looks aside": ({"detector": DETECTOR | {"tilt_x_deg": 50.0}}, 1.5),
    "a narrow receiver": ({"detector": DETECTOR | {"acceptance_hwhm_deg": 6.0}}, 0.8),
    "a collimator": ({"detector": DETECTOR | {"quantity": "radiance", "full_angle_deg": 4.0}}, 0.9),
    "30 degrees": ({"lamp": {"hwhm_deg": 30.0}, "detector": FINE}, 10.0),
    "2 degrees": ({"lamp": {"hwhm_deg": 2.0}, "detector": FINE}, 1.5),
    "1 degree": ({"lamp": {"hwhm_deg": 1.0}, "detector": FINE}, 0.8),
    "0.5 degrees": ({"lamp": {"hwhm_deg": 0.5}, "detector": FINE}, 0.8),
    "0.2 degrees": ({"lamp": {"hwhm_deg": 0.2}, "detector": FINE}, 0.8),
}
#: Not their own mirror image.
ASIDE = ("tilted beside a wall", "a receiver that looks aside")
#: Widths between those of the quick tests; all are mirrored in the slow tier.
BETWEEN = ("2 degrees", "1 degree", "0.5 degrees")


def by_both(scene: Scene, mirror_x: bool) -> tuple[np.ndarray, np.ndarray]:
    """Tally of direct light per batch and cell, shape (n_batches, n_cells): by all lines, and by photons."""
    use_backend()
    import drjit as dr
    import mitsuba as mi

    from lightfield.render.response.grid import reference_of, scene_grid
    from lightfield.render.tracer import straight
    from lightfield.render.tracer.absorption import Absorption
    from lightfield.render.tracer.build import assembled

    setup = assembled(scene, scene_grid(scene), reference_of(scene))
    b0 = mi.Float(setup.water.scattering_per_m)
    found: list[list[np.ndarray]] = [[], []]
    for seed in range(BATCHES):
        for kind, tallied in zip(found, (straight.tally_straight, straight.by_flights), strict=True):
            tally = dr.zeros(mi.Float, setup.histories.size * setup.planes.cells)
            # Other photons, so that the two are independent.
            of_its_own = seed if kind is found[0] else 1000 + seed
            water = Absorption(setup.water)
            tallied(straight.Launch(tally, setup, water, b0, PHOTONS, of_its_own, 0, mirror_x))
            by_row = np.array(tally).reshape(setup.histories.size, -1)
            assert not by_row[setup.histories.path_nodes :].any(), "direct light is the first channel"
            kind.append(by_row.sum(axis=0))
    lines, photons = (np.array(kind, float) for kind in found)
    return lines, photons


@pytest.mark.parametrize("mirror_x", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in BETWEEN)) for name in CASES]
)
def test_lines_find_what_photons_find(name: str, mirror_x: bool) -> None:
    """The same in every lit cell, to what both state."""
    if mirror_x and name in ASIDE:
        pytest.skip("not its own mirror image")
    changed, better = CASES[name]
    values: dict[str, Any] = {"lamp": {"hwhm_deg": 6.0}, "water": WATER, "detector": DETECTOR}
    for section, more in changed.items():
        values[section] = values.get(section, {}) | more
    lines, photons = by_both(Scene.from_dict(values), mirror_x)
    lit = photons.mean(axis=0) > 0.01 * photons.mean(axis=0).max()
    mean, error = lines.mean(axis=0)[lit], lines.std(axis=0, ddof=1)[lit] / np.sqrt(BATCHES)
    other, others = photons.mean(axis=0)[lit], photons.std(axis=0, ddof=1)[lit] / np.sqrt(BATCHES)
    assert np.sqrt(np.sum(error**2)) < np.sqrt(np.sum(others**2)) / better
    z = normal_scores(mean, other, np.hypot(error, others), BATCHES)
    assert 1e-4 < chi_square_p(z) < 1 - 1e-4


@pytest.mark.parametrize("pixels", [1, 3])
def test_a_beam_that_is_narrow_against_the_cells_is_found(pixels: int) -> None:
    """0.05 degrees in cells of up to 2 m: all of the beam is in the one on the axis, and known."""
    detector = {"planes_m": [2.0], "width_m": 2.0, "pixels": pixels}
    scene = Scene.from_dict(
        {"lamp": {"hwhm_deg": 0.05}, "water": {"absorption_per_m": 0.1}, "detector": detector}
    )
    mean, error = (
        v[0] for v in render_scene(scene, max_photons=2e5, cache=False).relative_maps(np.array([525.0]))
    )
    power = np.pi * np.radians(0.05) ** 2 / np.log(2) * np.exp(-0.1 * 2.0)
    middle = (0, pixels // 2, pixels // 2)
    assert mean[middle] * (2.0 / pixels) ** 2 == pytest.approx(power, rel=1e-3)
    assert error[middle] < 1e-3 * mean[middle]


@pytest.mark.parametrize("receiver", [{}, {"quantity": "scalar_irradiance"}, {"tilt_x_deg": 30.0}])
def test_a_plane_at_the_end_wall_sees_the_light_on_its_way_there(receiver: dict[str, Any]) -> None:
    """The closed form, in every cell, to what is stated and to single precision."""
    tank = {"width_m": 2.0, "depth_m": 1.4, "length_m": 6.0, "behind_lamp_m": 0.5}
    detector = {"planes_m": [5.5], "width_m": 1.2, "height_m": 0.6, "pixels": 8} | receiver
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 6.0}, "water": WATER, "tank": tank, "detector": detector})
    rendering = render_scene(scene, max_photons=2e5, rel_error=1e-4, cache=False)
    mean, error = (v[0] for v in rendering.relative_maps(np.array([525.0]), "direct"))
    known = cell_average(rendering.grid, lambda *at: direct_field(scene, *at))
    assert (np.abs(mean - known) < 6 * error + 1e-4 * known.max()).all()
    diffuse, _ = (v[0] for v in rendering.relative_maps(np.array([525.0]), "diffuse"))
    nearer = render_scene(
        scene.with_values({"detector.planes_m": (5.49,)}), max_photons=2e5, rel_error=1e-4, cache=False
    )
    beside, _ = (v[0] for v in nearer.relative_maps(np.array([525.0]), "diffuse"))
    assert diffuse.sum() == pytest.approx(beside.sum(), rel=0.03)
