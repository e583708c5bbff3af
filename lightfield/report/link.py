"""How far a lamp carries data, as a page: errors per bit, power and bandwidth against distance."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lightfield.report.page import Section, Table, page_figure, study_page
from lightfield.report.style import BAD, DASH, INK, SERIES, banded, label, legend_below, panels, say_why_empty
from lightfield.studies.compare.rings import SIGMAS
from lightfield.studies.link.study import Link
from lightfield.studies.link.text import (
    HEAD,
    REPORTED_HEAD,
    asked_words,
    bandwidth_sentence,
    headline,
    in_band_words,
    keying_words,
    reported_rows,
    rows,
    surely,
)
from lightfield.studies.working_range.reaches import Reach
from lightfield.studies.working_range.text import UNTOLD

#: Below this many errors per bit a figure shows none.
_LEAST_BER = 1e-12


def reach_figure(found: Link, narrow: bool = False) -> Figure:
    """Left: errors per bit against distance. Right: how far each water lets data go, and docking reports."""
    with panels(2, 4.2, narrow=narrow) as (fig, (left, right)):
        _draw_errors(left, found)
        _draw_reaches(right, found)
        legend_below(fig, left, title="lines; dashed: exp(−cz)")
    return fig


def _draw_errors(axes: Axes, found: Link) -> None:
    data, z = found.dataset, found.dataset.z_m.values
    for k, name in enumerate(data.water.values):
        shade = SERIES[k % len(SERIES)]
        axes.plot(z, np.maximum(data.ber.values[k], _LEAST_BER), color=shade, label=str(name))
        axes.plot(z, np.maximum(data.ber_formula.values[k], _LEAST_BER), color=shade, linestyle=DASH)
    axes.axhline(found.receiver.ber, color=BAD, linewidth=1)
    axes.set_yscale("log")
    axes.set_ylim(_LEAST_BER, 0.6)
    label(axes, "z (m)", "errors per bit", f"{found.receiver.bit_rate_per_s / 1e6:g} Mbit/s, on-off keying")


def _draw_reaches(axes: Axes, found: Link) -> None:
    """Two bars for each water: data above, docking below."""
    names = [str(name) for name in found.dataset.water.values]
    first, last = (float(z) for z in found.dataset.z_m.values[[0, -1]])
    for k, name in enumerate(names):
        its, y, shade = found.reaches[name], len(names) - k, SERIES[k % len(SERIES)]
        found_at = its.data_m, its.data_stderr_m, its.data_formula_m
        data = Reach("data", *found_at, sure_m=its.data_sure_m)
        for words, reach, most, at in (
            ("data", data, last, y + 0.18), ("docking", its.docking, found.docking_to_m, y - 0.18),
        ):  # fmt: skip
            ends = _draw_bar(axes, reach, most, at, shade)
            axes.annotate(
                f"{words}: {_reach_words(reach, first, most)}",
                (ends, at),
                (5, 0),
                textcoords="offset points",
                va="center",
                fontsize=8.5,
            )
    axes.set_xlim(0, 1.45 * last)
    axes.set_yticks(range(len(names), 0, -1), names)
    axes.grid(False, axis="y")
    label(axes, "farthest distance (m)", "", "With scattered light; black: by exp(−cz)")


def _draw_bar(axes: Axes, reach: Reach, most: float, y: float, shade: str) -> float:
    """A bar, no farther than was asked, and a line where the formula ends; where the longer of both ends."""
    end, begin, formula = (
        0.0 if np.isnan(v) else min(v, most) for v in (reach.z_m, reach.from_m, reach.formula_m)
    )
    axes.barh(y, end - begin, left=begin, height=0.32, color=shade, alpha=0.45)
    axes.plot([formula] * 2, [y - 0.16, y + 0.16], color=INK, linewidth=2)
    return max(end, formula)


def _reach_words(reach: Reach, first: float, most: float) -> str:
    if np.isnan(reach.z_m):
        return f"nowhere from {first:g} m on" if reach.is_told else UNTOLD
    to = f"> {most:g} m" if np.isinf(reach.z_m) else f"{reach.z_m:.1f} m"
    return surely(f"{reach.from_m:.1f} m to {to}" if np.isfinite(reach.from_m) else to, reach.sure_m)


def arrival_figure(found: Link, narrow: bool = False) -> Figure:
    """Left: received power. Right: bandwidth that the lengths of the paths leave."""
    data, z = found.dataset, found.dataset.z_m.values
    with panels(2, 3.6, narrow=narrow) as (fig, (left, right)):
        for k, name in enumerate(str(n) for n in data.water.values):
            shade, power = SERIES[k % len(SERIES)], data.power_w.values[k]
            error = SIGMAS * data.power_stderr_w.values[k]
            banded(left, z, power, error, least=1e-3, color=shade, label=name)
            left.plot(z, data.power_formula_w.values[k], color=shade, linestyle=DASH)
            width = data.bandwidth_hz.values[k] / 1e6
            if np.isfinite(width).any():
                known = np.isfinite(width)
                spread = SIGMAS * data.bandwidth_stderr_hz.values[k] / 1e6
                banded(right, z[known], width[known], spread[known], least=1e-2, color=shade, label=name)
        left.set_yscale("log")
        top, least = (
            float(data.power_w.max()),
            min(float(v.min()) for v in (data.power_w, data.power_formula_w)),
        )
        left.set_ylim(max(1e-14 * top, 0.5 * least) if top > 0 else None, 2 * top if top > 0 else None)
        label(left, "z (m)", "W", "Received power")
        label(right, "z (m)", "MHz", "Bandwidth by the traced paths")
        if np.isfinite(data.bandwidth_hz).any():
            right.set_yscale("log")
        else:
            say_why_empty(right, "no limit at these distances")
            right.set(xticks=[], yticks=[])
        legend_below(fig, left, title="lines; dashed: exp(−cz)")
    return fig


def link_page(found: Link) -> str:
    """The page."""
    reach = page_figure(
        "reach", "Red: the errors that are accepted. Scattered light carries data too.",
        "Errors per bit against distance, and ranges for data and docking", reach_figure, found,
    )  # fmt: skip
    light = page_figure(
        "light", f"Bands of {SIGMAS:g} standard errors of the render.",
        "Received power and bandwidth against distance", arrival_figure, found,
    )  # fmt: skip
    table = Table(
        "± is one standard error of the render.", HEAD, rows(found),
    )  # fmt: skip
    others = Table(
        "What others report, with lamps and receivers of their own: not computed here.", REPORTED_HEAD,
        reported_rows(), (1, 2),
    )  # fmt: skip
    lamp = f"{found.scene.lamp.power_w:g} W lamp, {in_band_words(found)}; {keying_words(found)}."
    sections = [
        Section("How far", (reach,), asked_words(found), (table, others)),
        Section("What arrives", (light,), (lamp, bandwidth_sentence(found))),
    ]
    title = f"{found.scene.name or 'Lamp'}: optical link"
    return study_page(title, headline(found), (), sections, found.scene.to_toml())
