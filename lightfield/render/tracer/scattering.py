"""How a scattering turns a flight: by Henyey and Greenstein's function, or by any of Mitsuba's plugins."""

from __future__ import annotations

from math import pi
from typing import Protocol

import drjit as dr
import mitsuba as mi

from lightfield.scene.water.phase.molecular import ANISOTROPY


class Turn(Protocol):
    """A sampler of directions after a scattering."""

    def __call__(
        self, direction: mi.Vector3f, which: mi.Float, u: mi.Point2f, active: mi.Bool
    ) -> mi.Vector3f:
        """The new direction, from the old one and three uniform numbers, where it is asked for."""


def henyey_greenstein(g: float) -> Turn:
    """Sampler of the phase function of Henyey and Greenstein (1941, ApJ 93, 70).

    The inverse of its cumulative distribution is written for s = sin^2(theta/2) = (1 - cos theta) / 2, which
    keeps its digits at small angles where 1 - cos theta in single precision has none left, and at g = 0:

        s = (1 - g) (1 - u) (q + 1 - g) / (2 d),    d = 1 - g + 2 g u,    q = (1 - g^2) / d
    """
    asymmetry = dr.opaque(mi.Float, float(g))

    def turn(direction: mi.Vector3f, which: mi.Float, u: mi.Point2f, active: mi.Bool) -> mi.Vector3f:
        g = asymmetry
        d = 1 - g + 2 * g * u.x
        q = (1 - g * g) / d
        s = dr.clip(0.5 * (1 - g) * (1 - u.x) * (q + 1 - g) / d, 0, 1)
        across = 2 * dr.sqrt(s * (1 - s))
        sin_phi, cos_phi = dr.sincos(2 * pi * u.y)
        return mi.Frame3f(direction).to_world(mi.Vector3f(across * cos_phi, across * sin_phi, 1 - 2 * s))

    return turn


def with_molecules(particles: Turn, share: float) -> Turn:
    """A part of the scatterings as molecules do, by the closed inverse of `phase.molecular.Molecular`."""
    part = dr.opaque(mi.Float, share)

    def turn(direction: mi.Vector3f, which: mi.Float, u: mi.Point2f, active: mi.Bool) -> mi.Vector3f:
        molecular = which < part
        rest = dr.select(molecular, 0, (which - part) / dr.maximum(1 - part, 1e-6))
        by_particles = particles(direction, rest, u, active & ~molecular)
        half = 1.5 / ANISOTROPY * (1 + ANISOTROPY / 3) * (1 - 2 * u.x)
        root = dr.sqrt(half * half + ANISOTROPY**-3)
        cosine = dr.clip(dr.cbrt(half + root) + dr.cbrt(half - root), -1, 1)
        across = dr.safe_sqrt(1 - cosine * cosine)
        sin_phi, cos_phi = dr.sincos(2 * pi * u.y)
        turned = mi.Frame3f(direction).to_world(mi.Vector3f(across * cos_phi, across * sin_phi, cosine))
        return mi.Vector3f(dr.select(molecular, turned, by_particles))

    return turn


def by_plugin(phase: mi.PhaseFunction) -> Turn:
    """Sampler of any phase function that Mitsuba knows."""
    context = mi.PhaseFunctionContext(None)

    def turn(direction: mi.Vector3f, which: mi.Float, u: mi.Point2f, active: mi.Bool) -> mi.Vector3f:
        interaction = dr.zeros(mi.MediumInteraction3f)
        interaction.wi = -direction
        interaction.sh_frame = mi.Frame3f(interaction.wi)
        turned, _, _ = phase.sample(context, interaction, which, u, active)
        return turned

    return turn
