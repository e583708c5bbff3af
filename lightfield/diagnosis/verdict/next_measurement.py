"""What to measure next, as data; its words are made here, from the data alone."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from pydantic import Field, computed_field

from lightfield.diagnosis.verdict.parts import Kind, Misfit, PlaceToRead, Record, SetAside
from lightfield.diagnosis.verdict.speech import join, place
from lightfield.wording import plain

#: So often a reading that was set aside is to be repeated. Chosen: once could be another slip.
REPEATS = 3
#: And one whose scatter is to be told. Chosen: the error of an error from ten is a quarter of it.
_IN_A_ROW = 10


class Asks(str, Enum):
    """What is to be done."""

    PART = "part two explanations"
    OTHER_KIND = "another kind of measurement"
    REPEAT = "repeat where the misfit is largest"
    REFERENCE = "repeat one position in time"
    LOOK = "look what stands in the light"
    IN_A_ROW = "repeat one position in a row"


class NextMeasurement(Record):
    """What to measure next, and what it would decide."""

    asks: Asks
    between: list[list[str]] = Field(
        default_factory=list, description="the two explanations it would separate"
    )
    readings: list[PlaceToRead] = Field(default_factory=list)
    wavelength_nm: float | None = Field(default=None, description="of several bands the one it is judged in")
    time_s: float | None = Field(
        default=None, description="the moment it is judged at, that of the last reading; none without times"
    )
    separation_now_sigma: float | None = None
    separation_predicted_sigma: float | None = None
    above_model: bool | None = Field(
        default=None,
        description="of readings set aside: all lie above the model, or all below; null: some and some",
    )
    laboratory: dict[str, str] = Field(
        default_factory=dict, description="where no reading parts them: a check of each effect of one alone"
    )

    @computed_field(description="the same in words")
    @property
    def sentence(self) -> str:
        return _WORDS[self.asks](self)


def repeat(spot: PlaceToRead, misfit: Misfit | None) -> NextMeasurement:
    """What to do about a misfit that nothing explains.

    Parameters
    ----------
    spot : PlaceToRead
        Where it is largest.
    """
    in_time = misfit is not None and misfit.coordinate == "time"
    return NextMeasurement(asks=Asks.REFERENCE if in_time else Asks.REPEAT, readings=[spot])


def look(aside: Sequence[SetAside]) -> NextMeasurement:
    """What to do about readings set aside that are no slips, the farthest first."""
    one = aside[0]
    spot = PlaceToRead(x_m=one.x_m, y_m=one.y_m, z_m=one.z_m, medium=one.medium, repeats=REPEATS)
    sides = {each.off_sigma > 0 for each in aside if each.off_sigma is not None}
    return NextMeasurement(
        asks=Asks.LOOK, readings=[spot], above_model=sides.pop() if len(sides) == 1 else None
    )


def in_a_row(spot: PlaceToRead) -> NextMeasurement:
    """What to do about readings that scatter more than their errors say, and as no effect would.

    Parameters
    ----------
    spot : PlaceToRead
        A bright one.
    """
    again = spot.model_copy(update={"repeats": _IN_A_ROW})
    return NextMeasurement(asks=Asks.IN_A_ROW, readings=[again])


def what_next(verdict: Kind, asked: NextMeasurement | None) -> str:
    """What to measure next in words, and why nothing is named where nothing is."""
    if asked is not None:
        return asked.sentence
    return _UNASKED.get(verdict, "No further reading is asked for.")


def _where(spot: PlaceToRead) -> str:
    return f"x = {spot.x_m:.2f}, y = {spot.y_m:.2f}, z = {spot.z_m:.2f} m"


def _part(asked: NextMeasurement) -> str:
    spots = "; ".join(_where(spot) for spot in asked.readings)
    count = sum(spot.repeats for spot in asked.readings)
    first, second = asked.between
    at = "" if asked.wavelength_nm is None else f" at {asked.wavelength_nm:g} nm"
    at += "" if asked.time_s is None else ", right after the last one"
    return (
        f"{count} readings{at} ({spots}) would part {join(first)} and {join(second)} by "
        f"{asked.separation_predicted_sigma:.1f} sigma (now {asked.separation_now_sigma:.1f})."
    )


def _other_kind(asked: NextMeasurement) -> str:
    first, second = asked.between
    when = "" if asked.time_s is None else ", right after the last one,"
    advice = " ".join(f"For {plain(name)}: {check}" for name, check in asked.laboratory.items())
    return (
        f"No further reading of this kind{when} separates {join(first)} from {join(second)}; "
        f"change the kind of measurement. {advice}"
    )


def _repeat(asked: NextMeasurement) -> str:
    return (
        f"Repeat readings where the misfit is largest ({_where(asked.readings[0])}) at another time: what "
        "repeats is a structure, what does not is noise."
    )


def _reference(asked: NextMeasurement) -> str:
    return "Repeat one reference position every few minutes: the misfit follows the time, not the place."


def _look(asked: NextMeasurement) -> str:
    return (
        f"Look for {_SUSPECTS[asked.above_model]}, and repeat them (the farthest at "
        f"{place(asked.readings[0])}): what repeats is a structure of the light, what does not is a slip."
    )


def _in_a_row(asked: NextMeasurement) -> str:
    spot = asked.readings[0]
    return (
        f"Read one bright place ({_where(spot)}) {spot.repeats} times in a row, and as often with the "
        "detector moved away and back each time: what the first scatter by is the lamp's and the detector's, "
        "what the others scatter by is the error of a reading, and belongs into stderr."
    )


#: What is to be looked for where readings set aside lie above the model, or below it, or on both sides.
_SUSPECTS = {
    True: "what sends or mirrors light to the readings set aside, or for a bright spot of the lamp in their "
    "direction",
    False: "what stands between the lamp and the readings set aside",
    None: "what shades the readings set aside, or sends more light there",
}
#: Where no answer is sure, and yet no reading is named.
_UNASKED: dict[Kind, str] = {
    Kind.AMBIGUOUS: "No reading is named that would tell for sure: that is worked out where two whole "
    "explanations stand against each other. A plan says what other places could tell apart.",
    Kind.UNEXPLAINED: "No reading is named before what is said above is cleared up.",
}
_WORDS = {
    Asks.PART: _part,
    Asks.OTHER_KIND: _other_kind,
    Asks.REPEAT: _repeat,
    Asks.REFERENCE: _reference,
    Asks.LOOK: _look,
    Asks.IN_A_ROW: _in_a_row,
}
