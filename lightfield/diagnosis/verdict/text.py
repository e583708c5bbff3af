"""The words of a verdict, made last and from its data alone: headline, support, text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from lightfield.diagnosis.problem.untestable import Hindrance, in_words
from lightfield.diagnosis.verdict import aside_words, stated, words
from lightfield.diagnosis.verdict.found import found_words, rest
from lightfield.diagnosis.verdict.parts import AcceptedExplanation, Doubt, DoubtReason, NearestRival
from lightfield.fitting.parameter import is_gain

if TYPE_CHECKING:
    from lightfield.diagnosis.verdict.verdict import Verdict

#: Explanations, and readings set aside, that a terminal is shown.
_SHOWN, _LISTED = 8, 20
#: No column of the ladder has the room for a longer number with its decimals.
_LONG = 1e5


def words_of(verdict: Verdict) -> words.Said:
    """Headline and what supports it."""
    why = verdict.reason_to_doubt
    told = _found(verdict) if why is None else _doubted(verdict, why)
    if why is None and verdict.verdict == "unexplained":
        told = told.then(rest.sentences(verdict.left_over, verdict.misfit))
    if why is None or why.reason is DoubtReason.SET_ASIDE:
        told = told.then(words.not_asked(verdict.asked) if verdict.verdict == "unexplained" else "")
    aside = aside_words.sentence(verdict.set_aside, verdict.readings, verdict.several_wavelengths)
    return told.then(aside)


def warnings_of(verdict: Verdict) -> list[str]:
    """What to be warned of, in words."""
    best = verdict.explanations[0].parameters if verdict.explanations else {}
    return [
        *(one.sentence for one in verdict.cautions),
        *found_words.unnamed_sentences(verdict.unnamed, best),
    ]


def _doubted(verdict: Verdict, why: Doubt) -> words.Said:
    """Why there is no answer; beside readings that are beyond all effects, what is known of the others."""
    partly = why.reason is DoubtReason.SET_ASIDE
    so_far = found_words.so_far(verdict.found, verdict.ladder, " of the others") if partly else ()
    return words.Said.of(
        f"Unexplained{' in part' if so_far else ''}: {words.doubt(why, verdict.asked)}.", *so_far
    )


def _found(verdict: Verdict) -> words.Said:
    """What was found, where nothing speaks against believing it."""
    within = f" within {verdict.tolerance_percent:g} %" if verdict.within_tolerance else ""
    if verdict.errors_on_trust:
        within += " with the errors taken on trust"
    noise = words.at_noise(verdict.noise_percent, verdict.errors_stated, verdict.variance_scale)
    own = {entry.effect for entry in verdict.stated}
    limits = {name: limit for name, limit in verdict.detection_limits.items() if name not in own}
    many = found_words.said_of_many(verdict.verdict, verdict.found, verdict.ladder, verdict.misfit)
    curve = any(found_words.follows_any(one) for one in verdict.found)
    certain, instead = found_words.told_of_shared(verdict.found, [e.effects for e in verdict.explanations])
    on = words.Grounds(
        limits, verdict.misfit, within, verdict.determined, noise, curve, tuple(certain), tuple(instead),
        tuple(verdict.asked),
    )  # fmt: skip

    def say(told: Sequence[AcceptedExplanation], rival: NearestRival | None) -> words.Said:
        if many is not None:
            return many
        return words.said(verdict.verdict, told, rival, on)

    return stated.with_stated(
        verdict.verdict, verdict.explanations, verdict.nearest_rival, verdict.stated, say
    )


def as_text(verdict: Verdict) -> str:
    """The verdict for people: one sentence, then what supports it."""
    lines = [verdict.sentence]
    if verdict.ladder:
        lines.append("")
        lines.append(f"{'ladder':<28}{'error %':>9}{'chi2/dof':>10}{'held out %':>12}{'removes %':>11}")
        for rung in verdict.ladder:
            part = "-" if rung.removed_percent is None else f"{rung.removed_percent:.1f}"
            numbers = f"{_short(rung.error_percent):>9}{_short(rung.chi2_per_dof):>10}"
            numbers += f"{_short(rung.held_out_percent):>12}{part:>11}"
            lines.append(f"{rung.label:<28}{numbers}")
            if rung.rendered_error_percent is not None:
                about = (
                    f"{_short(rung.rendered_error_percent):>9} +- {_short(rung.rendered_stderr_percent or 0)}"
                )
                lines.append(f"{'  rendered afresh':<28}{about}")
        lines.append(f"{'noise floor':<28}{_short(verdict.noise_floor_percent):>9}")
    lines += found_words.found_lines(verdict.found)
    for explanation in verdict.explanations[:_SHOWN]:
        values = ", ".join(
            f"{path} = {e.value:.4g} " + (f"+- {e.stderr:.2g}" if e.stderr is not None else f"({e.reason})")
            for path, e in explanation.parameters.items()
            if not is_gain(path) and not path.rpartition(".")[2].isdigit()  # of a curve
        )
        lines.append(f"{words.join(explanation.effects)} (weight {explanation.weight:.2f}): {values}")
    if verdict.next_measurement:
        lines.append(f"next: {verdict.next_measurement.sentence}")
    reachable = {k: v for k, v in verdict.detection_limits.items() if v.within_range}
    if reachable and verdict.verdict == "none":
        listed = ", ".join(
            f"{k} {v.value:.2g} {'' if v.unit == '1' else v.unit}".rstrip() for k, v in reachable.items()
        )
        lines.append("would have been seen: " + listed)
    hidden = [name for name, each in verdict.detection_limits.items() if not each.within_range]
    if hidden and verdict.verdict == "none":
        lines.append(f"could not have been seen, not even at the largest plausible size: {', '.join(hidden)}")
    alike: dict[tuple[Hindrance, ...], list[str]] = {}
    for name, why in verdict.hindrances.items():
        alike.setdefault(tuple(why), []).append(name)
    lines += [f"not testable here: {', '.join(names)} ({in_words(why)})" for why, names in alike.items()]
    waves = len({one.wavelength_nm for one in verdict.set_aside}) > 1
    for one in verdict.set_aside[:_LISTED]:
        lines.append(f"set aside: {aside_words.place(one, waves)}: {aside_words.off(one)}")
    if (more := len(verdict.set_aside) - _LISTED) > 0:
        lines.append(f"set aside: {more} more")
    lines += stated.stated_lines(verdict.stated)
    lines += [f"assumed: {a}" for a in verdict.assumed]
    lines += [f"warning: {w}" for w in verdict.warnings]
    return "\n".join(lines)


def _short(number: float | None) -> str:
    """Two decimals; of what no column has the room for, its size."""
    if number is None:
        return "-"
    return f"{number:.2f}" if abs(number) < _LONG else f"{number:.1e}"
