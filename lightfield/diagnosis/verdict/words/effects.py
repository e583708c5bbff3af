"""How sure is each effect of the best set, how large, and what else would do?"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.verdict.parts import (
    AcceptedExplanation,
    Estimate,
    FoundEffect,
    NearestRival,
    Rung,
    Unnamed,
    WaterAndBeam,
)
from lightfield.diagnosis.verdict.speech import exactly, join, roughly, short
from lightfield.fitting import effects
from lightfield.fitting.effects.free_form import BEAM_PROFILE
from lightfield.scene import Lamp
from lightfield.scene.lamp.section import oval_widths, widest_turn
from lightfield.wording import capital, plain, rounded

#: Part of the misfit, in per cent, that a set removes before it is spoken of. Chosen: half.
_SPOKEN = 50.0
#: Every water has some. Between walls that reflect it is fitted beside them.
_SCATTERING = "scattering"
_OVAL = ("lamp.ellipticity", "lamp.ellipticity_diagonal")
_WIDTH, _PROFILE = "lamp.hwhm_deg", "lamp.profile_departure."
#: A lamp of any shape.
_CURVE = "beam_profile"
_DETAIL = " detail of the lamp that its curve leaves out"
#: From this rms change of the logarithm of readings on it is told as a factor, and as none that is beyond
#: numbers. Chosen: words alone.
_A_PART, _MOST_LOG = 0.3, 500.0
#: A beam that is longer than across by less than the first is hardly oval, and by less than the second so by
#: per cent, of which a factor has no digits to tell. Chosen: words alone.
_HARDLY_OVAL, _BY_PERCENT = 1e-3, 0.1
#: What may replace an effect, of which so many are told. Chosen: words alone.
_ALTERNATIVES_TOLD = 3


def level(one: FoundEffect) -> str:
    """How sure an effect is, with what else would do."""
    if one.level == Certainty.CERTAIN:
        return "certain"
    if one.level == Certainty.PARTIAL:
        return "certain as far as the unexplained rest allows"
    others = instead(one)
    if one.level == Certainty.SIMPLEST:
        also = f"; {others} would do as well" if others else ""
        return f"simplest{also}{'; perhaps' + _DETAIL if one.lamp_detail else ''}"
    if others:
        return f"one of: this, or {others}"
    if follows_any(one):
        return "not sure: so free a curve would follow nearly any readings at these places"
    return "not sure"


def short_level(one: FoundEffect) -> str:
    """The same in a word or two: one of nothing is not sure."""
    return "not sure" if one.level == Certainty.ONE_OF and not instead(one) else one.level


def follows_any(one: FoundEffect) -> bool:
    """Is it a curve that nothing replaces, and that is not sure all the same?"""
    return one.level == Certainty.ONE_OF and one.hardly_tested and not instead(one)


def has_only_courses(one: FoundEffect) -> bool:
    """Does nothing but curves that an effect is one course of do in its place?"""
    return bool(one.alternatives) and all(_is_course_of(one.effect, names) for names in one.alternatives)


def instead(one: FoundEffect, it: str = "it") -> str:
    """What would do in place of an effect; "" for nothing. `it` may stand for several that have the same."""
    # What one alone does needs no other beside it.
    least = [a for a in one.alternatives if not any(set(b) < set(a) for b in one.alternatives)]
    shown = least[:_ALTERNATIVES_TOLD]
    courses = [names for names in shown if _is_course_of(one.effect, names)]
    told = [in_company(names) for names in shown if names not in courses]
    if one.beyond:
        told.insert(0, f"more {in_company(one.beyond)} than is held plausible")
    if courses:  # first, next to what "it" is
        told.insert(0, f"any course of {it} ({' or '.join(map(in_company, courses))})")
    if one.other_lamp and not any(_CURVE in names for names in one.alternatives):
        told.append("a lamp of another shape")
    # Sets without an effect of the scene hold it as stated.
    as_stated = "the scene's beside " if one.of_scene and told else ""
    return f"{as_stated}{(', or ' if any(len(names) > 2 for names in shown) else ' or ').join(told)}"


def called(one: FoundEffect) -> str:
    """What an effect of the best set is called: of one that the scene has, what the set makes of it."""
    if not one.of_scene:
        return plain(one.effect)
    return f"no {plain(one.effect)}" if one.is_taken_away else f"{plain(one.effect)} unlike the scene's"


def as_well(found: Sequence[FoundEffect]) -> str:
    """What would do as well as effects that are the simplest explanation alone; "" for nothing."""
    open_ = [one for one in found if one.level in (Certainty.SIMPLEST, Certainty.ONE_OF) and instead(one)]
    told = " and ".join(f"instead of {called(one)}, {instead(one)}" for one in open_)
    return f"{told} would do as well" if told else ""


def shared(
    found: Sequence[FoundEffect], explanations: Sequence[AcceptedExplanation]
) -> tuple[list[str], list[str]]:
    """Of effects that all explanations name: which are certain, and what else does as well, in sentences."""
    common = [one for one in found if all(one.effect in each.effects for each in explanations)]
    certain = [one.effect for one in common if one.level == Certainty.CERTAIN]
    open_ = [one for one in common if one.level == Certainty.ONE_OF and instead(one)]
    return certain, [f"Instead of {plain(o.effect)}: {instead(o)}." for o in open_]


def why_first(told: Sequence[AcceptedExplanation]) -> str:
    """Why the first explanation stands before others of more weight, which have curves; "" if none has."""
    curves = set(effects.curves())
    if not told:
        return ""
    heavier = [curves.intersection(one.effects) for one in told[1:] if one.weight > told[0].weight]
    if not heavier or not all(some.difference(told[0].effects) for some in heavier):
        return ""
    return "The first needs fewer curves than those of more weight: a curve follows noise, too."


def has_no_equal(found: Sequence[FoundEffect], rival: NearestRival) -> bool:
    """Is a rival without all that would do as well? How far it is said to be would contradict that."""
    return not any(set(names) <= set(rival.effects) for one in found for names in one.alternatives)


def _is_course_of(effect: str, names: Sequence[str]) -> bool:
    """Is it a curve that an effect is one course of? It is no other cause."""
    curve = effects.curves().get(names[0]) if len(names) == 1 else None
    return curve is not None and effect in curve.contains


def in_company(names: Sequence[str]) -> str:
    """ "a", "a with b", "a with b and c": a set of effects among others."""
    return plain(names[0]) if len(names) == 1 else f"{plain(names[0])} with {join(names[1:])}"


def effect_size(one: FoundEffect) -> str:
    """The parameters of an effect with their errors; of a curve how far it departs."""
    if one.rms_percent is not None:
        return f"a curve of {len(one.parameters)} functions, {changes(one.rms_percent / 100)}"
    if one.is_taken_away:
        off = ", ".join(f"{path.rpartition('.')[2]} = {e.value:.4g}" for path, e in one.parameters.items())
        return f"{off} instead of the scene's"
    sizes = ", ".join(f"{path.rpartition('.')[2]} = {exactly(e)}" for path, e in one.parameters.items())
    return f"{sizes}{_as_an_oval(one.parameters)}"


def changes(rms: float) -> str:
    """What a curve does to readings, by the rms change of their logarithm: a large one as a factor."""
    if rms < _A_PART:
        return f"changing the readings by {short(100 * rms, 2)} % rms"
    return f"changing the readings by a factor of {rounded(math.exp(min(rms, _MOST_LOG)))} (rms)"


def half_widths(what: WaterAndBeam, digits: int) -> str:
    """The half width of a beam in degrees; of an oval one where it is narrowest and where widest."""
    ends = [f"{deg:.{digits}g}" for deg in what.oval_hwhm_deg or (what.hwhm_deg,)]
    return " and ".join(dict.fromkeys(ends))


def _as_an_oval(parameters: Mapping[str, Estimate]) -> str:
    """What two ellipticities are together: how long the oval is, and where it points."""
    if not {*_OVAL} <= {*parameters}:
        return ""
    lamp = Lamp(**{path.rpartition(".")[2]: parameters[path].value for path in _OVAL})
    narrow, wide = oval_widths(lamp)
    turn_deg = math.degrees(widest_turn(lamp))
    longer = wide / narrow - 1
    if longer < _HARDLY_OVAL:
        return " (hardly oval)"
    by = (
        f"{short(100 * longer, 2)} % wider than"
        if longer < _BY_PERCENT
        else f"{1 + longer:.3g} times as wide as"
    )
    return f" ({by} across at {turn_deg:.0f} degrees from x towards y)"


def so_far(found: Sequence[FoundEffect], ladder: Sequence[Rung], misfit: str = "") -> tuple[str, ...]:
    """What a best set explains that leaves something, and what is certain of it; nothing of less than half of
    the misfit.

    Parameters
    ----------
    misfit : str
        Of what, where not of all readings: " of the others".
    """
    names = [one.effect for one in found]
    certain = [one.effect for one in found if one.level == Certainty.PARTIAL]
    # What a local unknown removes is not theirs.
    theirs = (rung for rung in ladder if rung.effects and rung.effects[-1] in names)
    removed = sum(rung.removed_percent or 0.0 for rung in theirs)
    if not found or (removed < _SPOKEN and not certain):
        return ()
    verb = "removes" if len(names) == 1 else "remove"
    what = f"{capital(join(names))} {verb} {removed:.3g} % of the misfit{misfit}"
    known = f"Certain so far: {join(certain)}." if certain else "None of these is certain so far."
    return f"{what}.", known


def unnamed_sentences(told: Sequence[Unnamed], values: Mapping[str, Estimate]) -> list[str]:
    """What effects that are too small to be named, or detail of the lamp, would change, a sentence for each.

    Parameters
    ----------
    values : mapping
        Parameters of the best set by path, as stated.
    """
    out = []
    for one in told:
        if one.effect == _SCATTERING and one.with_it.keys() - values.keys():  # its size is told, too
            there = ", ".join(f"{path} = {roughly(e)}" for path, e in one.with_it.items())
            why = "is hardly told from what reflects here, and every water has some: with it"
        else:
            there = ", ".join(
                f"{path} would be {roughly(e)} instead of {values[path].value:.3g}"
                for path, e in one.with_it.items()
                if path in values
            )
            why = f"is too small to be named ({one.sigma:.1f} sigma); if it is there,"
            if one.effect == _SCATTERING:
                why = f"is too small to be named ({one.sigma:.1f} sigma), and every water has some: with it"
            if one.stated:
                why = f"of another size than the scene's is hardly asked for ({one.sigma:.1f} sigma); with it"
            if one.effect == BEAM_PROFILE:
                why = "in more detail does nearly as well: with it"
        if there:
            out.append(f"{plain(one.effect)} {why} {there}; the stated errors reach there")
    return out


def means_something(path: str, parameters: Iterable[str]) -> bool:
    """Is a parameter one to be told? The width of a Gaussian that a curve changes is that of no light."""
    return path != _WIDTH or not any(p.startswith(_PROFILE) for p in parameters)
