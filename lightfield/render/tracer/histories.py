"""Histories of light: how a tally is split so that any water can be evaluated from it afterwards.

A cell of the tally is one channel (n scatterings, m wall hits, k surface reflections, and where there are
panes, j reflections by those) times one node of the excess path (path minus straight line) times one node of
the direction of emission. A deposit goes to one of the two nearest path nodes, chosen at random with the
weights of linear interpolation, so that evaluating exp(-c L) at the nodes is exact, on average, up to the
curvature of the exponential between them. Sharing it between both takes twice the writes and tells no more:
the variance of a map is the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightfield.render.response.grid import AngleNodes
from lightfield.render.response.open_ended import HELD_FROM


@dataclass(frozen=True)
class WallNodes:
    """Numbers of wall hits m that a tally tells apart; what lies between goes to one of its neighbours.

    The chance of the upper one, b, beside a is (q^m - q^a) / (q^b - q^a), q = brightest / reference: the
    factor (rho / rho_0)^m is right on average at the reference and at the brightest albedo, nearly between.

    Parameters
    ----------
    hits : tuple of int
        Ascending from 0; the last also holds everything beyond it.
    reference, brightest : float
        Wall albedo of the trace, and that of the brightest walls to be asked for.
    """

    hits: tuple[int, ...]
    reference: float
    brightest: float

    def between(self) -> tuple[NDArray[np.int_], NDArray[np.float64]]:
        """For every m up to the last: number of the node below, and the chance of the next."""
        m, hits, q = np.arange(self.hits[-1] + 1), np.array(self.hits), self.brightest / self.reference
        below = np.clip(np.searchsorted(hits, m, side="right") - 1, 0, len(hits) - 2)
        a, b = hits[below], hits[below + 1]
        return below, np.expm1((m - a) * np.log(q)) / np.expm1((b - a) * np.log(q))


@dataclass(frozen=True)
class TallyLayout:
    """Which histories a tally tells apart.

    Parameters
    ----------
    max_scatterings, max_walls, max_surfaces : int
        The last class of each also holds everything beyond it.
    max_panes : int
        The same of reflections by panes; 0: there are none, and no number of them is kept.
    max_reflections : int
        Bound on wall hits plus surface reflections, for the same purpose.
    max_scatterings_reflected : int
        Bound on the scatterings of light that was reflected as well.
    longest_excess_m : float, m
        Last node of the excess path; nodes lie at longest (j / (n - 1))^3.
    nodes : AngleNodes, optional
        Of the direction of emission; None: it is not kept.
    wall_nodes : WallNodes, optional
        Numbers of wall hits that are told apart, in place of `max_walls` and that bound.
    clearer_per_m : float, m^-1
        Few path nodes leave the exponential curved between them. It is right at the reference and in its
        slope there; with a number here, at the reference and in water that attenuates so much less instead.
    """

    max_scatterings: int
    max_walls: int = 0
    max_surfaces: int = 0
    max_panes: int = 0
    max_reflections: int = 3
    max_scatterings_reflected: int = HELD_FROM
    longest_excess_m: float = 8.0
    path_nodes: int = 28
    nodes: AngleNodes | None = None
    wall_nodes: WallNodes | None = None
    clearer_per_m: float = 0.0

    @property
    def classes(self) -> tuple[tuple[int, int, int, int], tuple[int, ...], int]:
        """Last class of scatterings, walls, surface and panes; wall hits of each class; and the bound."""
        hits, bound = tuple(range(self.max_walls + 1)), self.max_reflections
        if self.wall_nodes is not None:
            hits, bound = self.wall_nodes.hits, 10**9
        most = self.max_scatterings, len(hits) - 1, self.max_surfaces, self.max_panes
        return most, hits, bound


class Histories:
    """A tally over histories. No data class: Dr.Jit would take it apart.

    Parameters
    ----------
    layout : TallyLayout
    held : (int, int), optional
        The tally is of the channels from the first to before the last of these alone.

    Attributes
    ----------
    channels : array, shape (n_channels, 3 or 4)
        n, m, k of every channel of the tally, and j where there are panes.
    excess_m : array, shape (path_nodes,), m
    """

    def __init__(self, layout: TallyLayout, held: tuple[int, int] | None = None) -> None:
        self.layout, self.wall_nodes, self.path_nodes = layout, layout.wall_nodes, layout.path_nodes
        nodes, longest = layout.nodes, layout.longest_excess_m
        self.emission_nodes, self.n_phi = (1, 1) if nodes is None else (nodes.size, nodes.n_phi)
        most, hits, bound = layout.classes
        # In variables, not literals: another water needs no new kernel.
        self._most = [dr.opaque(mi.UInt32, number) for number in most]
        self._last, self._directions = (
            dr.opaque(mi.UInt32, n) for n in (self.path_nodes - 1, self.emission_nodes)
        )
        self._longest = dr.opaque(mi.Float, longest)
        self._clearer = dr.opaque(mi.Float, layout.clearer_per_m) if layout.clearer_per_m else None
        self.excess_m = longest * (np.arange(self.path_nodes) / (self.path_nodes - 1)) ** 3
        rows: dict[tuple[int, ...], int] = {}
        lookup = []
        for n, m, k, j in np.ndindex(*(number + 1 for number in most)):
            m_kept = min(m, bound)
            k_kept = min(k, bound - m_kept)
            n_kept = min(n, layout.max_scatterings_reflected) if m or k or j else n
            history = (n_kept, hits[m_kept], k_kept, j)[: 4 if layout.max_panes else 3]
            lookup.append(rows.setdefault(history, len(rows)))
        self.lookup = mi.UInt32(lookup)
        first, last = held or (0, len(rows))
        self.channels = np.array(list(rows))[first:last]
        self._first, self._held = (dr.opaque(mi.UInt32, n) for n in (first, len(self.channels)))
        if self.wall_nodes is not None:
            below, share = self.wall_nodes.between()
            self._most_hits = dr.opaque(mi.UInt32, len(below) - 1)
            self._below, self._share = mi.UInt32(below), mi.Float(share)

    def holds(self, channel: mi.UInt32) -> mi.Bool:
        """Has the tally this channel?"""
        return channel < self._held

    @property
    def size(self) -> int:
        """Number of history cells."""
        return len(self.channels) * self.path_nodes * self.emission_nodes

    @property
    def shape(self) -> tuple[int, int, int]:
        """(channels, path nodes, emission nodes)."""
        return len(self.channels), self.path_nodes, self.emission_nodes

    def channel(
        self, scatterings: mi.UInt32, walls: mi.UInt32, surfaces: mi.UInt32, panes: mi.UInt32, u: mi.Float
    ) -> mi.UInt32:
        """Channel of a history in the tally, or none of it, see `holds`.

        Of two nodes of wall hits around it a uniform number chooses one.
        """
        if self.wall_nodes is not None:
            hits = dr.minimum(walls, self._most_hits)
            above = dr.select(u < dr.gather(mi.Float, self._share, hits), mi.UInt32(1), mi.UInt32(0))
            walls = dr.gather(mi.UInt32, self._below, hits) + above
        counted = zip((scatterings, walls, surfaces, panes), self._most, strict=True)
        n, m, k, j = (dr.minimum(number, most) for number, most in counted)
        _, most_m, most_k, most_j = self._most
        place = ((n * (most_m + 1) + m) * (most_k + 1) + k) * (most_j + 1) + j
        return dr.gather(mi.UInt32, self.lookup, place) - self._first

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
        way, whole = excess - below, above - below
        if self._clearer is not None:
            way, whole = (dr.exp(self._clearer * v) - 1 for v in (dr.minimum(way, whole), whole))
        share = dr.clip(way / whole, 0, 1)
        path_node = low + dr.select(u < share, mi.UInt32(1), mi.UInt32(0))
        return (channel * (self._last + 1) + path_node) * self._directions + node
