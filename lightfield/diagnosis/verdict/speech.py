"""How names, sizes, places and sentences are said, in every verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lightfield.diagnosis.verdict.parts import Estimate, PlaceToRead, SetAside
from lightfield.readings.columns import PLACE_DECIMALS
from lightfield.wording import plain

#: Units of the coordinates that a misfit depends on, or that readings set aside share.
UNITS = {
    "x": "m", "y": "m", "plane": "m", "angle": "degrees", "azimuth": "degrees", "time": "minutes",
    "wavelength": "nm",
}  # fmt: skip
#: Digits of a fitted value to look it up, and to read on. Chosen: words alone.
_DIGITS_TO_LOOK_UP, _DIGITS_TO_READ = 4, 3


@dataclass(frozen=True)
class Said:
    """What a verdict says.

    Parameters
    ----------
    sentence : str
        All of it.
    headline : str
        What was found, to be read from across the room.
    support : tuple of str
        How sure that is, and what took no part: sentences that stand below the headline.
    """

    sentence: str
    headline: str
    support: tuple[str, ...] = ()

    @classmethod
    def of(cls, headline: str, *support: str) -> Said:
        """Sentences of which the first is the headline."""
        return cls(" ".join((headline, *support)), headline, support)

    def after(self, first: str) -> Said:
        """The same below another finding."""
        return Said(f"{first} {self.sentence}", f"{first} {self.headline}", self.support)

    def then(self, more: str) -> Said:
        """The same with one more support, unless that is empty."""
        return Said(f"{self.sentence} {more}", self.headline, (*self.support, more)) if more else self


def join(names: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    words = [plain(n) for n in names]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def in_unit(number: str, unit: str) -> str:
    """A number with its unit, or alone where it has none."""
    return number if unit == "1" else f"{number} {unit}"


def place(one: SetAside | PlaceToRead, waves: bool = False) -> str:
    """Where a reading was taken, or is to be taken; with `waves` at which wavelength, too."""
    medium = "" if one.medium == "water" else f" in {one.medium}"
    wavelength = one.wavelength_nm if isinstance(one, SetAside) and waves else None
    colour = "" if wavelength is None else f", {wavelength:g} nm"
    x, y, z = (round(v, PLACE_DECIMALS) + 0.0 for v in (one.x_m, one.y_m, one.z_m))
    return f"x = {x:.3g}, y = {y:.3g}, z = {z:.3g} m{colour}{medium}"


def short(value: float, digits: int) -> str:
    """A number to so many digits, of a large one all before the point."""
    return f"{value:.0f}" if abs(value) >= 10**digits else f"{value:.{digits}g}"


def exactly(one: Estimate) -> str:
    """A value with its error, or why there is none: to look it up."""
    value = short(one.value, _DIGITS_TO_LOOK_UP)
    if one.stderr is None:
        return f"{in_unit(value, one.unit)} ({one.reason})"
    return in_unit(f"{value} ± {short(one.stderr, 2)}", one.unit)


def roughly(one: Estimate) -> str:
    """A value with its error, if any: to read on."""
    error = "" if one.stderr is None else f" ± {short(one.stderr, 1)}"
    return in_unit(f"{short(one.value, _DIGITS_TO_READ)}{error}", one.unit)
