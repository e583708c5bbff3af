"""Figures of an array: its elements, and what they tell of the pose."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from lightfield.arrays import TINY
from lightfield.report.style import (
    BAD,
    DASH,
    GOOD,
    INK,
    MUTED,
    NARROW,
    SERIES,
    WIDTH,
    figure,
    label,
    legend_under,
    panels,
    plain_log_axis,
)
from lightfield.studies.follower.design.compared import JudgedArray
from lightfield.studies.follower.elements import Elements
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.information import is_told
from lightfield.studies.follower.survey import DOCKING, Survey
from lightfield.wording import capital

#: In which unit a coordinate is shown, and its factor.
SHOWN = {name: ("mm", 1e3) if name in POSE[:3] else ("deg", float(np.degrees(1))) for name in POSE}
_MAP_LEVELS = 13  # of a map
_MOST_ARRAYS = 4  # side by side
_NARROW, _WIDE = 16, 24  # letters of a name in a line
WORDS = {"x": "sideways", "y": "up, down", "z": "along", "yaw": "yaw", "pitch": "pitch", "roll": "roll"}


def survey_figure(survey: Survey, narrow: bool = False) -> Figure:
    """The array, and the bound on the beam's axis beside what docking asks for."""
    with panels(2, 3.9, narrow=narrow, ratios=(1, 1.6)) as (fig, (array, bars)):
        draw_array(array, survey.elements, survey.here.readings, narrow)
        names = survey.here.names
        shown = [*survey.axis, survey.here]
        width = 0.8 / len(shown)
        for k, one in enumerate(shown):
            parts = [one.sigma[n] / DOCKING[n] for n in names]
            told = [is_told(n, one.sigma[n]) for n in names]
            known = np.where(told, parts, np.nan)
            at = np.arange(len(names)) + (k - 0.5 * (len(shown) - 1)) * width
            title = "the scene's pose" if one is survey.here else survey.on_axis(one)
            bars.bar(at, known, 0.92 * width, color=SERIES[k % len(SERIES)], label=title)
            for place, part, name in zip(at, known, names, strict=True):
                text = f"{SHOWN[name][1] * one.sigma[name]:.3g}" if np.isfinite(part) else "unknown"
                height = part if np.isfinite(part) else 1.0
                bars.annotate(
                    text,
                    (place, height),
                    (0, 2),
                    textcoords="offset points",
                    ha="center",
                    fontsize=8,
                    rotation=90,
                    path_effects=[withStroke(linewidth=2.5, foreground="white")],  # over the line
                )
        bars.axhline(1, color=BAD, linestyle=DASH, label="what docking allows")
        bars.set_yscale("log")
        low, high = bars.get_ylim()
        bars.set_ylim(low, max(high, 2.0) * 6)  # room for the numbers
        words = [f"{WORDS[n]}\n({SHOWN[n][0]})" for n in names]
        bars.set_xticks(range(len(names)), words, fontsize=8 if narrow else None)
        bars.set_xlim(-0.5, len(names) - 0.5)  # where bars are unknown, too
        bars.grid(False, axis="x")
        legend_under(bars)
        label(bars, "", "smallest error / what docking allows", "What one reading can tell at best")
    return fig


def draw_array(
    axis: Axes, elements: Elements, readings: np.ndarray | None = None, narrow: bool = False
) -> None:
    """Elements seen from behind, towards the lamp; arrows: where they face."""
    x, y, _ = elements.place_m.T
    light = None if readings is None else 100 * readings / max(float(readings.max()), TINY)
    colours = {"color": SERIES[0]} if light is None else {"c": light, "cmap": "magma", "vmin": 0, "vmax": 100}
    points = axis.scatter(x, y, s=45, edgecolors=MUTED, zorder=3, **colours)
    size = max(elements.reach_m, 1e-6)
    axis.quiver(
        x, y, elements.normal[:, 0], elements.normal[:, 1], color=MUTED, angles="xy", scale_units="xy",
        scale=3 / size, width=0.005, zorder=4,
    )  # fmt: skip
    if light is not None:
        where = "bottom" if narrow else "right"
        axis.figure.colorbar(
            points, ax=axis, shrink=0.75, label="reading at the scene's pose (%)", location=where
        )
    axis.set_aspect("equal")
    # An arrow is a third of the reach long at most: all of it is seen.
    edge = (
        1.1 * np.abs(np.concatenate([x, y, *(np.stack([x, y]) + elements.normal[:, :2].T * size / 3)])).max()
    )
    axis.set_xlim(-edge, edge)
    axis.set_ylim(-edge, edge)
    label(axis, "x (m)", "y (m)", f"{len(elements)} elements, seen from behind them")


def map_figure(survey: Survey, narrow: bool = False) -> Figure:
    """Bounds over the formation space, seen from above; the line is what docking allows."""
    names = [n for n in ("x", "z", "yaw") if n in survey.here.names]
    x, z = survey.space.x_m.values, survey.space.z_m.values
    with panels(len(names), 3.6, narrow=narrow, each=3.0, sharey=True) as (fig, axes):
        for axis, name in zip(axes, names, strict=True):
            unit, factor = SHOWN[name]
            values = factor * survey.space[f"sigma_{name}"].values
            lit = np.where(np.isfinite(values) & (values > 0), values, np.nan)
            if np.isfinite(lit).any():
                low, high = np.nanmin(lit), np.nanmax(lit)
                norm = LogNorm(low, max(high, 1.01 * low))
                levels = np.geomspace(low, max(high, 1.01 * low), _MAP_LEVELS)
                picture = axis.contourf(x, z, lit, levels, cmap="viridis_r", norm=norm)
                bar = fig.colorbar(picture, ax=axis, label=f"{unit}")
                plain_log_axis(bar.ax.yaxis)
                limit = factor * DOCKING[name]
                if low < limit < high:
                    axis.contour(x, z, lit, [limit], colors=BAD, linewidths=2)
            axis.plot(
                survey.here.pose[0], survey.here.pose[2], "o", color="none", markeredgecolor=INK, markersize=9
            )
            axis.grid(False)
            met = 100 * float((survey.space[f"sigma_{name}"].values <= DOCKING[name]).mean())
            label(axis, "x (m)", "", f"{capital(WORDS[name])}: within {met:.0f} %")
        for axis in axes if narrow else axes[:1]:
            axis.set_ylabel("distance from the lamp z (m)")
    return fig


def comparison_figure(arrays: Sequence[JudgedArray], narrow: bool = False) -> Figure:
    """The arrays, best first, over their criterion; narrow: an array a row."""
    shown = arrays[:_MOST_ARRAYS]
    tall = 2.6 * (len(shown) if narrow else 1)
    reach = 1.25 * max(one.elements.reach_m for one in shown)
    with figure(NARROW if narrow else WIDTH, tall + 0.8 + 0.45 * len(shown)) as fig:
        ratios = (tall, 0.5 + 0.45 * len(shown))
        upper, lower = fig.subfigures(2, 1, squeeze=False, height_ratios=ratios)[:, 0]
        drawn = upper.subplots(*((len(shown), 1) if narrow else (1, len(shown))), squeeze=False)
        for axis, one in zip(drawn.ravel(), shown, strict=True):
            draw_array(axis, one.elements)
            axis.set_xlim(-reach, reach)
            axis.set_ylim(-reach, reach)
            axis.set_title(f"{fill(one.name, _WIDE)}\n{len(one.elements)} elements", fontsize=9)
        axis = lower.subplots()
        if len(shown) < len(arrays):
            upper.suptitle(f"the best {len(shown)} of {len(arrays)} arrays", fontsize=9, color=MUTED)
        # Of an array that leaves a coordinate unknown A is a number without a meaning: it has no point.
        told = {k: one.criterion for k, one in enumerate(shown) if one.is_told}
        colours = [GOOD if k == 0 else SERIES[5] for k in told]
        axis.scatter(list(told.values()), list(told), color=colours, s=60)
        axis.set_yticks(range(len(shown)), [fill(one.name, _NARROW if narrow else _WIDE) for one in shown])
        for k, one in enumerate(shown):
            at = (told[k], k) if k in told else (0, k)
            axis.annotate(
                f"{one.criterion:.3g}" if k in told else "some of the pose unknown", at, (8, 0), va="center",
                xycoords="data" if k in told else ("axes fraction", "data"), textcoords="offset points",
            )  # fmt: skip
        axis.set_xscale("log")
        if told:
            axis.set_xlim(0.5 * min(told.values()), 4 * max(told.values()))
        axis.set_ylim(-0.6, len(shown) - 0.4)
        axis.invert_yaxis()
        axis.grid(False, axis="y")
        label(axis, "A, sum of variances in units of the task", "")
    return fig
