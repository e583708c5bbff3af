"""Pages of the follower, of one template: sections with figures and a table each."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from lightfield.report.follower.array_figures import (
    SHOWN,
    WORDS,
    comparison_figure,
    map_figure,
    survey_figure,
)
from lightfield.report.page import PageFigure, Section, SideBySide, Table, page_figure, study_page
from lightfield.scene import Scene
from lightfield.studies.follower.design.compared import Arrays
from lightfield.studies.follower.frames import in_degrees
from lightfield.studies.follower.information import Bound, is_told, with_doubt_in_words
from lightfield.studies.follower.survey import DOCKING_ASKS, LOOKS_AWAY, Survey
from lightfield.wording import minus

_NOT_MODELLED = (
    "shadow and reflections of the follower itself, receivers that accept less than a half space, and light "
    "that reaches an element from behind its plane"
)


def section(
    title: str,
    figures: Sequence[PageFigure] = (),
    caption: str = "",
    head: Sequence[str] = (),
    rows: Sequence[Sequence[str]] = (),
    words: Collection[int] = (),
) -> Section:
    """A heading, its figures, and a table where there are rows for it."""
    return Section(title, figures, tables=[Table(caption, head, rows, words)] if rows else ())


def page(
    title: str,
    verdict: str,
    lead: Sequence[str],
    sections: Sequence[Section],
    scene: Scene,
    provenance: Sequence[tuple[str, str]] = (),
) -> str:
    """A page of a follower in a scene."""
    title = f"{title}: {scene.name}" if scene.name else title
    origin = [*provenance, ("scene", scene.digest()[:16]), ("left out", _NOT_MODELLED)]
    return study_page(title, verdict, lead, sections, scene.to_toml(), origin)


def light_in_words(traced: bool) -> str:
    """Which light a study used, for its table of origins."""
    if traced:
        return "traced: direct, scattered and reflected, as a flux vector on cosine receivers"
    return "formula: Gaussian beam, inverse square, Beer-Lambert; nothing scattered"


def bound_row(title: str, one: Bound) -> list[str]:
    """Standard deviations, the correlation of x and yaw, and the sum of variances."""
    cells = []
    for name, sigma in one.sigma.items():
        shown = with_doubt_in_words(SHOWN[name][1] * sigma, one.doubt.get(name, 0.0))
        cells.append(shown if is_told(name, sigma) else "unknown")
    tied = one.correlation("x", "yaw") if "yaw" in one.names else np.nan
    return [title, *cells, minus(f"{tied:+.2f}") if np.isfinite(tied) else "–", f"{one.criteria['A']:.3g}"]


def survey_page(survey: Survey) -> str:
    """Page of `array show`."""
    place = in_degrees(survey.here.pose)
    rows = [bound_row(survey.on_axis(one), one) for one in survey.axis]
    rows.append(bound_row(f"scene: x {place[0]:g}, z {place[2]:g} m, yaw {place[3]:g} deg", survey.here))
    rival = [
        [f"{r.sigma:.1f}", *(f"{v:.3g}" for v in in_degrees(r.pose)), f"{r.gain:.3g}"] for r in survey.rivals
    ]
    sections = [
        section(
            "What one reading can tell",
            [
                page_figure(
                    "array",
                    SideBySide(
                        "the elements and where they face.",
                        "the smallest error any method can have (Cramer-Rao), as a part of what docking "
                        "allows; numbers in mm and degrees.",
                    ),
                    "Array and bounds",
                    survey_figure,
                    survey,
                )
            ],
            "One standard deviation of the best unbiased estimate from one reading of all elements, ± error "
            "of the trace where there is one. A: sum of the variances in units of 1 cm across, 10 cm along, "
            "1 degree.",
            ["where", *(f"{WORDS[n]} ({SHOWN[n][0]})" for n in survey.here.names), "x with yaw", "A"],
            rows,
        ),
        section(
            "Over the formation space",
            [
                page_figure(
                    "maps",
                    "From above, lamp below, follower facing along the tank. Dark: poorly known. Red line: "
                    "what docking allows. Circle: the scene's pose. Per cent: part of the space good enough.",
                    "Maps of the bounds",
                    map_figure,
                    survey,
                )
            ],
        ),
        section(
            "Poses that look alike" if rival else "No other pose looks alike",
            (),
            "Poses whose readings differ by less than 5 sigma from those at the scene's pose.",
            ("sigma", "x (m)", "y (m)", "z (m)", "yaw (deg)", "pitch (deg)", "roll (deg)", "gain"),
            rival,
        ),
    ]
    unknown = ", ".join(f"{k} (standard deviation {v:.3g})" for k, v in survey.nuisances.items()) or "nothing"
    origin = [("light", light_in_words(survey.traced)), ("unknown beside the pose", unknown)]
    lead = [f"Docking asks for {DOCKING_ASKS}.", *([LOOKS_AWAY] if survey.looks_away else [])]
    lead += [survey.why_unknown] if survey.tied else []
    return page("Detector array", _survey_headline(survey), lead, sections, survey.scene, origin)


def _survey_headline(survey: Survey) -> str:
    where = f"in {100 * survey.reaches:.0f} % of the formation space"
    if survey.reaches in (0, 1):
        where = "everywhere" if survey.reaches else "nowhere in the formation space"
    said = [f"{len(survey.elements)} elements know where they are well enough to dock {where}"]
    if blind := [WORDS[n] for n, s in survey.here.sigma.items() if not is_told(n, s)]:
        said.append(f"blind to {', '.join(blind)}")
    if survey.rivals:
        said.append(survey.rivals_in_words)
    return f"{'; '.join(said)}."


def arrays_page(found: Arrays) -> str:
    """Page of `array compare` and `array optimise`."""
    best = found.arrays[0]
    rows = [
        [
            one.name,
            str(len(one.elements)),
            one.told_criterion,
            *(f"{SHOWN[n][1] * s:.3g}" if is_told(n, s) else "unknown" for n, s in one.sigma.items()),
        ]
        for one in found.arrays
    ]
    places = [
        [str(k + 1), *(f"{1e3 * v:.0f}" for v in place), *(f"{v:+.0f}" for v in tilts)]
        for k, (place, tilts) in enumerate(zip(best.elements.place_m, best.elements.tilts_deg, strict=True))
    ]
    sections = [
        section(
            "Side by side",
            [
                page_figure(
                    "arrays",
                    "Every array seen from behind; arrows: where its elements face. Points: sum of the "
                    "variances, smaller is better; a factor of 4 is half the error.",
                    "Arrays side by side", comparison_figure, found.arrays,
                )
            ],
            f"Root mean square bounds over the poses of the task ({found.task}).",
            ["array", "elements", "A", *(f"{WORDS[n]} ({SHOWN[n][0]})" for n in best.sigma)],
            rows,
        ),
        section(
            f"Elements of {best.name}",
            (),
            "Places and tilts towards +x and +y.",
            ("", "x (mm)", "y (mm)", "z (mm)", "tilt x (deg)", "tilt y (deg)"),
            places,
        ),
    ]  # fmt: skip
    lead = [
        "Compared by A: the sum of the variances of the pose in units of 1 cm across, 10 cm along, 1 degree."
    ]
    origin = [("light", light_in_words(found.traced)), ("task", found.task)]
    return page("Detector arrays", f"{found.verdict}.", lead, sections, found.scene, origin)
