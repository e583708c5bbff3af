"""How far a lamp carries data, as a page: errors per bit, power and bandwidth against distance."""

from __future__ import annotations

import numpy as np
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
from lightfield.studies.working_range.text import UNTOLD

#: Below this many errors per bit a figure shows none.
_LEAST_BER = 1e-12


def reach_figure(found: Link, narrow: bool = False) -> Figure:
    """Left: errors per bit against distance. Right: how far each water lets data go, and docking reports."""
    data, z = found.dataset, found.dataset.z_m.values
    names = [str(name) for name in data.water.values]
    with panels(2, 4.2, narrow=narrow) as (fig, (left, right)):
        for k, name in enumerate(names):
            shade = SERIES[k % len(SERIES)]
            left.plot(z, np.maximum(data.ber.values[k], _LEAST_BER), color=shade, label=name)
            left.plot(z, np.maximum(data.ber_formula.values[k], _LEAST_BER), color=shade, linestyle=DASH)
        left.axhline(found.receiver.ber, color=BAD, linewidth=1)
        left.set_yscale("log")
        left.set_ylim(_LEAST_BER, 0.6)
        label(
            left, "z (m)", "errors per bit", f"{found.receiver.bit_rate_per_s / 1e6:g} Mbit/s, on-off keying"
        )
        far = float(z[-1])
        for k, name in enumerate(names):
            reach, y = found.reaches[name], len(names) - k
            docking = reach.docking
            for at, near, formula, most, above, words in (
                (reach.data_m, np.nan, reach.data_formula_m, far, 0.18, "data"),
                (docking.z_m, docking.from_m, docking.formula_m, found.docking_to_m, -0.18, "docking"),
            ):
                length, begin = (0.0 if np.isnan(v) else min(v, most) for v in (at, near))
                right.barh(
                    y + above, length - begin, left=begin, height=0.32, color=SERIES[k % len(SERIES)],
                    alpha=0.45,
                )  # fmt: skip
                straight = most if np.isinf(formula) else 0.0 if np.isnan(formula) else formula
                right.plot([straight] * 2, [y + above - 0.16, y + above + 0.16], color=INK, linewidth=2)
                shown = f"> {most:g} m" if np.isinf(at) else f"{length:.1f} m"
                if np.isfinite(near):
                    shown = f"{near:.1f} m to {shown}"
                shown = surely(shown, reach.data_sure_m if words == "data" else docking.sure_m)
                if np.isnan(at):
                    told = words == "data" or docking.is_told
                    shown = f"nowhere from {z[0]:g} m on" if told else UNTOLD
                right.annotate(
                    f"{words}: {shown}",
                    (max(length, straight), y + above),
                    (5, 0),
                    textcoords="offset points",
                    va="center",
                    fontsize=8.5,
                )
        right.set_xlim(0, 1.45 * far)
        right.set_yticks(range(len(names), 0, -1), names)
        right.grid(False, axis="y")
        label(right, "farthest distance (m)", "", "With scattered light; black: by exp(−cz)")
        legend_below(fig, left, title="lines; dashed: exp(−cz)")
    return fig


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
        Section(
            "What arrives",
            (light,),
            (lamp, bandwidth_sentence(found)),
        ),
    ]
    title = f"{found.scene.name or 'Lamp'}: optical link"
    return study_page(title, headline(found), (), sections, found.scene.to_toml())
