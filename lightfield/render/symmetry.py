"""Mirror images: cells that see the same light by symmetry of the scene share one tally. No Mitsuba here.

A lamp on the axis of a tank sends as much light to +x as to -x. Merging a cell with its mirror images gives
each of them the photons of all, for nothing; but their errors are then one error, not several of their own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lightfield.render.grid import Grid
from lightfield.scene import Scene


def mirrors(scene: Scene, grid: Grid) -> tuple[bool, bool, bool]:
    """Whether the light is symmetric under x -> -x, under y -> -y, and under the exchange of x and y."""
    lamp, tank, tilted = scene.lamp, scene.tank, scene.detector.tilt_x_deg != 0
    x = lamp.offset_x_m == 0 and lamp.tilt_x_deg == 0 and not tilted
    y = lamp.offset_y_m == 0 and lamp.tilt_y_deg == 0
    if tank is not None:
        # A lid reflects as the floor does, a water surface does not.
        y = y and tank.surface_reflectance == 0 and abs(2 * tank.lamp_depth_m - tank.depth_m) < 1e-9
    square = len(grid.x_m) == len(grid.y_m) and np.allclose(grid.x_m, grid.y_m, atol=1e-9)
    round_beam = lamp.ellipticity == 1
    x = x and bool(np.allclose(grid.x_m, -grid.x_m[::-1], atol=1e-9))
    y = y and bool(np.allclose(grid.y_m, -grid.y_m[::-1], atol=1e-9))
    return x, y, bool(x and y and square and round_beam and tank is None)


def merge_mirror_images(scene: Scene, grid: Grid) -> Grid:
    """The grid with one tally cell for each set of mirror images; unchanged when there are none.

    Parameters
    ----------
    scene : Scene
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
