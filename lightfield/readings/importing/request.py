"""What the user has to say about instrument files because it is not in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lightfield.errors import MeasurementError, did_you_mean
from lightfield.readings import units
from lightfield.readings.columns import QUANTITIES
from lightfield.readings.importing import places
from lightfield.readings.instruments import plain
from lightfield.readings.problems import Problems

BandLimits = Sequence[tuple[float, float]]


def settle_request(
    quantity: str | None, unit: str | None, bands_nm: BandLimits, saturation_level: float | None
) -> str:
    """The canonical unit of the numbers in the files, when everything has been said and makes sense.

    Raises
    ------
    MeasurementError
        Something has not been said (all of it at once), or makes no sense.
    """
    needed = {
        "quantity": (quantity, f"what the instrument's head receives: {', '.join(QUANTITIES)}"),
        "units": (unit, f"unit of the numbers in the files: {units.CHOICES}"),
        "bands": (bands_nm, "from and to in nm, for example 500:550"),
    }
    missing = [f"{option}: {meaning}" for option, (given, meaning) in needed.items() if not given]
    if missing or not quantity or not unit:
        raise MeasurementError(
            f"not stated: {', '.join(option for option, (given, _) in needed.items() if not given)}",
            rule="what is not in the instrument's files is asked for, never guessed",
            remedy="; ".join(missing),
        )
    if quantity not in QUANTITIES:
        raise MeasurementError(
            "unknown quantity", found=quantity, rule=", ".join(QUANTITIES), remedy="correct the quantity"
        )
    try:
        found = units.canonical(unit)
        if units.is_absolute(found):
            units.to_si(found, quantity)
    except ValueError as error:
        raise MeasurementError(f"unusable unit: {error}", found=unit, remedy="correct the unit") from error
    for low, high in bands_nm:
        if not 0 < low < high < float("inf"):
            raise MeasurementError(
                "impossible band",
                found=f"{low:g}:{high:g}",
                rule="0 < low < high, nm",
                remedy="correct the band",
            )
    if len({low + high for low, high in bands_nm}) < len(bands_nm):
        raise MeasurementError("two bands have the same centre", remedy="import them into two tables")
    if saturation_level is not None and not 0 < saturation_level < float("inf"):
        raise MeasurementError(
            "impossible saturation level",
            found=saturation_level,
            rule="> 0",
            remedy="correct the saturation level",
        )
    return found


def has_places(columns: Mapping[str, str] | None) -> bool:
    """Are these columns of a table of one's own, which has the places in it?"""
    return columns is not None and "z_m" in columns


def check_meanings(columns: Mapping[str, str], problems: Problems) -> None:
    """What columns are said to be must be known; what is not goes to `problems`."""
    known = places.MEANINGS if has_places(columns) else plain.MEANINGS
    for meaning in columns:
        if meaning in known:
            continue
        remedy = did_you_mean(meaning.lower(), known) or "correct what stands before the ="
        if meaning in places.MEANINGS:
            remedy = "say too which column is z_m, if the places are in the table"
        problems.add("unknown meaning of a column", found=meaning, rule=", ".join(known), remedy=remedy)
