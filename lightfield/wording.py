"""How the names of effects, quantities and fields are written for people, numbers with their sign, and the
beginning of a sentence; words that are data as well."""

from __future__ import annotations

import math
import re
from enum import Enum

#: Places after the point that anybody reads, in m, degrees or their parts; and the least error there. Chosen.
_MOST_PLACES, _LEAST_ERROR = 4, 1e-4
_CDOM = re.compile(r"\bcdom\b")


class Word(str, Enum):
    """A word of few: programs compare it, reports print it as it is. (`enum.StrEnum` is of Python 3.11.)"""

    __str__ = str.__str__
    __repr__ = str.__repr__


def plain(name: str) -> str:
    """A name, or several in a row, for people: "beam tilt", "CDOM"."""
    return _CDOM.sub("CDOM", name.replace("_", " "))


def capital(text: str) -> str:
    """The same as the beginning of a sentence; only its first letter changes."""
    return text[:1].upper() + text[1:]


def rounded(value: float, digits: int = 2) -> str:
    """So many significant digits, written out below a million: 850, not 8.5e+02."""
    return f"{float(f'{value:.{digits}g}'):g}"


def with_error(value: float, error: float, digits: int = 2) -> str:
    """A value with its error, both to the place of so many digits of the error: 3.96 ± 0.05, 0.00 ± 0.11.

    An error that is not known is left out; beside one of zero, as beside none, a value has three digits. None
    is told as less than `_LEAST_ERROR`.
    """
    if not (math.isfinite(value) and math.isfinite(error) and error > 0):
        return f"{value:.3g}" + (" ± 0" if error == 0 else "")
    error = max(error, _LEAST_ERROR)
    to_first = math.floor(math.log10(float(f"{error:.{digits}g}")))
    places = digits - 1 - to_first
    shown = min(max(places, 0), _MOST_PLACES)
    first, second = (f"{round(v, min(places, shown)) + 0.0:.{shown}f}" for v in (value, error))
    return f"{first} ± {second}"


def minus(number: str) -> str:
    """A number as it is printed, with a minus sign in place of hyphens."""
    return number.replace("-", "\N{MINUS SIGN}")
