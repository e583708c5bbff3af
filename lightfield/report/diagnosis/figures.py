"""Figures of a diagnosis: data and model, residuals, signatures, ladder, separations."""

from __future__ import annotations

from collections.abc import Iterable
from textwrap import fill

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import ListedColormap, Normalize, SymLogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from numpy.typing import NDArray

from lightfield.arrays import Array, evenly
from lightfield.report.diagnosis.view import DiagnosisView, Group, ReadingsView
from lightfield.report.style import (
    DASH,
    DATA,
    FORMULA,
    GRID,
    MUTED,
    NARROW,
    RENDER,
    SERIES,
    WIDTH,
    banded,
    figure,
    label,
    legend_below,
)
from lightfield.wording import minus, plain

_MOST_PANELS, _MOST_NARROW = 5, 3
#: Readings that span more than this are drawn over decades, and of decades no more than these.
_LOG_FROM, MOST_DECADES = 5.0, 1e-6
LEAST_PERCENT = 0.01  # an exact fit to a few readings leaves rounding errors, which are no finding
_AXIS_NAMES = {"x_m": "x (m)", "y_m": "y (m)", "z_m": "z (m)"}
#: A panel of five has room for so many letters above it, or beside it (chosen by eye).
_ONE_LINE = 18
#: Misfits are drawn linear within the first, and over decades beyond where they reach the second, in sigma.
_NOISE_SIGMA, FAR_SIGMA = 3.0, 15.0
#: Where decades of misfit are labelled, of either sign.
_DECADES = (0, 3, 10, 30, 100, 300, 1000, 3000, 10000)
#: Explanations whose signatures are drawn.
_MOST_SIGNATURES = 4
_STYLES, _MARKS = ("solid", DASH, "dotted", "dashdot"), ("s", "^", "D", "v")
# Without its darkest ends: they would vanish on a dark page.
_RED_BLUE = ListedColormap(colormaps["RdBu_r"](np.linspace(0.13, 0.87, 256)))


def data_figure(view: ReadingsView, narrow: bool = False) -> Figure:
    """Readings with one-sigma bars, base model and explanation; below, what is left in sigma.

    `narrow`: the first, the middle and the last panel below each other.
    """
    panels = _panels(view)
    if narrow:
        panels = few(panels, _MOST_NARROW)
    size = (NARROW, 1.2 + 3.4 * len(panels)) if narrow else (WIDTH if len(panels) > 1 else 6.0, 4.8)
    with figure(*size) as fig:
        if narrow:
            ratios = (1.5, 1) * len(panels)
            stack = fig.subplots(2 * len(panels), 1, squeeze=False, sharex=True, height_ratios=ratios)
            axes = stack.reshape(len(panels), 2).T
        else:
            axes = fig.subplots(
                2, len(panels), squeeze=False, sharex=True, sharey="row", height_ratios=(1.5, 1)
            )
        for column, group in enumerate(panels):
            _readings_panel(axes[:, column], view, group)
        for upper, group in zip(axes[0], panels, strict=True):
            _mark_no_light(upper, view, group)
        if _largest_misfit(view) > FAR_SIGMA:
            for lower in axes[1] if narrow else axes[1, :1]:
                _linear_over_noise(lower)
        several = "reading / largest of the scan" if len(panels) > 1 else "reading / largest"
        for one in range(len(panels) if narrow else 1):
            axes[0, one].set_ylabel("reading / largest" if narrow else several)
            axes[1, one].set_ylabel("left over (σ)" if narrow else "reading \N{MINUS SIGN} model (σ)")
        legend_below(fig, *axes[0])
        say_left_out(fig, len(panels), len(view.groups()) if view.scan_axis != "z_m" else 1)
    return fig


def _readings_panel(axes: Iterable[Axes], view: ReadingsView, group: Group) -> None:
    """One panel: readings and models over the largest reading, and below what the models leave."""
    upper, lower = axes
    at, rows, out = _sorted(view, group)
    unit = float(np.nanmax(np.abs(view.readings.value[rows]))) or 1.0
    value, sigma = view.readings.value[rows] / unit, view.readings.sigma[rows] / unit
    base, best = (view.predictions[k].value[rows] / unit for k in (0, -1))
    upper.plot(*_line(at, base), color=FORMULA, linestyle=DASH, label=view.predictions[0].name)
    if len(view.predictions) > 1:
        named = view.predictions[-1].short_name
        banded(upper, *_line(at, best, sigma), alpha=0.2, color=RENDER, label=named)
    upper.errorbar(
        at[~out], value[~out], sigma[~out], fmt="o", color=DATA, markersize=3, linewidth=0.9, label="readings"
    )
    upper.plot(at[out], value[out], "x", color=MUTED, markersize=5, label="left out" if out.any() else None)
    # A long one would run into that of the next panel.
    label = group.label if len(group.label) <= _ONE_LINE else group.label.replace(", ", ",\n", 1)
    upper.set_title(label)
    _over_decades(upper, value[~out])
    residual_panel(lower, view, at, rows, out)
    lower.set_xlabel(_AXIS_NAMES[view.scan_axis])


def _mark_no_light(upper: Axes, view: ReadingsView, group: Group) -> None:
    """Readings of zero and below at the foot of a logarithmic axis, which has no place for them."""
    at, rows, out = _sorted(view, group)
    dark = ~out & (view.readings.value[rows] <= 0)
    if upper.get_yscale() == "log" and dark.any():
        foot = np.full(int(dark.sum()), 0.03)
        upper.plot(
            at[dark], foot, "v", color=DATA, markersize=5, mfc="none", label="zero or below",
            transform=upper.get_xaxis_transform(),
        )  # fmt: skip


def _linear_over_noise(axis: Axes) -> None:
    """Logarithmic beyond the noise: one axis for the misfit and for what is left of it."""
    axis.set_yscale("symlog", linthresh=_NOISE_SIGMA, linscale=1)
    _label_decades(axis)


def _label_decades(axis: Axes) -> None:
    axis.yaxis.set_major_locator(FixedLocator([sign * value for sign in (-1, 1) for value in _DECADES]))
    axis.yaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: minus(f"{value:g}")))


def _largest_misfit(view: ReadingsView) -> float:
    """Of the base model, in sigma."""
    return float(np.nanmax(np.abs(view.residual_sigma(0)[~view.readings.left_out]), initial=0.0))


def steps(view: ReadingsView) -> list[tuple[int, str]]:
    """The base model, and the best explanation where there is one."""
    last = len(view.predictions) - 1
    return [(k, view.predictions[k].short_name) for k in dict.fromkeys((0, last))]


def few(panels: list[Group], most: int) -> list[Group]:
    """First, last and evenly chosen panels between: of scans, before single places and short ones."""
    size = np.array([len(panel.rows) for panel in panels])
    long = 2 * size >= size.max()
    first, rest = np.flatnonzero(long), np.flatnonzero(~long)
    first = first[evenly(len(first), most)]
    rest = rest[evenly(len(rest), most - len(first))]
    return [panels[i] for i in sorted([*first, *rest])]


def misfit_dots(
    axis: Axes,
    view: ReadingsView,
    step: int,
    x: Array,
    y: Array,
    rows: NDArray[np.intp] | slice = slice(None),
) -> PathCollection:
    """Readings at their places, coloured by what a model leaves of them; those left out are large and ringed.

    The colours reach as far as the base model's misfit.
    """
    out = view.readings.left_out[rows]
    most = max(_largest_misfit(view), _NOISE_SIGMA)
    over = most > FAR_SIGMA
    norm = SymLogNorm(_NOISE_SIGMA, vmin=-most, vmax=most) if over else Normalize(-most, most)
    return axis.scatter(
        x, y, c=view.residual_sigma(step)[rows], cmap=_RED_BLUE, norm=norm,
        s=np.where(out, 70, 34),
        edgecolors=[DATA if one else MUTED for one in out], linewidths=np.where(out, 1.8, 0.4).tolist(),
    )  # fmt: skip


def misfit_bar(fig: Figure, dots: PathCollection, axes: Iterable[Axes]) -> None:
    """What the colours of `misfit_dots` mean."""
    bar = fig.colorbar(dots, ax=list(axes), extend="both", pad=0.015, aspect=22)
    if isinstance(dots.norm, SymLogNorm):
        _label_decades(bar.ax)
    bar.set_label("reading \N{MINUS SIGN} model (σ)", fontsize=9)


def rms_title(view: ReadingsView, step: int, rows: NDArray[np.intp] | slice = slice(None)) -> str:
    """Root mean square of what a model leaves of some readings."""
    residual = view.residual_sigma(step)[rows][~view.readings.left_out[rows]]
    return f"rms {float(np.sqrt(np.nanmean(residual**2))):.1f} σ"


def _over_decades(axis: Axes, value: np.ndarray) -> None:
    """A logarithmic axis for readings that are positive and span more than a few times their least."""
    lit = value[np.isfinite(value) & (value > 0)]
    if 2 * lit.size < value.size or not lit.size or lit.max() < _LOG_FROM * lit.min():
        return
    low, high = axis.get_ylim() if axis.get_yscale() == "log" else (lit.min(), lit.max())
    axis.set_yscale("log")
    axis.set_ylim(max(min(low, 0.6 * lit.min()), MOST_DECADES), max(high, 1.7 * lit.max()))


def say_left_out(fig: Figure, shown: int, there: int, what: str = "scans") -> None:
    if shown < there:
        fig.suptitle(f"{shown} of {there} {what} are drawn", x=0.01, ha="left", fontsize=9, color=MUTED)


def residual_panel(axis: Axes, view: ReadingsView, at: np.ndarray, rows: np.ndarray, out: np.ndarray) -> None:
    """Residuals of the base model (open) and of the explanation (filled) over the zone of two sigma."""
    axis.axhspan(-2, 2, color=GRID, alpha=0.7, linewidth=0)
    axis.axhline(0, color=MUTED, linewidth=0.8)
    axis.plot(at[~out], view.residual_sigma(0)[rows][~out], "o", color=FORMULA, markersize=3.6, mfc="none")
    if len(view.predictions) > 1:
        axis.plot(at[~out], view.residual_sigma(-1)[rows][~out], "o", color=RENDER, markersize=3.2)
    axis.grid(False, axis="y")


def residual_map(view: ReadingsView, narrow: bool = False) -> Figure:
    """Where the misfit lives: every reading at its place, coloured by its residual, before and after.

    Several bands stand side by side, before above, after below.
    """
    if view.is_grid:
        return _grid_map(view)
    readings, scan, shown = view.readings, "y_m" if view.scan_axis == "y_m" else "x_m", steps(view)
    there = view.bands()
    bands = few(there, _MOST_NARROW if narrow else _MOST_PANELS)
    panels = [(step, band) for step, _ in shown for band in bands]
    side_by_side = len(bands) > 1 and not narrow
    columns = 1 if narrow else len(bands) if side_by_side else len(shown)
    rows = len(panels) // columns
    high = 1.3 + 0.55 * min(max(np.unique(readings.z_m).size, 2), 6)
    with figure(NARROW if narrow else WIDTH, high * rows * (0.7 if len(bands) > 1 else 1.0)) as fig:
        axes = fig.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for axis, (step, band) in zip(axes.ravel(), panels, strict=True):
            at = band.rows
            dots = misfit_dots(axis, view, step, getattr(readings, scan)[at], readings.z_m[at], at)
            names = [band.label] if side_by_side else [view.predictions[step].short_name, band.label]
            label(axis, "", "", f"{', '.join(filter(None, names))}\n{rms_title(view, step, at)}")
            axis.margins(0.06, 0.12)
        for axis in axes[-1]:
            axis.set_xlabel(_AXIS_NAMES[scan])
        for k, axis in enumerate(axes[:, 0]):
            axis.set_ylabel(f"{shown[k][1]}\nz (m)" if side_by_side else "z (m)")
        misfit_bar(fig, dots, axes.ravel())
        say_left_out(fig, len(bands), len(there), "bands")
    return fig


def _grid_map(view: ReadingsView) -> Figure:
    """The same for readings in x and y: one map per scan, before above, after below."""
    groups = few(view.groups(), _MOST_PANELS)
    rungs = [step for step, _ in steps(view)]
    readings = view.readings
    with figure(WIDTH, 0.8 + 2.1 * len(rungs)) as fig:
        axes = fig.subplots(len(rungs), len(groups), squeeze=False, sharex=True, sharey=True)
        for row, step in zip(axes, rungs, strict=True):
            for axis, group in zip(row, groups, strict=True):
                at = group.rows
                dots = misfit_dots(axis, view, step, readings.x_m[at], readings.y_m[at], at)
                axis.margins(0.12)
            row[0].set_ylabel(f"{fill(view.predictions[step].short_name, _ONE_LINE)}\ny (m)")
        for axis, group in zip(axes[0], groups, strict=True):
            axis.set_title(group.label)
        for axis in axes[-1]:
            axis.set_xlabel("x (m)")
        misfit_bar(fig, dots, axes.ravel())
        say_left_out(fig, len(groups), len(view.groups()))
    return fig


def signature_figure(view: DiagnosisView, narrow: bool = False) -> Figure:
    """Residual of the base model with what each accepted explanation would add to it.

    Over the scans; of single places over their distance from the axis, where no line joins them.
    """
    panels = [Group("", np.arange(len(view.readings.value)))] if view.is_scattered else _panels(view)
    panels = few(panels, _MOST_NARROW) if narrow else panels
    size = (NARROW, 0.9 + 2.3 * len(panels)) if narrow else (WIDTH if len(panels) > 1 else 6.0, 3.4)
    with figure(*size) as fig:
        grid = (len(panels), 1) if narrow else (1, len(panels))
        axes = fig.subplots(*grid, squeeze=False, sharex=True, sharey=True).ravel()
        for axis, group in zip(axes, panels, strict=True):
            at, rows, out = _sorted(view, group)
            if view.is_scattered:
                at = np.hypot(view.readings.x_m, view.readings.y_m)[rows]
            axis.axhspan(-2, 2, color=GRID, alpha=0.7, linewidth=0)
            axis.plot(
                at[~out],
                view.residual_sigma(0)[rows][~out],
                "o",
                color=DATA,
                markersize=3.2,
                label="residual of the base model",
            )
            for k, signature in enumerate(view.signatures[:_MOST_SIGNATURES]):
                change = (signature.change / view.readings.sigma)[rows]
                axis.plot(
                    *((at, change) if view.is_scattered else _line(at, change)),
                    color=SERIES[(0, 2, 3, 4)[k]],
                    linestyle="none" if view.is_scattered else _STYLES[k % len(_STYLES)],
                    marker=_MARKS[k % len(_MARKS)] if view.is_scattered else None,
                    markersize=3.5,
                    label=plain(signature.label),
                )
            axis.grid(False, axis="y")
            across = "r (m), from the axis" if view.is_scattered else _AXIS_NAMES[view.scan_axis]
            label(axis, across, "", group.label)
        axes[0].set_ylabel("σ")
        legend_below(fig, axes[0])
        if not view.is_scattered:
            say_left_out(fig, len(panels), len(view.groups()) if view.scan_axis != "z_m" else 1)
    return fig


def _panels(view: ReadingsView) -> list[Group]:
    """Scans to draw: all, or first, last and some between; a single one when readings vary in z only."""
    groups = view.groups()
    if view.scan_axis == "z_m":
        return [Group("along the axis", np.concatenate([group.rows for group in groups]))]
    if view.is_grid:
        groups = [view.middle_line(group, view.scan_axis) for group in groups]
    return few(groups, _MOST_PANELS)


def _line(at: Array, *values: Array) -> list[Array]:
    """Places with the means of what is told there: of one that was read at several times a line has one."""
    places, of = np.unique(at, return_inverse=True)
    count = np.bincount(of)
    return [places, *(np.bincount(of, weights=value) / count for value in values)]


def _sorted(view: ReadingsView, group: Group) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scan coordinate, rows and left-out flags in order of the coordinate."""
    at = getattr(view.readings, view.scan_axis)[group.rows]
    order = np.argsort(at, kind="stable")
    rows = group.rows[order]
    return at[order], rows, view.readings.left_out[rows]
