"""Mirror images: cells that see the same light by symmetry of the scene share one tally. No Mitsuba here.

A lamp on the axis of a tank sends as much light to +x as to -x. Merging a cell with its mirror images gives
each of them the photons of all, for nothing; but their errors are then one error, not several of their own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from lightfield.render.response.grid import AngleNodes, Grid
from lightfield.scene import Scene
from lightfield.scene.lamp.frame import has_round_section, is_mirrored


def symmetric(scene: Scene) -> tuple[bool, bool]:
    """Whether the light is the same at -x, and at -y."""
    lamp, tank, tilted = scene.lamp, scene.tank, scene.detector.tilt_x_deg != 0
    beam_x, beam_y = is_mirrored(lamp)
    x = beam_x and lamp.offset_x_m == 0 and lamp.tilt_x_deg == 0 and not tilted
    water, height = scene.water, ("height_gradient_per_m2", "bottom_layer_absorption_per_m")
    y = (
        beam_y
        and lamp.offset_y_m == 0
        and lamp.tilt_y_deg == 0
        and not any(getattr(water, k) for k in height)
    )
    if tank is not None:
        # A lid reflects as walls do; a water surface does not, nor a floor of another albedo, or of glass.
        y = y and tank.surface_reflectance == 0 and (tank.floor_share == 1 or tank.wall_albedo == 0)
        y = y and (tank.panes != "all" or tank.pane_reflectance == 0)
        y = y and abs(2 * tank.lamp_depth_m - tank.depth_m) < 1e-9
    return x, y


def mirrors(scene: Scene, grid: Grid) -> tuple[bool, bool, bool]:
    """Whether grid and light are the same at -x, at -y, and with x and y exchanged."""
    x, y = symmetric(scene)
    square = len(grid.x_m) == len(grid.y_m) and np.allclose(grid.x_m, grid.y_m, atol=1e-9)
    round_beam = has_round_section(scene.lamp)
    x = x and bool(np.allclose(grid.x_m, -grid.x_m[::-1], atol=1e-9))
    y = y and bool(np.allclose(grid.y_m, -grid.y_m[::-1], atol=1e-9))
    return x, y, bool(x and y and square and round_beam and scene.tank is None)


def merge_mirror_images(scene: Scene, grid: Grid) -> Grid:
    """The grid with one tally cell for each set of mirror images; unchanged when there are none.

    Parameters
    ----------
    grid : Grid
        Full grid, all cells tallied.
    """
    x, y, diagonal = mirrors(scene, grid)
    if grid.occupied is not None or not (x or y):
        return grid
    planes, rows, columns = grid.shape
    first = np.arange(rows * columns).reshape(rows, columns)
    if x:
        first = np.minimum(first, first[:, ::-1])
    if y:
        first = np.minimum(first, first[::-1])
    if diagonal:
        first = np.minimum(first, first.T)
    _, group = np.unique(first, return_inverse=True)
    group = group.reshape(rows, columns)
    plane = np.arange(planes)[:, None, None] * (group.max() + 1)
    return replace(grid, merged=plane + group)


@dataclass(frozen=True)
class MirrorImages:
    """Mirror images among listed cells.

    Parameters
    ----------
    y : array of int, shape (n_cells,)
        The cell's image at -y, itself if it lies at y = 0; -1 where there is none.
    orbits : sparse array, shape (n_cells, n_sets)
        1 of cells that share their photons once the images at -y are averaged.
    kept : array of int, shape (n_kept,)
        Cells whose tallies stand for those of all, ascending.
    place : array of int, shape (n_cells,)
        Which of them stands for a cell.
    flipped : array of bool, shape (n_cells, 2)
        Whether the cell lies at its -x, and at its -y.
    """

    y: np.ndarray
    orbits: csr_array
    kept: np.ndarray
    place: np.ndarray
    flipped: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """Factor on the Monte Carlo error of each cell by the averaging, shape (n_cells,)."""
        return np.where(self._paired, np.sqrt(0.5), 1.0)

    @property
    def _paired(self) -> np.ndarray:
        return (self.y >= 0) & (self.y != np.arange(len(self.y)))

    def traced(self, grid: Grid) -> Grid:
        """The grid with those of its listed cells that a trace tallies: of two that are images at -x one.

        A photon that crosses one of them crosses the other as its mirror image.
        """
        assert grid.occupied is not None
        occupied = grid.occupied.copy()
        occupied[grid.occupied] = ~self.flipped[:, 0]
        return replace(grid, occupied=occupied)

    @property
    def told_by(self) -> np.ndarray:
        """Number among the traced cells of the one with the same light of a round beam, shape (n_cells,)."""
        stands = self.kept[self.place]
        at_other_x = np.where(self.flipped[:, 1], self.y[stands], stands)
        return self._number[np.where(self.flipped[:, 0], at_other_x, np.arange(len(self.y)))]

    @property
    def _number(self) -> np.ndarray:
        """Of each cell among those that are traced, shape (n_cells,)."""
        return np.cumsum(~self.flipped[:, 0]) - 1

    def folded(self, tallies: np.ndarray, rows: np.ndarray, nodes: AngleNodes) -> np.ndarray:
        """Some rows of the tallies of the cells that are kept, averaged with those of their images at -y.

        Parameters
        ----------
        tallies : array, shape (n_rows, n_emission_nodes, n_traced)
        rows : array of int, shape (n_some,)

        Returns
        -------
        array, shape (n_some, n_emission_nodes, n_kept)
        """
        out = np.zeros((len(rows), nodes.size, len(self.kept)), np.float32)
        first = tallies.shape[2] * np.arange(nodes.size)[:, None]  # of each node's cells in a row
        mine = first + self._number[self.kept]
        image = self.y[self.kept]
        theirs = np.where(image >= 0, first[nodes.mirrored(False, True)] + self._number[image], mine)
        for own, row in zip(out, rows, strict=True):
            tally = tallies[row].ravel()
            tally.take(mine, out=own)
            if self._paired.any():
                own += tally.take(theirs)
                own *= 0.5
        return out


def mirror_images(scene: Scene, grid: Grid) -> MirrorImages:
    """Images of the tallied cells; the trace has averaged those at -x already where the scene allows it."""
    in_x, in_y = symmetric(scene)
    x, y, z = (np.round(v.ravel(), 4) + 0.0 for v in grid.centres())
    number = {place: i for i, place in enumerate(zip(x, y, z, strict=True))}
    image = np.array([number.get((p, -q, r), -1) if in_y else -1 for p, q, r in number])
    paired = (image >= 0) & (image != np.arange(len(image)))
    first: dict[tuple[float, float, float], int] = {}
    owner = [
        first.setdefault((abs(p) if in_x else p, abs(q) if paired[i] else q, r), len(first))
        for i, (p, q, r) in enumerate(number)
    ]
    # A cell that was averaged with its image at -y cannot stand for one that was not.
    stands: dict[tuple[float, float, float, bool], int] = {}
    by = [
        stands.setdefault((abs(p) if in_x else p, abs(q) if paired[i] else q, r, bool(paired[i])), i)
        for i, (p, q, r) in enumerate(number)
    ]
    kept, place = np.unique(by, return_inverse=True)
    flipped = np.stack([x != x[by], y != y[by]], axis=1)
    orbits = csr_array((np.ones(len(owner)), (np.arange(len(owner)), owner)), (len(owner), len(first)))
    return MirrorImages(image, orbits, kept, place, flipped)
