"""Histories of light: how a tally is split so that any water can be evaluated from it afterwards.

A cell of the tally is one channel (n scatterings, m wall hits, k surface reflections) times one node of the
excess path (path minus straight line) times one node of the direction of emission. A deposit goes to one of
the two nearest path nodes, chosen at random with the weights of linear interpolation, so that evaluating
exp(-c L) at the nodes is exact, on average, up to the curvature of the exponential between them. Sharing it
between both takes twice the writes and tells no more: the variance of a map is the same.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np


class Histories:
    """Layout of the tally over histories.

    Parameters
    ----------
    max_scatterings, max_walls, max_surfaces : int
        The last class of each also holds everything beyond it.
    max_reflections : int
        Bound on wall hits plus surface reflections, for the same purpose.
    max_scatterings_reflected : int
        Bound on the scatterings of light that was reflected as well.
    longest_excess_m : float, m
        Last node of the excess path; nodes lie at longest (j / (n - 1))^3.
    path_nodes : int
    emission_nodes : int
        Nodes of the direction of emission (1: not kept).
    n_phi : int
        How many of them share one polar angle.

    Attributes
    ----------
    channels : array, shape (n_channels, 3)
        n, m, k of every channel.
    excess_m : array, shape (path_nodes,), m
    """

    def __init__(
        self,
        max_scatterings: int,
        max_walls: int = 0,
        max_surfaces: int = 0,
        max_reflections: int = 3,
        max_scatterings_reflected: int = 5,
        longest_excess_m: float = 8.0,
        path_nodes: int = 28,
        emission_nodes: int = 1,
        n_phi: int = 1,
    ) -> None:
        self.max_scatterings, self.max_walls, self.max_surfaces = max_scatterings, max_walls, max_surfaces
        self.longest_excess_m, self.path_nodes = longest_excess_m, path_nodes
        self.emission_nodes, self.n_phi = emission_nodes, n_phi
        # In variables, not literals: another water needs no new kernel.
        self._most = [dr.opaque(mi.UInt32, most) for most in (max_scatterings, max_walls, max_surfaces)]
        self._last, self._directions = (dr.opaque(mi.UInt32, n) for n in (path_nodes - 1, emission_nodes))
        self._longest = dr.opaque(mi.Float, longest_excess_m)
        self.excess_m = longest_excess_m * (np.arange(path_nodes) / (path_nodes - 1)) ** 3
        rows: dict[tuple[int, int, int], int] = {}
        lookup = []
        for n, m, k in np.ndindex(max_scatterings + 1, max_walls + 1, max_surfaces + 1):
            m_kept = min(m, max_reflections)
            k_kept = min(k, max_reflections - m_kept)
            n_kept = min(n, max_scatterings_reflected) if m or k else n
            lookup.append(rows.setdefault((n_kept, m_kept, k_kept), len(rows)))
        self.channels = np.array(list(rows))
        self.lookup = mi.UInt32(lookup)

    @property
    def size(self) -> int:
        """Number of history cells."""
        return len(self.channels) * self.path_nodes * self.emission_nodes

    @property
    def shape(self) -> tuple[int, int, int]:
        """(channels, path nodes, emission nodes)."""
        return len(self.channels), self.path_nodes, self.emission_nodes

    def channel(self, scatterings: mi.UInt32, walls: mi.UInt32, surfaces: mi.UInt32) -> mi.UInt32:
        """Channel number of a history."""
        counted = zip((scatterings, walls, surfaces), self._most, strict=True)
        n, m, k = (dr.minimum(number, most) for number, most in counted)
        _, most_m, most_k = self._most
        return dr.gather(mi.UInt32, self.lookup, (n * (most_m + 1) + m) * (most_k + 1) + k)

    def mirrored(self, node: mi.UInt32) -> mi.UInt32:
        """Emission node of the mirror image at -x: phi -> pi - phi."""
        ring, sector = node // self.n_phi, node % self.n_phi
        return (
            ring * self.n_phi + (self.n_phi + self.n_phi // 2 - sector) % self.n_phi
            if self.n_phi > 1
            else node
        )

    def row(self, channel: mi.UInt32, excess: mi.Float, u: mi.Float, node: mi.UInt32) -> mi.UInt32:
        """Row of the tally: of the two path nodes around `excess` a uniform number chooses one."""
        last = mi.Float(self._last)
        # The cube root; its rounding may choose the next node over, which the clipping below forgives.
        place = dr.exp2(dr.log2(dr.clip(excess / self._longest, 1e-30, 1)) / 3) * last
        low = dr.minimum(mi.UInt32(place), self._last - 1)
        scale = self._longest / (last * last * last)
        a = mi.Float(low)
        below = a * a * a * scale
        above = (a + 1) * (a + 1) * (a + 1) * scale
        share = dr.clip((excess - below) / (above - below), 0, 1)
        path_node = low + dr.select(u < share, mi.UInt32(1), mi.UInt32(0))
        return (channel * (self._last + 1) + path_node) * self._directions + node
