"""Where the power of a trace went."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bookkeeping:
    """Where the power went, in the units of the emission (W for unit on-axis intensity: sr).

    Parameters
    ----------
    emitted, absorbed, walls, escaped, unfinished : float
        Power emitted; absorbed in the reference water; absorbed by walls; lost through the surface or out of
        the water; left in walks cut off at the flight limit. `roulette` is the net power that the roulette
        invented.
    """

    emitted: float
    absorbed: float
    walls: float
    escaped: float
    unfinished: float
    roulette: float

    @property
    def closure(self) -> float:
        """Relative difference between what was emitted and what is accounted for."""
        spent = self.absorbed + self.walls + self.escaped + self.unfinished - self.roulette
        return (spent - self.emitted) / self.emitted
