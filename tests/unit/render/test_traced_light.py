"""Which trace is asked for which light: none for light that there is not, under either top its own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import eye_array

from lightfield.render.diffuse.between_g import BetweenG
from lightfield.render.diffuse.traced import Traced, TracedLight, TracedWater
from lightfield.render.response.response import Reference
from lightfield.scene import Scene

SCENE = Scene.from_dict({"water": {"scattering_per_m": 0.1}, "tank": {"wall_albedo": 0.2}})
NO_WATER, WATER = np.zeros(1), np.full(1, 0.1)


class AskedError(Exception):
    """The trace was made."""


def never() -> Traced:
    raise AskedError


@pytest.mark.parametrize(
    ("b", "albedo", "surface", "kinds"),
    [
        (NO_WATER, 0.0, 0.0, (0, 1, 2, 3, 4)),  # nothing to scatter or reflect
        (NO_WATER, 0.2, 1.0, (0, 2, 4)),  # light that was not scattered is known without the trace
        (WATER, 0.0, 1.0, (1, 2)),  # walls are black
        (WATER, 0.2, 0.0, (3, 4)),  # no surface
    ],
)
def test_no_trace_for_light_that_there_is_not(
    b: np.ndarray, albedo: float, surface: float, kinds: tuple[int, ...]
) -> None:
    one = BetweenG((), np.ones(1), eye_array(1, format="csr"))
    scene = SCENE.with_values({"tank.wall_albedo": albedo, "tank.surface_reflectance": surface})
    light = TracedLight(never, kinds, Reference(0.1, 0.2, 0.5), one)
    assert light.classes(scene, WATER, b, range(5), errors=False) == {}
    lit = SCENE.with_values({"tank.wall_albedo": 0.2, "tank.surface_reflectance": 1.0})
    with pytest.raises(AskedError):
        light.classes(lit, WATER, WATER, range(5), errors=False)


@pytest.mark.parametrize(
    ("surface", "traced_under_it", "own", "under"),
    [
        (0.0, True, {0, 1, 2, 3, 4}, set()),
        (0.5, True, {0}, {1, 2, 3, 4}),
        (0.5, False, {0, 1, 2, 3, 4}, set()),
    ],
)
def test_light_that_a_surface_reflects_is_of_the_trace_under_it(
    surface: float, traced_under_it: bool, own: set[int], under: set[int]
) -> None:
    """But for light that was only scattered, which the tank's own trace knows at every g."""

    def told(name: str) -> Any:
        return SimpleNamespace(classes=lambda scene, a, b, kinds, errors: dict.fromkeys(kinds, name))

    water = TracedWater(told("own"), told("under") if traced_under_it else None)
    scene = SCENE.with_values({"tank.surface_reflectance": surface})
    found = water.classes(scene, WATER, WATER, errors=True)
    assert {kind for kind, name in found.items() if name == "own"} == own
    assert {kind for kind, name in found.items() if name == "under"} == under
