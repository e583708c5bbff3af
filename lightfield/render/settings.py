"""How well to render."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

from lightfield.render.limits import OF_MAPS, REL_ERROR, check_photons, check_rel_error

#: Least and most pixels of a side of a camera view, and paths per pixel and colour.
PICTURE_PIXELS, PICTURE_SAMPLES = (16, 8192), (2, 100_000)
#: Width and height, and paths, unless told otherwise.
PICTURE_SIZE, PICTURE_PATHS = (720, 405), 64
#: Relative error, the least that may be asked for, of a trace that ends with its photons.
BY_PHOTONS = REL_ERROR.low
#: Independent batches of a trace, from whose spread errors come: as many as a tally of so many bytes holds.
_FEWEST_BATCHES, BATCHES, _TALLY_BYTES = 4, 10, 900e6
#: Steps in which paths are tallied: absorption changes little over one.
PATH_NODES = 28


class Tracing(TypedDict, total=False):
    """How well to trace, as keywords; what is left out has the default of who takes them. See `Settings`."""

    rel_error: float
    max_photons: float
    seed: int


class CachedTracing(Tracing, total=False):
    """The same where the response may be looked for on disk, and left there."""

    cache: bool


class SharedTracing(CachedTracing, total=False):
    """The same where mirror images may share their photons."""

    symmetry: bool


def batches_of(cells: float, rows: float) -> int:
    """Batches of a trace whose tally has so many cells and rows, in single precision."""
    return int(min(max(_TALLY_BYTES / (4 * cells * rows), _FEWEST_BATCHES), BATCHES))


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

    rel_error: float = OF_MAPS.rel_error
    max_photons: float = OF_MAPS.max_photons
    seed: int = 0
    symmetry: bool = False

    def __post_init__(self) -> None:
        check_rel_error(self.rel_error)
        check_photons(self.max_photons)
