"""What may be asked of a trace: one range of each number, wherever it is asked."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from numbers import Real

from lightfield.errors import RenderError, UsageError
from lightfield.memory import byte_size, free_bytes


class Allowed:
    """Least and most, as they are said."""

    def __init__(self, low: str, high: str) -> None:
        self.low, self.high, self.rule = float(low), float(high), f"{low} to {high}"

    def holds(self, value: float) -> bool:
        """Whether a number is one of those."""
        return self.low <= value <= self.high


class Precision:
    """Relative standard error asked of a trace, and photons at which it ends all the same."""

    def __init__(self, rel_error: float, max_photons: float) -> None:
        self.rel_error, self.max_photons = rel_error, max_photons


#: How well to trace unless told otherwise: maps; each trace of a sweep; light on the axis, for the studies of
#: bands and of data; the grid of where the formula holds.
OF_MAPS, OF_SWEEPS = Precision(0.02, 1e8), Precision(0.05, 2e6)
ON_AXIS, OF_REGIME = Precision(0.005, 4e6), Precision(0.01, 4e6)
#: The render at the places of readings, beside a fit; and of readings that are made, how many photons.
AT_READINGS, MADE_PHOTONS = Precision(0.01, 3e6), 3e7
#: Photons, unless others are asked for: of the light field around an array, and of the flux vector along the
#: axis, whose derivatives tell what a pose is worth (1 % of a bound at 10 m, 4 % at 17).
FIELD_PHOTONS, AXIS_PHOTONS = 1e7, 2e6
REL_ERROR, PHOTONS, SEED = Allowed("1e-5", "1"), Allowed("1e3", "1e12"), Allowed("0", "2147483647")


def refuse_too_large(needed: float, what: str, where: str, remedy: str) -> None:
    """Refuse what takes more bytes than are free, before the system ends the program for it.

    Raises
    ------
    RenderError
    """
    if needed > (free := free_bytes()):
        raise RenderError(
            f"{what} does not fit into memory", where=where, found=f"about {byte_size(needed)}",
            rule=f"{byte_size(free)} are free", remedy=remedy,
        )  # fmt: skip


def check_rel_error(value: object) -> None:
    """Refuse a relative error that no trace can have, with a `RenderError`."""
    _check("rel_error", "relative error", value, REL_ERROR, "try 0.02, which is 2 %")


def check_photons(value: object) -> None:
    """Refuse a number of photons that no trace can have, with a `RenderError`."""
    _check("max_photons", "photon budget", value, PHOTONS, "try 1e8")


#: Wavelengths of which there can be maps, nm, and how many.
_WAVELENGTHS_NM, MOST_WAVELENGTHS = Allowed("200", "2000"), 2000


def check_wavelengths(wavelengths_nm: Sequence[float], where: str, found: object) -> None:
    """Refuse wavelengths of which there are no maps, with a `UsageError`."""
    count = len(wavelengths_nm)
    rising = all(one < other for one, other in pairwise(wavelengths_nm))
    if not (0 < count <= MOST_WAVELENGTHS and rising and all(map(_WAVELENGTHS_NM.holds, wavelengths_nm))):
        raise UsageError(
            "impossible wavelengths",
            where=where,
            found=found,
            rule=f"rising, from {_WAVELENGTHS_NM.rule} nm, at most {MOST_WAVELENGTHS}",
            remedy="for example 500, 525, 550",
        )


def _check(name: str, what: str, value: object, limit: Allowed, remedy: str) -> None:
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not (isinstance(value, Real) and number and limit.holds(float(value))):
        raise RenderError(
            f"impossible {what}",
            where=name,
            found=value if number else repr(value),
            rule=limit.rule if number else f"a number, {limit.rule}",
            remedy=remedy,
        )
