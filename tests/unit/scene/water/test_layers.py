"""Absorption that changes with the place: means along the axis against sums over it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lightfield.scene import Scene
from lightfield.scene.water.layers import layers_absorption_per_m, mean_to_per_m

LAYERS: dict[str, dict[str, Any]] = {
    "none": {},
    "gradient": {"gradient_per_m2": 0.02, "gradient_centre_m": 1.3},
    "height": {"height_gradient_per_m2": -0.03},
    "bottom": {
        "bottom_layer_absorption_per_m": 0.1,
        "bottom_layer_top_m": -0.38,
        "bottom_layer_blend_m": 0.1,
    },
    "slab": {"layer_absorption_per_m": 0.2, "layer_centre_m": 2.1, "layer_width_m": 0.8},
    "curve": {"absorption_departure": [[1.0, 0.02], [2.5, -0.03], [6.0, 0.04]]},
}
LAYERS["all"] = {name: value for values in LAYERS.values() for name, value in values.items()}


@pytest.mark.parametrize("far_m", [0.7, 2.2, 9.0])
@pytest.mark.parametrize("name", LAYERS)
def test_the_mean_to_somewhere_is_that_of_the_places_on_the_way(name: str, far_m: float) -> None:
    water = Scene.from_dict({"water": {"absorption_per_m": 0.3} | LAYERS[name]}).water
    z, height = (np.arange(200_000) + 0.5) / 200_000 * far_m, -0.4
    found = mean_to_per_m(water, far_m, (height, height))
    assert found == pytest.approx(np.mean(layers_absorption_per_m(water, z, height)), abs=2e-6)
    rising = np.linspace(-1.2, 0.7, len(z))
    found = mean_to_per_m(water, far_m, (-1.2, 0.7))
    assert found == pytest.approx(np.mean(layers_absorption_per_m(water, z, rising)), abs=2e-6)
