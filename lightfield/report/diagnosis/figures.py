"""Figures of a diagnosis: data and model, residuals, signatures, ladder, separations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter

from lightfield.diagnosis.verdict.parts import Rung
from lightfield.report.diagnosis.view import DiagnosisView, Group, Separation
from lightfield.report.style import (
    DATA,
    FORMULA,
    GOOD,
    GRID,
    MUTED,
    RENDER,
    SERIES,
    WIDTH,
    figure,
    label,
    plain_log_axis,
)

MOST_PANELS = 5
LEAST_PERCENT = 0.01  # an exact fit to a few readings leaves rounding errors, which are no finding
SAME_CLASS_SIGMA, SURE_SIGMA = 3.0, 6.0
AXIS_NAMES = {"x_m": "x (m)", "y_m": "y (m)", "z_m": "z (m)"}
DASHED = (0, (5, 2))
# Without its darkest ends: they would vanish on a dark page.
RED_BLUE = ListedColormap(colormaps["RdBu_r"](np.linspace(0.13, 0.87, 256)))


def data_figure(view: DiagnosisView) -> Figure:
    """Readings with one-sigma bars, base model and explanation; below, what is left in sigma."""
    panels = _panels(view)
    explained = len(view.predictions) > 1
    with figure(WIDTH if len(panels) > 1 else 6.0, 4.8) as fig:
        axes = fig.subplots(2, len(panels), squeeze=False, sharex=True, sharey="row", height_ratios=(1.5, 1))
        for column, group in enumerate(panels):
            upper, lower = axes[:, column]
            at, rows, out = _sorted(view, group)
            unit = float(np.nanmax(np.abs(view.readings.value[rows]))) or 1.0
            value, sigma = view.readings.value[rows] / unit, view.readings.sigma[rows] / unit
            base, best = (view.predictions[k].value[rows] / unit for k in (0, -1))
            upper.plot(at, base, color=FORMULA, linestyle=DASHED, label=_plain(view.predictions[0].label))
            if explained:
                upper.fill_between(at, best - sigma, best + sigma, color=RENDER, alpha=0.2, linewidth=0)
                upper.plot(at, best, color=RENDER, label=_plain(view.predictions[-1].label))
            upper.errorbar(
                at[~out],
                value[~out],
                sigma[~out],
                fmt="o",
                color=DATA,
                markersize=3,
                linewidth=0.9,
                label="readings",
            )
            upper.plot(
                at[out], value[out], "x", color=MUTED, markersize=5, label="left out" if out.any() else None
            )
            upper.set_title(group.label)
            residual_panel(lower, view, at, rows, out)
            lower.set_xlabel(AXIS_NAMES[view.scan_axis])
        if np.nanmax(np.abs(view.residual_sigma(0)[~view.readings.left_out])) > 15:
            # Linear over the noise, logarithmic beyond: one axis for the misfit and for what is left of it.
            axes[1, 0].set_yscale("symlog", linthresh=3, linscale=1)
            axes[1, 0].yaxis.set_major_formatter(
                FuncFormatter(lambda value, _: f"{value:g}".replace("-", "\N{MINUS SIGN}"))
            )
            axes[1, 0].yaxis.set_major_locator(
                FixedLocator([-100, -30, -10, -3, 0, 3, 10, 30, 100, 300, 1000])
            )
        axes[0, 0].set_ylabel("reading / largest of the scan" if len(panels) > 1 else "reading / largest")
        axes[1, 0].set_ylabel("reading \N{MINUS SIGN} model (σ)")
        handles, names = axes[0, 0].get_legend_handles_labels()
        fig.legend(handles, names, loc="outside lower center", ncols=len(names))
    return fig


def residual_panel(
    axis: Axes, view: DiagnosisView, at: np.ndarray, rows: np.ndarray, out: np.ndarray
) -> None:
    """Residuals of the base model (open) and of the explanation (filled) over the zone of two sigma."""
    axis.axhspan(-2, 2, color=GRID, alpha=0.7, linewidth=0)
    axis.axhline(0, color=MUTED, linewidth=0.8)
    axis.plot(at[~out], view.residual_sigma(0)[rows][~out], "o", color=FORMULA, markersize=3.6, mfc="none")
    if len(view.predictions) > 1:
        axis.plot(at[~out], view.residual_sigma(-1)[rows][~out], "o", color=RENDER, markersize=3.2)
    axis.grid(False, axis="y")


def residual_map(view: DiagnosisView) -> Figure:
    """Where the misfit lives: every reading at its place, coloured by its residual, before and after."""
    if view.is_grid:
        return _grid_map(view)
    shown = [(0, view.predictions[0].label)]
    if len(view.predictions) > 1:
        shown.append((len(view.predictions) - 1, view.predictions[-1].label))
    readings, scan = view.readings, view.scan_axis
    across = readings.y_m if scan == "y_m" else readings.x_m
    first = view.residual_sigma(0)[~readings.left_out]
    scale = float(np.clip(np.nanmax(np.abs(first), initial=3.0), 3.0, 12.0))
    with figure(WIDTH, 1.3 + 0.55 * min(max(np.unique(readings.z_m).size, 2), 6)) as fig:
        axes = fig.subplots(1, len(shown), squeeze=False, sharex=True, sharey=True)[0]
        for axis, (step, name) in zip(axes, shown, strict=True):
            dots = axis.scatter(
                across,
                _spread(readings.z_m, readings.wavelength_nm, readings.medium),
                c=view.residual_sigma(step),
                cmap=RED_BLUE,
                vmin=-scale,
                vmax=scale,
                s=np.where(readings.left_out, 8, 34),
                edgecolors=MUTED,
                linewidths=0.4,
            )
            rms = float(np.sqrt(np.nanmean(view.residual_sigma(step)[~readings.left_out] ** 2)))
            label(axis, AXIS_NAMES["y_m" if scan == "y_m" else "x_m"], "", f"{_short(name)}: rms {rms:.1f} σ")
            axis.margins(0.06, 0.12)
        axes[0].set_ylabel("z (m)")
        bar = fig.colorbar(dots, ax=list(axes), extend="both", pad=0.015, aspect=22)
        bar.set_label("reading \N{MINUS SIGN} model (σ)", fontsize=9)
    return fig


def _grid_map(view: DiagnosisView) -> Figure:
    """The same for readings in x and y: one map per scan, before above, after below."""
    groups = view.groups()
    if len(groups) > MOST_PANELS:
        chosen = np.unique(np.linspace(0, len(groups) - 1, MOST_PANELS).round().astype(int))
        groups = [groups[i] for i in chosen]
    steps = [0] if len(view.predictions) == 1 else [0, len(view.predictions) - 1]
    readings = view.readings
    first = view.residual_sigma(0)[~readings.left_out]
    scale = float(np.clip(np.nanmax(np.abs(first), initial=3.0), 3.0, 12.0))
    with figure(WIDTH, 0.8 + 2.1 * len(steps)) as fig:
        axes = fig.subplots(len(steps), len(groups), squeeze=False, sharex=True, sharey=True)
        for row, step in zip(axes, steps, strict=True):
            residual = view.residual_sigma(step)
            for axis, group in zip(row, groups, strict=True):
                dots = axis.scatter(
                    readings.x_m[group.rows],
                    readings.y_m[group.rows],
                    c=residual[group.rows],
                    cmap=RED_BLUE,
                    vmin=-scale,
                    vmax=scale,
                    s=np.where(readings.left_out[group.rows], 8, 34),
                    edgecolors=MUTED,
                    linewidths=0.4,
                )
                axis.margins(0.12)
            row[0].set_ylabel(f"{_short(view.predictions[step].label)}\ny (m)")
        for axis, group in zip(axes[0], groups, strict=True):
            axis.set_title(group.label)
        for axis in axes[-1]:
            axis.set_xlabel("x (m)")
        bar = fig.colorbar(dots, ax=axes.ravel().tolist(), extend="both", pad=0.015, aspect=22)
        bar.set_label("reading \N{MINUS SIGN} model (σ)", fontsize=9)
    return fig


def signature_figure(view: DiagnosisView, most: int = 4) -> Figure:
    """Residual of the base model with what each accepted explanation would add to it."""
    panels = _panels(view)
    with figure(WIDTH if len(panels) > 1 else 6.0, 3.4) as fig:
        axes = fig.subplots(1, len(panels), squeeze=False, sharex=True, sharey=True)[0]
        for axis, group in zip(axes, panels, strict=True):
            at, rows, out = _sorted(view, group)
            axis.axhspan(-2, 2, color=GRID, alpha=0.7, linewidth=0)
            axis.plot(
                at[~out],
                view.residual_sigma(0)[rows][~out],
                "o",
                color=DATA,
                markersize=3.2,
                label="residual of the base model",
            )
            for k, signature in enumerate(view.signatures[:most]):
                axis.plot(
                    at,
                    (signature.change / view.readings.sigma)[rows],
                    color=SERIES[(0, 2, 3, 4)[k % 4]],
                    linestyle=("solid", DASHED, "dotted", "dashdot")[k % 4],
                    label=_plain(signature.label),
                )
            axis.grid(False, axis="y")
            label(axis, AXIS_NAMES[view.scan_axis], "", group.label)
        axes[0].set_ylabel("σ")
        handles, names = axes[0].get_legend_handles_labels()
        fig.legend(handles, names, loc="outside lower center", ncols=min(len(names), 3))
    return fig


def ladder_figure(ladder: Sequence[Rung], noise_floor_percent: float) -> Figure:
    """Error of every rung falling towards the noise floor; the last rung rendered afresh."""
    at = np.arange(len(ladder))
    error = np.array([rung.error_percent for rung in ladder], float)
    held_out = np.array([np.nan if r.held_out_percent is None else r.held_out_percent for r in ladder])
    texts = [f"{value:.2g} %" if value >= LEAST_PERCENT else f"< {LEAST_PERCENT:g} %" for value in error]
    error, held_out = np.maximum(error, LEAST_PERCENT), np.maximum(held_out, LEAST_PERCENT)
    with figure(max(4.5, min(WIDTH, 2.6 + 1.6 * len(ladder))), 4.0) as fig:
        axis = fig.subplots()
        axis.axhspan(0, noise_floor_percent, color=GOOD, alpha=0.14, linewidth=0)
        axis.axhline(noise_floor_percent, color=GOOD, linewidth=1.2)
        axis.annotate(
            f"noise floor {noise_floor_percent:.2g} %",
            (0, noise_floor_percent),
            (5, 4),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            color=GOOD,
            fontsize=9.5,
        )
        axis.plot(at, error, color=RENDER, marker="o", markersize=7, label="error of the fit")
        if np.isfinite(held_out).any():
            axis.plot(
                at,
                held_out,
                "D",
                color=MUTED,
                mfc="none",
                markersize=6,
                label="each plane predicted from the others",
            )
        for x, value, text in zip(at, error, texts, strict=True):
            axis.annotate(
                text,
                (float(x), float(value)),
                (8, 5),
                textcoords="offset points",
                fontsize=10,
                weight="bold",
            )
        for x, rung in zip(at, ladder, strict=True):
            if rung.rendered_error_percent is not None:
                axis.errorbar(
                    [x],
                    [rung.rendered_error_percent],
                    [rung.rendered_stderr_percent or 0.0],
                    fmt="*",
                    color=FORMULA,
                    markersize=12,
                    label="rendered afresh",
                )
        everything = np.concatenate([error, held_out[np.isfinite(held_out)], [noise_floor_percent]])
        if everything.max() > 8 * max(everything.min(), 1e-6):
            axis.set_yscale("log")
            axis.set_ylim(0.6 * everything.min(), 1.9 * everything.max())
            plain_log_axis(axis.yaxis)
        else:
            axis.set_ylim(0, 1.18 * everything.max())
        axis.set_xticks(at, [_wrapped(rung.label) for rung in ladder])
        axis.set_xlim(-0.4, len(ladder) - 0.4)
        axis.grid(False, axis="x")
        axis.set_ylabel("rms error (%)")
        handles, names = axis.get_legend_handles_labels()
        fig.legend(handles, names, loc="outside lower left", ncols=2 if len(ladder) > 1 else 1)
    return fig


def separation_figure(separation: Separation) -> Figure:
    """How far the explanations are apart; under three sigma they cannot be told apart."""
    k = len(separation.names)
    with figure(min(WIDTH, 2.6 + 0.85 * k), 1.5 + 0.42 * k) as fig:
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
                    if value < SURE_SIGMA
                    else (GOOD, 0.16, "normal")
                )
                cell = Rectangle((i - 0.48, j - 0.46), 0.96, 0.92, facecolor=colour, alpha=alpha, linewidth=0)
                axis.add_patch(cell)
                axis.text(i, j, text, ha="center", va="center", fontsize=10, weight=weight)
        axis.set_xlim(-0.55, k - 0.45)
        axis.set_ylim(k - 0.45, -0.55)
        names = [_wrapped(name) for name in separation.names]
        axis.set_xticks(range(k), names, rotation=30, ha="right", rotation_mode="anchor")
        axis.set_yticks(range(k), names)
        axis.grid(False)
        for side in ("left", "bottom"):
            axis.spines[side].set_visible(False)
        axis.tick_params(length=0)
        label(axis, "imitated by", "true", "")
    return fig


def _panels(view: DiagnosisView) -> list[Group]:
    """Scans to draw: all, or first, last and some between; a single one when readings vary in z only."""
    groups = view.groups()
    if view.scan_axis == "z_m":
        return [Group("along the axis", np.concatenate([group.rows for group in groups]))]
    if view.is_grid:
        groups = [_middle_line(view, group) for group in groups]
    if len(groups) <= MOST_PANELS:
        return groups
    chosen = np.unique(np.linspace(0, len(groups) - 1, MOST_PANELS).round().astype(int))
    return [groups[i] for i in chosen]


def _middle_line(view: DiagnosisView, group: Group) -> Group:
    """Of a grid, the line next to the axis: lines drawn through a grid would jump from row to row."""
    name = "x_m" if view.scan_axis == "y_m" else "y_m"
    other = getattr(view.readings, name)[group.rows]
    nearest = other[np.abs(other).argmin()]
    rows = group.rows[np.abs(other - nearest) < 1e-6]
    return Group(f"{group.label}, {name[0]} = {nearest + 0.0:g} m", rows)


def _sorted(view: DiagnosisView, group: Group) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scan coordinate, rows and left-out flags in order of the coordinate."""
    at = getattr(view.readings, view.scan_axis)[group.rows]
    order = np.argsort(at, kind="stable")
    rows = group.rows[order]
    return at[order], rows, view.readings.left_out[rows]


def _spread(z_m: np.ndarray, wavelength_nm: np.ndarray, medium: Sequence[str]) -> np.ndarray:
    """Distances, scans of other wavelengths and media set a little apart: no dot hides another."""
    keys = sorted({(m, float(w)) for m, w in zip(medium, wavelength_nm, strict=True)})
    if len(keys) == 1:
        return z_m
    gaps = np.diff(np.unique(z_m))
    step = 0.5 * (gaps.min() if gaps.size else 1.0) / len(keys)
    place = {key: k - (len(keys) - 1) / 2 for k, key in enumerate(keys)}
    return z_m + step * np.array([place[m, float(w)] for m, w in zip(medium, wavelength_nm, strict=True)])


def _wrapped(text: str) -> str:
    return _plain(text).replace(" + ", "\n+ ")


def _plain(text: str) -> str:
    return text.replace("_", " ")


def _short(text: str) -> str:
    """A name that fits beside a panel: of many effects their number."""
    effects = text.count(" + ")
    return _plain(text) if effects < 2 else f"with {effects} effects"
