"""The verdict in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce

from lightfield.diagnosis.adequacy.structure import Structure
from lightfield.diagnosis.problem.layout import PLACE_DECIMALS
from lightfield.diagnosis.verdict.cautions.caution import not_confirmed
from lightfield.diagnosis.verdict.parts import (
    AcceptedExplanation,
    DetectionLimit,
    Doubt,
    DoubtReason,
    Misfit,
    NearestRival,
    Reason,
)
from lightfield.diagnosis.verdict.speech import Said, capital, in_unit, join, plain

#: Units of the coordinates that a misfit depends on, or that readings set aside share.
UNITS = {"x": "m", "y": "m", "plane": "m", "angle": "degrees", "time": "minutes", "wavelength": "nm"}
_CALLED = {"plane": "z", "angle": "the angle from the axis", "wavelength": "the wavelength"}
_NO_BEAM = "these readings do not look like a beam through water"
#: Explanations that the sentence names one by one.
_NAMED = 4
#: Errors within these factors of the stated ones are "as stated".
_AS_STATED = 0.8, 1.25


@dataclass(frozen=True)
class Grounds:
    """What a verdict rests on beside its explanations.

    Parameters
    ----------
    limits : mapping
        The smallest sizes that would have been seen, by effect.
    misfit : Misfit, optional
        What nothing explains.
    within : str
        "" or the tolerance that the statement needs.
    determined : bool
        There are more readings than the best explanation has parameters.
    noise : str
        What the detection limits rest on.
    follows_any : bool
        The explanation has a curve that would follow nearly any readings at these places.
    certain : tuple of str
        Effects of one explanation that are certain, whatever stands in for the others.
    instead : tuple of str
        What does as well in place of effects that every explanation has, a sentence for each.
    asked : tuple of str
        The only effects that were considered; empty: all that are known.
    """

    limits: Mapping[str, DetectionLimit] = field(default_factory=dict)
    misfit: Misfit | None = None
    within: str = ""
    determined: bool = True
    noise: str = ""
    follows_any: bool = False
    certain: tuple[str, ...] = ()
    instead: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()


def said(
    kind: str, explanations: Sequence[AcceptedExplanation], rival: NearestRival | None, on: Grounds
) -> Said:
    """One or two sentences that say what was found and how sure it is."""
    within = on.within
    if kind == "none":
        among = f" among those asked for{_listed(on.asked)}" if on.asked else ""
        seen = f"{capital(_seen(on.limits, on.noise))}."
        return Said.of(f"No missing effect{among} detectable{within}.", seen)
    if kind == "identified":
        names = explanations[0].effects
        families = list(dict.fromkeys(explanations[0].families))
        word = "family" if len(families) == 1 else "families"
        next_one = (
            f"; the next rival, {join(rival.effects)}, is {rival.separation_sigma:.1f} sigma away"
            if rival
            else ""
        )
        verb = "is" if len(names) == 1 else "are"
        kinds = f"{word}: {join(families)}"
        what = f"{capital(join(names))} {verb} missing in the model{within}"
        return Said(f"{what} ({kinds}){next_one}.", f"{what}.", (f"{capital(kinds)}{next_one}.",))
    if kind == "ambiguous":
        if len(explanations) == 1:
            doubt = "other sets do as well" if on.instead else "the evidence against chance is weak"
            if on.follows_any:
                doubt = "so would it nearly any readings at these places: it is a curve as free as they are"
            reasons = {e.reason for e in explanations[0].parameters.values()}
            if Reason.AT_BOUNDARY in reasons:
                doubt = "only with a parameter at the edge of what is plausible"
            elif not on.determined:
                doubt = "with as many parameters as there are readings anything can"
            elif reasons & {Reason.UNDETERMINED, Reason.TOO_WIDE}:
                doubt = "these readings do not determine its size"
            certain = [f"Certain: {join(on.certain)}."] if on.certain else []
            what = (
                f"Perhaps {join(explanations[0].effects)}{within}: it would explain the misfit, but {doubt}."
            )
            return Said.of(what, *certain, *on.instead)
        listed = " or ".join(join(e.effects) for e in explanations[:_NAMED])
        others = len(explanations) - _NAMED
        more = f" or one of {others} others" if others > 1 else " or one other" if others == 1 else ""
        if on.instead:
            more = " or others"
        what = f"{capital(listed)}{more}: these readings cannot tell"
        if rival is None:
            return Said.of(f"{what}{within}.", *on.instead)
        apart = f"the first lies {rival.separation_sigma:.1f} sigma from {join(rival.effects)}"
        first = Said(f"{what} ({apart}){within}.", f"{what}{within}.", (f"{capital(apart)}.",))
        return reduce(Said.then, on.instead, first)
    by = f"the effects asked for{_listed(on.asked)}" if on.asked else "any known effects"
    return Said.of(f"Unexplained by {by}; {unexplained_about(on.misfit)}.")


def not_asked(asked: Sequence[str]) -> str:
    """What to do where nothing explains the readings, and only some effects were asked for; "" for all."""
    return "Other effects were not considered; without --effects all that are known are." if asked else ""


def _listed(asked: Sequence[str]) -> str:
    """The effects asked for, where they are few."""
    return f" ({join(asked)})" if len(asked) <= _NAMED else ""


def unexplained_about(misfit: Misfit | None) -> str:
    """What is known of a misfit that nothing explains."""
    if misfit is None:
        return "it is not a function of one coordinate"
    if misfit.like is not None and misfit.period_deg is None:
        name, unit = misfit.coordinate, UNITS.get(misfit.coordinate, "")
        return f"it looks like a {plain(misfit.like)}, near {name} = {misfit.worst_at:.3g} {unit}".rstrip()
    return f"it depends on {misfit.coordinate} alone, {_largest(misfit)}"


def _largest(misfit: Misfit) -> str:
    """Where an unexplained misfit is largest."""
    if misfit.period_deg is not None:
        return f"with a period of {misfit.period_deg:.2g} degrees"
    return f"most near {misfit.worst_at:.3g} {UNITS.get(misfit.coordinate, '')}".rstrip()


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
    if why.reason is DoubtReason.PINNED:
        pinned = " and ".join(f"{path} = {value + 0.0:.3g}" for path, value in why.pinned.items())
        return f"{_NO_BEAM}: they ask for more than {pinned} allows, the edge of what is possible"
    if why.reason is DoubtReason.SET_ASIDE and why.structure is not None:
        effects = "none of the effects asked for" if asked else "no known effect"
        return f"readings that {effects} reaches are no slips: {_in_common(why.structure)}"
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


def _seen(limits: Mapping[str, DetectionLimit], noise: str) -> str:
    """The smallest effect that would have been seen, and at which noise."""
    first = [name for name in ("scattering", "background") if name in limits]
    for name in (*first, *limits):
        limit = limits[name]
        if limit.within_range:
            least = in_unit(f"{limit.value:.2g}", limit.unit)
            return f"{noise}{plain(name)} above {least} would have been seen"
    return f"{noise}no effect of plausible size would have been seen: these readings say nothing of any"


def at_noise(percent: float | None, errors_stated: bool, variance_scale: float) -> str:
    """The noise that detection limits rest on, as the beginning of a sentence."""
    if percent is None:
        return ""
    origin = "estimated from the scatter"
    if errors_stated:
        factor = variance_scale**0.5
        low, high = _AS_STATED
        origin = "as stated" if low < factor < high else f"{factor:.2g} times the stated one"
    return f"at a noise of {percent:.2g} % of a bright reading ({origin}), "
