"""One trace, every water: evaluated maps equal maps traced anew, and errors mean what they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from montecarlo import cell_average, chi_square_p, normal_scores, same_light_p
from scipy import stats

from lightfield.errors import RenderError
from lightfield.formula.closed_form import direct_field
from lightfield.render.backend import use_backend
from lightfield.render.maps import Rendering, render_scene
from lightfield.render.response.grid import scene_grid
from lightfield.render.response.response import Reference, TransportResponse, Waters
from lightfield.scene import Scene

SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 12.0},
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.2},
        "tank": {
            "width_m": 2.4,
            "depth_m": 1.6,
            "length_m": 8.0,
            "lamp_depth_m": 0.7,
            "wall_albedo": 0.5,
            "surface": "flat",
        },
        "detector": {"planes_m": [2.0, 5.0], "width_m": 1.8, "height_m": 1.0, "pixels": 9},
    }
)
REFERENCE = Reference(0.05, 0.3, 0.6)
PHOTONS = 6e5


@pytest.fixture(scope="module")
def traced() -> Rendering:
    """The one trace that is asked for every water."""
    return render_scene(SCENE, rel_error=1e-4, max_photons=PHOTONS, reference=REFERENCE, cache=False)


WATERS = [
    (0.1, 0.0, 0.5), (0.4, 0.3, 0.0), (0.8, 0.2, 0.5),
    *(pytest.param(*water, marks=pytest.mark.slow) for water in (
        (0.05, 0.1, 0.6), (0.05, 0.3, 0.2), (0.1, 0.2, 0.0), (0.2, 0.05, 0.3), (0.2, 0.3, 0.6),
        (0.4, 0.15, 0.4),
    )),
]  # fmt: skip


@pytest.mark.parametrize(("a", "b", "rho"), WATERS)
def test_other_water_and_walls(traced: Rendering, a: float, b: float, rho: float) -> None:
    """Evaluated from one trace at (0.05, 0.3, 0.6), against a trace made in that very water and tank."""
    values = {"water.absorption_per_m": a, "water.scattering_per_m": b, "tank.wall_albedo": rho}
    scene = SCENE.with_values(values)
    fresh = render_scene(scene, rel_error=1e-4, max_photons=PHOTONS, seed=7, cache=False)
    for part in ("all", "diffuse"):
        maps = [one.response.batches(a, b, rho, 1.0, part=part) for one in (traced, fresh)]
        assert same_light_p(*maps) > 0.001


def fresh_and_evaluated(
    scene: Scene, reference: Reference, photons: float = PHOTONS
) -> tuple[TransportResponse, TransportResponse]:
    """The response of a trace in the scene's own water, and of one in other water."""
    own, other = (
        render_scene(scene, rel_error=1e-4, max_photons=photons, seed=seed, reference=where, cache=False)
        for seed, where in ((7, None), (1, reference))
    )
    return own.response, other.response


def test_coarse_cells_are_right_on_the_mean_in_other_water() -> None:
    """Three cells over 3 m, 0.8 m away: from the lamp to the near and the far edge of the outer ones it is
    0.3 m more or less than to their middle, and most light is near the edge. Asked by the middles, water that
    absorbs 0.5 per m more had 10 % less light there than a fresh trace."""
    detector = {"planes_m": [0.8, 2.5], "width_m": 3.0, "height_m": 2.0, "pixels": 3}
    water = {"absorption_per_m": 0.6, "scattering_per_m": 0.1}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 25.0}, "water": water, "detector": detector})
    both = fresh_and_evaluated(scene, Reference(0.1, 0.1, 0.0))
    for part in ("all", "diffuse"):
        maps = [one.batches(0.6, 0.1, 0.0, 0.0, part=part) for one in both]
        assert same_light_p(*maps) > 0.001


def test_light_of_a_wide_window_in_other_water() -> None:
    """Aside, light from its near rim has a shorter way than that from its middle: 0.15 of 1.5 m at 1.2 m.

    Traced in water of 0.1 per m, beside the closed form in water of 2.1: side cells were 4 % too dark.
    """
    lamp = {"hwhm_deg": 40.0, "radius_m": 0.3}
    detector = {"planes_m": [1.0], "width_m": 3.0, "pixels": 5}
    scene = Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 2.1}, "detector": detector})
    reference = Reference(0.1, 0.0, 0.0)
    rendering = render_scene(scene, rel_error=1e-3, max_photons=2e6, reference=reference, cache=False)
    (mean,), (stderr,) = rendering.relative_maps(np.array([525.0]), "direct")
    truth = cell_average(rendering.grid, lambda x, y, z: direct_field(scene, x, y, z))
    batches = len(rendering.response.tally)
    assert chi_square_p(normal_scores(mean, truth, stderr, batches)) > 1e-3
    assert mean[0, 2, ::4].sum() == pytest.approx(truth[0, 2, ::4].sum(), rel=0.01)


@pytest.mark.slow
def test_light_of_dense_water_in_clearer_water() -> None:
    """From b = 2.1 to 1.05 per m between walls. A sixth of the light at 4 m was reflected and scattered five
    times or more, and is told by the length of its path; its error is what is stated of it. By the mean
    length of all cells the light was 22 to 30 % too bright there."""
    detector = {"planes_m": [0.8, 4.0], "width_m": 1.8, "height_m": 1.0, "pixels": 3}
    values = {"water.absorption_per_m": 0.1, "water.scattering_per_m": 1.05}
    scene = Scene.from_dict({**SCENE.model_dump(exclude_none=True), "detector": detector}).with_values(values)
    own, other = fresh_and_evaluated(scene, Reference(0.05, 2.1, 0.5, 1.0), 2e6)
    planes = [one.batches(0.1, 1.05, 0.5, 1.0, part="diffuse").mean(axis=(2, 3)) for one in (own, other)]
    (mine, noise), (found, more) = ((p.mean(0), p.std(0, ddof=1) / np.sqrt(len(p))) for p in planes)
    tally, water = other.tally.mean(axis=0)[None], Waters(*np.array([[0.1], [1.05], [0.5], [1.0]]))
    along = np.exp((2.15 - 1.15) * other.straight_m)
    uncertain = other.uncertain(tally, water, slice(None)).reshape(along.shape)
    stated = (uncertain * along).mean(axis=(1, 2))
    assert (stated < 0.06 * mine).all()
    assert (np.abs(found - mine) < stated + 3 * np.hypot(noise, more)).all()


def test_grid_of_path_lengths_is_fine_enough() -> None:
    """What lies between two nodes, as their weights share it, is right to 1e-3 of every map.

    The paths of a trace with 16 times the nodes are shared between the nodes that a scene gets. Absorption is
    moved by up to 0.5 per m from that of the trace: more than from 500 to 600 nm in any water.
    """
    use_backend()
    from lightfield.render.tracer.accumulate import response_from
    from lightfield.render.tracer.build import assembled
    from lightfield.render.tracer.histories import Histories, TallyLayout
    from lightfield.render.tracer.walk import counted, trace

    setup = assembled(SCENE, scene_grid(SCENE), Reference(0.05, 0.2, 0.5))
    coarse = setup.histories
    told = coarse.layout
    fine = Histories(
        TallyLayout(
            told.max_scatterings,
            told.max_walls,
            told.max_surfaces,
            max_reflections=2,
            longest_excess_m=2 * told.longest_excess_m,
            path_nodes=16 * told.path_nodes,
        )
    )
    counts, _ = trace(replace(setup, histories=fine), 200_000, 3)
    by_path = counts.reshape(len(fine.channels), fine.path_nodes, -1)
    nodes = coarse.excess_m
    shares = np.array([np.interp(fine.excess_m, nodes, row) for row in np.eye(len(nodes))])
    shared = np.einsum("np,cpk->cnk", shares, by_path).reshape(len(coarse.channels) * len(nodes), -1)
    assert fine.channels.tolist() == coarse.channels.tolist()
    a, per_batch = np.array([0.05, 0.06, 0.1, 0.2, 0.3, 0.55]), counted(200_000)
    maps = []
    for histories, tally in ((coarse, shared), (fine, counts)):
        sums = np.stack([tally, tally]).astype(np.float32)  # an error needs two batches
        response = response_from(sums, per_batch, 200_000, replace(setup, histories=histories))
        maps.append(response.evaluate(a, 0.2, 0.5, 1.0)[0])
    assert np.abs(maps[0] / maps[1] - 1).max() < 1e-3


def test_absorption_that_varies_over_the_spectrum(traced: Rendering) -> None:
    """All wavelengths from one trace: an array of waters gives what each of them gives alone."""
    a, b = np.array([0.05, 0.1, 0.4]), np.array([0.3, 0.2, 0.1])
    mean, stderr = traced.response.evaluate(a, b, 0.4, 1.0)
    for i in range(3):
        alone = traced.response.evaluate(float(a[i]), float(b[i]), 0.4, 1.0)
        np.testing.assert_allclose(mean[i], alone[0], rtol=1e-5)
        np.testing.assert_allclose(stderr[i], alone[1], rtol=1e-3)


SEEDS = 12
SCENES = {
    "open": SCENE.model_copy(update={"tank": None}),
    "black tank": SCENE.with_values({"tank.wall_albedo": 0.0, "tank.surface_reflectance": 0.0}),
    "grey tank with a surface": SCENE,
}


@pytest.mark.parametrize(
    "name",
    [
        "grey tank with a surface",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("open", "black tank")),
    ],
)
def test_energy_closes(name: str) -> None:
    """Emitted = absorbed + lost at walls + escaped (less what the roulette invented), photon by photon."""
    invented = []
    for seed in range(SEEDS):
        energy = render_scene(SCENES[name], rel_error=1e-3, max_photons=2e5, seed=seed, cache=False).energy
        assert abs(energy.closure) < 1e-5  # single precision, summed over 2e5 photons
        assert energy.unfinished == 0
        parts = energy.absorbed, energy.walls, energy.escaped
        assert min(parts) >= 0 and max(parts) < 1.02 * energy.emitted
        invented.append(energy.roulette / energy.emitted)
    # The roulette is fair: what it invents averages to nothing, and is little.
    stderr = np.std(invented, ddof=1) / np.sqrt(SEEDS)
    assert stderr < 0.003
    assert abs(np.mean(invented)) < stats.t.isf(1e-4, SEEDS - 1) * stderr


def test_same_seed_same_result() -> None:
    """Bit for bit on one thread; many, as a graphics card's, add in any order: equal to single precision."""
    kind = use_backend().kind
    import drjit as dr

    def tally(seed: int) -> np.ndarray:
        return render_scene(SCENE, rel_error=1e-3, max_photons=1e5, seed=seed, cache=False).response.tally

    threads, several, other = dr.thread_count(), tally(4), tally(5)
    try:
        dr.set_thread_count(1)
        one, same = tally(4), tally(4)
    finally:
        dr.set_thread_count(threads)
    assert one.tobytes() == same.tobytes() or kind == "cuda"
    np.testing.assert_allclose(same, one, rtol=1e-5, atol=1e-6 * one.max())
    np.testing.assert_allclose(several, one, rtol=1e-5, atol=1e-6 * one.max())
    assert other.shape != one.shape or not np.allclose(other, one, rtol=1e-3)


def test_stated_error_is_the_observed_scatter() -> None:
    """Over 30 seeds; the ratio averaged over cells is 1 within 0.1, for direct and diffuse light and both."""
    runs = [
        render_scene(SCENE, rel_error=1e-3, max_photons=6e4, seed=100 + seed, cache=False).response
        for seed in range(30)
    ]
    for part in ("all", "direct", "diffuse"):
        maps = [run.evaluate(0.1, 0.2, 0.5, 1.0, part=part) for run in runs]
        mean, stderr = (np.array(v) for v in zip(*maps, strict=True))
        ratio = np.sqrt((stderr**2).mean(axis=0)) / mean.std(axis=0, ddof=1)
        assert 0.9 < ratio.mean() < 1.1


def test_what_is_kept_between_waters_is_that_of_the_walls_asked_for() -> None:
    """Albedo and surface move in turn while the water stays: one row of each kind, its factor by hand."""
    histories = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    straight, reference = np.ones((1, 1, 1)), Reference(0.1, 0.2, 0.5)
    response = TransportResponse(np.ones((1, 3, 1)), histories, np.zeros(3), straight, reference, 1)
    for rho, surface in ((0.5, 1.0), (0.25, 1.0), (0.25, 0.4), (0.5, 1.0)):
        asked = Waters(*(np.array([v]) for v in (0.1, 0.2, rho, surface)))
        weights = response.row_weights(asked, np.arange(3))
        np.testing.assert_allclose(weights[0], [1.0, rho / 0.5, surface])


def test_the_same_rows_of_other_cells_keep_nothing_of_these() -> None:
    """Factors of light that scattered often are another in every cell: those of two cells of three, which are
    told between lengths of their own, right to 0.3 % (`open_ended.STEP`)."""
    histories, reference = np.array([[1, 0, 0], [2, 0, 0]]), Reference(0.1, 0.2, 0.0)
    straight = np.array([[[1.0, 2.0, 4.0]]])
    every = TransportResponse(np.ones((2, 2, 3)), histories, np.zeros(2), straight, reference, 1)
    known, _ = every.evaluate(0.1, 0.4)
    far = replace(every, tally=every.tally[:, :, 1:], straight_m=straight[:, :, 1:])
    assert far.evaluate(0.1, 0.4)[0] == pytest.approx(known[..., 1:], rel=6e-3)


def test_a_map_between_walls_answers_for_its_own_surface_alone() -> None:
    """Of light that met two walls and the surface it says that it met walls: under another one it was 7 %
    too bright at most."""
    tank = {"width_m": 1.0, "depth_m": 1.0, "length_m": 3.0, "surface": "flat"}
    read = {"planes_m": [1.0], "width_m": 0.8, "height_m": 0.8, "pixels": 4}
    for walls in (0.0, 0.5):
        scene = Scene.from_dict(
            {"lamp": {"hwhm_deg": 40.0}, "tank": {**tank, "wall_albedo": walls}, "detector": read}
        )
        response = render_scene(scene, max_photons=1e4, rel_error=1.0, cache=False).response
        own, _ = response.evaluate(0.1, 0.0, walls, 1.0)
        if walls:
            with pytest.raises(RenderError, match=r"under another surface; found 0\.5"):
                response.evaluate(0.1, 0.0, walls, 0.5)
        else:
            half, _ = response.evaluate(0.1, 0.0, walls, 0.5)
            assert (half < own).any()
