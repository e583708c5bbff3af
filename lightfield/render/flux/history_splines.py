"""Splines over the water of the flux vector of every history of a trace: what a new water weighs anew.

The tally of each, averaged over the mirror images that the light has and times z^2, becomes coefficients of a
cubic spline over x, y and z. Of axes whose halves tell each other one half is kept, and one cell beyond the
middle: the other half is its mirror image, with components turned.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from types import EllipsisType

import numpy as np
from scipy.ndimage import spline_filter1d

from lightfield.arrays import Array, Mask
from lightfield.render.response.grid import COMPONENTS, Grid
from lightfield.render.response.response import TransportResponse
from lightfield.render.response.symmetry import symmetric
from lightfield.scene import Scene
from lightfield.scene.lamp.frame import is_round

#: How the components change under x -> -x and y -> -y, and which they become when x and y are exchanged.
_MIRROR_X, _MIRROR_Y, _EXCHANGED = (-1, 1, 1, 1), (1, -1, 1, 1), (1, 0, 2, 3)


@dataclass(frozen=True)
class HistorySplines:
    """Coefficients history by history, made when they are first asked for.

    Parameters
    ----------
    scene : Scene
        Of the trace.
    grid : Grid
        Its cells, as many on either side of the lamp.
    response : TransportResponse
        Flux vector, cell by cell.
    without : (HistorySplines, int), optional
        Those of all independent batches of the trace, and which of these is left out here.
    """

    scene: Scene
    grid: Grid
    response: TransportResponse
    without: tuple[HistorySplines, int] | None = field(default=None, compare=False, repr=False)

    @cached_property
    def whole(self) -> TransportResponse:
        """Coefficients stand for a tally, and the four components for its batches."""
        if self.without is not None:
            every, left_out = self.without
            n, one = every.parts.shape[1], every.parts[:, left_out]
            return replace(every.whole, tally=(n * every.whole.tally - one) / (n - 1))
        mean = self._coefficients(self.response.tally.mean(axis=0)[None])[:, 0]
        straight = self.response.straight_m.reshape(len(COMPONENTS), *self.grid.shape)[0]
        return replace(self.response, tally=mean, straight_m=straight[self._window])

    @cached_property
    def parts(self) -> Array:
        """Coefficients batch by batch, which take as many times as long: (4, n_batches, n_rows, n_cells)."""
        return self._coefficients(self.response.tally) if self.without is None else self.without[0].parts

    def layers(self, z: slice) -> TransportResponse:
        """`whole` of some layers of cells across the beam: a view, made once for the same layers."""
        known, key = self._layers, (z.start, z.stop)
        if key not in known:
            tally, straight = self.whole.tally[..., self._cells_of(z)], self.whole.straight_m[z]
            known[key] = replace(self.whole, tally=tally, straight_m=straight)
        return known[key]

    def parts_of(self, z: slice) -> Array:
        """`parts` of the same layers, a view."""
        return self.parts[..., self._cells_of(z)]

    def _cells_of(self, z: slice) -> slice:
        _, n_y, n_x = self.whole.straight_m.shape
        return slice(z.start * n_y * n_x, z.stop * n_y * n_x)

    @cached_property
    def _layers(self) -> dict[tuple[int, int], TransportResponse]:
        return {}

    def leave_one_out(self) -> list[HistorySplines]:
        """Without one of the independent batches of the trace, each in turn."""
        return [replace(self, without=(self, one)) for one in range(self.parts.shape[1])]

    def cells(self, place_m: Array) -> Array:
        """Places, or their mirror images, in cells along (z, y, x), shape (n, 3)."""
        at = np.where(self._mirrored, np.abs(place_m), place_m)
        return np.asarray(((at - self._first_m) / self.step_m)[:, ::-1])

    def signs(self, place_m: Array) -> Array:
        """How x, y and z are turned in the mirror image that is kept, shape (n, 3)."""
        return np.where(self._mirrored & (place_m < 0), -1.0, 1.0)

    @cached_property
    def step_m(self) -> Array:
        """Distance of cells along x, y and z, m."""
        return np.array([axis[1] - axis[0] for axis in self._axes])

    @cached_property
    def _first_m(self) -> Array:
        return np.array([axis[half][0] for axis, half in zip(self._axes, self._halves, strict=True)])

    @property
    def _axes(self) -> tuple[Array, Array, Array]:
        return self.grid.x_m, self.grid.y_m, self.grid.z_m

    @cached_property
    def _mirrored(self) -> Mask:
        """Along which of x, y and z one half tells the other."""
        detector = self.scene.detector.model_copy(update={"tilt_x_deg": 0.0})
        return np.array([*symmetric(self.scene.model_copy(update={"detector": detector})), False])

    @property
    def _halves(self) -> list[slice]:
        both = zip(self._axes, self._mirrored, strict=True)
        return [slice(len(axis) // 2 - 1 if mirrored else 0, None) for axis, mirrored in both]

    @property
    def _window(self) -> tuple[EllipsisType | slice, ...]:
        return (..., *self._halves[::-1])

    def _coefficients(self, tally: Array) -> Array:
        """Of tallies of shape (k, n_rows, n), in shape (4, k, n_rows, n_cells)."""
        tally = tally.reshape(*tally.shape[:2], len(COMPONENTS), *self.grid.shape)
        tally = self._averaged_over_images(tally) * (self.grid.z_m**2)[:, None, None]
        tally = _at_middles(_at_middles(tally).swapaxes(-1, -2)).swapaxes(-1, -2)
        # The straight line of the response is not in the tally, but in its factor exp(-change r).
        for axis in (-3, -2, -1):
            tally = spline_filter1d(tally, order=3, axis=axis, mode="nearest", output=np.float32)
        kept = np.ascontiguousarray(tally[self._window].transpose(2, 0, 1, 3, 4, 5))
        return kept.reshape(*kept.shape[:3], -1)

    def _averaged_over_images(self, tally: Array) -> Array:
        """Mean over the mirror images that the light has, components turned with them, shape as given."""
        in_x, in_y, _ = self._mirrored
        signs_x, signs_y = (np.array(s, np.float32)[:, None, None, None] for s in (_MIRROR_X, _MIRROR_Y))
        if in_x:
            tally = 0.5 * (tally + signs_x * tally[..., ::-1])
        if in_y:
            tally = 0.5 * (tally + signs_y * tally[..., ::-1, :])
        if in_x and in_y and self.scene.tank is None and is_round(self.scene.lamp):
            tally = 0.5 * (tally + tally[:, :, _EXCHANGED].swapaxes(-1, -2))
        return tally


def _at_middles(means: Array) -> Array:
    """Values in the middle of cells from their means, along the last axis: f = mean - (step^2 / 24) f''."""
    values = means.copy()
    values[..., 1:-1] -= (means[..., 2:] - 2 * means[..., 1:-1] + means[..., :-2]) / 24
    return values
