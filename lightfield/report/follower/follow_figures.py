"""Figures of a closed loop: a film strip from above, and the way over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lightfield.formula import own_formulas
from lightfield.report.style import (
    BAD,
    FORMULA,
    GOOD,
    INK,
    MUTED,
    NARROW,
    RENDER,
    SERIES,
    WIDTH,
    figure,
    label,
    panels,
)
from lightfield.scene.follower import Mission
from lightfield.scene.lamp.width import stated_width_deg
from lightfield.studies.following.metrics import METRICS
from lightfield.studies.following.study import Followed
from lightfield.sweep.results import axes_of
from lightfield.wording import plain

#: Frames of a strip, and rows of one figure.
_FRAMES, _FEW_FRAMES, MOST_ROWS = 5, 3, 6
#: Width and height of a frame, inches, about.
_PANEL_INCHES = np.array([1.7, 0.9])
#: Metrics of a sweep that stand beside each other, and the height of their panels, inches.
_PANELS_ACROSS, _PANEL_HEIGHT = 3, 2.4
#: Half widths of the lamp's beam that are drawn as light, the outer ones fainter.
_FANS = ((2.0, 0.10), (1.4, 0.14), (1.0, 0.22))
#: Widest beam that is drawn as one, degrees.
_WIDEST_DEG = 80.0
#: What of a mission says when its light or its water changes.
_EVENTS = ("dark_from_s", "dark_for_s", "turbid_factor", "turbid_from_s", "turbid_for_s", "current_from_s")
#: Runs that lost their way are drawn so far beyond the others, as a part of the largest distance. Chosen.
_BEYOND = 0.5
#: Colours of what is believed: the traced field in that of renders, the formula in its own.
_COLOURS = {
    "field": RENDER, "exact": FORMULA, "fitted": SERIES[5], "clear": SERIES[3], "relative": SERIES[4],
}  # fmt: skip


def strip_figure(cases: Sequence[Followed], narrow: bool = False) -> Figure:
    """Frames of the most typical run of every follower, from above: lamp on the left, light to the right.

    `narrow`: fewer frames, one a row.
    """
    frames = _FEW_FRAMES if narrow else _FRAMES
    shown = cases[:MOST_ROWS]
    ways = [one.track.pose[:, one.typical, :3] + one.track.leader_m for one in shown]
    far = max(float(way[:, 2].max()) for way in ways) + 0.8
    wide = max(0.5, *(float(np.abs(way[:, 0]).max()) for way in ways)) + 0.3
    shape = (frames * len(shown), 1) if narrow else (len(shown), frames)
    size = (NARROW, 0.75 + (0.4 + 1.2 * frames) * len(shown)) if narrow else (WIDTH, 0.75 + 1.45 * len(shown))
    with figure(*size) as fig:
        axes = fig.subplots(*shape, squeeze=False, sharex=True, sharey=True).reshape(len(shown), frames)
        for row, one in zip(axes, shown, strict=True):
            times = one.track.time_s
            for axis, k in zip(row, np.linspace(0, len(times) - 1, frames).round().astype(int), strict=True):
                _frame(axis, one, int(k), np.array([0.4 + far, 2 * wide]), below_name=axis is row[0])
                axis.set_xlim(-0.4, far)
                axis.set_ylim(-wide, wide)
            row[0].set_ylabel("across (m)", fontsize=8.5)
            believed = one.believed_short if narrow else one.believed
            name = row[0].annotate(
                f"{one.name}; believes {believed}", (0, 1), (0, 21), ha="left",
                xycoords="axes fraction", textcoords="offset points", fontsize=9.5, fontweight="bold",
            )  # fmt: skip
            name.set_in_layout(False)
        for axis in axes[-1, -1:] if narrow else axes[-1]:
            axis.set_xlabel("along the beam (m)", fontsize=8.5)
    return fig


def _frame(axis: Axes, one: Followed, k: int, size: np.ndarray, *, below_name: bool) -> None:
    track, mission = one.track, one.mission
    run = one.typical
    lamp, pose, believed = track.leader_m[k], track.pose[k, run], track.estimate[k, run]
    lit, colour = bool(track.lit[k, run]), _COLOURS[mission.believes]
    half = np.tan(np.radians(min(stated_width_deg(own_formulas.lit(one.scene).lamp), _WIDEST_DEG)))
    end = lamp[2] + 20.0
    if lit:
        for wider, strength in _FANS:
            edge = wider * half * 20.0
            corners = np.array([[lamp[2], lamp[0]], [end, lamp[0] + edge], [end, lamp[0] - edge]])
            axis.fill(*corners.T, color=SERIES[4], alpha=strength, linewidth=0)
    axis.plot(lamp[2], lamp[0], "o", color=SERIES[4] if lit else MUTED, markersize=6, markeredgecolor=INK)
    past = slice(max(0, k - len(track.time_s) // _FRAMES), k + 1)
    way = track.pose[past, run, :3] + track.leader_m[past]
    axis.plot(way[:, 2], way[:, 0], color=colour, linewidth=0.9, alpha=0.7)
    goal = lamp[2] + track.goal_m[k, run]
    axis.plot([goal, goal], [lamp[0] - 0.25, lamp[0] + 0.25], color=GOOD, linewidth=2.2)
    _vehicle(axis, pose + np.append(lamp, np.zeros(3)), size, colour, filled=True)
    if np.isfinite(believed).all():
        _vehicle(axis, believed + np.append(lamp, np.zeros(3)), size, colour, filled=False)
    room = "\n\n" if below_name else ""
    axis.set_title(
        room + f"{track.time_s[k]:.0f} s: {pose[2]:.1f} m" + ("" if lit else ", dark"), fontsize=8.5,
        fontweight="normal", color=INK if lit else BAD,
    )  # fmt: skip
    axis.tick_params(labelsize=7.5)
    axis.grid(False)


def _vehicle(axis: Axes, pose: np.ndarray, size: np.ndarray, colour: str, *, filled: bool) -> None:
    """A dart that points where the follower looks, towards the lamp at rest; larger than it is.

    It is drawn in inches and then taken into the panel's own metres, which across are longer than along.
    """
    body = 0.13 * np.array([[-1.0, 0.0], [1.0, 0.5], [0.6, 0.0], [1.0, -0.5]])
    c, s = np.cos(pose[3]), np.sin(pose[3])
    along, across = body[:, 0] * c + body[:, 1] * s, body[:, 1] * c - body[:, 0] * s
    metres = size / _PANEL_INCHES
    axis.fill(
        pose[2] + metres[0] * along, pose[0] + metres[1] * across, facecolor=colour if filled else "none",
        edgecolor=colour, linewidth=1.0, linestyle="-" if filled else (0, (2, 1)), zorder=3 if filled else 4,
    )  # fmt: skip


def way_figure(cases: Sequence[Followed], narrow: bool = False) -> Figure:
    """Distance and offset of all runs over time; thick: the mean of those that kept their way."""
    with panels(2, 3.6, narrow=narrow, ratios=(1.5, 1)) as (fig, (far, aside)):
        for k, one in enumerate(cases[:MOST_ROWS]):
            track = one.track
            colour, style = (
                _COLOURS[one.mission.believes],
                ("-", (0, (4, 2)), (0, (1, 1)))[_scene(cases, k) % 3],
            )
            going = np.isnan(track.contact[:, 0]) | (track.time_s[:, None] <= track.contact[:, 0])
            z = np.where(going, track.pose[..., 2], np.nan)
            x = np.where(going, 100 * np.hypot(track.pose[..., 0], track.pose[..., 1]), np.nan)
            for axis, values in ((far, z), (aside, x)):
                axis.plot(track.time_s, values, color=colour, linewidth=0.6, alpha=0.35, linestyle=style)
            far.plot(
                track.time_s, _mean(z, one), color=colour, linestyle=style, linewidth=2,
                label=f"{one.name}: {one.believed_short}",
            )  # fmt: skip
            aside.plot(track.time_s, _mean(x, one), color=colour, linestyle=style, linewidth=2)
        for one in cases[:MOST_ROWS]:
            far.plot(one.track.time_s, one.track.goal_m.mean(axis=1), color=GOOD, linewidth=1.4, zorder=1)
        _events(far, cases[:MOST_ROWS])
        if narrow:
            fig.legend(handles=far.get_legend_handles_labels()[0], loc="outside lower center", fontsize=8.5)
        else:
            far.legend(fontsize=8.5, loc="best")
        far.margins(y=0.15)
        _within(far, cases[:MOST_ROWS])
        label(far, "time (s)", "distance along the beam (m)", "Distance; green: asked for")
        label(aside, "time (s)", "distance from the axis (cm)", "Off the axis")
        aside.set_ylim(bottom=0)
    return fig


def _mean(values: np.ndarray, one: Followed) -> np.ndarray:
    """Of the runs that kept their way; NaN where none did."""
    values = values[:, ~one.lost]
    count = np.isfinite(values).sum(axis=1)
    return np.where(count > 0, np.nansum(values, axis=1) / np.maximum(count, 1), np.nan)


def _within(axis: Axes, cases: Sequence[Followed]) -> None:
    """Leave out where only runs go that lost their way, far beyond what was asked for or behind the lamp."""
    kept = [one.track.pose[:, ~one.lost, 2] for one in cases]
    known = np.concatenate([*(v.ravel() for v in kept), *(one.track.goal_m.ravel() for one in cases)])
    top = float(known.max())
    low, high = axis.get_ylim()
    axis.set_ylim(max(low, min(float(known.min()), 0.0) - _BEYOND * top), min(high, (1 + _BEYOND) * top))


def _scene(cases: Sequence[Followed], k: int) -> int:
    return list(dict.fromkeys(one.name for one in cases)).index(cases[k].name)


def _events(axis: Axes, cases: Sequence[Followed]) -> None:
    """Darkness, water that changes, a current that sets in; what missions have in common once."""
    alike = {tuple(getattr(one.mission, name) for name in _EVENTS): one.mission for one in cases}
    for mission in alike.values():
        _events_of(axis, mission)


def events_in_words(cases: Sequence[Followed]) -> str:
    """What the bands and lines over the time are, of those that some mission has."""
    missions = [one.mission for one in cases]
    known = {
        " Grey band: dark.": any(m.dark_for_s > 0 for m in missions),
        " Green band: the water changes.": any(m.turbid_factor != 1 for m in missions),
        " Dotted line: a current sets in.": any(m.current_from_s > 0 for m in missions),
    }
    return "".join(words for words, shown in known.items() if shown)


def _events_of(axis: Axes, mission: Mission) -> None:
    if mission.dark_for_s > 0:
        axis.axvspan(mission.dark_from_s, mission.dark_from_s + mission.dark_for_s, color=MUTED, alpha=0.25)
    if mission.turbid_factor != 1:
        axis.axvspan(
            mission.turbid_from_s, mission.turbid_from_s + mission.turbid_for_s, color=SERIES[2], alpha=0.2
        )
    if mission.current_from_s > 0:
        axis.axvline(mission.current_from_s, color=MUTED, linestyle=":")


def sweep_figures(data: xr.Dataset) -> dict[str, Callable[..., Figure]]:
    """What to draw runs over parameters with, by the metric; only those that a case has."""
    return {name: partial(sweep_figure, metric=name) for name in metrics_in(data)}


def metrics_in(data: xr.Dataset) -> list[str]:
    """Metrics that a case has."""
    return [name for name in METRICS if name in data and np.isfinite(data[name].values).any()]


def sweep_figure(data: xr.Dataset, metric: str, narrow: bool = False) -> Figure:
    """A metric over the first axis, a line for each step of the others; bars: standard errors."""
    with panels(1, 3.8, narrow=narrow) as (fig, (axis,)):
        _over_first(axis, data, metric)
        if len(axes_of(data)) > 1:
            axis.legend(title=", ".join(axes_of(data)[1:]), fontsize=8.5)
    return fig


def all_figure(data: xr.Dataset, metrics: Sequence[str], narrow: bool = False) -> Figure:
    """Several metrics, a small panel each; lines as in `sweep_figure`."""
    across = 1 if narrow else _PANELS_ACROSS
    down = -(-len(metrics) // across)
    with figure(*(NARROW if narrow else WIDTH, 0.3 + _PANEL_HEIGHT * down)) as fig:
        every = fig.subplots(down, across, squeeze=False).ravel()
        for axis, name in zip(every, metrics, strict=False):
            _over_first(axis, data, name)
        for axis in every[len(metrics) :]:
            axis.set_axis_off()
    return fig


def _over_first(axis: Axes, data: xr.Dataset, metric: str) -> None:
    first, *others = axes_of(data)
    steps = data[first].values
    numbers = steps.dtype.kind in "fi"
    at = steps if numbers else np.arange(len(steps))
    for k, at_others in enumerate(np.ndindex(*(data.sizes[name] for name in others))):
        one = data.isel(dict(zip(others, at_others, strict=True)))
        name = ", ".join(str(data[n].values[i]) for n, i in zip(others, at_others, strict=True))
        belief = name if name in _COLOURS else ""
        error = np.nan_to_num(one[f"{metric}_stderr"].values)
        axis.errorbar(
            at, one[metric].values, error, marker="o", capsize=3, linestyle="-" if numbers else "none",
            color=_COLOURS[belief] if belief else SERIES[k % len(SERIES)], label=name or None,
        )  # fmt: skip
    if not numbers:
        axis.set_xticks(at, [str(step) for step in steps])
    unit = data[first].attrs.get("units", "")
    label(axis, f"{first} ({unit})" if unit else first, f"{plain(metric)} ({data[metric].attrs['units']})")
