"""How far a lamp can be used, as a page: light, spot and accuracy of a pose against distance."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from lightfield.arrays import Array
from lightfield.report.page import Section, Table, page_figure, study_page
from lightfield.report.style import (
    BAD,
    DASH,
    DATA,
    FORMULA,
    MUTED,
    RENDER,
    SERIES,
    banded,
    label,
    legend_below,
    panels,
    percent_axis,
    plain_log_axis,
    say_why_empty,
)
from lightfield.studies.compare.rings import SIGMAS
from lightfield.studies.follower.information import NOTHING_M, NOTHING_RAD
from lightfield.studies.working_range.reaches import POSE_RULES
from lightfield.studies.working_range.study import WorkingRange
from lightfield.studies.working_range.text import (
    array_sentence,
    asked_sentences,
    columns,
    distance,
    distance_or_none,
    headline,
    rows,
)


def fall_figure(found: WorkingRange, narrow: bool = False) -> Figure:
    """Normalised intensity against distance (left) and the radius of half intensity (right)."""
    data, z = found.dataset, found.dataset.z_m.values
    with panels(2, 4.2, narrow=narrow) as (fig, (left, right)):
        light, error = data.light.values, SIGMAS * data.light_stderr.values
        if found.traced:
            banded(left, z, light, error, alpha=0.3, color=RENDER, label="with scattered light")
        left.plot(z, data.formula.values, color=FORMULA, linestyle=DASH, label="formula, exp(−cz)")
        if found.readings is not None:
            r = found.readings
            left.errorbar(
                r.z_m.values,
                r.value.values,
                r.stderr.values,
                color=DATA,
                fmt="o",
                capsize=3,
                label="readings",
            )
        rule = found.reaches[0]
        left.axhline(found.share, color=MUTED, linewidth=0.9)
        for at, other, shade, words in (
            *([(rule.z_m, rule.formula_m, RENDER, distance(rule))] if found.traced else []),
            (rule.formula_m, rule.z_m, FORMULA, distance_or_none(rule.formula_m)),
        ):
            if np.isfinite(at):
                left.plot([at, at], [0, found.share], color=shade, linewidth=1)
                # The farther one above the light, the nearer below it.
                farther = at > other if at != other else shade is RENDER
                left.annotate(
                    words, (at, found.share if farther else 0.02), (3 if farther else -8, 4 * farther),
                    textcoords="offset points", color=shade, fontsize=9, ha="left" if farther else "right",
                )  # fmt: skip
        left.set_ylim(bottom=0)
        percent_axis(left.yaxis)
        left.legend(loc="upper right")
        label(left, "z (m)", f"light over that at {found.reference_m:g} m", "On the axis")
        half, half_error = data.half_radius_m.values, SIGMAS * data.half_radius_stderr_m.values
        if found.traced:
            banded(right, z, half, half_error, alpha=0.3, color=RENDER, label="with scattered light")
        right.plot(z, data.half_radius_formula_m.values, color=FORMULA, linestyle=DASH, label="formula")
        if found.readings is not None and np.isfinite(found.readings.half_radius_m.values).any():
            r = found.readings
            right.plot(r.z_m.values, r.half_radius_m.values, "o", color=DATA, label="readings")
        right.set_ylim(bottom=0)
        right.legend(loc="upper left")
        label(right, "z (m)", "radius of half intensity (m)", "Across the beam")
    return fig


#: Beyond such errors nothing is known, by the unit.
_NOTHING = {"m": NOTHING_M, "deg": float(np.degrees(NOTHING_RAD))}
#: What is shown about what docking asks where nothing is known, in its multiples: less below, for the words.
_ABOUT = 0.4, 10.0
_TITLES = {"across": "Across the beam", "along": "Along the beam", "turned": "Yaw and pitch"}


def pose_figure(found: WorkingRange, narrow: bool = False) -> Figure:
    """Least standard errors of a pose against distance, with what docking asks."""
    data, z = found.dataset, found.dataset.z_m.values
    with panels(3, 4.1, narrow=narrow, each=2.9) as (fig, axes):
        for axis, (name, (_, unit, limit)) in zip(axes, POSE_RULES.items(), strict=True):
            for suffix, shade, words in (
                ("", RENDER, "gain known as the scene says"),
                ("_relative", SERIES[2], "relative readings only"),
            ):
                sigma = _where_told(data[f"sigma_{name}{suffix}_{unit}"].values, unit)
                error = SIGMAS * data[f"sigma_{name}{suffix}_stderr_{unit}"].values
                banded(axis, z, sigma, error, least=1e-2, alpha=0.3, color=shade, label=words)
                if found.traced:
                    by_formula = _where_told(data[f"sigma_{name}{suffix}_formula_{unit}"].values, unit)
                    axis.plot(z, by_formula, color=shade, linestyle=DASH, alpha=0.7)
            drawn = axis.get_lines()
            axis.axhline(limit, color=BAD, linewidth=1)
            axis.annotate(
                f"asked: {limit:g} {unit}",
                (z[-1] if name == "turned" else z[0], limit),
                (-2 if name == "turned" else 2, 3),
                textcoords="offset points",
                color=BAD,
                fontsize=9,
                ha="right" if name == "turned" else "left",
                path_effects=[withStroke(linewidth=3, foreground="white")],
            )
            axis.set_yscale("log")
            if not any(np.isfinite(line.get_ydata()).any() for line in drawn):
                axis.set(xlim=(z[0], z[-1]), ylim=limit * np.array(_ABOUT))
                say_why_empty(axis, "not known\nat any distance")
            plain_log_axis(axis.yaxis)
            label(axis, "z (m)", f"standard error ({unit})", _TITLES[name])
        legend_below(fig, axes[0], columns=1 if narrow else 4)
    return fig


def _where_told(sigma: Array, unit: str) -> Array:
    """Standard errors, NaN where nothing is known: drawn, they would be all that the axis shows."""
    return np.where(sigma < _NOTHING[unit], sigma, np.nan)


def range_page(found: WorkingRange) -> str:
    """The page."""
    bands = f"Bands of {SIGMAS:g} standard errors of the render. " if found.traced else ""
    light = page_figure(
        "light", f"{bands}Grey line: what must be left.",
        "Light on the axis and radius of half intensity against distance", fall_figure, found,
    )  # fmt: skip
    dashed = "Dashed: the same by the formula. " if found.traced else ""
    pose = page_figure(
        "pose", f"{dashed}{bands}Red: what docking asks.",
        "Least standard errors of a pose against distance", pose_figure, found,
    )  # fmt: skip
    told = (
        "± is one standard error of the render; what is sure holds with bounds two of them worse, too."
        if found.traced
        else "By direct light alone."
    )
    table = Table(told, ("what holds", *columns(found)), rows(found))
    sections = [
        Section("How far", (light,), asked_sentences(found), (table,)),
        Section("What an array of receivers tells of its pose", (pose,), (array_sentence(found),)),
    ]
    title = f"{found.scene.name or 'Lamp'}: working range"
    return study_page(title, headline(found), (), sections, found.scene.to_toml())
