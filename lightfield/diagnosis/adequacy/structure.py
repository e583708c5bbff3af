"""What readings set aside have in common, as data; `slips` finds it."""

from __future__ import annotations

from dataclasses import dataclass

Span = tuple[float, float]


@dataclass(frozen=True)
class Structure:
    """Why readings set aside are not slips.

    Parameters
    ----------
    coordinate : str, optional
        Along which they lie together: "x", "y", "plane", "x/z", "y/z", "angle", "wavelength", "signal",
        "place" (neighbours in a row) or "time"; None: they are only too many.
    chance : float
        Probability of it if they were slips.
    span : tuple of float, optional
        Ends along the coordinate, in m, degrees or nm; of "time" the readings in the order of the scan, from
        1.
    box_m : tuple of tuple of float, optional
        Ends in x, y and z of neighbours.
    rate : float
        Part of the readings that slips may spoil.
    """

    coordinate: str | None
    chance: float
    span: Span | None = None
    box_m: tuple[Span, Span, Span] | None = None
    rate: float = 0.0
