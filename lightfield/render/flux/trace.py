"""A trace of the flux vector over a part of the water. Import it after `use_backend()`."""

from __future__ import annotations

import numpy as np

from lightfield.progress import tell
from lightfield.render.backend import use_backend
from lightfield.render.response.grid import Grid
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.render.tracer.accumulate import LARGEST_LAUNCH, response_from
from lightfield.render.tracer.build import assembled
from lightfield.render.tracer.walk import PHOTONS_PER_LANE, counted, trace
from lightfield.scene import Scene

#: Independent parts, whose scatter is the error.
_BATCHES = 8


def trace_flux(scene: Scene, grid: Grid, reference: Reference, photons: int, seed: int) -> TransportResponse:
    """Scattered and reflected light's flux vector in every cell, split by history.

    Parameters
    ----------
    grid : Grid
        All of its cells are tallied.
    photons : int
        At least; every batch gets whole lanes.

    Returns
    -------
    TransportResponse
        Its planes are those of the grid once for every one of `COMPONENTS`.
    """
    setup, largest = assembled(scene, grid, reference, flux=True), LARGEST_LAUNCH[use_backend().kind]
    each = PHOTONS_PER_LANE * -(-photons // (_BATCHES * PHOTONS_PER_LANE))
    sums = np.zeros((_BATCHES, setup.histories.size, setup.planes.cells), np.float32)
    for batch in range(_BATCHES):
        for first in range(0, each, largest):
            launch = min(largest, each - first)
            counts, _ = trace(setup, launch, seed * 1009 + batch, first=first, direct=False)
            sums[batch] += counts
            sent = batch * each + first + launch
            tell(f"{sent:.3g} photons", sent / (_BATCHES * each))
    return response_from(sums, counted(each), each * _BATCHES, setup)
