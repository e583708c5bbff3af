"""What the verdict says of the effects that the scene itself has: as data, and in words."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from lightfield import effects
from lightfield.diagnosis.refutation import Judged
from lightfield.diagnosis.verdict import Estimate, Explanation, NearestRival, StatedEffect
from lightfield.diagnosis.words import join
from lightfield.fit import Fit

Say = Callable[[Sequence[Explanation], NearestRival | None], str]
#: Judgements that contradict the scene.
REFUTED = ("absent", "contradicted")


def entries(
    scene: Any,
    judged: Iterable[Judged],
    free: Iterable[str],
    untestable: Mapping[str, str],
    estimate: Callable[[Fit, Mapping[str, float]], Mapping[str, Estimate]],
) -> list[StatedEffect]:
    """Every effect that the scene has: first those that were tested, then what is held as stated.

    Parameters
    ----------
    free : iterable of str
        Paths that the base model fits.
    estimate : callable
        Values of a fit with their errors, which are given the smallest they may be.
    """
    known = scene.parameters()
    out = []
    for one in judged:
        moved = [p.path for p in one.candidate.parameters if p.path in one.free.paths]
        values = estimate(one.free, one.errors)
        out.append(
            StatedEffect(
                effect=one.candidate.name,
                judgement=one.judgement,
                stated={path: float(known[path].value) for path in moved},
                neutral={p: float(off) for p in moved if (off := known[p].neutral) is not None},
                fitted={path: values[path] for path in moved},
                limit=one.limit,
                sigma_from_stated=one.sigma_from_stated,
                sigma_to_remove=one.sigma_to_remove,
            )
        )
    tested = {path for entry in out for path in entry.stated} | set(free)
    owner = {f.path: e.name for e in effects.table().values() for form in e.forms for f in form.amplitudes}
    for path, parameter in known.items():
        if parameter.neutral is None or parameter.value == parameter.neutral or path in tested:
            continue
        name = owner.get(path)
        reason = "no effect of the table sets it free" if name is None else untestable.get(name)
        out.append(
            StatedEffect(
                effect=name,
                judgement="held",
                stated={path: float(parameter.value)},
                reason=reason or "not among the effects that were considered",
            )
        )
    return out


def clause(entry: StatedEffect) -> str:
    """How the readings contradict the scene, as part of a sentence."""
    whose = f"your scene's {join([entry.effect or ''])}"
    if entry.judgement == "absent":
        path, value = next(iter(entry.stated.items()))
        return f"{whose} is not in the readings ({_bound(entry, path)}, not {value:.4g})"
    found = [f"{path} = {_value(entry.fitted[path])}, not {entry.stated[path]:.4g}" for path in entry.stated]
    return f"{whose} is contradicted by the readings ({'; '.join(found)})"


def _bound(entry: StatedEffect, path: str) -> str:
    """The limit of an effect that is not there."""
    if entry.limit is None:
        return f"{path} = {_value(entry.fitted[path])}"
    unit = entry.fitted[path].unit
    limit = f"{entry.limit:.2g}" + ("" if unit == "1" else f" {unit}")
    off = entry.neutral[path]
    return f"{path} within {limit} of {off:g}" if off else f"{path} < {limit}"


def _value(estimate: Estimate) -> str:
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    error = "" if estimate.stderr is None else f" +- {float(f'{estimate.stderr:.2g}'):g}"
    return f"{estimate.value:.4g}{error}{unit}"


def sentence(
    kind: str,
    explanations: Sequence[Explanation],
    rival: NearestRival | None,
    stated: Sequence[StatedEffect],
    say: Say,
) -> str:
    """The verdict in words, where an effect of the scene is not "missing" but there, or not as stated.

    Parameters
    ----------
    say : callable
        Words the verdict on effects that the scene does not have.
    """
    has = {entry.effect for entry in stated}
    wrong = {entry.effect: clause(entry) for entry in stated if entry.judgement in REFUTED}

    def spoken(names: Sequence[str]) -> list[str]:
        return [f"{join([n])} unlike your scene's" if n in has else n for n in names]

    next_one = rival and rival.model_copy(update={"effects": spoken(rival.effects)})
    listed = "; ".join(wrong.values())
    against = listed[:1].upper() + listed[1:]
    if kind == "identified" and wrong:
        first = explanations[0]
        missing = [k for k, name in enumerate(first.effects) if name not in wrong]
        if not missing:
            apart = f"; the next rival, {join(next_one.effects)}, is " if next_one else ""
            far = f"{next_one.separation_sigma:.1f} sigma away" if next_one else ""
            return f"{against}{apart}{far}."
        left = {
            "effects": [first.effects[k] for k in missing],
            "families": [first.families[k] for k in missing],
        }
        return f"{against}. {say([first.model_copy(update=left)], next_one)}"
    named = [e.model_copy(update={"effects": spoken(e.effects)}) for e in explanations]
    told = say(named, next_one)
    return f"{against}. {told}" if wrong else told


def lines(stated: Sequence[StatedEffect]) -> list[str]:
    """What the verdict says of each of them, a line each; those held fixed share one."""
    out = []
    for entry in stated:
        if entry.judgement in REFUTED:
            out.append(f"stated: {clause(entry)}")
        elif entry.judgement != "held":
            path, value = next(iter(entry.stated.items()))
            there = "cannot be told from none, or from another size, with these readings"
            if entry.judgement == "supported":
                sure = entry.sigma_to_remove
                there = (
                    "agrees with the readings" if sure is None else f"is in the readings ({sure:.1f} sigma)"
                )
            out.append(
                f"stated: your scene's {join([entry.effect or ''])} {there}; "
                f"{path} = {_value(entry.fitted[path])} fitted, {value:.4g} stated"
            )
    held = [
        f"{path} = {value:.4g}" for e in stated if e.judgement == "held" for path, value in e.stated.items()
    ]
    return [*out, "held as stated: " + ", ".join(held)] if held else out
