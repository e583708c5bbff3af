"""Figures of attenuation: spectrum of K, per cent over distances, the straight lines behind it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lightfield.arrays import evenly
from lightfield.readings.columns import LINE_DECIMALS
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
    legend_under,
    panels,
    plain_log_axis,
)
from lightfield.studies.attenuation.apparent import Apparent
from lightfield.studies.attenuation.scattered import Scattered
from lightfield.studies.attenuation.study import Content
from lightfield.wording import capital, minus

#: Errors that are smaller are told with two decimals.
_SMALL_PERCENT = 0.1
#: Distances and colours that a figure can show apart.
_LINES = 6


def percent_figure(one: Apparent, narrow: bool = False) -> Figure:
    """Light lost per metre and over every distance that was measured, with bands of one standard error.

    Grey: wavelengths of what was published of this water.
    """
    colour, distances = one.ratios.wavelength_nm, np.unique(np.round(one.path_m, LINE_DECIMALS))
    marker = "o" if len(colour) < 30 else ""
    with panels(2, 4.2, narrow=narrow) as (fig, (left, right)):
        value, error = one.percent()
        banded(left, colour, value, error, color=RENDER, marker=marker, markersize=4)
        if len(colour) == 1:
            left.errorbar(colour, value, error, color=RENDER, marker="o", capsize=3)
        least = int(np.argmin(value))
        digits = 1 if error[least] >= _SMALL_PERCENT else 2
        left.annotate(
            f"least: {value[least]:.{digits}f} ± {error[least]:.{digits}f} % at {colour[least]:g} nm",
            (colour[least], value[least]), (0, -22), textcoords="offset points", color=RENDER,
            ha="left" if colour[least] < colour.mean() else "right",
        )  # fmt: skip
        low, high = left.get_ylim()
        left.set_ylim(min(low, value[least] - 0.25 * (high - low)), high)
        for first, last, K in one.ratios.published:
            for axis in (left, right):
                axis.axvspan(first, last, color=MUTED, alpha=0.12, linewidth=0)
            level = -100 * np.expm1(-K)
            left.plot([first, last], [level, level], color=BAD, linewidth=3)
            left.annotate(
                f"published: {level:.1f} %",
                (0.5 * (first + last), level),
                (0, 26),
                color=BAD,
                textcoords="offset points",
                ha="center",
            )
        label(left, "wavelength (nm)", "% lost per metre", "What the receiver loses per metre")
        for k, d in enumerate(distances[evenly(len(distances), _LINES)]):
            value, error = one.percent(float(d))
            shade = SERIES[k % len(SERIES)]
            drawn: dict[str, Any] = {"marker": marker, "markersize": 3, "label": f"{d:.3g} m"}
            banded(right, colour, value, error, alpha=0.2, color=shade, **drawn)
        legend_under(right, columns=3, title="distance")
        label(right, "wavelength (nm)", "% lost", "… and over each distance")
    return fig


def lines_figure(one: Apparent, narrow: bool = False) -> Figure:
    """ln(water / air) against distance with the fitted straight lines, and what is left over."""
    r, e, here, path_m = one.ratios, one.estimate, one.on_line, one.path_m
    order = np.argsort(path_m)
    chosen = evenly(len(one.K_per_m), _LINES)
    with panels(2, 3.8, narrow=narrow) as (fig, (upper, lower)):
        for k, colour in enumerate(chosen):
            shade = SERIES[k % len(SERIES)]
            error = np.hypot(r.stderr[:, colour], r.shared_stderr)[here]
            upper.errorbar(path_m, r.y[here, colour], error, color=shade, fmt="o", markersize=4)
            line = e.theta[colour, 0] - one.K_per_m[colour] * path_m
            upper.plot(path_m[order], line[order], color=shade, label=f"{r.wavelength_nm[colour]:g} nm")
        cut = f"{len(chosen)} of {len(one.K_per_m)} wavelengths" if len(chosen) < len(one.K_per_m) else None
        legend_under(upper, columns=3, title=cut)
        label(upper, "path in water (m)", "ln(water / air)", "Straight lines, to the eye")
        scaled = (e.residual / r.stderr)[here]
        for colour in range(scaled.shape[1]):
            lower.plot(path_m, scaled[:, colour], ".", color=DATA, alpha=0.4, markersize=4)
        lower.axhline(0, color=MUTED, linewidth=0.8)
        stays, stay = 100 * e.beta[: len(r.stay_stderr)], r.stay[here]
        decimals = 1 if np.abs(stays).max() >= _SMALL_PERCENT else 2
        for k, value in ((k, stays[k]) for k in np.unique(stay)):
            told = minus(f"{value:+.{decimals}f} %")
            lower.annotate(
                told, (path_m[stay == k].mean(), 0.97), ha="center", va="top",
                xycoords=("data", "axes fraction"), fontsize=8.5, color=FORMULA,
            )  # fmt: skip
        lower.margins(x=0.09)
        reach = float(np.nanmax(np.abs(scaled), initial=1.0))
        lower.set_ylim(-1.15 * reach, 1.5 * reach)
        label(
            lower, "path in water (m)", "residual / its standard error", "Left over; above: error of the stay"
        )
    return fig


def hidden_figure(one: Apparent, found: Scattered, content: Content | None, narrow: bool = False) -> Figure:
    """Left: K between a and c. Right: the line of a and b that the readings allow at the clearest colour."""
    colour, k = found.wavelength_nm, int(np.argmin(found.combined))
    with panels(2, 4.0, narrow=narrow) as (fig, (left, right)):
        drawn: dict[str, Any] = {"marker": "o", "markersize": 3, "label": "K, as measured"}
        banded(left, colour, one.K_per_m, one.K_stderr, color=DATA, **drawn)
        if content is not None and content.traced is not None:
            water = content.traced.water
            seen = one.ratios.seen
            a, b = ((seen.share * v).sum(axis=1) for v in seen.coefficients(water))
            left.plot(colour, a, color=RENDER, label="a of the best constituents")
            left.plot(colour, a + b, color=FORMULA, linestyle=DASH, label="c = a + b")
            left.fill_between(colour, a, a + b, color=FORMULA, alpha=0.08, linewidth=0)
        if found.told.any():
            at = found.told
            left.errorbar(
                colour[at],
                found.a[at],
                found.a_stderr[at],
                color=RENDER,
                fmt="s",
                markersize=3,
                label="a, told",
            )
        left.set_yscale("log")
        plain_log_axis(left.yaxis)
        legend_under(left)
        label(left, "wavelength (nm)", "1/m", "K is neither a nor c")
        b = np.linspace(0.0, min(found.largest_b, 1.1 * found.combined[k] / found.kappa[k]), 50)
        line, error = found.combined[k] - found.kappa[k] * b, found.combined_stderr[k]
        told = f"a + {found.kappa[k]:.2f} b, as told at {colour[k]:g} nm"
        banded(right, b, line, error, color=RENDER, label=told)
        right.plot(b, one.K_per_m[k] - b, color=FORMULA, linestyle=DASH, label="a + b = K (Beer-Lambert)")
        if found.told[k]:
            right.errorbar(
                found.b[k], found.a[k], found.a_stderr[k], found.b_stderr[k], color=DATA, fmt="o", capsize=3,
                label="told by this layout",
            )  # fmt: skip
        right.set_ylim(bottom=0)
        right.set_xlim(left=0)
        legend_under(right)
        label(right, "scattering b (1/m)", "absorption a (1/m)", "Which a and b agree with the readings")
    return fig


def content_figure(found: Content, narrow: bool = False) -> Figure:
    """Each constituent by each model: 95 % thin, 68 % thick; other phase functions as open marks."""
    models = [
        (m, name, shade)
        for m, name, shade in (
            (found.traced, "scattered light traced", RENDER),
            (found.loose, "… grey scattering free", SERIES[2]),
            (found.beer_lambert, "Beer-Lambert", FORMULA),
        )
        if m is not None
    ]
    names = list(found.beer_lambert.amounts)
    with panels(len(names), 2.7, narrow=narrow, each=1.9, sharey=True) as (fig, axes):
        for axis, name in zip(axes, names, strict=True):
            for row, (model, _, shade) in enumerate(models):
                amount, y = model.amounts[name], len(models) - row
                axis.plot([amount.low_95, amount.high_95], [y, y], color=shade, linewidth=1.5)
                axis.plot([amount.low_68, amount.high_68], [y, y], color=shade, linewidth=6, alpha=0.5)
                axis.plot(amount.value, y, "o", color=shade, markersize=6)
            for k, (g, amounts) in enumerate(found.other_phases.items()):
                axis.plot(amounts[name], len(models), "D", color=RENDER, fillstyle="none", markersize=6)
                axis.annotate(
                    f"g {g:g}", (amounts[name], len(models)), (0, 7 if k else -15), color=RENDER,
                    textcoords="offset points", ha="center", fontsize=8.5,
                )  # fmt: skip
            first = found.beer_lambert.amounts[name]
            axis.axvline(0, color=MUTED, linewidth=0.8)
            axis.set_ylim(0.5, len(models) + 0.6)
            axis.locator_params(axis="x", nbins=3)
            label(axis, first.unit, "", capital(first.name))
        axes[0].set_yticks(range(len(models), 0, -1), [name for _, name, _ in models])
    return fig
