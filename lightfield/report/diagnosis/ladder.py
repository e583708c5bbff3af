"""Figures of how a diagnosis ends: the ladder of models and their errors, and what can be told apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke

from lightfield.arrays import Array
from lightfield.diagnosis.search.told_apart import SAME_CLASS_SIGMA
from lightfield.diagnosis.verdict.parts import FAR_OFF_PERCENT, Rung
from lightfield.report.diagnosis.figures import LEAST_PERCENT, NARROW
from lightfield.report.diagnosis.view import Separation
from lightfield.report.page import three_digits
from lightfield.report.style import (
    FORMULA,
    GOOD,
    LETTER,
    MUTED,
    RENDER,
    SERIES,
    WIDTH,
    figure,
    label,
    plain_log_axis,
)
from lightfield.wording import plain

_SURE_SIGMA = 6.0
#: Inches that the axis takes, and the number beside a point. Chosen by eye.
_AXIS_IN, _OF_A_NUMBER = 0.9, 0.6
#: Rungs whose errors lie farther apart than this are drawn on a logarithmic axis.
FAR_APART = 8.0


def ladder_figure(ladder: Sequence[Rung], noise_floor_percent: float | None, narrow: bool = False) -> Figure:
    """Error of every rung falling towards the noise floor; the last rung rendered afresh."""
    at = np.arange(len(ladder))
    error = np.array([rung.error_percent for rung in ladder], float)
    held_out = np.array([np.nan if r.held_out_percent is None else r.held_out_percent for r in ladder])
    held_out = np.where(held_out > FAR_OFF_PERCENT, np.nan, held_out)
    texts = [
        f"{three_digits(value)} %" if value >= LEAST_PERCENT else f"< {LEAST_PERCENT:g} %" for value in error
    ]
    error, held_out = np.maximum(error, LEAST_PERCENT), np.maximum(held_out, LEAST_PERCENT)
    wide = NARROW if narrow else max(4.5, min(WIDTH, 2.6 + 1.6 * len(ladder)))
    names = [plain(rung.label) for rung in ladder]
    room = (wide - _AXIS_IN) / len(ladder)
    fits = max(len(line) for name in names for line in name.splitlines()) * LETTER < room
    with figure(wide, 3.2 if fits or not narrow else 4.2) as fig:
        axis = fig.subplots()
        if noise_floor_percent is not None:
            _noise_floor(axis, noise_floor_percent)
        axis.plot(at, error, color=RENDER, marker="o", markersize=7, label="error of the fit")
        if np.isfinite(held_out).any():
            each = "each plane predicted from the others"
            axis.plot(at, held_out, "D", color=MUTED, mfc="none", markersize=6, label=each)
        shown = np.isfinite(error)  # a dark model has no error in per cent
        told = np.flatnonzero(shown)
        if room < _OF_A_NUMBER:  # the table has them all
            told = told[[0, -1]]
        for k in told:
            # Under the line of the floor a number stands below its point, or the line would cross it.
            below = noise_floor_percent is not None and error[k] <= noise_floor_percent
            beside = (8, -14 if below else 5)
            axis.annotate(
                texts[k], (float(k), float(error[k])), beside, textcoords="offset points", fontsize=10,
                weight="bold", path_effects=[withStroke(linewidth=3, foreground="white")],
            )  # fmt: skip
        for x, rung in zip(at, ladder, strict=True):
            if rung.rendered_error_percent is not None:
                axis.errorbar(
                    [x], [rung.rendered_error_percent], [rung.rendered_stderr_percent or 0.0], fmt="*",
                    color=FORMULA, markersize=12, label="rendered afresh",
                )  # fmt: skip
        floor = [] if noise_floor_percent is None else [noise_floor_percent]
        _over_all(axis, np.concatenate([error[shown], held_out[np.isfinite(held_out)], floor]))
        if fits:
            axis.set_xticks(at, names)
        else:
            turn = 60 if narrow else 20
            axis.set_xticks(at, names, rotation=turn, ha="right", rotation_mode="anchor")
        axis.set_xlim(-0.4, len(ladder) - 0.4)
        axis.grid(False, axis="x")
        axis.set_ylabel("rms error (%)")
        handles, names = axis.get_legend_handles_labels()
        fig.legend(handles, names, loc="outside lower left", ncols=2 if len(ladder) > 1 and not narrow else 1)
    return fig


def _noise_floor(axis: Axes, percent: float) -> None:
    axis.axhspan(0, percent, color=GOOD, alpha=0.14, linewidth=0)
    # Named in the legend: beside the line there is a point wherever an error comes near to it.
    axis.axhline(percent, color=GOOD, linewidth=1.2, label=f"noise floor {three_digits(percent)} %")


def _over_all(axis: Axes, percent: Array) -> None:
    """Let the axis reach over all that is drawn, on a logarithmic scale where that is much."""
    if not percent.size:
        axis.set_ylim(0, 1)
    elif percent.max() > FAR_APART * max(percent.min(), 1e-6):
        axis.set_yscale("log")
        axis.set_ylim(0.6 * percent.min(), 1.9 * percent.max())
        plain_log_axis(axis.yaxis)
    else:
        axis.set_ylim(0, 1.18 * percent.max())


def separation_figure(separation: Separation, narrow: bool = False) -> Figure:
    """How far the explanations are apart; under three sigma they cannot be told apart."""
    k = len(separation.names)
    names = ["\n+ ".join(map(plain, effects)) for effects in separation.names]
    above = names
    if narrow:  # columns by the numbers of rows
        names, above = [f"{n}  {name}" for n, name in enumerate(names, 1)], [str(n + 1) for n in range(k)]
    with figure(NARROW if narrow else min(WIDTH, 2.6 + 0.85 * k), 1.5 + 0.42 * k) as fig:
        axis = fig.subplots()
        for j in range(k):
            for i in range(k):
                if i == j:
                    continue
                value = float(separation.sigma[j, i])
                text = ">99" if value > 99 else f"{value:.0f}" if value >= 10 else f"{value:.1f}"
                colour, alpha, weight = (
                    (FORMULA, 0.45, "bold")
                    if value < SAME_CLASS_SIGMA
                    else (SERIES[4], 0.28, "normal")
                    if value < _SURE_SIGMA
                    else (GOOD, 0.16, "normal")
                )
                cell = Rectangle((i - 0.48, j - 0.46), 0.96, 0.92, facecolor=colour, alpha=alpha, linewidth=0)
                axis.add_patch(cell)
                axis.text(i, j, text, ha="center", va="center", fontsize=10, weight=weight)
        axis.set_xlim(-0.55, k - 0.45)
        axis.set_ylim(k - 0.45, -0.55)
        if narrow:
            axis.set_xticks(range(k), above)
        else:
            axis.set_xticks(range(k), above, rotation=30, ha="right", rotation_mode="anchor")
        axis.set_yticks(range(k), names)
        axis.grid(False)
        for side in ("left", "bottom"):
            axis.spines[side].set_visible(False)
        axis.tick_params(length=0)
        label(axis, "imitated by", "true", "")
    return fig
