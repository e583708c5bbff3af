"""Why is nothing named or ruled out?"""

from __future__ import annotations

from collections.abc import Sequence

from lightfield.diagnosis.adequacy.structure import Structure
from lightfield.diagnosis.verdict.cautions.caution import not_confirmed
from lightfield.diagnosis.verdict.parts import Doubt, DoubtReason
from lightfield.diagnosis.verdict.speech import UNITS, join
from lightfield.readings.columns import PLACE_DECIMALS

_CALLED = {"plane": "z", "angle": "the angle from the axis", "wavelength": "the wavelength"}
_NO_BEAM = "these readings do not look like a beam through water"


def doubt(why: Doubt, asked: Sequence[str] = ()) -> str:
    """Why nothing is named or ruled out, as the verdict says it.

    Parameters
    ----------
    asked : sequence of str
        The only effects that were considered; empty: all that are known.
    """
    if why.reason is DoubtReason.NOTHING_BRIGHT:
        return f"{_NO_BEAM}: no bright one is left"
    if why.reason is DoubtReason.NOISE:
        return (
            f"the noise is {why.noise_percent:.0f} % of a typical bright reading, too much to name an effect "
            "or to rule one out; these may be no readings of a beam through water"
        )
    if why.reason is DoubtReason.COARSE:
        return (
            f"these readings come in steps, and rounding alone moves a typical bright one by "
            f"{why.noise_percent:.0f} %: too much to name an effect or to rule one out"
        )
    if why.reason is DoubtReason.FLAT:
        return f"{_NO_BEAM}: they do not change from place to place, where the lamp's light does"
    if why.reason is DoubtReason.NO_BETTER:
        return f"{_NO_BEAM}: one and the same value everywhere tells them as well as the model does"
    if why.reason is DoubtReason.SCATTER:
        return (
            f"the readings scatter {why.times:.1f} times as much as their errors say, as no effect would: "
            "the errors are too small, or something changes from one reading to the next"
        )
    if why.reason is DoubtReason.PINNED:
        pinned = " and ".join(f"{path} = {value + 0.0:.3g}" for path, value in why.pinned.items())
        return f"{_NO_BEAM}: they ask for more than {pinned} allows, the edge of what is possible"
    if why.reason is DoubtReason.SET_ASIDE and why.structure is not None:
        effects = "none of the effects asked for" if asked else "no known effect"
        return f"some readings fit {effects}, and are no slips: {_in_common(why.structure)}"
    named = join(why.named) if why.named else "the base model"
    return f"{named} would explain the readings, but {not_confirmed(why)}"


def _in_common(found: Structure) -> str:
    """What readings set aside have in common."""
    if found.box_m is not None:
        ends = (_ends(*(round(end, PLACE_DECIMALS) + 0.0 for end in span)) for span in found.box_m)
        where = ", ".join(f"{axis} = {span}" for axis, span in zip("xyz", ends, strict=True))
        return f"they lie together at neighbouring places, {where} m"
    if found.span is None:
        return f"there are more of them than the {100 * found.rate:g} % that slips explain"
    if found.coordinate == "signal":
        return "they lie together among readings of equal size"
    if found.coordinate == "time":
        first, last = found.span
        return f"they lie together in the scan, readings {first:.0f} to {last:.0f}"
    name = str(found.coordinate)
    where = f"where {_CALLED.get(name, name)} is {_ends(*found.span)} {UNITS.get(name, '')}".rstrip()
    return f"they lie together {where}"


def _ends(low: float, high: float) -> str:
    """ "0.1 to 0.2", or "0.1" where that is all."""
    first, last = f"{low:.3g}", f"{high:.3g}"
    return first if first == last else f"{first} to {last}"
