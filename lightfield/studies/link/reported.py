"""Distances at which vehicles are reported to have found a dock or each other by light, to compare with.

None of them is computed here; lamps, receivers and waters differ from one to the next.
"""

from __future__ import annotations

from typing import NamedTuple


class Reported(NamedTuple):
    """One report.

    Parameters
    ----------
    from_m, to_m : float, m
        Range of what was reported; `from_m` is 0 where only the farthest distance was.
    water, source : str
    """

    from_m: float
    to_m: float
    water: str
    source: str

    def as_text(self) -> str:
        """The distance."""
        return f"up to {self.to_m:g} m" if not self.from_m else f"{self.from_m:g} to {self.to_m:g} m"


THESIS = "Eren 2015, thesis, University of New Hampshire, scholars.unh.edu/dissertation/2193"
REPORTED = (
    Reported(0.0, 20.0, "K = 0.05 per m, 400 W lamp", THESIS),
    Reported(0.0, 8.0, "K = 0.1 per m, 400 W lamp", THESIS),
    Reported(
        10.0, 15.0, "turbid bay", "Cowen, Briest and Dombrowski 1997, Proc. OCEANS, 1143, as cited by others"
    ),
    Reported(20.0, 28.0, "not told", "second hand; no first source is known to us"),
)
