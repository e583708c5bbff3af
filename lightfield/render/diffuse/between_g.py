"""Light at one asymmetry parameter g from that at a few others, which were traced apart; or at one slope mu
of Fournier and Forand's function.

A fit would take the difference of their noise for that of g. But the light at one g over that at another
varies slowly from cell to cell: smoothed ratios, times the mean of all nodes, have a noise that hardly
depends on g, and less of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lightfield.arrays import Array
from lightfield.errors import RenderError
from lightfield.render.reflected.room import lagrange
from lightfield.scene import Scene


class Shape(NamedTuple):
    """The number that shapes a phase function and is free in a fit.

    Parameters
    ----------
    usual : float
        Its value in a stored trace.
    nodes : tuple of float
        Where light is traced, ascending.
    low, high : float
        How far beyond the first and the last node light is asked for.
    is_g : bool
        Interpolated in log(1 - g), others as they are.
    """

    path: str
    usual: float
    nodes: tuple[float, ...]
    low: float
    high: float
    is_g: bool = False

    def nodes_for(self, scene: Scene) -> tuple[float, ...]:
        """Where light is traced of a scene, ascending: also at its own value, where that lies beyond."""
        own = float(scene.get(self.path))
        within = self.nodes[0] + self.low <= own <= self.nodes[-1] + self.high
        return self.nodes if within else tuple(sorted((*self.nodes, own)))


#: By type of phase function.
SHAPES = {
    "henyey-greenstein": Shape("water.phase.g", 0.924, (0.75, 0.87, 0.924, 0.97), -0.1, 0.02, True),
    "fournier-forand": Shape("water.phase.mu", 3.5835, (3.3, 3.5, 3.75, 4.1), -0.1, 0.1),
}


class PassedOn(NamedTuple):
    """Change of the light in one cell with the relative error of a node's light in another.

    A matrix D(own) + D(after) S D(before), with diagonal D; applied, never made: there is one for each class
    of light, node and water.

    Parameters
    ----------
    own : array, shape (n_cells,)
    after, before : arrays, shape (n_cells,), optional
    smoother : sparse array S, shape (n_cells, n_cells), optional
    """

    own: Array
    after: Array | None = None
    before: Array | None = None
    smoother: csr_array | None = None

    def to(self, shares: Array) -> Array:
        """From the left: what combinations of cells, shape (n, n_cells), have of each error."""
        out = shares * self.own
        if self.smoother is not None and self.after is not None and self.before is not None:
            out += ((shares * self.after) @ self.smoother) * self.before
        return np.asarray(out)

    def among(self, cells: NDArray[np.int_], smoother: csr_array | None) -> PassedOn:
        """Among some of the cells, of which a part of the smoother tells."""
        after, before = (None if each is None else each[cells] for each in (self.after, self.before))
        return PassedOn(self.own[cells], after, before, smoother)

    def times(self, errors: Array) -> Array:
        """Changes with errors, shape (n_cells, k)."""
        out = self.own[:, None] * errors
        if self.smoother is not None and self.after is not None and self.before is not None:
            out += self.after[:, None] * (self.smoother @ (self.before[:, None] * errors))
        return np.asarray(out)


@dataclass(frozen=True)
class BetweenG:
    """Interpolation of light over the traced nodes of g.

    Parameters
    ----------
    nodes : tuple of float
        Ascending; empty when nothing shapes the phase function (one trace then).
    part : array, shape (n_nodes,)
        Of the photons that each was traced with.
    smoother : sparse array, shape (n_cells, n_cells)
        For ratios of the light at one g and another.
    shape : Shape
        What the nodes are of.
    """

    nodes: tuple[float, ...]
    part: Array
    smoother: csr_array
    shape: Shape = SHAPES["henyey-greenstein"]

    def shares(self, scene: Scene) -> Array:
        """Lagrange interpolation over the nodes, shape (n_nodes,).

        Raises
        ------
        RenderError
            The scene's value is outside the traced range.
        """
        if len(self.nodes) < 2:
            return np.ones(1)
        shape, value = self.shape, float(scene.get(self.shape.path))
        low, high = self.nodes[0] + shape.low, self.nodes[-1] + shape.high
        if not low <= value <= high:
            raise RenderError(
                f"{shape.path.rpartition('.')[2]} is outside the traced range",
                where=shape.path,
                found=value,
                rule=f"{low:.2f} to {high:.2f}",
            )
        return _interpolation(self.nodes, value, shape.is_g)

    def light(self, found: Array, shares: Array, errors: bool) -> tuple[Array, list[list[PassedOn]]]:
        """Light at one g from that at the nodes.

        Parameters
        ----------
        found : array, shape (n_nodes, n_waters, n_cells)
            Or of one node, if the light knows no g.
        shares : array, shape (n_nodes,)
            See `shares`.

        Returns
        -------
        value : array, shape (n_waters, n_cells)
        passed_on : list of n_nodes lists of n_waters PassedOn
            Empty unless errors are asked for.
        """
        if len(found) < 2:
            return found[0], [[PassedOn(light) for light in found[0]]] if errors else []
        flat = found.reshape(len(found), -1)
        mean, wanted = ((w @ flat).reshape(found.shape[1:]) for w in (self.part, shares))
        lit = mean > 0
        ratio = np.divide(wanted, mean, out=np.ones_like(mean), where=lit)
        value = mean * (self.smoother @ ratio.T).T
        if not errors:
            return value, []
        ratios = np.divide(found, mean, out=np.ones_like(found), where=lit)
        common = self.part[:, None, None] * ratios
        apart = shares[:, None, None] * ratios - common * ratio
        passed_on = [
            [PassedOn(c, m, n, self.smoother) for m, n, c in each]
            for each in (zip(mean, apart[i], common[i] * value, strict=True) for i in range(len(found)))
        ]
        return value, passed_on


@lru_cache(maxsize=64)
def _interpolation(nodes: tuple[float, ...], value: float, is_g: bool) -> Array:
    at = np.array([*nodes, value])
    *traced, asked = (np.log1p(-at) if is_g else at).tolist()
    return lagrange(traced, asked)
