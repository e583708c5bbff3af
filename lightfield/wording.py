"""How the names of effects, quantities and fields are written for people, and numbers with their sign."""

from __future__ import annotations

import re

_CDOM = re.compile(r"\bcdom\b")


def plain(name: str) -> str:
    """A name, or several in a row, for people: "beam tilt", "CDOM"."""
    return _CDOM.sub("CDOM", name.replace("_", " "))


def minus(number: str) -> str:
    """A number as it is printed, with a minus sign in place of hyphens."""
    return number.replace("-", "\N{MINUS SIGN}")
