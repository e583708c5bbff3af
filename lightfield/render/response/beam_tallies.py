"""Tallies that were kept by direction of emission, and what they are for one beam."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lightfield.arrays import Array
from lightfield.render.response.beam_nodes import BeamNodes
from lightfield.render.response.directed_tallies import DirectedTallies
from lightfield.render.response.light_classes import FROM_WALLS
from lightfield.render.response.symmetry import MirrorImages
from lightfield.scene import Lamp
from lightfield.scene.acts import Acts
from lightfield.scene.parameters import fields_on

#: Contracted tallies in memory: at most so many, and in so many bytes, but some.
_KEPT_BEAMS, FEWEST_BEAMS, KEPT_BYTES = 256, 8, 32e6
_BEAM_FIELDS = fields_on(Lamp, Acts.BEAM)
#: All of a lamp that a contracted tally knows.
BEAM = attrgetter(*_BEAM_FIELDS)
Beam = tuple[Any, ...]


@dataclass(frozen=True)
class Sent:
    """How the photons of a trace were sent out.

    Parameters
    ----------
    density : array, shape (n_rings,), 1/sr
        Part of them per solid angle at each ring.
    lamp : Lamp
        The beam that the stated errors belong to.
    """

    density: Array
    lamp: Lamp


@dataclass(frozen=True)
class BeamTallies:
    """Tallies of one or several traces with the same rows and cells.

    Parameters
    ----------
    tallies : DirectedTallies
        The caller knows what makes traces differ (g); of the cells that `images` keeps. Light that was never
        scattered stands in the first.
    cell_z_m : array, shape (n_cells,), m
        Plane by plane.
    wall_smoother : sparse array, shape (n_cells, n_cells)
        For light from walls.
    """

    tallies: DirectedTallies
    beam_nodes: BeamNodes
    sent: Sent
    cell_z_m: Array
    images: MirrorImages
    wall_smoother: csr_array

    @property
    def rows_of(self) -> dict[int, NDArray[np.integer[Any]]]:
        """Numbers of the rows of every class that was traced, see `light_classes`."""
        return self.tallies.rows_of

    def contracted(self, kind: int, lamp: Lamp, squares: bool = False) -> Array:
        """Tallies of one class of light, contracted with a beam, shape (n_g, n_rows, n_cells).

        Of one g for light that knows none. With `squares` the sum over photons of squared contributions, up
        to a constant. Of a round beam's light that met no wall only the cells that `images` keeps, shape
        (n_g, n_rows, n_kept): mirror images are alike; see `at_cells`.
        """
        return self._contracted(kind, squares, BEAM(lamp))

    def at_cells(self, found: Array) -> Array:
        """What was found from contracted tallies, of shape (..., n_kept) or (..., n_cells), in every cell."""
        place = self.images.place
        return found if found.shape[-1] == len(place) else found[..., place]

    @cached_property
    def _contracted(self) -> Callable[[int, bool, Beam], Array]:
        rows = max(each.shape[0] for each in self.tallies.lines.values()) // self.tallies.cells
        largest = np.dtype(np.float32).itemsize * rows * len(self.cell_z_m)
        return lru_cache(int(np.clip(KEPT_BYTES / largest, FEWEST_BEAMS, _KEPT_BEAMS)))(self._contract)

    def _contract(self, kind: int, squares: bool, beam: Beam) -> Array:
        lamp, parts = _lamp_with(beam), []
        for stretch, cells in self._stretches(lamp.apparent_distance_m):
            values = self._coefficients(BEAM(lamp), stretch) / stretch**2
            if squares:
                per_ring = values.reshape(self.beam_nodes.nodes.n_theta, -1)
                values = (per_ring**2 / self.sent.density[:, None]).ravel()
            parts.append(self._of_beam(kind, values.astype(np.float32), cells))
        contracted = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=2)  # plane by plane
        if kind in FROM_WALLS:
            every = self.at_cells(contracted)
            contracted = (self._smoother @ every.reshape(-1, every.shape[-1]).T).T.reshape(every.shape)
        return contracted

    @cached_property
    def _smoother(self) -> csr_array:
        return self.wall_smoother.astype(np.float32)

    def _of_beam(self, kind: int, values: Array, cells: slice) -> Array:
        """Tallies of one class of light at some cells for coefficients of all nodes, or one per ring.

        Parameters
        ----------
        values : array, shape (n_emission_nodes,) or (n_rings,)

        Returns
        -------
        array, shape (n_g, n_rows, n_cells), for one per ring (n_g, n_rows, n_kept)
        """
        nodes, place, flipped = self.beam_nodes.nodes, self.images.place[cells], self.images.flipped[cells]
        of_rings = len(values) == nodes.n_theta
        # What a beam brings to a mirror image is what the mirrored beam brings.
        if of_rings:
            beams = values[None]
        else:
            flips, which = np.unique(flipped @ (2, 1), return_inverse=True)
            beams = np.stack([values[nodes.mirrored(bool(f // 2), bool(f % 2))] for f in flips])
        kept = slice(int(place.min()), int(place.max()) + 1)
        found = (self._of_rings if of_rings else self.tallies).light(kind, kept, beams)
        if not of_rings:
            found = found[place - kept.start, ..., which]
        return np.ascontiguousarray(np.moveaxis(found.reshape(*found.shape[:3]), 0, -1))

    @cached_property
    def _of_rings(self) -> DirectedTallies:
        """The tallies with the sectors of every ring of emission added up."""
        return self.tallies.added(self.beam_nodes.nodes.n_phi)

    @cached_property
    def _coefficients(self) -> Callable[[Beam, float], Array]:
        """`BeamNodes.values` of the last few beams: they are the same for every trace and class of light."""
        return lru_cache(_KEPT_BEAMS)(lambda beam, s: self.beam_nodes.values(_lamp_with(beam), s))

    def thinning(self, index: int, kind: int, lamp: Lamp, weights: Array) -> Array:
        """Factor on the variance because other photons count now than in the traced beam and water.

        The effective number of photons of weights w is (sum w)^2 / sum w^2 (Kish 1965, Survey Sampling); two
        waters with weights v and w share sum v w / (sum v sum w).

        Parameters
        ----------
        weights : array, shape (n_waters, n_rows)
            Of the rows of one class.

        Returns
        -------
        array, shape (n_waters, n_waters, n_cells)
        """
        now, then = self._concentration(index, kind, lamp, weights), self._as_sent(index, kind)
        lit = (np.einsum("wwh->wh", now) > 0) & (then[0] > 0)
        unknown = np.broadcast_to(np.eye(len(now))[:, :, None], now.shape)
        return np.divide(now, then, out=unknown.copy(), where=lit[:, None] & lit)

    @cached_property
    def _as_sent(self) -> Callable[[int, int], Array]:
        """`_concentration` in the beam and water of the trace."""

        def of(index: int, kind: int) -> Array:
            return self._concentration(index, kind, self.sent.lamp, np.ones((1, len(self.rows_of[kind]))))

        return lru_cache(None)(of)

    def _concentration(self, index: int, kind: int, lamp: Lamp, weights: Array) -> Array:
        """Sum of products over the product of the sums of what single photons bring, up to a constant."""
        total = weights @ self.contracted(kind, lamp)[index]
        squares = np.maximum(self.contracted(kind, lamp, squares=True)[index], 0)
        products = (weights[:, None] * weights) @ squares
        sums = total[:, None] * total
        found = np.divide(products, sums, out=np.zeros_like(sums), where=np.abs(sums) > 1e-60)
        return self.at_cells(found)

    def _stretches(self, apparent_distance_m: float) -> list[tuple[float, slice]]:
        """Factor on the beam's angles at each plane, and its cells; or at all of them.

        Light from a point z0 behind the window starts at z0 theta beside the axis. At plane z it is, to first
        order in the angles, where light of a beam wider by (z + z0) / z would be that starts at the window.
        """
        if apparent_distance_m == 0:
            return [(1.0, slice(None))]
        planes, first = np.unique(self.cell_z_m, return_index=True)
        ends = [*first[1:].tolist(), len(self.cell_z_m)]
        return [
            ((z + apparent_distance_m) / z, slice(start, end))
            for z, start, end in zip(planes.tolist(), first.tolist(), ends, strict=True)
        ]


@lru_cache(1)
def _lamp_with(beam: Beam) -> Lamp:
    """A lamp of this beam, which is asked for at plane after plane."""
    return Lamp.model_construct(**dict(zip(_BEAM_FIELDS, beam, strict=True)))


def roots(covariance: Array) -> Array:
    """Lower triangular roots of the covariances of cells, shape (k, k, n_cells) as given."""
    size = np.sqrt(np.einsum("wwh->wh", covariance))
    lengths = np.where(size > 1e-150, size, np.inf)
    few = 1e-5 * np.eye(len(size))  # sums in single precision are positive definite only up to that
    correlation = np.moveaxis(covariance / (lengths[:, None] * lengths), 2, 0)
    correlation += np.eye(len(size)) * np.isinf(lengths.T)[:, :, None]
    roots = np.linalg.cholesky((correlation + few) / (1 + 1e-5))
    return np.asarray(size[:, None] * np.moveaxis(roots, 0, 2))
