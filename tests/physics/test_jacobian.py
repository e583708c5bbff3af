"""Closed derivatives of the direct light equal finite differences of the model itself."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.formula.derivatives import DEPTH, direct_jacobian
from lightfield.formula.field import direct_field
from lightfield.scene import Scene
from lightfield.scene.acts import Acts

PLACES = np.random.default_rng(3).uniform([-0.8, -0.8, 4.5], [0.8, 0.8, 8.5], (60, 3)).T
MEDIUM = np.where(np.arange(60) % 5 == 0, "air", "water")
WAVELENGTH = np.linspace(450, 650, 60)

BUSY = {
    "lamp.hwhm_deg": 5.0,
    "lamp.shape_exponent": 2.4,
    "lamp.skirt_fraction": 0.1,
    "lamp.ellipticity": 1.3,
    "lamp.tilt_x_deg": 1.0,
    "lamp.apparent_distance_m": 0.5,
    "lamp.window_index": 1.33,
    "lamp.offset_x_m": 0.03,
    "water.base": "pure",
    "water.absorption_per_m": 0.05,
    "water.scattering_per_m": 0.1,
    "water.gradient_per_m2": 0.005,
    "water.layer_absorption_per_m": 0.1,
    "water.hardening_per_m": 0.02,
    "water.cdom_440_per_m": 0.1,
    "water.sediment_g_per_m3": 0.2,
}
OTHERS = ("lamp.offset_x_m", "water.chlorophyll_mg_per_m3")
BEAM = [path for path, known in Scene().parameters().items() if known.acts_on & Acts.BEAM]


@pytest.mark.parametrize("path", [*DEPTH, *BEAM, *OTHERS])
def test_derivative(path: str) -> None:
    """Every part switched on at once; central difference with a step of its own, relative to the largest
    slope.
    """
    scene = Scene().with_values({**BUSY, "water.chlorophyll_mg_per_m3": 0.5})
    field, columns = direct_jacobian(scene, *PLACES, [path], WAVELENGTH, MEDIUM)
    np.testing.assert_array_equal(field, direct_field(scene, *PLACES, WAVELENGTH, MEDIUM))
    step = 1e-4 * max(abs(scene.get(path)), 0.1)
    up, down = (
        direct_field(scene.with_values({path: scene.get(path) + sign * step}), *PLACES, WAVELENGTH, MEDIUM)
        for sign in (1, -1)
    )
    slope = (up - down) / (2 * step)
    assert np.abs(slope).max() > 0
    np.testing.assert_allclose(columns[:, 0], slope, atol=2e-6 * np.abs(slope).max())


def test_order_of_columns_and_finite_window() -> None:
    """Columns follow the paths asked for; a finite window falls back to differences of the full model."""
    scene = Scene().with_values({"lamp.radius_m": 0.1, "water.absorption_per_m": 0.1})
    paths = ["lamp.hwhm_deg", "water.absorption_per_m"]
    _, columns = direct_jacobian(scene, *PLACES, paths)
    _, swapped = direct_jacobian(scene, *PLACES, paths[::-1])
    np.testing.assert_array_equal(columns, swapped[:, ::-1])
    h = 1e-4
    up, down = (direct_field(scene.with_values({paths[1]: 0.1 + d}), *PLACES) for d in (h, -h))
    np.testing.assert_allclose(columns[:, 1], (up - down) / (2 * h), rtol=1e-5)
