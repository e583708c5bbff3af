"""Trace batch after batch until the error is small enough. Import it after `use_backend()`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import product
from math import ceil

import drjit as dr
import numpy as np

from lightfield.memory import give_back
from lightfield.progress import part_of_trace, tell
from lightfield.render.backend import use_backend
from lightfield.render.limits import refuse_too_large
from lightfield.render.response.beam_nodes import BeamNodes
from lightfield.render.response.bookkeeping import Bookkeeping
from lightfield.render.response.grid import Grid
from lightfield.render.response.light_classes import CLASSES, light_classes
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.render.response.symmetry import MirrorImages, merge_mirror_images, mirror_images, symmetric
from lightfield.render.settings import BY_PHOTONS, Settings, batches_of
from lightfield.render.tracer.build import Setup, assembled
from lightfield.render.tracer.histories import Histories
from lightfield.render.tracer.walk import PHOTONS_PER_LANE, counted, trace
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm
from lightfield.scene.water.coefficients import coefficients_in
from lightfield.wording import rounded

_FIRST_LAUNCH = 1 << 16
#: Between two launches lie some 30 ms of the host in the tow tank, beside an H100 that traces four million
#: photons in less.
LARGEST_LAUNCH = {"llvm": 1 << 20, "cuda": 1 << 22}
_PER_CELL = 1 << 10  # photons of a launch per cell: single precision drops what adds little to a large sum
#: What one batch takes beside the sums: its tally, and the copy that is added.
_COPIES = 2
DIRECTION_BATCHES = 8
#: Of a tally by direction that is made at a time: for the rest of a larger one as many photons walk again.
_DIRECTIONS_BYTES = 120e6
#: Lit cells that tell how their errors change with their light; fewer have one in common.
_FEWEST_LIT = 8


def trace_until(
    scene: Scene, grid: Grid, reference: Reference, settings: Settings, path_nodes: int | None = None
) -> tuple[TransportResponse, Bookkeeping, float]:
    """Trace until 95 % of the lit cells are known to `settings.rel_error`, or the photon budget is spent.

    Returns
    -------
    response, energy, reached
        Response, energy balance (sr), and the relative error that was reached.
    """
    free_memory()
    if settings.symmetry:
        grid = merge_mirror_images(scene, grid)
    # Listed cells need not come in pairs: every photon is counted at its mirror image as well.
    mirrored = settings.symmetry and grid.occupied is not None and symmetric(scene)[0]
    images = mirror_images(scene, grid) if mirrored else None
    setup = assembled(scene, grid, reference, images=images, path_nodes=path_nodes)
    cells, rows = setup.planes.cells, setup.histories.size
    batches = batches_of(cells, rows)
    refuse_too_large(
        4.0 * (batches + _COPIES) * cells * rows, "the tally of these maps", where="detector",
        remedy="fewer pixels or planes, or render the planes one by one",
    )  # fmt: skip
    sums = np.zeros((batches, rows, cells), np.float32)
    listed = cells if images is None else len(images.place)
    largest = int(np.clip(_PER_CELL * listed, _FIRST_LAUNCH, LARGEST_LAUNCH[use_backend().kind]))
    launch = _whole_lanes(min(_FIRST_LAUNCH, settings.max_photons / batches))
    books: list[Bookkeeping] = []
    shares: list[int] = []
    first, reached = 0, float("inf")
    while True:
        for batch in range(batches):
            counts, book = trace(setup, launch, settings.seed * 1009 + batch, first=first, mirror_x=mirrored)
            sums[batch] += counts
            books.append(book)
            shares.append(launch)
            _tell(first * batches + (batch + 1) * launch, first * batches, reached, settings)
        first += launch
        spent = first * batches
        # The relative error of sums is that of means: the tally, which is large, is not copied for it.
        reached = worst_error(scene, _response(sums, spent, setup, np.ones(rows, bool)))
        if reached <= settings.rel_error or spent >= settings.max_photons:
            tell("", 1.0)  # what follows is no trace
            free_memory()
            return (
                response_from(sums, counted(first, mirrored), spent, setup),
                average(books, shares),
                reached,
            )
        wanted = spent * ((reached / settings.rel_error) ** 2 if np.isfinite(reached) else 4) * 1.05 - spent
        wanted = min(wanted, settings.max_photons - spent)
        launch = _whole_lanes(np.clip(wanted / batches, 1 << 12, min(4 * launch, largest)))


def _tell(sent: int, judged: int, reached: float, settings: Settings) -> None:
    """Say how far a trace is whose error was `reached` when `judged` photons had been sent."""
    by_now = reached * (judged / sent) ** 0.5 if judged else reached
    goal = f", {rounded(100 * settings.rel_error)} % asked for" if settings.rel_error > BY_PHOTONS else ""
    error = f", error {rounded(100 * reached)} %{goal}" if judged else ""
    part = part_of_trace(sent, by_now, settings.rel_error, settings.max_photons)
    tell(f"{sent:.3g} photons{error}", part)


def _whole_lanes(photons: float) -> int:
    """Next number of photons that fills every lane, so that no low-discrepancy point is used twice."""
    return PHOTONS_PER_LANE * ceil(photons / PHOTONS_PER_LANE)


def response_from(sums: np.ndarray, counted_per_batch: int, photons: int, setup: Setup) -> TransportResponse:
    """Response of accumulated tallies, which it takes over; rows that stayed empty are left out."""
    seen = np.asarray(sums.any(axis=(0, 2)))
    seen[0] = True
    batches, rows, cells = sums.shape
    kept = int(seen.sum())
    # To the front, where they lie together: no row comes to lie on one that is still to be moved.
    front = sums.reshape(batches * rows, cells)[: batches * kept].reshape(batches, kept, cells)
    for batch, to in zip(sums, front, strict=True):
        to[:] = batch[seen]
    front /= np.float32(counted_per_batch)
    return _response(front, photons, setup, seen)


def _response(tally: np.ndarray, photons: int, setup: Setup, seen: np.ndarray) -> TransportResponse:
    channels, nodes, _ = setup.histories.shape
    histories = np.repeat(setup.histories.channels, nodes, axis=0)[seen]
    excess = np.tile(setup.histories.excess_m, channels)[seen]
    return TransportResponse(
        tally, histories, excess, setup.straight_m, setup.reference, photons, setup.grid.merged
    )


def worst_error(scene: Scene, response: TransportResponse) -> float:
    """Relative standard error that 95 % of the lit cells have, in the scene's own water, under the surface of
    the trace."""
    wavelength = middles_nm(scene).mean()
    (a,), (b,) = coefficients_in(scene.water, np.array([wavelength]), response.reference.molecular_share)
    surface = response.reference.surface_reflectance if scene.surface_reflects else 0.0
    mean, stderr = response.evaluate(float(a), float(b), scene.reflectances[0], surface)
    lit = mean > 1e-4 * mean.max(axis=tuple(range(1, mean.ndim)), keepdims=True)
    if not lit.any():
        return float("inf")
    return float(np.quantile(stderr[lit] / mean[lit], 0.95))


def average(books: list[Bookkeeping], photons: list[int]) -> Bookkeeping:
    """Energy balance of several batches."""
    table = np.array([list(asdict(book).values()) for book in books])
    return Bookkeeping(*(float(v) for v in np.average(table, axis=0, weights=photons)))


def free_memory() -> None:
    """Give back the memory of tallies that were read."""
    dr.flush_malloc_cache()
    give_back()


def trace_by_direction(
    scene: Scene,
    grid: Grid,
    reference: Reference,
    beam_nodes: BeamNodes,
    photons: int,
    seed: int,
    images: MirrorImages,
    classes: Sequence[int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Trace with the direction of emission kept.

    Parameters
    ----------
    classes : sequence of int
        Of light, see `light_classes`, whose tallies are asked for.

    Returns
    -------
    tally : array, shape (n_emission_nodes, n_lit, n_kept)
        Of the rows that are asked for and were lit, in the cells that stand for all of their mirror images.
    lit : array of int, shape (n_lit,)
        These rows, ascending.
    relative_stderr : array, shape (5, n_cells)
        Of each class of light, for the scene's own beam in the reference water.
    histories : array of int, shape (n_rows, 3)
    excess_m : array, shape (n_rows,)
    density : array, shape (n_rings,), 1/sr
        Part of the photons sent out per solid angle at each ring.
    """
    free_memory()
    mirrored = symmetric(scene)[0]
    setup = assembled(scene, grid, reference, nodes=beam_nodes.nodes, images=images, wide_share=0.15)
    channels, path_nodes, emission_nodes = setup.histories.shape
    histories = np.repeat(setup.histories.channels, path_nodes, axis=0)
    kinds = light_classes(histories)
    asked, lit = np.isin(kinds, classes), np.zeros(len(histories), bool)
    # Of a round beam, as the traced one is; in single precision, as the tallies are.
    own = np.repeat(beam_nodes.values(scene.lamp), beam_nodes.nodes.n_phi).astype(np.float32)
    # Most rows stay dark: what is never written takes no memory.
    every = np.zeros((len(histories), emission_nodes, setup.planes.cells), np.float32)
    parts = np.zeros((DIRECTION_BATCHES, CLASSES, len(images.told_by)))
    at_once = int(max(_DIRECTIONS_BYTES // every[:path_nodes].nbytes, 1))
    groups = [(first, min(first + at_once, channels)) for first in range(0, channels, at_once)]
    for done, (group, batch) in enumerate(product(groups, range(DIRECTION_BATCHES)), start=1):
        counts, _ = trace(
            replace(setup, histories=Histories(setup.histories.layout, group)),
            photons // DIRECTION_BATCHES,
            seed * 1009 + batch,
            mirror_x=mirrored,
            direct=False,  # a fit knows it in closed form
        )
        part = done / (len(groups) * DIRECTION_BATCHES)
        tell(f"{photons * part:.3g} photons", part)
        here = slice(*(path_nodes * channel for channel in group))
        by_node = counts.reshape(-1, emission_nodes, setup.planes.cells)
        beam = (own @ by_node)[:, images.told_by]  # [n_rows, n_cells]
        for kind in range(CLASSES):
            parts[batch, kind] += beam[kinds[here] == kind].sum(axis=0)
        seen = asked[here] & by_node.any(axis=(1, 2))
        for row in np.flatnonzero(seen):
            every[here][row] += by_node[row]
        lit[here] |= seen
        del counts, by_node  # so that the next tally takes the memory of this one
    free_memory()
    rows = np.flatnonzero(lit)
    total = images.folded(every, rows, beam_nodes.nodes)
    del every
    mean = np.mean(parts, axis=0)
    stderr = np.std(parts, axis=0, ddof=1) / np.sqrt(DIRECTION_BATCHES)
    relative = shared_errors(mean, stderr)
    excess = np.tile(setup.histories.excess_m, channels)
    total /= np.float32(DIRECTION_BATCHES * counted(photons // DIRECTION_BATCHES, mirrored))
    rings = beam_nodes.nodes.scale_rad * np.sinh(np.arange(beam_nodes.nodes.n_theta) * beam_nodes.nodes.step)
    density = np.interp(rings, setup.emission.theta_rad, setup.emission.density)
    return total.transpose(1, 0, 2), rows, relative, histories, excess, density


def shared_errors(mean: np.ndarray, stderr: np.ndarray) -> np.ndarray:
    """Relative errors of cells, which a handful of batches tells only roughly.

    Half of the variance is a cell's own, half that of all cells of the class that are as bright: a power of
    the light, fitted to them. With their mean in its place those on the axis had 1.5 times, those at the edge
    of the beam 0.8 times their error.

    Parameters
    ----------
    mean, stderr : array, shape (n_classes, n_cells)

    Returns
    -------
    array, shape (n_classes, n_cells)
        Zero where there is no light.
    """
    relative = np.divide(stderr, mean, out=np.zeros_like(mean), where=mean > 0)
    for errors, light in zip(relative, mean, strict=True):
        lit = errors > 0
        own = errors[lit]
        terms = np.vander(np.log(light[lit]), 2 if lit.sum() >= _FEWEST_LIT else 1)
        law = np.exp(terms @ np.linalg.lstsq(terms, np.log(own), rcond=None)[0]) ** 2
        errors[lit] = np.sqrt(0.5 * own**2 + 0.5 * law * np.mean(own**2 / law)) if lit.any() else own
    return relative
