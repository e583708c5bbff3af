"""Detector planes that tally the flux vector of the light, for receivers that may face anywhere.

The flux vector F = integral of radiance times direction, over all directions, says what a cosine receiver of
outward normal n reads, max(-n . F, 0), as long as no light comes from behind its plane (Gershun 1939,
J. Math. Phys. 18, 51). What flies back to the lamp is kept apart, which tells how far that holds.
"""

from __future__ import annotations

from math import inf

import drjit as dr
import mitsuba as mi

from lightfield.render.response.grid import COMPONENTS, Grid
from lightfield.render.tracer.planes import Crossing, Planes
from lightfield.scene import Detector


class FluxPlanes(Planes):
    """Planes whose every cell is there once per component, see `COMPONENTS`.

    Parameters
    ----------
    grid, lamp_position_m, apparent_distance_m, ends_m
        As `Planes` takes them.
    """

    def __init__(
        self,
        grid: Grid,
        lamp_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        apparent_distance_m: float = 0.0,
        ends_m: tuple[float, float] = (-inf, inf),
    ) -> None:
        everywhere = Detector(quantity="scalar_irradiance")
        super().__init__(grid, everywhere, lamp_position_m, apparent_distance_m, ends_m)
        self.cells *= len(COMPONENTS)
        self.row_length = dr.opaque(mi.UInt32, self.cells)

    def reading(self, crossing: Crossing, direction: mi.Vector3f) -> tuple[tuple[mi.Float, ...], mi.Float]:
        (scalar,), straight = super().reading(crossing, direction)
        parts = direction.x, direction.y, direction.z, dr.maximum(-direction.z, 0)
        return tuple(scalar * part for part in parts), straight
