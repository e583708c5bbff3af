"""Figures of attenuation: spectrum of K, per cent over distances, the straight lines behind it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from lightfield.report.style import DATA, FORMULA, MUTED, RENDER, SERIES, WIDTH, figure, label
from lightfield.studies.attenuation.apparent import Apparent
from lightfield.studies.attenuation.text import some

#: Distances and colours that a figure can show apart.
LINES = 6


def percent_figure(one: Apparent) -> Figure:
    """Light lost per metre and over every distance that was measured, with bands of one standard error."""
    colour, distances = one.ratios.wavelength_nm, np.unique(np.round(one.ratios.path_m, 3))
    marker = "o" if len(colour) < 30 else ""
    with figure(WIDTH, 4.2) as fig:
        left, right = fig.subplots(1, 2)
        value, error = one.percent()
        left.fill_between(colour, value - error, value + error, color=RENDER, alpha=0.25, linewidth=0)
        left.plot(colour, value, color=RENDER, marker=marker, markersize=4)
        if len(colour) == 1:
            left.errorbar(colour, value, error, color=RENDER, marker="o", capsize=3)
        least = int(np.argmin(value))
        left.annotate(
            f"least: {value[least]:.1f} ± {error[least]:.1f} % at {colour[least]:g} nm",
            (colour[least], value[least]), (0, -22), textcoords="offset points", ha="center", color=RENDER,
        )  # fmt: skip
        low, high = left.get_ylim()
        left.set_ylim(min(low, value[least] - 0.25 * (high - low)), high)
        left.axvspan(500, 550, color=MUTED, alpha=0.12, linewidth=0)
        label(left, "wavelength (nm)", "% lost per metre", "What the receiver loses per metre")
        for k, d in enumerate(distances[some(len(distances), LINES)]):
            value, error = one.percent(float(d))
            shade = SERIES[k % len(SERIES)]
            right.fill_between(colour, value - error, value + error, color=shade, alpha=0.2, linewidth=0)
            right.plot(colour, value, color=shade, marker=marker, markersize=3, label=f"{d:g} m")
        right.axvspan(500, 550, color=MUTED, alpha=0.12, linewidth=0)
        right.legend(title="distance", loc="best")
        label(right, "wavelength (nm)", "% lost", "… and over each distance")
    return fig


def lines_figure(one: Apparent) -> Figure:
    """ln(water / air) against distance with the fitted straight lines, and what is left over."""
    r, e = one.ratios, one.estimate
    order = np.argsort(r.path_m)
    with figure(WIDTH, 3.8) as fig:
        upper, lower = fig.subplots(1, 2)
        for k, colour in enumerate(some(len(one.K_per_m), LINES)):
            shade = SERIES[k % len(SERIES)]
            error = np.hypot(r.stderr[:, colour], r.stay_stderr[r.stay])
            upper.errorbar(r.path_m, r.y[:, colour], error, color=shade, fmt="o", markersize=4)
            line = e.theta[colour, 0] - one.K_per_m[colour] * r.path_m
            upper.plot(r.path_m[order], line[order], color=shade, label=f"{r.wavelength_nm[colour]:g} nm")
        upper.legend(loc="lower left", fontsize=8.5)
        label(upper, "path in water (m)", "ln(water / air)", "Straight lines, to the eye")
        scaled = e.residual / r.stderr
        for colour in range(scaled.shape[1]):
            lower.plot(r.path_m, scaled[:, colour], ".", color=DATA, alpha=0.4, markersize=4)
        lower.axhline(0, color=MUTED, linewidth=0.8)
        twin = 100 * e.beta
        for place, value in zip(r.path_m, twin[r.stay], strict=True):
            lower.annotate(
                f"{value:+.1f} %".replace("-", "\N{MINUS SIGN}"), (place, 0.97), ha="center", va="top",
                xycoords=("data", "axes fraction"), fontsize=8.5, color=FORMULA,
            )  # fmt: skip
        reach = float(np.nanmax(np.abs(scaled), initial=1.0))
        lower.set_ylim(-1.15 * reach, 1.5 * reach)
        label(
            lower, "path in water (m)", "residual / its standard error", "Left over; above: error of the stay"
        )
    return fig
