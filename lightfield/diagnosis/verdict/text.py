"""The verdict as text for a terminal."""

from __future__ import annotations

from lightfield.diagnosis.verdict import aside_words, stated, words
from lightfield.diagnosis.verdict.verdict import Verdict

_SHOWN, _LISTED = 8, 20


def as_text(verdict: Verdict) -> str:
    """The verdict for people: one sentence, then what supports it."""
    lines = [verdict.sentence]
    if verdict.ladder:
        lines.append("")
        lines.append(f"{'ladder':<28}{'error %':>9}{'chi2/dof':>10}{'held out %':>12}")
        for rung in verdict.ladder:
            held = "-" if rung.held_out_percent is None else f"{rung.held_out_percent:.2f}"
            lines.append(f"{rung.label:<28}{rung.error_percent:>9.2f}{rung.chi2_per_dof:>10.2f}{held:>12}")
            if rung.rendered_error_percent is not None:
                about = f"{rung.rendered_error_percent:>9.2f} +- {rung.rendered_stderr_percent or 0:.2f}"
                lines.append(f"{'  rendered afresh':<28}{about}")
        lines.append(f"{'noise floor':<28}{verdict.noise_floor_percent:>9.2f}")
    for explanation in verdict.explanations[:_SHOWN]:
        values = ", ".join(
            f"{path} = {e.value:.4g} " + (f"+- {e.stderr:.2g}" if e.stderr is not None else f"({e.reason})")
            for path, e in explanation.parameters.items()
            if not path.startswith("gain")
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
    for reason in dict.fromkeys(verdict.untestable.values()):
        names = ", ".join(k for k, v in verdict.untestable.items() if v == reason)
        lines.append(f"not testable here: {names} ({reason})")
    waves = len({one.wavelength_nm for one in verdict.set_aside}) > 1
    for one in verdict.set_aside[:_LISTED]:
        lines.append(f"set aside: {aside_words.place(one, waves)}: {aside_words.off(one)}")
    if (more := len(verdict.set_aside) - _LISTED) > 0:
        lines.append(f"set aside: {more} more")
    lines += stated.lines(verdict.stated)
    lines += [f"assumed: {a}" for a in verdict.assumed]
    lines += [f"warning: {w}" for w in verdict.warnings]
    return "\n".join(lines)
