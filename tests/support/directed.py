"""Tallies by direction of emission, made of dense arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lightfield.render.response.directed_tallies import DirectedTallies, Entries


def directed(tallies: Sequence[np.ndarray], histories: np.ndarray) -> DirectedTallies:
    """One per trace, each of shape (n_emission_nodes, n_rows, n_cells)."""
    n_nodes, n_rows, n_cells = tallies[0].shape
    every = [Entries.of(tally, np.arange(n_rows)) for tally in tallies]
    part = np.full(len(every), 1 / len(every))
    return DirectedTallies.of(every, part, histories, n_cells, n_nodes)
