"""The verdict in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lightfield.diagnosis.verdict.verdict import (
    DetectionLimit,
    Explanation,
    NearestRival,
    NextMeasurement,
    Reason,
)
from lightfield.fitting import effects


@dataclass(frozen=True)
class Said:
    """What a verdict says.

    Parameters
    ----------
    sentence : str
        All of it.
    headline : str
        What was found, to be read from across the room.
    support : tuple of str
        How sure that is, and what took no part: sentences that stand below the headline.
    """

    sentence: str
    headline: str
    support: tuple[str, ...] = ()

    @classmethod
    def of(cls, headline: str, *support: str) -> Said:
        """Sentences of which the first is the headline."""
        return cls(" ".join((headline, *support)), headline, support)

    def after(self, first: str) -> Said:
        """The same below another finding."""
        return Said(f"{first} {self.sentence}", f"{first} {self.headline}", self.support)

    def then(self, more: str) -> Said:
        """The same with one more support, unless that is empty."""
        return Said(f"{self.sentence} {more}", self.headline, (*self.support, more)) if more else self

    @property
    def fields(self) -> dict[str, Any]:
        """As fields of the verdict."""
        return {"sentence": self.sentence, "headline": self.headline, "support": list(self.support)}


def _plain(name: str) -> str:
    return "CDOM" if name == "cdom" else name.replace("_", " ")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def join(names: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    words = [_plain(n) for n in names]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def said(
    kind: str,
    explanations: Sequence[Explanation],
    rival: NearestRival | None,
    limits: Mapping[str, DetectionLimit],
    coordinate: str | None,
    where: str,
    within: str,
    determined: bool,
    noise: str = "",
) -> Said:
    """One or two sentences that say what was found and how sure it is.

    Parameters
    ----------
    where : str
        Where an unexplained misfit is largest.
    within : str
        "" or the tolerance that the statement needs.
    determined : bool
        There are more readings than the best explanation has parameters.
    noise : str
        What the detection limits rest on.
    """
    if kind == "none":
        return Said.of(f"No missing effect detectable{within}.", f"{_sentence(_seen(limits, noise))}.")
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
        what = f"{_sentence(join(names))} {verb} missing in the model{within}"
        return Said(f"{what} ({kinds}){next_one}.", f"{what}.", (f"{_sentence(kinds)}{next_one}.",))
    if kind == "ambiguous":
        if len(explanations) == 1:
            doubt = "the evidence against chance is weak"
            reasons = {e.reason for e in explanations[0].parameters.values()}
            if Reason.AT_BOUNDARY in reasons:
                doubt = "only with a parameter at the edge of what is plausible"
            elif not determined:
                doubt = "with as many parameters as there are readings anything can"
            elif reasons & {Reason.UNDETERMINED, Reason.TOO_WIDE}:
                doubt = "these readings do not determine its size"
            return Said.of(
                f"Perhaps {join(explanations[0].effects)}{within}: it would explain the misfit, but {doubt}."
            )
        listed = " or ".join(join(e.effects) for e in explanations[:4])
        others = len(explanations) - 4
        more = f" or one of {others} others" if others > 1 else " or one other" if others == 1 else ""
        what = f"{_sentence(listed)}{more}: these readings cannot tell"
        if rival is None:
            return Said.of(f"{what}{within}.")
        apart = f"the first lies {rival.separation_sigma:.1f} sigma from {join(rival.effects)}"
        return Said(f"{what} ({apart}){within}.", f"{what}{within}.", (f"{_sentence(apart)}.",))
    about = (
        f"; it depends on {coordinate} alone, {where}"
        if coordinate
        else "; it is not a function of one coordinate"
    )
    return Said.of(f"Unexplained by any one or two known effects{about}.")


def _seen(limits: Mapping[str, DetectionLimit], noise: str) -> str:
    """The smallest effect that would have been seen, and at which noise."""
    first = [name for name in ("scattering", "background") if name in limits]
    for name in (*first, *limits):
        limit = limits[name]
        if limit.within_range:
            unit = "" if limit.unit == "1" else f" {limit.unit}"
            return f"{noise}{_plain(name)} above {limit.value:.2g}{unit} would have been seen"
    return f"{noise}no effect of plausible size would have been seen: these readings say nothing of any"


def at_noise(percent: float | None, errors_stated: bool, variance_scale: float) -> str:
    """The noise that detection limits rest on, as the beginning of a sentence."""
    if percent is None:
        return ""
    origin = "estimated from the scatter"
    if errors_stated:
        factor = variance_scale**0.5
        origin = "as stated" if 0.8 < factor < 1.25 else f"{factor:.2g} times the stated one"
    return f"at a noise of {percent:.2g} % of a bright reading ({origin}), "


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
