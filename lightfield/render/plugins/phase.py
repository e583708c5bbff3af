"""Mitsuba plugin `lightfield_phase`: any of the package's phase functions, with its exact sampler.

Mitsuba's own `tabphase` is uniform in cos(theta) and cannot hold the forward peak of ocean water. Here the
cumulative distribution is tabulated on a log-angle grid and inverted by search, linear in log(angle) between
nodes.
"""

from __future__ import annotations

from math import pi

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.scene.water.phase.function import PhaseFunction
from lightfield.scene.water.phase.of_scene import parse_phase


class LightfieldPhase(mi.PhaseFunction):
    """Phase function from the package's models or a measured table.

    Properties: `model` (JSON of the phase section of a scene file, for example
    `{"type": "fournier-forand", "n": 1.10, "mu": 3.5835}`).
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.model: PhaseFunction = parse_phase(
            str(props.get("model", '{"type": "henyey-greenstein", "g": 0.924}'))
        )
        u, psi = self.model.inverse_cdf_table()
        self.nodes = len(u)
        self.u, self.log_psi = mi.Float(u), mi.Float(np.log(psi))
        # Not from differences of u, which have no digits left at large angles in single precision.
        self.log_density = mi.Float(np.log(np.maximum(self.model.pdf(np.cos(psi)), 1e-30)))
        self.m_flags = int(mi.PhaseFunctionFlags.Anisotropic)

    def sample(
        self,
        ctx: mi.PhaseFunctionContext,
        mei: mi.MediumInteraction3f,
        sample1: mi.Float,
        sample2: mi.Point2f,
        active: mi.Bool = True,
    ) -> tuple[mi.Vector3f, mi.Spectrum, mi.Float]:
        """Scattered direction (world), weight 1, and its density per sr."""
        low = dr.binary_search(0, self.nodes - 2, lambda i: dr.gather(mi.Float, self.u, i + 1) <= sample2.x)
        u0, u1 = dr.gather(mi.Float, self.u, low), dr.gather(mi.Float, self.u, low + 1)
        a, b = dr.gather(mi.Float, self.log_psi, low), dr.gather(mi.Float, self.log_psi, low + 1)
        psi = dr.minimum(
            dr.exp(dr.lerp(a, b, dr.clip((sample2.x - u0) / dr.maximum(u1 - u0, 1e-20), 0, 1))), pi
        )
        sin_psi, cos_psi = dr.sincos(psi)
        sin_phi, cos_phi = dr.sincos(2 * pi * sample2.y)
        # Mitsuba's wi points back along the flight, so forward is -z of its frame.
        wo = mei.to_world(mi.Vector3f(sin_psi * cos_phi, sin_psi * sin_phi, -cos_psi))
        return wo, mi.Spectrum(1.0), self._density(psi)

    def eval_pdf(
        self,
        ctx: mi.PhaseFunctionContext,
        mei: mi.MediumInteraction3f,
        wo: mi.Vector3f,
        active: mi.Bool = True,
    ) -> tuple[mi.Spectrum, mi.Float]:
        """Phase function value and density for a given scattered direction."""
        forward = -mei.wi
        # From the chord and not the cosine, which cannot resolve small angles in single precision.
        chord = dr.norm(wo - forward)
        psi = 2 * dr.asin(dr.clip(0.5 * chord, 0, 1))
        density = self._density(psi)
        return mi.Spectrum(density), density

    def _density(self, psi: mi.Float) -> mi.Float:
        at = dr.log(dr.clip(psi, 1e-7, pi))
        low = dr.binary_search(0, self.nodes - 2, lambda i: dr.gather(mi.Float, self.log_psi, i + 1) <= at)
        a, b = dr.gather(mi.Float, self.log_psi, low), dr.gather(mi.Float, self.log_psi, low + 1)
        below, above = (dr.gather(mi.Float, self.log_density, low + i) for i in (0, 1))
        return dr.exp(dr.lerp(below, above, dr.clip((at - a) / (b - a), 0, 1)))

    def traverse(self, callback: mi.TraversalCallback) -> None:
        """Nothing to differentiate."""

    def to_string(self) -> str:
        """Readable summary."""
        return f"LightfieldPhase[{self.model!r}]"
