"""How well to render."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[
    [int, float, float], None
]  # photons so far, relative error so far, requested relative error


@dataclass(frozen=True)
class Settings:
    """How well to render.

    Parameters
    ----------
    rel_error : float
        Requested relative standard error, met by 95 % of the cells that the beam lights.
    max_photons : float
        Photon budget; reached first, the rendering says which error it has.
    seed : int
        Same seed, same result.
    symmetry : bool
        Cells that are mirror images of each other share their photons, and so their errors.
    """

    rel_error: float = 0.02
    max_photons: float = 1e8
    seed: int = 0
    symmetry: bool = False
