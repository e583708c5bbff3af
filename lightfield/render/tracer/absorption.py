"""Absorption along flights in the water that photons are traced in."""

from __future__ import annotations

from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.scene import Water
from lightfield.scene.curve import Nodes, value_at
from lightfield.scene.water.layers import bottom_m, is_layered, slab_m

_CURVE_NODES = 1024  # of an absorption that is a curve of z
_LEAST_STEP_M = 1e-2  # flights that are more level than this see one absorption
#: Beyond these z, and so far above or below the lamp, no flight gains light. Chosen about planes of 0.5 to
#: 10 m; between them the water that a trace is re-used from may absorb less than nothing where that which is
#: asked for does not.
BEYOND_M = ((-1.0, 12.0), 5.0)


@dataclass(frozen=True)
class ReferenceWater:
    """Reference water that photons are traced in.

    Parameters
    ----------
    absorption_per_m, scattering_per_m : float, m^-1
    layers : Water of a scene
        Its gradients, layers and curve are added to the absorption.
    """

    absorption_per_m: float
    scattering_per_m: float
    layers: Water = field(default_factory=Water)


class AbsorptionCurve:
    """Absorption that is a curve of z, on even nodes, and its integral; constant beyond them.

    Parameters
    ----------
    nodes : tuple of pairs
        z in m and absorption in m^-1, as a scene states them.
    """

    def __init__(self, nodes: Nodes) -> None:
        ends = nodes[0][0], max(nodes[-1][0], nodes[0][0] + _LEAST_STEP_M)
        z = np.linspace(*ends, _CURVE_NODES)
        value = value_at(nodes, z)
        step = (ends[1] - ends[0]) / (_CURVE_NODES - 1)
        integral = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * step)])
        self.value, self.integral = mi.Float(value), mi.Float(integral)
        self.first, self.step = (dr.opaque(mi.Float, v) for v in (ends[0], step))

    def mean(self, z0: mi.Float, z1: mi.Float) -> mi.Float:
        """Mean absorption between two z; of a level flight that in its middle."""
        far = dr.abs(z1 - z0) > _LEAST_STEP_M
        between = (self._to(z1) - self._to(z0)) / dr.select(far, z1 - z0, 1)
        return dr.select(far, between, self._at(0.5 * (z0 + z1))[0])

    def _at(self, z: mi.Float) -> tuple[mi.Float, mi.UInt32, mi.Float]:
        """Value, the node before, and the way from there in steps, below 0 or above 1 beyond the ends."""
        at = (z - self.first) / self.step
        low = mi.UInt32(dr.clip(at, 0, _CURVE_NODES - 2))
        beyond = at - mi.Float(low)
        a, b = dr.gather(mi.Float, self.value, low), dr.gather(mi.Float, self.value, low + 1)
        return dr.lerp(a, b, dr.clip(beyond, 0, 1)), low, beyond

    def _to(self, z: mi.Float) -> mi.Float:
        """Integral from the first node."""
        value, low, steps = self._at(z)
        inside = dr.clip(steps, 0, 1)
        before = dr.gather(mi.Float, self.value, low)
        return dr.gather(mi.Float, self.integral, low) + self.step * (
            0.5 * (before + value) * inside + value * (steps - inside)
        )


class BottomLayer:
    """Absorption below a height, which sets in evenly, see `part_in_bottom_layer`."""

    def __init__(self, layers: Water) -> None:
        self.absorption, self.low, self.high = (
            dr.opaque(mi.Float, value) for value in (layers.bottom_layer_absorption_per_m, *bottom_m(layers))
        )

    def mean(self, y0: mi.Float, y1: mi.Float) -> mi.Float:
        """Mean absorption between two heights; of a level flight that in its middle."""
        climb = dr.abs(y1 - y0)
        climbs, blend = climb > _LEAST_STEP_M, self.high - self.low
        part = dr.abs(self._below(y1) - self._below(y0)) / dr.select(climbs, climb, 1)
        middle = (self.high - dr.clip(0.5 * (y0 + y1), self.low, self.high)) / blend
        return self.absorption * dr.select(climbs, part, middle)

    def _below(self, y: mi.Float) -> mi.Float:
        inside = self.high - dr.clip(y, self.low, self.high)
        return 0.5 * inside * inside / (self.high - self.low) + self.low - dr.minimum(y, self.low)


class Absorption:
    """The reference water's absorption, held in variables so that a new water needs no new kernel."""

    def __init__(self, water: ReferenceWater) -> None:
        layers = water.layers
        self.is_uniform = not is_layered(layers)
        self.uniform, self.gradient, self.centre, self.upwards, self.layer, self.low, self.high = (
            dr.opaque(mi.Float, value)
            for value in (
                water.absorption_per_m,
                layers.gradient_per_m2,
                layers.gradient_centre_m,
                layers.height_gradient_per_m2,
                layers.layer_absorption_per_m,
                *slab_m(layers),
            )
        )
        self.bottom = BottomLayer(layers) if layers.bottom_layer_absorption_per_m else None
        self.curve = AbsorptionCurve(layers.absorption_departure) if layers.absorption_departure else None

    def depth(self, start: mi.Point3f, direction: mi.Vector3f, t: mi.Float) -> mi.Float:
        """Optical depth of absorption along a flight of length t; beyond `BEYOND_M` never below nothing.

        In water without walls a gradient has somewhere, far behind the lamp or above it, less absorption than
        none: what strays there would gain light without bounds, and return.
        """
        if self.is_uniform:
            return self.uniform * t
        z0, cos_z = start.z, direction.z
        z1 = z0 + cos_z * t
        low, high = dr.minimum(z0, z1), dr.maximum(z0, z1)
        crossed = dr.maximum(dr.minimum(high, self.high) - dr.maximum(low, self.low), 0)
        level = dr.select((z0 > self.low) & (z0 < self.high), t, 0)
        steepness = dr.abs(cos_z)
        in_layer = dr.select(steepness > 1e-4, crossed / dr.maximum(steepness, 1e-4), level)
        height = start.y + 0.5 * direction.y * t
        graded = self.gradient * (0.5 * (z0 + z1) - self.centre) + self.upwards * height
        depth = (self.uniform + graded) * t + self.layer * in_layer
        if self.curve is not None:
            depth = depth + t * self.curve.mean(z0, z1)
        if self.bottom is not None:
            depth = depth + t * self.bottom.mean(start.y, start.y + direction.y * t)
        (first, last), aside = BEYOND_M
        highest = dr.maximum(dr.abs(start.y), dr.abs(start.y + direction.y * t))
        far = (low < first) | (high > last) | (highest > aside)
        return dr.select(far, dr.maximum(depth, 0), depth)
