"""The verdict in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lightfield.diagnosis.verdict.verdict import DetectionLimit, Explanation, NearestRival, NextMeasurement
from lightfield.fitting import effects


def _plain(name: str) -> str:
    return "CDOM" if name == "cdom" else name.replace("_", " ")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def join(names: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    words = [_plain(n) for n in names]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def sentence(
    kind: str,
    explanations: Sequence[Explanation],
    rival: NearestRival | None,
    limits: Mapping[str, DetectionLimit],
    coordinate: str | None,
    where: str,
    within: str,
    determined: bool,
) -> str:
    """One or two sentences that say what was found and how sure it is.

    Parameters
    ----------
    where : str
        Where an unexplained misfit is largest.
    within : str
        "" or the tolerance that the statement needs.
    determined : bool
        There are more readings than the best explanation has parameters.
    """
    if kind == "none":
        visible = [
            name for name in ("scattering", "background") if name in limits and limits[name].within_range
        ]
        seen = ""
        if visible:
            limit = limits[visible[0]]
            unit = "" if limit.unit == "1" else f" {limit.unit}"
            seen = f" {_sentence(_plain(visible[0]))} above {limit.value:.2g}{unit} would have been seen."
        return f"No missing effect detectable{within}.{seen}"
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
        kinds = f" ({word}: {join(families)})"
        return f"{_sentence(join(names))} {verb} missing in the model{within}{kinds}{next_one}."
    if kind == "ambiguous":
        if len(explanations) == 1:
            doubt = "the evidence against chance is weak"
            reasons = [e.reason or "" for e in explanations[0].parameters.values()]
            if "at boundary" in reasons:
                doubt = "only with a parameter at the edge of what is plausible"
            elif not determined:
                doubt = "with as many parameters as there are readings anything can"
            elif any(reason.startswith("undetermined") for reason in reasons):
                doubt = "these readings do not determine its size"
            return (
                f"Perhaps {join(explanations[0].effects)}{within}: it would explain the misfit, but {doubt}."
            )
        listed = " or ".join(join(e.effects) for e in explanations[:4])
        others = len(explanations) - 4
        more = f" or one of {others} others" if others > 1 else " or one other" if others == 1 else ""
        apart = ""
        if rival:
            apart = f" (the first lies {rival.separation_sigma:.1f} sigma from {join(rival.effects)})"
        return f"{listed[:1].upper()}{listed[1:]}{more}: these readings cannot tell{apart}{within}."
    about = (
        f"; it depends on {coordinate} alone, {where}"
        if coordinate
        else "; it is not a function of one coordinate"
    )
    return f"Unexplained by any one or two known effects{about}."


def other_kind(first: Sequence[str], second: Sequence[str]) -> str:
    """What to do when no further reading of the same kind parts two explanations."""
    different = [n for n in (*first, *second) if (n in first) != (n in second)]
    advice = " ".join(f"For {_plain(n)}: {effects.get(n).laboratory}" for n in different)
    return (
        f"No further reading of this kind separates {join(first)} from {join(second)}; "
        f"change the kind of measurement. {advice}"
    )


def next_reading(first: Sequence[str], second: Sequence[str], advice: NextMeasurement) -> str:
    """Advice with numbers."""
    spots = "; ".join(f"x = {s.x_m:.2f}, y = {s.y_m:.2f}, z = {s.z_m:.2f} m" for s in advice.readings)
    count = sum(s.repeats for s in advice.readings)
    return (
        f"{count} readings ({spots}) would part {join(first)} and {join(second)} by "
        f"{advice.separation_predicted_sigma:.1f} sigma (now {advice.separation_now_sigma:.1f})."
    )
