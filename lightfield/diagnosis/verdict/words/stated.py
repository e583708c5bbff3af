"""What do the readings say of the effects that the scene itself has?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lightfield.diagnosis.verdict.parts import (
    CONTRADICTED_SIGMA,
    AcceptedExplanation,
    Estimate,
    Judgement,
    NearestRival,
    Reason,
    StatedEffect,
)
from lightfield.diagnosis.verdict.speech import in_unit, join
from lightfield.diagnosis.verdict.verdict_data import VerdictData
from lightfield.wording import plain

#: From here on the distance is told, though nothing is contradicted: one in twenty is so far away (chosen).
_TOLD_SIGMA = 2.0
#: An effect is there surely, and of hardly known size, where its removal is so many times as far in sigma as
#: its size is from none by its error. Chosen: of five that nothing makes up for the two agree within 1.3.
_FAR_SURER = 3.0


def _clause(entry: StatedEffect) -> str:
    """How the readings contradict the scene, as part of a sentence."""
    whose = f"your scene's {plain(entry.effect or '')}"
    if entry.judgement == Judgement.ABSENT:
        path, value = next(iter(entry.stated.items()))
        return f"{whose} is not in the readings ({_bound(entry, path)}, not {value:.4g})"
    found = [f"{path} = {_value(entry.fitted[path])}, not {entry.stated[path]:.4g}" for path in entry.stated]
    return f"{whose} is contradicted by the readings ({'; '.join(found)})"


def _bound(entry: StatedEffect, path: str) -> str:
    """The limit of an effect that is not there."""
    if entry.limit is None:
        return f"{path} = {_value(entry.fitted[path])}"
    limit = in_unit(f"{entry.limit:.2g}", entry.fitted[path].unit)
    off = entry.neutral[path]
    return f"{path} within {limit} of {off:g}" if off else f"{path} < {limit}"


def _value(estimate: Estimate) -> str:
    error = "" if estimate.stderr is None else f" ± {float(f'{estimate.stderr:.2g}'):g}"
    return in_unit(f"{estimate.value:.4g}{error}", estimate.unit)


def against(entries: Sequence[StatedEffect]) -> dict[str | None, str]:
    """How the readings contradict the scene, by effect; empty where they do not."""
    return {entry.effect: _clause(entry) for entry in entries if entry.judgement.contradicts_scene}


def beside_scene(v: VerdictData) -> tuple[list[AcceptedExplanation], NearestRival | None]:
    """Explanations and rival, where an effect of the scene is not "missing" but of another size."""
    has = {entry.effect for entry in v.stated}

    def called(names: Sequence[str]) -> dict[str, list[str]]:
        return {"effects": [f"{plain(n)} unlike your scene's" if n in has else n for n in names]}

    told = [one.model_copy(update=called(one.effects)) for one in v.explanations]
    rival = v.nearest_rival
    return told, rival and rival.model_copy(update=called(rival.effects))


def named_beside_scene(explanation: AcceptedExplanation, entries: Sequence[StatedEffect]) -> list[str]:
    """Effects of an explanation by name: of one that the scene has, what the explanation makes of it."""
    has = {entry.effect: entry.stated for entry in entries}
    return [_beside_scene(name, explanation.parameters, has.get(name, {})) for name in explanation.effects]


def _beside_scene(name: str, fitted: Mapping[str, Estimate], in_scene: Mapping[str, float]) -> str:
    if not in_scene:
        return plain(name)
    gone = all(path in fitted and fitted[path].reason is Reason.HELD for path in in_scene)
    return f"no {plain(name)}" if gone else f"{plain(name)} unlike the scene's"


def stated_lines(stated: Sequence[StatedEffect]) -> list[str]:
    """What the verdict says of each of them, a line each; those held fixed share one."""
    out = []
    for entry in stated:
        if entry.judgement.contradicts_scene:
            out.append(f"stated: {_clause(entry)}")
        elif entry.judgement != Judgement.HELD:
            path, value = next(iter(entry.stated.items()))
            size, beside = f"{path} = {_value(entry.fitted[path])} fitted", ""
            if _is_hardly_sized(entry):  # two statements: that it is there, and how large beside those others
                beside = f", but how large it is these readings hardly tell beside {join(entry.beside)}"
                size += f" with {'that' if len(entry.beside) == 1 else 'these'} free"
            out.append(
                f"stated: your scene's {plain(entry.effect or '')} {_standing(entry)}{beside}; "
                f"{size}, {value:.4g} stated{_apart(entry)}"
            )
            if entry.if_free:
                out.append(_conditional(entry, path, value))
    as_stated = [e for e in stated if e.judgement == Judgement.HELD]
    held = [f"{path} = {value:.4g}" for e in as_stated for path, value in e.stated.items()]
    return [*out, "held as stated: " + ", ".join(held)] if held else out


def _conditional(entry: StatedEffect, path: str, value: float) -> str:
    """What is only known while a value of the scene is held."""
    others = "; ".join(f"{name} = {_value(one)}" for name, one in entry.if_free.items())
    return f"stated: what is fitted holds only if {path} = {value:.4g} is right; with that free {others}"


def _is_hardly_sized(entry: StatedEffect) -> bool:
    """Is an effect in the readings far more surely than the error of its size says, as others that are free
    with it make up for one size by another, and not for none?"""
    sure = entry.sigma_to_remove
    if sure is None or not entry.beside or any(one.stderr is None for one in entry.fitted.values()):
        return False
    known = (
        (one.value - entry.neutral[p], one.stderr) for p, one in entry.fitted.items() if p in entry.neutral
    )
    by_size = [abs(size) / error for size, error in known if error]
    return bool(by_size) and sure > _FAR_SURER * max(by_size)


def _apart(entry: StatedEffect) -> str:
    """How far a size is from the stated one, where that is worth a look."""
    far = entry.sigma_from_stated or 0.0
    return f", {far:.1f} sigma apart: look into it" if far >= _TOLD_SIGMA else ""


def _standing(entry: StatedEffect) -> str:
    """What the readings say of an effect that they do not contradict."""
    if entry.judgement == Judgement.SUPPORTED:
        sure = entry.sigma_to_remove
        return "agrees with the readings" if sure is None else f"is in the readings ({sure:.1f} sigma)"
    if (entry.sigma_from_stated or 0.0) > CONTRADICTED_SIGMA:
        return "is of another size, or a rival holds"
    return "cannot be told from none, or from another size, with these readings"
