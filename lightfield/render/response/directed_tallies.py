"""Tallies kept by direction of emission: most of their numbers are nought, and only the others are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lightfield.arrays import Array
from lightfield.render.response.light_classes import CLASSES, NEVER_SCATTERED, light_classes

Numbers = NDArray[np.integer[Any]]


class Entries(NamedTuple):
    """What a trace tallied: numbers of rows, cells and nodes of emission, and how much; each (n,)."""

    row: Numbers
    cell: Numbers
    node: Numbers
    value: Array

    @classmethod
    def of(cls, tally: Array, rows: Numbers) -> Entries:
        """Of a tally of shape (n_emission_nodes, n_lit, n_cells), whose rows have these numbers."""
        node, row, cell = (each.astype(np.int32) for each in np.nonzero(tally))
        return cls(rows[row], cell, node, tally[node, row, cell])


@dataclass(frozen=True)
class DirectedTallies:
    """Tallies of one or several traces with the same rows and cells.

    Parameters
    ----------
    histories : array of int, shape (n_rows, 3)
        Scatterings, wall hits and surface reflections of each row; classes of light one after the other.
    cells, nodes : int
        How many.
    lines : dict of sparse arrays, shape (n_cells * n_traces * n_rows_of_class, n_nodes)
        Of each class of light, see `light_classes`: cell after cell, of a cell trace after trace, of a trace
        its rows. Of light that was never scattered one trace stands for all.
    """

    histories: Numbers
    cells: int
    nodes: int
    lines: dict[int, csr_array]

    @classmethod
    def of(
        cls, entries: Sequence[Entries], part: Array, histories: Numbers, cells: int, nodes: int
    ) -> DirectedTallies:
        """From what each trace tallied.

        Parameters
        ----------
        entries : sequence of Entries
            Rows are those of `histories`.
        part : array, shape (n_traces,)
            Of all photons: weights of traces of light that knows no difference between them.
        """
        kinds, lines = light_classes(histories), {}
        for kind, rows in _rows_of(histories).items():
            alike = kind in NEVER_SCATTERED
            several, places, values = 1 if alike else len(entries), [], []
            for k, (each, share) in enumerate(zip(entries, part.tolist(), strict=True)):
                row, cell, node, value = (of[kinds[each.row] == kind] for of in each)
                places.append(((cell * several + (0 if alike else k)) * len(rows) + row - rows[0], node))
                values.append(np.float32(share if alike else 1.0) * value)
            shape = cells * several * len(rows), nodes
            lines[kind] = csr_array((np.concatenate(values), np.concatenate(places, axis=1)), shape=shape)
        return cls(histories, cells, nodes, lines)

    def packed(self) -> dict[str, NDArray[Any]]:
        """Plain arrays to store, all but the histories."""
        lines, none = self.lines.values(), np.zeros(0, np.uint16)
        return {
            "values": np.concatenate([none.astype(np.float32), *(each.data for each in lines)]),
            "nodes": np.concatenate([none, *(each.indices.astype(np.uint16) for each in lines)]),
            "counts": np.concatenate([none, *(np.diff(each.indptr).astype(np.uint16) for each in lines)]),
            "lines": np.array([each.shape[0] for each in lines], int),
            "cells_and_nodes": np.array([self.cells, self.nodes]),
        }

    @classmethod
    def unpacked(cls, stored: Mapping[str, NDArray[Any]], histories: Numbers) -> DirectedTallies:
        """The tallies that were `packed`."""
        ends = np.append(0, np.cumsum(stored["counts"], dtype=np.int32))
        stops, lines = np.append(0, np.cumsum(stored["lines"])).tolist(), {}
        cells, nodes = stored["cells_and_nodes"].tolist()
        for kind, (first, last) in zip(_rows_of(histories), pairwise(stops), strict=True):
            mine = slice(ends[first], ends[last])
            node, of_lines = stored["nodes"][mine].astype(np.int32), ends[first : last + 1] - ends[first]
            lines[kind] = csr_array((stored["values"][mine], node, of_lines), shape=(last - first, nodes))
        return cls(histories, cells, nodes, lines)

    @cached_property
    def rows_of(self) -> dict[int, Numbers]:
        """Numbers of the rows of every class that was traced, see `light_classes`."""
        return _rows_of(self.histories)

    def added(self, neighbours: int) -> DirectedTallies:
        """With so many neighbouring nodes added up: the sectors of every ring."""
        one = np.ones(self.nodes, np.float32), np.arange(self.nodes) // neighbours, np.arange(self.nodes + 1)
        adding = csr_array(one, shape=(self.nodes, self.nodes // neighbours))
        lines = {kind: each @ adding for kind, each in self.lines.items()}
        return DirectedTallies(self.histories, self.cells, self.nodes // neighbours, lines)

    def light(self, kind: int, cells: slice, beams: Array) -> Array:
        """Of one class of light in neighbouring cells, for several beams.

        Parameters
        ----------
        beams : array, shape (n_beams, n_nodes)

        Returns
        -------
        array, shape (n_cells, n_traces, n_rows_of_class, n_beams)
        """
        every, rows, asked = self.lines[kind], len(self.rows_of[kind]), cells.stop - cells.start
        each = every.shape[0] // self.cells
        if asked < self.cells:
            ends = every.indptr[each * cells.start : each * cells.stop + 1]
            mine = slice(ends[0], ends[-1])
            of = every.data[mine], every.indices[mine], ends - ends[0]
            every = csr_array(of, shape=(each * asked, every.shape[1]))  # a view: a slice would be a copy
        return np.asarray(every @ beams.T).reshape(asked, each // rows, rows, len(beams))


def _rows_of(histories: Numbers) -> dict[int, Numbers]:
    kinds = light_classes(histories)
    return {kind: np.flatnonzero(kinds == kind) for kind in range(CLASSES) if (kinds == kind).any()}
