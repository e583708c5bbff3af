"""How well to render."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lightfield.errors import RenderError

OnProgress = Callable[
    [int, float, float], None
]  # photons so far, relative error so far, requested relative error

#: Least and most pixels of a side of a camera view, and paths per pixel and colour.
PICTURE_PIXELS, PICTURE_SAMPLES = (16, 8192), (2, 100_000)


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

    Raises
    ------
    RenderError
        A relative error or photon budget that no trace can have.
    """

    rel_error: float = 0.02
    max_photons: float = 1e8
    seed: int = 0
    symmetry: bool = False

    def __post_init__(self) -> None:
        if not 1e-5 <= self.rel_error <= 1:
            raise RenderError(
                "impossible relative error",
                where="rel_error",
                found=self.rel_error,
                rule="1e-5 to 1",
                remedy="try 0.02",
            )
        if not 1e3 <= self.max_photons <= 1e12:
            raise RenderError(
                "impossible photon budget",
                where="max_photons",
                found=self.max_photons,
                rule="1e3 to 1e12",
                remedy="try 1e8",
            )
