"""Backscatter ratio of a phase function, as tables of measured ones state it."""

from __future__ import annotations

import math

from lightfield.scene.water.phase.function import PhaseFunction


def backscatter_ratio(phase: PhaseFunction) -> float:
    """Part scattered by more than 90 degrees."""
    return 1.0 - float(phase.cdf(0.5 * math.pi))
