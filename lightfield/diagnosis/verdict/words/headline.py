"""What does the verdict say? What was found, and how sure that is, by its kind."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Final

from lightfield.diagnosis.certainty import CONVINCING, Certainty
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.diagnosis.verdict.parts import (
    AcceptedExplanation,
    Doubt,
    DoubtReason,
    FoundEffect,
    Kind,
    NearestRival,
    Reason,
)
from lightfield.diagnosis.verdict.speech import Said, in_unit, join
from lightfield.diagnosis.verdict.verdict_data import VerdictData
from lightfield.diagnosis.verdict.words import aside, rest, stated
from lightfield.diagnosis.verdict.words.doubt import doubt
from lightfield.diagnosis.verdict.words.effects import (
    as_well,
    follows_any,
    has_no_equal,
    has_only_courses,
    in_company,
    instead,
    level,
    shared,
    so_far,
)
from lightfield.fitting.effects.free_form import BEAM_PROFILE
from lightfield.wording import capital, plain

#: Effects from which on the verdict is told by what is known of each. Derived: for fewer there are words.
_MANY: Final = 3
#: Explanations, or effects asked for, that the sentence names one by one. Chosen: words alone.
_NAMED = 4
#: Explanations of less weight are not spoken of in it, but for two. Chosen: words alone.
_SPOKEN_OF = 0.01
#: Why a size is not known.
_NO_SIZE: Final = {Reason.UNDETERMINED, Reason.TOO_WIDE}
#: Errors within these factors of the stated ones are "as stated". Chosen: words alone.
_AS_STATED = 0.8, 1.25


def words_of(v: VerdictData) -> Said:
    """Headline and what supports it."""
    why, open_ = v.reason_to_doubt, v.verdict == Kind.UNEXPLAINED
    told = _found(v) if why is None else _doubted(v, why)
    if why is None and open_:
        told = told.then(rest.sentences(v.left_over, v.misfit))
    if open_ and v.asked and (why is None or why.reason is DoubtReason.SET_ASIDE):
        told = told.then("Other effects were not considered; where none is chosen, all that are known are.")
    if (lamp := next((c for c in v.cautions if c.warns is Warns.ANOTHER_LAMP), None)) is not None:
        with_curve = any(BEAM_PROFILE in one.effects for one in v.explanations[:1])
        is_there = "" if with_curve else f", a Gaussian of {lamp.values['width_deg']:.3g} degrees is"
        told = told.after(f"The beam of your scene's table is not in the readings{is_there}.")
    return told.then(aside.sentence(v.set_aside, v.readings, v.several_wavelengths))


def _doubted(v: VerdictData, why: Doubt) -> Said:
    """Why there is no answer; beside readings that are beyond all effects, what is known of the others."""
    others = " of the others" if why.reason is DoubtReason.SET_ASIDE else ""
    known = so_far(v.found, v.ladder, others) if why.leaves_names else ()
    told = Said.of(f"Unexplained{' in part' if known else ''}: {doubt(why, v.asked)}.", *known)
    if why.reason is not DoubtReason.SCATTER:
        return told
    told = told if v.found else told.then("In errors as large as that no effect is missing.")
    return told.then(rest.sentences((), None))


def _found(v: VerdictData) -> Said:
    """What was found, where nothing speaks against believing it; first what it says against the scene."""
    against = stated.against(v.stated)
    told, rival = stated.beside_scene(v)
    if not against:
        return _of_kind(v, told, rival)
    refuted = capital("; ".join(against.values())) + "."
    if v.verdict == Kind.IDENTIFIED:
        one = v.explanations[0]
        left = [(e, f) for e, f in zip(one.effects, one.families, strict=True) if e not in against]
        if not left:
            return Said.of(refuted, *(f"{capital(text)}." for text in _near(v, rival)))
        told = [one.model_copy(update={"effects": [e for e, _ in left], "families": [f for _, f in left]})]
    return _of_kind(v, told, rival).after(refuted)


def _of_kind(v: VerdictData, told: Sequence[AcceptedExplanation], rival: NearestRival | None) -> Said:
    """What was found, in a sentence or two.

    Parameters
    ----------
    told : sequence of AcceptedExplanation
        The explanations with their effects as they are to be called.
    """
    if v.verdict == Kind.UNEXPLAINED:
        return _unexplained(v)
    if v.verdict == Kind.NONE:
        return _none(v)
    if len(v.found) >= _MANY:
        return _many(v, [one for one in v.found if one.effect not in stated.against(v.stated)])
    if v.verdict == Kind.IDENTIFIED:
        return _identified(v, told[0], rival)
    alone = len(told) == 1 or told[0].weight > CONVINCING
    return _perhaps(v, told[0]) if alone else _one_of(v, told, rival)


def _none(v: VerdictData) -> Said:
    among = f" among those asked for{_listed(v.asked)}" if v.asked else ""
    aside = f"; smooth misfits up to {v.tolerance_percent:g} % count as none" if v.within_tolerance else ""
    what = f"No missing effect{among} detectable{_on_trust(v)}{aside}."
    return Said.of(what, f"{capital(_seen(v))}.")


def _identified(v: VerdictData, one: AcceptedExplanation, rival: NearestRival | None) -> Said:
    families = list(dict.fromkeys(one.families))
    kinds = f"{'family' if len(families) == 1 else 'families'}: {join(families)}"
    near = "".join(f"; {text}" for text in _near(v, rival))
    what = f"{_missing(one.effects)}{_within(v)}"
    return Said(f"{what} ({kinds}){near}.", f"{what}.", (f"{capital(kinds)}{near}.",))


def _perhaps(v: VerdictData, one: AcceptedExplanation) -> Said:
    """The only explanation, and why it is not sure."""
    certain, others = shared(v.found, [one])
    reasons, several = {e.reason for e in one.parameters.values()}, len(one.effects) > 1
    if Reason.AT_BOUNDARY in reasons:
        but = "only with a parameter at the edge of what is plausible"
    elif not v.determined:
        but = "with as many parameters as there are readings anything can"
    elif reasons & _NO_SIZE:
        but = f"these readings do not determine {'all their sizes' if several else 'its size'}"
    elif any(map(follows_any, v.found)):
        but = "so would it nearly any readings at these places: it is a curve as free as they are"
    elif others:
        but = "other sets do as well"
    else:
        but = "the evidence against chance is weak"
    would = f"{'they' if several else 'it'} would explain the misfit"
    what = f"Perhaps {join(one.effects)}{_within(v)}: {would}, but {but}."
    known = [f"Certain: {join(certain)}."] if certain else []
    if {*certain} == {*one.effects}:  # a name that is in doubt by its sizes is not called certain beside it
        known = [f"That {'effects like these act' if several else 'an effect like it acts'} is certain."]
    return Said.of(what, *known, *others)


def _one_of(v: VerdictData, told: Sequence[AcceptedExplanation], rival: NearestRival | None) -> Said:
    """Explanations that cannot be told apart."""
    _, others = shared(v.found, v.explanations)
    told = [one for k, one in enumerate(told) if k < 2 or one.weight >= _SPOKEN_OF]
    rest_of = len(told) - _NAMED
    more = "or one of {rest_of} others" if rest_of > 1 else "or one other" if rest_of == 1 else ""
    more = "or others" if others else more.format(rest_of=rest_of)
    what = f"{capital(_either([one.effects for one in told[:_NAMED]], more))}: these readings cannot tell"
    if rival is None:
        return Said.of(f"{what}{_within(v)}.", *others)
    first, far = told[0].effects, f"{rival.separation_sigma:.1f} sigma from"
    if {*rival.effects} in [{*one.effects} for one in v.explanations]:
        apart = f"{join(first)} {'lies' if len(first) == 1 else 'lie'} {far} {join(rival.effects)}"
    else:
        apart = f"what comes next, {join(rival.effects)}, lies {far} {join(first)}"
    said = Said(f"{what} ({apart}){_within(v)}.", f"{what}{_within(v)}.", (f"{capital(apart)}.",))
    return reduce(Said.then, others, said)


def _either(sets: Sequence[Sequence[str]], more: str) -> str:
    """Sets of effects of which one is there; what they share is said once.

    Parameters
    ----------
    more : str
        What follows them, or nothing.
    """
    common = [name for name in sets[0] if all(name in names for names in sets)]
    own = [[name for name in names if name not in common] for names in sets]
    if common and all(own):
        each = " or ".join(map(in_company, own))
        return f"{join(common)}, and {each} {more}".rstrip()
    if all(len(names) == 1 for names in sets):
        return f"{' or '.join(map(join, sets))} {more}".rstrip()
    return "; ".join([join(sets[0]), *(f"or {join(names)}" for names in sets[1:]), *([more] if more else [])])


def _many(v: VerdictData, found: Sequence[FoundEffect]) -> Said:
    """The effects of the best set that are missing in the model, each by what is known of it."""
    sure = [one.effect for one in found if one.level.is_claimed]
    certain = [one.effect for one in found if one.level == Certainty.CERTAIN]
    whole = f"{'Both' if len(found) == 2 else 'All'} of them are certain."
    support = [whole if len(certain) == len(found) > 1 else f"Certain: {join(certain)}."] if certain else []
    support += [f"{capital(plain(o.effect))}: {level(o)}." for o in found if o.level == Certainty.SIMPLEST]
    missing = f"{_missing(sure)}{_on_trust(v)}" if sure else ""
    slots = "; ".join(map(_slot, _in_slots([one for one in found if one.level == Certainty.ONE_OF])))
    if not slots:
        if but := _unsure(found) if v.verdict == Kind.AMBIGUOUS else None:
            what = f"Perhaps {join(sure)}: they would explain the misfit, but {but}."
            return Said.of(what, *support)
        return Said.of(f"{missing}." if missing else "Nothing else is missing in the model.", *support)
    if not sure:
        return Said.of(f"Several effects are missing in the model: {slots}.")
    return Said.of(f"{missing}; also {slots}.", *support)


def _unsure(found: Sequence[FoundEffect]) -> str | None:
    """Why effects without others in their place are no answer: their sizes."""
    vague = [o.effect for o in found if {e.reason for e in o.parameters.values()} & _NO_SIZE]
    ends = [o.effect for o in found if Reason.AT_BOUNDARY in {e.reason for e in o.parameters.values()}]
    if ends:
        return f"only with {join(ends)} at the edge of what is plausible"
    return f"these readings do not determine the size of {join(vague)}" if vague else None


def _in_slots(found: Sequence[FoundEffect]) -> list[list[FoundEffect]]:
    """Effects that are one of several, those together that the same curves have all at once."""
    slots: dict[str, list[FoundEffect]] = {}
    for one in found:
        slots.setdefault(instead(one) if has_only_courses(one) else one.effect, []).append(one)
    return list(slots.values())


def _slot(ones: Sequence[FoundEffect]) -> str:
    one, *more = ones
    if more:
        return f"{join([o.effect for o in ones])}, or {instead(one, 'them')}"
    if others := instead(one):
        return f"{plain(one.effect)} or {others}"
    if Reason.AT_BOUNDARY in {e.reason for e in one.parameters.values()}:
        return f"{plain(one.effect)}, but only at the edge of what is plausible"
    return f"perhaps {plain(one.effect)}"


def _unexplained(v: VerdictData) -> Said:
    about = rest.about(v.misfit)
    if known := so_far(v.found, v.ladder):
        return Said.of(f"Unexplained in part: {about}.", *known)
    by = f"the effects asked for{_listed(v.asked)}" if v.asked else "any known effects"
    return Said.of(f"Unexplained by {by}; {about}.")


def _missing(names: Sequence[str]) -> str:
    return f"{capital(join(names))} {'is' if len(names) == 1 else 'are'} missing in the model"


def _near(v: VerdictData, rival: NearestRival | None) -> list[str]:
    """What would do as well as what was found, and how far the next rival is that has none of it."""
    others = as_well(v.found)
    told = [others] if others else []
    if rival is not None and has_no_equal(v.found, rival):
        far = f"{join(rival.effects)}, is {rival.separation_sigma:.1f} sigma away"
        told.append(f"the next rival{' with none of these' if others else ''}, {far}")
    return told


def _within(v: VerdictData) -> str:
    """The tolerance that the statement needs, and the errors that it rests on."""
    within = f" within {v.tolerance_percent:g} %" if v.within_tolerance else ""
    return f"{within}{_on_trust(v)}"


def _on_trust(v: VerdictData) -> str:
    """The errors that a statement rests on, where they are not those of the table, or nothing tells them."""
    if v.errors_on_trust:
        return " with the errors taken on trust"
    larger = (c.values["times"] for c in v.cautions if c.warns is Warns.SCATTER_MORE)
    return next((f" if the errors are {times:.2g} times as large as stated" for times in larger), "")


def _listed(asked: Sequence[str]) -> str:
    """The effects asked for, where they are few."""
    return f" ({join(asked)})" if len(asked) <= _NAMED else ""


def _seen(v: VerdictData) -> str:
    """The smallest effect that would have been seen, of those that the scene has not, and at which noise."""
    own = {entry.effect for entry in v.stated}
    limits = {name: limit for name, limit in v.detection_limits.items() if name not in own}
    first = [name for name in ("scattering", "background") if name in limits]
    for name in (*first, *limits):
        if (limit := limits[name]).within_range:
            least = in_unit(f"{limit.value:.2g}", limit.unit)
            return f"{_at_noise(v)}{plain(name)} above {least} would have been seen"
    return (
        f"{_at_noise(v)}no effect of plausible size would have been seen: these readings say nothing of any"
    )


def _at_noise(v: VerdictData) -> str:
    """The noise that detection limits rest on, as the beginning of a sentence.

    It has the errors of stays and places in it; what is stated, and scaled, is the readings' own part.
    """
    if v.noise_percent is None:
        return ""
    origin = "estimated from the scatter"
    if v.errors_stated:
        factor = v.variance_scale**0.5
        low, high = _AS_STATED
        origin = "as stated" if low < factor < high else f"{factor:.2g} times the stated one"
    return f"at a noise of {v.noise_percent:.2g} % of a bright reading (its own part {origin}), "
