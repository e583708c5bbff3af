"""Which trace is asked for which light: none for light that there is not, under either top its own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from directed import directed
from scipy.sparse import eye_array

from lightfield.render.diffuse.between_g import BetweenG
from lightfield.render.diffuse.traced import Traced, TracedLight, TracedWater
from lightfield.render.response.beam_nodes import BeamNodes
from lightfield.render.response.beam_tallies import BeamTallies, Sent
from lightfield.render.response.grid import angle_nodes, positions_grid, straight_path
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.render.response.symmetry import mirror_images
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


def test_light_of_a_round_beam_is_worked_out_in_one_of_mirror_images() -> None:
    """And is in all of them, with its errors, that of a beam which a tilt of 1e-7 degrees makes not round."""
    across = np.linspace(-0.6, 0.6, 5)
    z, y, x = (v.ravel() for v in np.meshgrid([4.5, 6.5], across, across, indexing="ij"))
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 5.0}, "water": {"scattering_per_m": 0.15}})
    grid, nodes = positions_grid(x, y, z, 0.3), angle_nodes(4.0)
    images, rng = mirror_images(scene, grid), np.random.default_rng(0)
    histories, reference = np.array([(1, 0, 0), (2, 0, 0), (3, 0, 0)]), Reference(0.1, 0.1, 0.0)
    tallies = [rng.random((nodes.size, 3, len(images.kept))).astype(np.float32) for _ in range(2)]
    sent, even = Sent(np.ones(nodes.n_theta), scene.lamp), eye_array(len(x), format="csr")
    straight = straight_path(scene, grid).ravel()
    rows, rows_of_kept = (
        TransportResponse(np.zeros((1, 0, 0)), histories, np.array([0.0, 0.1, 0.3]), way, reference, 1000)
        for way in (straight, straight[images.kept])
    )
    beams = BeamTallies(directed(tallies, histories), BeamNodes(nodes, 4.0), sent, z, images, even)
    traced = Traced(beams, np.full((2, 5, len(x)), 0.01), rows, rows_of_kept)
    light = TracedLight(lambda: traced, (0,), reference, BetweenG((0.87, 0.97), np.full(2, 0.5), even))
    a, b = np.array([0.1, 0.3]), np.array([0.15, 0.05])
    tilted = scene.with_values({"lamp.tilt_x_deg": 1e-7})
    one, other = (light.classes(s, a, b, range(1), errors=True)[0] for s in (scene, tilted))
    assert beams.contracted(0, scene.lamp).shape[2] == len(images.kept) < len(x)
    assert beams.contracted(0, tilted.lamp).shape[2] == len(x)
    np.testing.assert_allclose(one.value, other.value, rtol=1e-4)
    np.testing.assert_allclose(one.uncertain, other.uncertain, rtol=1e-4)
    for mine, its in zip(one.noises, other.noises, strict=True):
        np.testing.assert_allclose(mine.roots, its.roots, rtol=1e-3)
