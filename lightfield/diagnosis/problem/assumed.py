"""What was taken where the error budget says nothing: a record, and its words."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any


class Term(str, Enum):
    """A term of the error budget, named as in the head of a table; `STDERR` is a column."""

    PLANE_GAIN = "plane_gain_percent"
    POSITION = "position_mm"
    TOLERANCE = "tolerance_percent"
    OUTLIERS = "outlier_percent"
    CALIBRATION = "calibration_percent"
    STDERR = "stderr"


@dataclass(frozen=True)
class Assumed:
    """A term of the error budget that was not given.

    Parameters
    ----------
    term : Term
    value : float
        What was taken instead, in the term's unit; of standard errors, whose scale is estimated, per cent of
        the reading.
    visits : int
        Repeats it was estimated from; 0: nothing but a usual value.
    at_reference : bool
        These repeats are marked as those of the reference position.
    floor_percent : float
        Of standard errors: what is added, in per cent of the largest reading.
    """

    term: Term
    value: float
    visits: int = 0
    at_reference: bool = False
    floor_percent: float = 0.0

    def __str__(self) -> str:
        if self.term is Term.STDERR:
            own = f"{self.value:g} % of the reading + {self.floor_percent:g} % of the largest"
            return f"stderr = {own}, up to a factor that is estimated"
        if self.visits:
            where = "the reference position" if self.at_reference else "one position"
            return f"{self.term.value} = {self.value:.2g} from {self.visits} repeats of {where}"
        stays = " for every stay of several readings at one distance"
        return f"{self.term.value} = {self.value:g}" + (stays if self.term is Term.PLANE_GAIN else "")

    def as_data(self) -> dict[str, Any]:
        """The record as plain data."""
        return asdict(self) | {"term": self.term.value}
