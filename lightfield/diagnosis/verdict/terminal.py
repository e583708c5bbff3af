"""The verdict for people at a terminal: its sentence, then what supports it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lightfield.diagnosis.problem.untestable import Hindrance, in_words
from lightfield.diagnosis.verdict.parts import (
    FAR_OFF_PERCENT,
    Estimate,
    FoundEffect,
    Kind,
    WaterAndBeam,
    WhyAside,
)
from lightfield.diagnosis.verdict.speech import join, place
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.diagnosis.verdict.words import aside
from lightfield.diagnosis.verdict.words.effects import (
    effect_size,
    half_widths,
    level,
    means_something,
    why_first,
)
from lightfield.diagnosis.verdict.words.floor import left_of_floor
from lightfield.diagnosis.verdict.words.stated import named_beside_scene, stated_lines
from lightfield.fitting.parameter import is_gain
from lightfield.wording import plain

#: Explanations, and readings set aside, that a terminal is shown. Chosen: words alone.
_SHOWN, _LISTED = 8, 20
#: Digits of a half width, as of what is told beside it; decimals of b, of which a rounding may be left, 1/m.
#: Chosen: words alone.
_DIGITS, _DECIMALS = 4, 9
#: No column of the ladder has the room for a longer number with its decimals. Chosen: words alone.
_LONG = 1e5


def as_text(verdict: Verdict) -> str:
    """The verdict for people: one sentence, then what supports it."""
    lines = [verdict.sentence, *(f"check first: {text}" for text in verdict.check_first)]
    if verdict.ladder:
        lines.append("")
        lines.append(f"{'ladder':<28}{'error %':>9}{'chi2/dof':>10}{'held out %':>12}{'removes %':>11}")
        for rung in verdict.ladder:
            part = "-" if rung.removed_percent is None else f"{rung.removed_percent:.1f}"
            numbers = f"{_short(rung.error_percent):>9}{_short(rung.chi2_per_dof):>10}"
            numbers += f"{_held_out(rung.held_out_percent):>12}{part:>11}"
            lines.append(f"{rung.label:<28}{numbers}")
            if rung.rendered_error_percent is not None:
                about = f"{_short(rung.rendered_error_percent):>9}"
                if rung.rendered_stderr_percent:  # none where nothing was traced
                    about += f" ± {_short(rung.rendered_stderr_percent)}"
                lines.append(f"{'  rendered afresh':<28}{about}")
        lines.append(f"{'noise floor':<28}{_short(verdict.noise_floor_percent):>9}")
        if left := left_of_floor(verdict):
            lines.append(f"{'  of it left by the fit':<28}{left:>9}")
    lines += _found(verdict.found)
    if verdict.verdict == Kind.NONE and verdict.ladder:
        lines.append(f"fitted: {_values(verdict.ladder[-1].parameters)}")
    for explanation in verdict.explanations[:_SHOWN]:
        names, values = named_beside_scene(explanation, verdict.stated), _values(explanation.parameters)
        lines.append(f"{join(names)} (weight {explanation.weight:.2f}): {values}")
    if about_order := why_first(verdict.explanations[:_SHOWN]):
        lines.append(about_order)
    if verdict.next_measurement:
        lines.append(f"next: {verdict.next_measurement.sentence}")
    reachable = {k: v for k, v in verdict.detection_limits.items() if v.within_range}
    if reachable and verdict.verdict == Kind.NONE:
        listed = ", ".join(
            f"{k} {v.value:.2g} {'' if v.unit == '1' else v.unit}".rstrip() for k, v in reachable.items()
        )
        lines.append("would have been seen, each alone: " + listed)
    hidden = [name for name, each in verdict.detection_limits.items() if not each.within_range]
    if hidden and verdict.verdict == Kind.NONE:
        lines.append(f"could not have been seen, not even at the largest plausible size: {', '.join(hidden)}")
    alike: dict[tuple[Hindrance, ...], list[str]] = {}
    for name, why in verdict.hindrances.items():
        alike.setdefault(tuple(why), []).append(name)
    lines += [f"not testable here: {', '.join(names)} ({in_words(why)})" for why, names in alike.items()]
    named = [one for one in verdict.set_aside if one.reason != WhyAside.BEYOND_TABLE]
    waves = len({one.wavelength_nm for one in named}) > 1
    for one in named[:_LISTED]:
        lines.append(f"set aside: {place(one, waves)}: {aside.off(one)}")
    if (more := len(named) - _LISTED) > 0:
        lines.append(f"set aside: {more} more")
    lines += stated_lines(verdict.stated)
    lines += [f"assumed: {a}" for a in verdict.assumed]
    lines += [f"warning: {w}" for w in verdict.warnings if w not in verdict.check_first]
    return "\n".join(lines)


def _values(parameters: Mapping[str, Estimate]) -> str:
    """Values with their errors; without gains, amplitudes of a curve, and what they make void."""
    return ", ".join(
        f"{path} = {e.value:.4g} " + (f"± {e.stderr:.2g}" if e.stderr is not None else f"({e.reason})")
        for path, e in parameters.items()
        if not is_gain(path) and not path.rpartition(".")[2].isdigit() and means_something(path, parameters)
    )


def _short(number: float | None) -> str:
    """Two decimals; of what no column has the room for, its size."""
    if number is None:
        return "-"
    return f"{number:.2f}" if abs(number) < _LONG else f"{number:.1e}"


def _held_out(percent: float | None) -> str:
    return f"> {FAR_OFF_PERCENT:g}" if percent is not None and percent > FAR_OFF_PERCENT else _short(percent)


def _found(found: Sequence[FoundEffect]) -> list[str]:
    """A table of the effects of the best set; "in sets" is the share of all sets' weight that holds each."""
    if not found:
        return []
    out = ["", f"{'effect':<18}{'sigma':>8}{'gap':>9}{'in sets':>8}  level; size"]
    for one in found:
        sigma = "-" if one.sigma_to_remove is None else f"{one.sigma_to_remove:.1f}"
        gap = "-" if one.gap is None else f"{one.gap:.1f}"
        about = f"{level(one)}; {effect_size(one)}"
        out.append(f"{_row(one):<18}{sigma:>8}{gap:>9}{one.weight:>8.2f}  {about}")
    return [*out, *_changes(found)]


def _row(one: FoundEffect) -> str:
    """The name of an effect, signed as in the ladder where the scene has it."""
    sign = "" if not one.of_scene else "- " if one.is_taken_away else "~ "
    return f"{sign}{one.effect}"


def _changes(found: Sequence[FoundEffect]) -> list[str]:
    """What water and beam would be without each."""
    out = [f"with all: {_water_and_beam(found[0].with_it)}"]
    for one in found:
        if one.without_it is not None:
            less = f"with the scene's {plain(one.effect)}" if one.of_scene else f"without {plain(one.effect)}"
            out.append(f"{less}: {_water_and_beam(one.without_it)}")
    return out


def _water_and_beam(what: WaterAndBeam) -> str:
    stderr = what.attenuation_stderr_per_m
    error = "" if stderr is None else f" ± {stderr:.2g}"
    return (
        f"a = {what.absorption_per_m:.4g}, b = {round(what.scattering_per_m, _DECIMALS):.4g}, "
        f"K = {what.attenuation_per_m:.4g}{error} 1/m at {what.wavelength_nm:.4g} nm, "
        f"hwhm = {half_widths(what, _DIGITS)} degrees"
    )
