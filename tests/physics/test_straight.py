"""Direct light by straight lines to places in a cell is that of photons which cross it, and better known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from montecarlo import chi_square_p, normal_scores

from lightfield.render.backend import use_backend
from lightfield.scene import Scene

BATCHES, PHOTONS = 10, 40_000
TANK = {"width_m": 1.6, "depth_m": 1.0, "length_m": 6.0}
DETECTOR = {"planes_m": [1.5, 4.0], "width_m": 1.2, "height_m": 0.8, "pixels": 8}
WATER = {"absorption_per_m": 0.1, "scattering_per_m": 0.2}
CASES: dict[str, dict[str, Any]] = {
    "open water": {},
    "a window and an apparent source": {"lamp": {"radius_m": 0.1, "apparent_distance_m": 1.0}},
    "tilted beside a wall": {"lamp": {"tilt_x_deg": 9.0, "offset_x_m": 0.7}, "tank": TANK},
    "layers": {"water": WATER | {"gradient_per_m2": 0.05, "height_gradient_per_m2": 0.1}},
    "scalar irradiance": {"detector": DETECTOR | {"quantity": "scalar_irradiance"}, "tank": TANK},
    "a receiver that looks aside": {"detector": DETECTOR | {"tilt_x_deg": 50.0}},
    "a narrow receiver": {"detector": DETECTOR | {"acceptance_hwhm_deg": 6.0}},
}


def by_both(scene: Scene, mirror_x: bool) -> tuple[np.ndarray, np.ndarray]:
    """Tally of direct light per batch and cell, shape (n_batches, n_cells): by lines, and by photons."""
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
        for kind, tallied in zip(found, (straight.by_cells, straight.by_flights), strict=True):
            tally = dr.zeros(mi.Float, setup.histories.size * setup.planes.cells)
            tallied(tally, setup, Absorption(setup.water), b0, PHOTONS, seed, 0, mirror_x)
            by_row = np.array(tally).reshape(setup.histories.size, -1)
            assert not by_row[setup.histories.path_nodes :].any(), "direct light is the first channel"
            kind.append(by_row.sum(axis=0))
    lines, photons = (np.array(kind, float) for kind in found)
    return lines, photons


@pytest.mark.parametrize("mirror_x", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_lines_find_what_photons_find(name: str, mirror_x: bool) -> None:
    """The same in every lit cell, to what both state; the errors of lines are several times smaller."""
    if mirror_x and name in ("tilted beside a wall", "a receiver that looks aside"):
        pytest.skip("not its own mirror image")
    values: dict[str, Any] = {"lamp": {"hwhm_deg": 6.0}, "water": WATER, "detector": DETECTOR}
    for section, more in CASES[name].items():
        values[section] = values.get(section, {}) | more
    lines, photons = by_both(Scene.from_dict(values), mirror_x)
    lit = photons.mean(axis=0) > 0.01 * photons.mean(axis=0).max()
    assert lit.sum() > 20
    mean, error = lines.mean(axis=0)[lit], lines.std(axis=0, ddof=1)[lit] / np.sqrt(BATCHES)
    other, others = photons.mean(axis=0)[lit], photons.std(axis=0, ddof=1)[lit] / np.sqrt(BATCHES)
    assert np.median(error / others) < 0.5
    z = normal_scores(mean, other, np.hypot(error, others), BATCHES)
    assert 1e-4 < chi_square_p(z) < 1 - 1e-4
