"""Figures of readings at single places, which make no scans: measured against model, and the misfit."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from lightfield.report.diagnosis.figures import (
    MOST_DECADES,
    NARROW,
    misfit_bar,
    misfit_dots,
    rms_title,
    steps,
)
from lightfield.report.diagnosis.view import ReadingsView
from lightfield.report.style import FORMULA, MUTED, RENDER, WIDTH, figure, label


def measured_figure(view: ReadingsView, narrow: bool = False) -> Figure:
    """Readings at single places against what base model and explanation predict there; both logarithmic."""
    readings, kept = view.readings, ~view.readings.left_out
    shown = steps(view)
    unit = float(np.nanmax(np.abs(readings.value))) or 1.0
    least = [np.abs(readings.value[kept]), *(np.abs(view.predictions[k].value[kept]) for k, _ in shown)]
    low = max(min(float(np.nanmin(v[v > 0], initial=unit)) for v in least) / unit, MOST_DECADES)
    size = (NARROW, 1.0 + 3.6 * len(shown)) if narrow else (4.9 * len(shown), 4.6)
    with figure(*size) as fig:
        grid = (len(shown), 1) if narrow else (1, len(shown))
        for axis, (step, name) in zip(fig.subplots(*grid, squeeze=False).ravel(), shown, strict=True):
            colour = RENDER if step else FORMULA
            axis.plot([low / 2, 2], [low / 2, 2], color=MUTED, linewidth=1, label="measured = model")
            axis.errorbar(
                view.predictions[step].value[kept] / unit, readings.value[kept] / unit,
                readings.sigma[kept] / unit, fmt="o", color=colour, markersize=3.4, linewidth=0.8,
                label="readings with their errors",
            )  # fmt: skip
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.set_xlim(low / 2, 2)
            axis.set_ylim(low / 2, 2)
            label(axis, "model / largest reading", "", name)
        fig.axes[0].set_ylabel("measured / largest reading")
        handles, names = fig.axes[0].get_legend_handles_labels()
        fig.legend(handles, names, loc="outside lower center", ncols=1 if narrow else 2)
    return fig


def place_map(view: ReadingsView, narrow: bool = False) -> Figure:
    """Where the misfit of single places lives: distance from the axis over distance along it."""
    readings, shown = view.readings, steps(view)
    size = (NARROW, 0.8 + 2.4 * len(shown)) if narrow else (WIDTH, 3.4)
    with figure(*size) as fig:
        grid = (len(shown), 1) if narrow else (1, len(shown))
        axes = fig.subplots(*grid, squeeze=False, sharex=True, sharey=True).ravel()
        for axis, (step, name) in zip(axes, shown, strict=True):
            dots = misfit_dots(axis, view, step, readings.z_m, np.hypot(readings.x_m, readings.y_m))
            label(axis, "z (m)", "r (m), from the axis", f"{name}: {rms_title(view, step)}")
            axis.margins(0.06, 0.12)
        misfit_bar(fig, dots, axes)
    return fig
