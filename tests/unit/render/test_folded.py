"""Many places in few numbers: tallies of mirror images kept once, cells coarser than the readings, blocks."""

from __future__ import annotations

import numpy as np
import pytest
from directed import directed
from numpy.testing import assert_allclose
from scipy.sparse import eye_array
from scipy.special import erf

from lightfield.render.diffuse.bending import surrounded
from lightfield.render.diffuse.shift import Shift
from lightfield.render.diffuse.trace_errors import LEFT_OUT, fewer_modes
from lightfield.render.reflected import patches
from lightfield.render.response.beam_nodes import BeamNodes
from lightfield.render.response.beam_tallies import BeamTallies, Sent
from lightfield.render.response.grid import angle_nodes, positions_grid
from lightfield.render.response.symmetry import mirror_images
from lightfield.scene import Scene

OPEN_WATER = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}})


@pytest.mark.parametrize(
    "lamp",
    [
        {"hwhm_deg": 5.0},
        {"hwhm_deg": 5.0, "tilt_x_deg": 1.5, "tilt_y_deg": -1.0},
        {"hwhm_deg": 5.0, "tilt_y_deg": 1.0, "apparent_distance_m": 1.0},
    ],
)
def test_mirrored_beams_stand_for_mirror_images(lamp: dict[str, float]) -> None:
    """A tally with the symmetry of a trace on the axis, all of it against the part that is kept."""
    across = np.linspace(-0.6, 0.6, 5)
    z, y, x = (v.ravel() for v in np.meshgrid([4.5, 6.5], across, across, indexing="ij"))
    grid = positions_grid(x, y, z, 0.3)
    images, nodes = mirror_images(OPEN_WATER, grid), angle_nodes(4.0)
    assert len(images.kept) == 2 * 3 * 3
    rng = np.random.default_rng(0)
    every = rng.random((nodes.size, 3, len(x)))

    def at(mx: float, my: float) -> np.ndarray:
        """Numbers of the cells at mirrored places."""
        apart = [
            np.abs(mx * x - u) + np.abs(my * y - v) + np.abs(z - w) for u, v, w in zip(x, y, z, strict=True)
        ]
        return np.argmin(apart, axis=1)

    flip_x, flip_y = at(-1, 1), at(1, -1)
    every = 0.5 * (every + every[nodes.mirrored(True, False)][:, :, flip_x])
    whole = 0.5 * (every + every[nodes.mirrored(False, True)][:, :, flip_y])
    beam_nodes = BeamNodes(nodes, 4.0)
    cx, cy, cz = (v.ravel() for v in images.traced(grid).centres())
    assert len(cx) == 2 * 3 * 5
    by = images.told_by
    assert_allclose([cx[by], cy[by], cz[by]], [-np.abs(x), y, z], atol=1e-12)
    traced = every.astype(np.float32)[:, :, x < 1e-12].transpose(1, 0, 2)
    folded = images.folded(traced, np.arange(3), nodes)
    kept = folded.transpose(1, 0, 2)
    histories = np.array([(1, 0, 0), (2, 0, 0), (3, 0, 0)])
    beams = BeamTallies(
        directed([kept], histories), beam_nodes,
        Sent(np.ones(nodes.n_theta), OPEN_WATER.lamp), z, images, eye_array(len(x), format="csr"),
    )  # fmt: skip
    beam = Scene.from_dict({"lamp": lamp}).lamp
    expected = np.empty((3, len(x)))
    for plane in np.unique(z):
        stretch = (plane + beam.apparent_distance_m) / plane
        angles = ("hwhm_deg", "tilt_x_deg", "tilt_y_deg")
        wider = beam.model_copy(update={name: stretch * getattr(beam, name) for name in angles})
        values = beam_nodes.values(wider) / stretch**2
        values = np.repeat(values, nodes.n_phi) if len(values) == nodes.n_theta else values
        expected[:, z == plane] = np.einsum("n,nrc->rc", values, whole[:, :, z == plane])
    found = beams.at_cells(beams.contracted(0, beam))[0]
    assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * expected.max())


def test_a_place_without_a_mirror_image_keeps_its_own_light() -> None:
    """Of four places two are images at -y and share their photons; two lack an image, at -x or at -y."""
    x, y = np.array([-0.3, -0.3, 0.3, 0.0]), np.array([-0.3, 0.3, 0.0, 0.6])
    grid = positions_grid(x, y, np.full(4, 4.5), 0.3)
    images, nodes = mirror_images(OPEN_WATER, grid), angle_nodes(4.0)
    cx, cy, _ = images.traced(grid).centres()
    assert len(cx) == 4 and len(images.kept) == 3
    tally = np.random.default_rng(0).random((1, nodes.size, 4), np.float32)
    folded = images.folded(tally, np.arange(1), nodes)
    other = nodes.mirrored(False, True)
    for cell, found in zip(images.kept.tolist(), folded[0].T, strict=True):
        (image,) = np.flatnonzero((cx == cx[cell]) & np.isclose(cy, -cy[cell])) if cy[cell] < 0.6 else (cell,)
        its = tally[0][other, image] if cy[cell] < 0.6 else tally[0][:, cell]
        assert_allclose(found, 0.5 * (tally[0][:, cell] + its), rtol=1e-6)


def test_cells_coarser_than_dense_readings() -> None:
    """45 x 45 places 4 cm apart in cells of 0.1 m: a field as wide as scattered light, from its exact means,
    is known at the places to 0.5 %: half of what is stated of interpolation."""
    across = np.linspace(-0.9, 0.9, 45)
    y, x = (v.ravel() for v in np.meshgrid(across, across, indexing="ij"))
    z = np.full(len(x), 4.5)
    assert positions_grid(x, y, z, 0.2).pitch_x_m < 0.05
    grid = surrounded(positions_grid(x, y, z, 0.2, most_even=1500))
    assert grid.pitch_x_m == pytest.approx(0.1)

    def mean(at: np.ndarray, width: float, cell: float) -> np.ndarray:
        ends = (erf((at + half) / width / np.sqrt(2)) for half in (0.5 * cell, -0.5 * cell))
        above, below = ends
        return np.asarray(width * np.sqrt(np.pi / 2) * (above - below) / cell)

    cx, cy, _ = (v.ravel() for v in grid.centres())
    parts = [(0.5, 0.3), (0.3, 0.5), (0.2, 1.0)]
    means = sum(w / s**2 * mean(cx, s, grid.pitch_x_m) * mean(cy, s, grid.pitch_y_m) for w, s in parts)
    field = sum(w / s**2 * np.exp(-0.5 * (x**2 + y**2) / s**2) for w, s in parts)
    found = Shift.on(grid, x, y, z).apply(np.asarray(means))
    assert np.abs(found / field - 1).max() < 0.005


def test_fewer_contributions_have_the_same_covariance() -> None:
    """Fifty of very different sizes that lie in three directions, and a little noise."""
    rng = np.random.default_rng(0)
    modes = rng.standard_normal((30, 3)) @ rng.standard_normal((3, 50)) * 10.0 ** rng.uniform(-3, 0, (30, 1))
    found, covariance = fewer_modes(modes), modes @ modes.T
    assert found.shape == (30, 3)
    size = np.sqrt(np.diag(covariance))
    assert (np.abs(found @ found.T - covariance) <= 2 * LEFT_OUT * np.outer(size, size)).all()


def test_walls_are_seen_block_by_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """However few places are taken at a time, some of them so near to a wall that its patches are divided."""
    scene = Scene.from_dict({"tank": {"width_m": 2.0, "depth_m": 2.0, "lamp_depth_m": 1.0}})
    places = np.random.default_rng(0).uniform([-0.95, -0.95, 3.0], [0.95, 0.95, 6.0], (40, 3))
    some, _ = patches.walls(scene, 6.0, True, 60.0)

    def response(direction: list[np.ndarray], which: np.ndarray) -> np.ndarray:
        return np.abs(direction[2]) * (1 + which)

    whole = patches.transfer(places, response, some)
    monkeypatch.setattr(patches, "AT_ONCE", 200)
    for one, other in zip(whole, patches.transfer(places, response, some), strict=True):
        assert_allclose(one, other, rtol=1e-6)
