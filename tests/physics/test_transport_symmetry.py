"""Mirror images may share their photons: the maps stay right, their errors shrink as the counts say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from beams import aside, phi_table
from montecarlo import chi_square_p, normal_scores

from lightfield.render.maps import render_scene
from lightfield.render.response.grid import scene_grid
from lightfield.render.response.symmetry import merge_mirror_images
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


@pytest.mark.parametrize("parts", [{}, {"tank": {"wall_albedo": 0.5, "width_m": 2.0}}], ids=["open", "tank"])
def test_shared_photons_give_the_same_maps(parts: dict[str, Any]) -> None:
    """Against an independent trace without sharing, over the cells that have errors of their own."""
    one = scene(**parts)
    settings: dict[str, Any] = {"rel_error": 1e-3, "max_photons": 1.5e6, "cache": False}
    plain = render_scene(one, seed=3, **settings)
    shared = render_scene(one, seed=4, symmetry=True, **settings)
    at = np.array([525.0])
    (mean, error), (image, image_error) = plain.relative_maps(at), shared.relative_maps(at)
    merged = shared.response.merged
    assert merged is not None
    own = np.unique(merged, return_index=True)[1]
    first, other, combined = (v.reshape(-1)[own] for v in (mean, image, np.hypot(error, image_error)))
    scores = normal_scores(first, other, combined, len(shared.response.tally))
    assert 0.001 < chi_square_p(scores) < 0.999
    assert np.array_equal(image, image[..., ::-1])
    gain = np.median(error / image_error) ** 2
    copies = mean[0].size / len(own)
    assert 0.6 * copies < gain < 1.6 * copies


def test_listed_places_count_every_photon_twice() -> None:
    """On one side only, where no cell has a partner: the same light as without, and smaller errors; nothing
    is shared by a beam that points aside."""
    places = [(x, 0.0, z) for z in (4.5, 6.5) for x in (0.25, 0.5, 0.75)]
    one = scene(detector={"positions_m": places})
    settings: dict[str, Any] = {"rel_error": 1e-3, "max_photons": 3e5, "cache": False}
    at = np.array([525.0])

    def light(of: Scene, seed: int, symmetry: bool) -> tuple[np.ndarray, np.ndarray]:
        made = render_scene(of, seed=seed, symmetry=symmetry, **settings)
        mean, error = (v.ravel() for v in made.relative_maps(at, "diffuse"))
        return mean[mean > 0], error[mean > 0]

    (mean, error), (image, image_error) = light(one, 3, False), light(one, 4, True)
    assert chi_square_p((image - mean) / np.hypot(error, image_error)) > 0.001
    # An error from ten batches is itself uncertain by a quarter: of several seeds.
    seeds = range(20, 25)
    squares = [[light(one, seed, shared)[1] ** 2 for seed in seeds] for shared in (False, True)]
    assert 1.5 < np.median(np.mean(squares[0], axis=0) / np.mean(squares[1], axis=0)) < 2.7
    aside = one.with_values({"lamp.tilt_x_deg": 1.0})
    np.testing.assert_allclose(light(aside, 3, True)[0], light(aside, 3, False)[0], rtol=1e-5)
