"""The diagnosis as a page: the verdict in one sentence, then everything it rests on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from matplotlib.figure import Figure

from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.diagnosis.verdict.next_measurement import what_next
from lightfield.diagnosis.verdict.parts import (
    FAR_OFF_PERCENT,
    AcceptedExplanation,
    DetectionLimit,
    FoundEffect,
    Kind,
    NearestRival,
    PlaceToRead,
    Rung,
    SetAside,
    StatedEffect,
    WaterAndBeam,
)
from lightfield.diagnosis.verdict.speech import exactly, in_unit
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.diagnosis.verdict.words.effects import (
    as_well,
    called,
    effect_size,
    half_widths,
    has_no_equal,
    instead,
    means_something,
    short_level,
    why_first,
)
from lightfield.diagnosis.verdict.words.floor import why_below
from lightfield.diagnosis.verdict.words.stated import named_beside_scene, stated_lines
from lightfield.fitting.curves import field_of, is_amplitude
from lightfield.report.diagnosis.curves import curve_figure, left_figure
from lightfield.report.diagnosis.figures import LEAST_PERCENT, data_figure, residual_map, signature_figure
from lightfield.report.diagnosis.ladder import ladder_figure, separation_figure
from lightfield.report.diagnosis.rest import rest_figure
from lightfield.report.diagnosis.single_places import measured_figure, place_map
from lightfield.report.diagnosis.view import DiagnosisView
from lightfield.report.page import PageFigure, fill, page_figure, three_digits
from lightfield.report.tank import tank_figure
from lightfield.wording import plain, rounded

_TAGS = {
    Kind.NONE: ("good", "nothing missing"),
    Kind.IDENTIFIED: ("good", "identified"),
    Kind.AMBIGUOUS: ("open", "cannot be told apart"),
    Kind.UNEXPLAINED: ("bad", "unexplained"),
}
#: Of these the errors of the readings were taken for larger than the table says.
_ERRORS_TOO_SMALL = (Warns.SCATTER_MORE, Warns.SCATTER_FAR_MORE)
#: Names of the figures.
_DRAWN = ("data", "residuals", "ladder", "tank", "curves", "left", "signatures", "separation")
#: Sigma and gaps beyond this are one: surely there.
_MANY = 1000.0
_FORMULA_IS_NOT_CAUSE = (
    "An effect is named for the formula that explains the readings; a formula that fits is not yet the cause."
)


def diagnosis_page(view: DiagnosisView) -> str:
    """Page of a diagnosis.

    Parameters
    ----------
    view : DiagnosisView
    """
    verdict = view.verdict
    kind, text = _tag(verdict)
    advice = verdict.next_measurement
    spots = advice.readings if advice else []
    return fill(
        "diagnosis.html",
        title=view.title,
        verdict=verdict.headline,
        tag={"kind": kind, "text": text},
        check_first=verdict.check_first,
        lead=[*verdict.support, *_lead(verdict)],
        found=[_found(one) for one in verdict.found],
        with_all=_light(verdict.found[0].with_it) if verdict.found else [],
        has_of_scene=any(one.of_scene for one in verdict.found),
        at_nm=f"{verdict.found[0].with_it.wavelength_nm:.4g}" if verdict.found else "",
        rungs=[_rung(rung) for rung in verdict.ladder],
        about_error=_about_error(verdict.ladder),
        explanations=[_explanation(each, verdict.stated) for each in verdict.explanations],
        about_order=why_first(verdict.explanations),
        rival=_rival(verdict.nearest_rival, verdict.found),
        next_sentence=what_next(verdict.verdict, advice),
        spots=[[f"{s.x_m:g}", f"{s.y_m:g}", f"{s.z_m:g}", s.medium, s.repeats] for s in spots],
        limits=[_limit(name, each) for name, each in verdict.detection_limits.items() if each.within_range],
        unseen=[plain(name) for name, each in verdict.detection_limits.items() if not each.within_range],
        untestable=[(plain(name), reason) for name, reason in verdict.untestable.items()],
        stated=stated_lines(verdict.stated),
        assumed=verdict.assumed,
        warnings=[text for text in verdict.warnings if text not in verdict.check_first],
        aside=[_aside(each) for each in verdict.set_aside],
        provenance=view.provenance,
        scene_toml=view.scene_toml,
        **_figures(view, spots),
    )


def _figures(view: DiagnosisView, spots: Sequence[PlaceToRead]) -> dict[str, PageFigure | None]:
    """What the page draws, by name; None where there is nothing to show.

    Parameters
    ----------
    spots : sequence of PlaceToRead
        Where to read next.
    """
    verdict, readings = view.verdict, view.readings
    drawn: dict[str, PageFigure | None] = dict.fromkeys(_DRAWN)
    wide = "residuals" if view.is_grid else ""  # scrolls on a telephone

    def draw(name: str, caption: str, alt: str, how: Callable[..., Figure], *of: object) -> None:
        drawn[name] = page_figure(name, caption, alt, how, *of, narrow=name != wide)

    if view.is_scattered:
        draw(
            "data",
            "Each reading with its error against what the model says of its place: on the line they agree. "
            "Over the decades of the readings, which share no scan.",
            "Readings against models at single places", measured_figure, view,
        )  # fmt: skip
    else:
        draw(
            "data",
            "Above: readings with their errors, base model (dashed) and, where there is one, the explained "
            "model with its one-sigma band, over decades where they span some. Below: what is left, open for "
            "the base model, filled for the explained one.",
            "Readings and models per plane with residuals", data_figure, view,
        )  # fmt: skip
    if view.scan_axis != "z_m" or view.is_scattered:  # a map of points on one line shows nothing more
        draw(
            "residuals",
            "Every reading at its place; red: brighter than the model, blue: darker. Ringed: set aside.",
            "Residuals by position", place_map if view.is_scattered else residual_map, view,
        )  # fmt: skip
    draw(
        "ladder",
        "Rms of the residual, over readings above 5 % of their plane's maximum and five errors.",
        "Error of each rung of the ladder against the noise floor",
        ladder_figure, verdict.ladder, verdict.noise_floor_percent,
    )  # fmt: skip
    draw(
        "tank",
        "Readings taken, and stars where the next ones decide most." if spots else "Readings taken.",
        "Tank from above and from the side with positions of readings",
        tank_figure, readings.x_m, readings.y_m, readings.z_m, view.tank, spots, view.hwhm_deg,
    )  # fmt: skip
    if view.curves:
        draw(
            "curves",
            "What the explanation says of lamp, water or time as a curve: above against the model without "
            "it, below the band of its two standard errors.",
            "Fitted curves with their errors", curve_figure, view.curves,
        )  # fmt: skip
    if verdict.left_over:
        draw(
            "left",
            "Where the rest lies that nothing explains. Lines: factors on the light that would make it good, "
            "with two standard errors. Dots: readings over the model without them. No explanations.",
            "Local unknowns along their coordinates", left_figure, verdict.left_over,
        )  # fmt: skip
    elif verdict.verdict == Kind.UNEXPLAINED:
        draw(
            "left",
            "What nothing explains, along each coordinate. Where the line stays within its band of nothing, "
            "the rest is no function of that coordinate.",
            "What is left along the coordinates", rest_figure, view,
        )  # fmt: skip
    if view.signatures:
        draw(
            "signatures",
            "Dots: what the base model leaves. Lines: what each accepted explanation adds, all else "
            "refitted. Lines that lie on each other cannot be told apart by these readings.",
            "Signatures of the accepted explanations over the residual", signature_figure, view,
        )  # fmt: skip
    if view.separation is not None and len(view.separation.names) > 1:
        draw(
            "separation",
            "Row: the truth, as fitted. Column: the nearest that the other explanation can come, in sigma. "
            "Under 3 (bold) they form one class; above 6 they are told apart safely.",
            "Matrix of separations between explanations", separation_figure, view.separation,
        )  # fmt: skip
    return drawn


def _aside(each: SetAside) -> list[str]:
    """A reading set aside: row, place, and how far it lies from the model."""
    wavelength, off = each.wavelength_nm, each.off_sigma
    place = (f"{round(v, 4) + 0.0:.4g}" for v in (each.x_m, each.y_m, each.z_m))
    return [
        str(each.row),
        *place,
        each.medium,
        "–" if wavelength is None else f"{wavelength:g}",
        each.reason if off is None else f"{off:+.1f}",
    ]


def _tag(verdict: Verdict) -> tuple[str, str]:
    """Colour and words of the badge: nothing is plainly good beside errors that were taken for too small."""
    kind, text = _TAGS[verdict.verdict]
    if kind == "good" and any(one.warns in _ERRORS_TOO_SMALL for one in verdict.cautions):
        return "open", f"{text}, with errors larger than stated"
    return kind, text


def _course(ladder: Sequence[Rung]) -> str | None:
    """What the error in per cent does, as it is printed: "falls", "rises" or "stays"; None of one rung.

    It can rise where the model is dark, and stay where few readings tell, while the misfit in sigma falls.
    """
    first, last = ladder[0].error_percent, ladder[-1].error_percent
    if len(ladder) < 2:
        return None
    if first is not None and last is not None and _percent(first, 2) == _percent(last, 2):
        return "stays"
    return "rises" if first is not None and last is not None and last > first else "falls"


def _about_error(ladder: Sequence[Rung]) -> str:
    """Heading of the ladder."""
    course = _course(ladder)
    if course in (None, "falls"):
        return "The error falls" if course else "The error and the noise floor"
    return f"The error {course}, chi-square falls"


def _lead(verdict: Verdict) -> list[str]:
    ladder, floor = verdict.ladder, verdict.noise_floor_percent
    first, last = ladder[0].error_percent, ladder[-1].error_percent
    lines = []
    if course := _course(ladder):
        between = f"from {_optional(first, 2)} % to {_optional(last, 2)} %"
        told = {
            "falls": f"falls {between}",
            "rises": f"rises, though chi-square falls, {between}",
            "stays": f"stays at {_optional(last, 2)} %, though chi-square falls",
        }
        lines.append(f"The error {told[course]}; the noise floor is {_floor(floor)} %.")
        lines.append(_FORMULA_IS_NOT_CAUSE)
    else:
        lines.append(f"The error is {_optional(first, 2)} %; the noise floor is {_floor(floor)} %.")
    if why := why_below(verdict):
        lines.append(why)
    if verdict.run > 1:
        lines.append(
            f"This is look {verdict.run} at these readings. Every look spends some of their power: keep a "
            "plane or a day untouched."
        )
    return lines


def _found(one: FoundEffect) -> dict[str, str | list[str]]:
    """An effect of the best set: how sure it is, and what would be without it."""
    numbers = [
        "–" if v is None else f"{v:.3g}" if v < _MANY else f"> {_MANY:g}"
        for v in (one.sigma_to_remove, one.gap)
    ]
    less = ["–"] * 4 if one.without_it is None else _light(one.without_it)
    return {
        "effect": called(one),
        "level": short_level(one),
        "kind": "good" if one.level.is_claimed else "open",
        "instead": instead(one) or "–",
        "size": effect_size(one),
        "numbers": [*numbers, f"{one.weight:.2f}", *less],
    }


def _light(what: WaterAndBeam) -> list[str]:
    """a, b, K, with its error if that is known, and half width."""
    values = (what.absorption_per_m, what.scattering_per_m, what.attenuation_per_m)
    a, b, attenuation = (f"{value:.3g}" for value in values)
    stderr = what.attenuation_stderr_per_m
    known = attenuation if stderr is None else f"{attenuation} ± {stderr:.1g}"
    return [a, b, known, half_widths(what, 3)]


def _rung(rung: Rung) -> list[str]:
    rendered = rung.rendered_error_percent
    fresh = three_digits(rendered)
    if rendered is not None and rung.rendered_stderr_percent:
        fresh += f" ± {rung.rendered_stderr_percent:.1g}"
    return [
        plain(rung.label),
        _optional(rung.error_percent),
        _percent(rung.chi2_per_dof),
        _held_out(rung.held_out_percent),
        three_digits(rung.removed_percent),
        fresh,
    ]


def _explanation(each: AcceptedExplanation, stated: Sequence[StatedEffect]) -> dict[str, str | list[str]]:
    values, amplitudes = [], [path for path in each.parameters if is_amplitude(path)]
    for path, estimate in each.parameters.items():
        if path in amplitudes or not means_something(path, each.parameters):
            continue
        alone = estimate.stderr_of_set
        values.append(
            f"{path} = {exactly(estimate)}" + (f" (± {alone:.2g} if nothing else acts)" if alone else "")
        )
    for field, count in Counter(field_of(path) for path in amplitudes).items():
        values.append(f"{field}: a curve of {count} functions")
    return {
        "effects": " + ".join(named_beside_scene(each, stated)),
        "weight": f"{each.weight:.2f}",
        "error": _optional(each.error_percent),
        "held_out": _held_out(each.held_out_percent),
        "values": values,
    }


def _rival(rival: NearestRival | None, found: Sequence[FoundEffect]) -> str:
    """How far the nearest other explanation is, which has nothing of what would do as well."""
    if rival is None or not has_no_equal(found, rival):
        return ""
    names = " + ".join(plain(name) for name in rival.effects)
    what = "explanation that has nothing of what would do as well" if as_well(found) else "explanation"
    return f"The nearest other {what}, {names}, is {rival.separation_sigma:.1f} sigma away."


def _limit(name: str, each: DetectionLimit) -> dict[str, str]:
    limit = in_unit(f"{each.value:.2g}", each.unit)
    return {"effect": plain(name), "parameter": each.parameter, "limit": limit}


def _optional(value: float | None, digits: int = 3) -> str:
    return "–" if value is None else _percent(value, digits)


def _held_out(percent: float | None) -> str:
    return (
        f"> {FAR_OFF_PERCENT:g}" if percent is not None and percent > FAR_OFF_PERCENT else _optional(percent)
    )


def _floor(value: float | None) -> str:
    return "–" if value is None else rounded(value)


def _percent(value: float, digits: int = 3) -> str:
    return rounded(value, digits) if value >= LEAST_PERCENT else f"< {LEAST_PERCENT:g}"
