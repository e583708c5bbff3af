"""The effects of the best set in words: what is certain, what is the simplest, what is one of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from lightfield.diagnosis.verdict.parts import Estimate, FoundEffect, Kind, Misfit, Rung, Unnamed
from lightfield.diagnosis.verdict.speech import Said, capital, exactly, join, roughly
from lightfield.diagnosis.verdict.words import unexplained_about

#: Effects from which on the verdict is told by what is known of each.
MANY: Final = 3
#: Part of the misfit, in per cent, that a set removes before it is spoken of.
_SPOKEN = 50.0
#: What may replace an effect, of which so many are told.
_TOLD = 3


def level(one: FoundEffect) -> str:
    """How sure an effect is, with what else would do."""
    if one.level == "certain":
        return "certain"
    if one.level == "partial":
        return "certain as far as the unexplained rest allows"
    others = instead(one)
    if one.level == "simplest":
        return f"simplest; {others} would do as well" if others else "simplest"
    if others:
        return f"one of: this, or {others}"
    if follows_any(one):
        return "not sure: so free a curve would follow nearly any readings at these places"
    return "not sure"


def follows_any(one: FoundEffect) -> bool:
    """Is it a curve that nothing replaces, and that is not sure all the same?"""
    return one.level == "one of" and one.hardly_tested and not one.alternatives


def instead(one: FoundEffect) -> str:
    """What would do in place of an effect; "" for nothing."""
    told = [_with(names) for names in one.alternatives[:_TOLD]]
    return " or ".join(told)


def told_of_shared(
    found: Sequence[FoundEffect], explanations: Sequence[Sequence[str]]
) -> tuple[list[str], list[str]]:
    """Of effects that all explanations name: which are certain, and what else does as well, in sentences."""
    shared = [one for one in found if all(one.effect in names for names in explanations)]
    certain = [one.effect for one in shared if one.level == "certain"]
    open_ = [one for one in shared if one.level == "one of" and one.alternatives]
    return certain, [f"Instead of {join([o.effect])}: {instead(o)}." for o in open_]


def _with(names: Sequence[str]) -> str:
    return join(names) if len(names) < 2 else " with ".join(join([n]) for n in names)


def effect_size(one: FoundEffect) -> str:
    """The parameters of an effect with their errors; of a curve how far it departs."""
    if one.rms_percent is not None:
        return f"a curve of {len(one.parameters)} functions, {one.rms_percent:.2g} % rms of the readings"
    return ", ".join(f"{path.rpartition('.')[2]} = {exactly(e)}" for path, e in one.parameters.items())


def said_of_many(
    kind: Kind, found: Sequence[FoundEffect], ladder: Sequence[Rung], misfit: Misfit | None
) -> Said | None:
    """The verdict on three effects and more, or on an unexplained best set; None where others have the word.

    Parameters
    ----------
    found : sequence of FoundEffect
        Effects of the best set.
    ladder : sequence of Rung
        That climbs to it.
    """
    if kind == "unexplained":
        return _unexplained(found, ladder, misfit)
    if len(found) < MANY or kind == "none":
        return None
    sure = [one.effect for one in found if one.level in ("certain", "simplest")]
    open_ = [one for one in found if one.level == "one of"]
    support = [f"{capital(join([o.effect]))}: {level(o)}." for o in found if o.level == "simplest"]
    certain = [one.effect for one in found if one.level == "certain"]
    if certain:
        support.insert(0, f"Certain: {join(certain)}.")
    if not open_:
        return Said.of(f"{capital(join(sure))} are missing in the model.", *support)
    slots = "; ".join(_slot(one) for one in open_)
    if not sure:
        return Said.of(f"Several effects are missing in the model: {slots}.")
    verb = "is" if len(sure) == 1 else "are"
    return Said.of(f"{capital(join(sure))} {verb} missing in the model; also {slots}.", *support)


def _slot(one: FoundEffect) -> str:
    others = instead(one)
    return f"{join([one.effect])} or {others}" if others else f"perhaps {join([one.effect])}"


def _unexplained(found: Sequence[FoundEffect], ladder: Sequence[Rung], misfit: Misfit | None) -> Said | None:
    told = so_far(found, ladder)
    return Said.of(f"Unexplained in part: {unexplained_about(misfit)}.", *told) if told else None


def so_far(found: Sequence[FoundEffect], ladder: Sequence[Rung], misfit: str = "") -> tuple[str, ...]:
    """What a best set explains that leaves something, and what is certain of it; nothing of less than half of
    the misfit.

    Parameters
    ----------
    misfit : str
        Of what, where not of all readings: " of the others".
    """
    removed = sum(rung.removed_percent or 0.0 for rung in ladder)
    if not found or removed < _SPOKEN:
        return ()
    certain = [one.effect for one in found if one.level == "partial"]
    names = [one.effect for one in found]
    verb = "removes" if len(names) == 1 else "remove"
    what = f"{capital(join(names))} {verb} {removed:.3g} % of the misfit{misfit}"
    known = f"Certain so far: {join(certain)}." if certain else "None of these is certain so far."
    return f"{what}.", known


def found_lines(found: Sequence[FoundEffect]) -> list[str]:
    """A table for a terminal."""
    if not found:
        return []
    out = ["", f"{'effect':<18}{'sigma':>8}{'gap':>9}{'weight':>8}  level; size"]
    for one in found:
        sigma = "-" if one.sigma_to_remove is None else f"{one.sigma_to_remove:.1f}"
        gap = "-" if one.gap is None else f"{one.gap:.1f}"
        about = f"{level(one)}; {effect_size(one)}"
        out.append(f"{one.effect:<18}{sigma:>8}{gap:>9}{one.weight:>8.2f}  {about}")
    return [*out, *_changes(found)]


def _changes(found: Sequence[FoundEffect]) -> list[str]:
    """What water and beam would be without each."""
    first = found[0].with_it
    out = [f"with all: a = {first.absorption_per_m:.4g}, b = {first.scattering_per_m:.4g}, "
           f"K = {first.attenuation_per_m:.4g} 1/m, hwhm = {first.hwhm_deg:.4g} degrees"]  # fmt: skip
    for one in found:
        if (less := one.without_it) is not None:
            out.append(
                f"without {join([one.effect])}: a = {less.absorption_per_m:.4g}, "
                f"b = {less.scattering_per_m:.4g}, K = {less.attenuation_per_m:.4g} 1/m, "
                f"hwhm = {less.hwhm_deg:.4g} degrees"
            )
    return out


def unnamed_sentences(told: Sequence[Unnamed], values: Mapping[str, Estimate]) -> list[str]:
    """What effects that are too small to be named would change, a sentence for each.

    Parameters
    ----------
    values : mapping
        Parameters of the best set by path, as stated.
    """
    out = []
    for one in told:
        if one.in_errors:
            there = ", ".join(f"{path} = {roughly(e)}" for path, e in one.with_it.items())
            out.append(
                f"{join([one.effect])} is hardly told from what was found here, and every water has some: "
                f"with it {there}; the stated errors reach there"
            )
            continue
        changes = [
            f"{path} from {values[path].value:.3g} to {roughly(e)}"
            for path, e in one.with_it.items()
            if path in values
        ]
        if changes:
            out.append(
                f"{join([one.effect])} is too small to be named ({one.sigma:.1f} sigma), but if it is there "
                f"it changes {', '.join(changes)}: more than the stated errors say"
            )
    return out
