"""Mirror images may share their photons: the maps stay right, their errors shrink as the counts say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from beams import aside, phi_table
from montecarlo import keeps_its_rate, least_p, turned_p

from lightfield.render.maps import Rendering, render_scene
from lightfield.render.response.grid import scene_grid
from lightfield.render.response.symmetry import merge_mirror_images
from lightfield.render.settings import BATCHES
from lightfield.scene import Scene

WATER = {"absorption_per_m": 0.05, "scattering_per_m": 0.15}
DETECTOR = {"planes_m": [4.5, 6.5], "pixels": 16, "width_m": 1.6}


def scene(**parts: dict[str, Any]) -> Scene:
    return Scene.from_dict({"water": WATER, "detector": DETECTOR} | parts)


@pytest.mark.parametrize(
    ("parts", "cells"),
    [
        ({}, 36),  # an octant of 16 x 16: 8 * 9 / 2
        ({"lamp": {"ellipticity": 1.3}}, 64),
        ({"lamp": {"ellipticity_diagonal": 1.3}}, 256),
        ({"tank": {}}, 64),
        ({"tank": {"wall_albedo": 0.5}}, 64),
        ({"tank": {"lamp_depth_m": 1.0}}, 128),
        ({"tank": {"surface": "flat"}}, 128),
        ({"lamp": {"tilt_x_deg": 1.0}}, 128),
        ({"lamp": {"offset_x_m": 0.1, "tilt_y_deg": 1.0}}, 256),
        ({"detector": DETECTOR | {"tilt_x_deg": 5.0}}, 128),
    ],
)
def test_cells_that_are_images_of_each_other(parts: dict[str, Any], cells: int) -> None:
    """Every break of the symmetry is seen: lamp, beam, tank, surface, receiver."""
    one = scene(**parts)
    merged = merge_mirror_images(one, scene_grid(one)).merged
    assert (256 if merged is None else merged[0].max() + 1) == cells


@pytest.mark.parametrize(("to_deg", "cells"), [(90.0, 64), (180.0, 128), (360.0, 256)])
def test_cells_of_a_measured_beam(to_deg: float, cells: int, tmp_path: Path) -> None:
    """A quarter, a half and all of a beam: the parts that a table leaves out are mirror images."""
    file = phi_table(tmp_path / "aside.csv", aside, np.arange(0.0, to_deg + 1, 15.0))
    one = scene(lamp={"profile": "table", "intensity_table": str(file)})
    merged = merge_mirror_images(one, scene_grid(one)).merged
    assert (256 if merged is None else merged[0].max() + 1) == cells


TANK: dict[str, Any] = {"tank": {"wall_albedo": 0.5, "width_m": 2.0}}
AT = np.array([525.0])


def both_ways(of: Scene, seed: int, photons: float) -> tuple[Rendering, Rendering]:
    """Without and with photons that are shared, of seeds of their own."""
    settings: dict[str, Any] = {"rel_error": 1e-5, "max_photons": photons, "cache": False}
    return render_scene(of, seed=2 * seed, **settings), render_scene(
        of, seed=2 * seed + 1, symmetry=True, **settings
    )


def of_own_cells(plain: Rendering, shared: Rendering) -> list[np.ndarray]:
    """Light in the cells that have errors of their own, batch by batch."""
    own = np.unique(shared.response.merged, return_index=True)[1]
    tank = plain.scene.tank
    water = WATER["absorption_per_m"], WATER["scattering_per_m"], tank.wall_albedo if tank else 0.0
    maps = [one.response.batches(*water) for one in (plain, shared)]
    return [batches.reshape(len(batches), -1)[:, own] for batches in maps]


@pytest.mark.parametrize("parts", [pytest.param({}, marks=pytest.mark.slow), TANK], ids=["open", "tank"])
def test_shared_photons_give_the_same_maps(parts: dict[str, Any]) -> None:
    """Against an independent trace without sharing, over the cells that have errors of their own."""
    plain, shared = both_ways(scene(**parts), 2, 1.5e6)
    one, other = of_own_cells(plain, shared)
    assert turned_p(one - other) > 0.003
    (_, error), (image, image_error) = plain.relative_maps(AT), shared.relative_maps(AT)
    assert np.array_equal(image, image[..., ::-1])
    gain = np.median(error / image_error) ** 2
    copies = image[0].size / one.shape[1]
    assert 0.6 * copies < gain < 1.6 * copies


@pytest.mark.slow
def test_maps_of_shared_photons_keep_the_rate_of_their_test() -> None:
    """Their errors are unlike: exchanging batches, 60 of 200 were below 0.2."""

    def p_of(seed: int) -> float:
        one, other = of_own_cells(*both_ways(scene(**TANK), seed, 1.5e5))
        return turned_p(one - other)

    keeps_its_rate(p_of)


ON_ONE_SIDE = [(x, 0.0, z) for z in (4.5, 6.5) for x in (0.25, 0.5, 0.75)]


def diffuse(of: Scene, seed: int, photons: float, shared: bool) -> tuple[np.ndarray, np.ndarray]:
    """Scattered light and its error where there is any."""
    made = render_scene(of, rel_error=1e-5, max_photons=photons, seed=seed, symmetry=shared, cache=False)
    mean, error = (v.ravel() for v in made.relative_maps(AT, "diffuse"))
    return mean[mean > 0], error[mean > 0]


def same_at_places(seed: int, photons: float) -> float:
    """Probability of what shared photons change in the light at listed places."""
    one = scene(detector={"positions_m": ON_ONE_SIDE})
    (mean, error), (image, image_error) = (
        diffuse(one, 2 * seed + shared, photons, bool(shared)) for shared in (0, 1)
    )
    return least_p(image - mean, (error, BATCHES - 1), (image_error, BATCHES - 1))


def test_listed_places_count_every_photon_twice() -> None:
    """On one side only, where no cell has a partner: the same light as without, and smaller errors; nothing
    is shared by a beam that points aside."""
    one = scene(detector={"positions_m": ON_ONE_SIDE})
    assert same_at_places(2, 3e5) > 0.001
    # An error from ten batches is itself uncertain by a quarter: of several seeds.
    seeds = range(20, 25)
    squares = [[diffuse(one, seed, 3e5, shared)[1] ** 2 for seed in seeds] for shared in (False, True)]
    assert 1.5 < np.median(np.mean(squares[0], axis=0) / np.mean(squares[1], axis=0)) < 2.7
    aside = one.with_values({"lamp.tilt_x_deg": 1.0})
    alike = [diffuse(aside, 3, 3e5, shared)[0] for shared in (True, False)]
    np.testing.assert_allclose(*alike, rtol=1e-5)


def test_listed_places_on_both_sides_share_one_tally() -> None:
    """Places and their images at -x: the light of the one side alone, half of the cells in memory."""
    both = scene(detector={"positions_m": [*ON_ONE_SIDE, *((-x, y, z) for x, y, z in ON_ONE_SIDE)]})
    made = render_scene(both, rel_error=1e-5, max_photons=3e5, seed=5, symmetry=True, cache=False)
    mean, error = (v.ravel() for v in made.relative_maps(AT, "diffuse"))
    x, _, z = made.grid.centres()
    assert made.response.tally.shape[2] == len(ON_ONE_SIDE) == len(x) // 2
    right = np.flatnonzero(x > 0)
    image = [int(np.flatnonzero(np.isclose(x, -x[i]) & (z == z[i]))[0]) for i in right]
    assert np.array_equal(mean[right], mean[image]) and np.array_equal(error[right], error[image])
    alone = diffuse(scene(detector={"positions_m": ON_ONE_SIDE}), 6, 3e5, True)
    assert least_p(mean[right] - alone[0], (error[right], BATCHES - 1), (alone[1], BATCHES - 1)) > 0.001


@pytest.mark.slow
def test_listed_places_keep_the_rate_of_their_test() -> None:
    """As chi-square of normal numbers: 10 of 200 below 0.01, for errors from ten batches are uncertain."""
    keeps_its_rate(lambda seed: same_at_places(seed, 1e5))
