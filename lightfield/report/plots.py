"""One drawing each, in axes that the user gives: what `plot` of an answer draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
import xarray as xr
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from lightfield.arrays import Array, evenly
from lightfield.diagnosis.verdict.parts import Rung
from lightfield.errors import UsageError
from lightfield.readings import Readings
from lightfield.render.picture import Picture, as_seen
from lightfield.report.diagnosis.ladder import FAR_APART
from lightfield.report.light_figures import light_map
from lightfield.report.style import (
    DASH,
    FORMULA,
    GOOD,
    GRID,
    MUTED,
    RENDER,
    SERIES,
    SHORT_UNITS,
    STYLE,
    banded,
    label,
    percent_axis,
    plain_log_axis,
)
from lightfield.studies.compare.maps import PlaneComparison
from lightfield.studies.compare.rings import SIGMAS
from lightfield.wording import plain, rounded

#: Lines that a drawing can show apart.
_LINES = len(SERIES)
#: A cell that holds two digits is at least so wide, inches (looked at).
_CELL_IN = 0.22


def axes_for(ax: Axes | None) -> Axes:
    """The axes that were given, or those of a new figure in our style."""
    if ax is not None:
        if not isinstance(ax, Axes):
            raise UsageError(
                "not what this argument takes", where="ax", found=type(ax).__name__,
                rule="the axes of a matplotlib figure, or none",
            )  # fmt: skip
        return ax
    with matplotlib.rc_context(STYLE):
        return pyplot.subplots(figsize=(7.0, 4.2), layout="constrained")[1]


def plot_ladder(ax: Axes | None, ladder: Sequence[Rung], noise_floor_percent: float | None) -> Axes:
    """Error of every rung, and the noise."""
    ax = axes_for(ax)
    error = np.array([rung.error_percent for rung in ladder], float)
    if noise_floor_percent is not None:
        ax.axhline(
            noise_floor_percent, color=GOOD, linewidth=1.2, label=f"noise {rounded(noise_floor_percent)} %"
        )
    ax.plot(range(len(error)), error, "o-", color=RENDER, label="error of the fit")
    for k, rung in enumerate(ladder):
        if rung.rendered_error_percent is not None:
            ax.plot(
                [k], [rung.rendered_error_percent], "*", color=FORMULA, markersize=12, label="rendered afresh"
            )
        if np.isfinite(error[k]):
            ax.annotate(f"{rounded(error[k])} %", (k, error[k]), (7, 5), textcoords="offset points")
    known = [v for v in (*error, noise_floor_percent) if v is not None and np.isfinite(v)]
    least, most = min(known, default=0.0), max(known, default=1.0)
    if least > 0 and most > FAR_APART * least:
        ax.set_yscale("log")
        plain_log_axis(ax.yaxis)
    else:
        ax.set_ylim(0, 1.18 * most)
    ax.set_xticks(range(len(error)), [plain(rung.label) for rung in ladder])
    ax.set_xlim(-0.4, len(error) - 0.4)
    ax.legend()
    label(ax, "", "rms error (%)", "Error of the model")
    return ax


def plot_distances(
    ax: Axes | None, names: Sequence[str], sigma: Array, seen: Array, same: float, sure: float
) -> Axes:
    """Pairs of effects that are not surely told apart, with their distance; all others are left blank.

    Parameters
    ----------
    sigma : array, shape (n, n)
        [j, k]: distance of effect j from the nearest readings that k can produce.
    seen : array, shape (n,)
        Distance of each from the base model, in sigma.
    same, sure : float
        Below the first two effects look alike; from the second on they are surely apart, and seen.
    """
    ax = axes_for(ax)
    n = len(names)
    narrow = ax.get_window_extent().width / ax.figure.dpi < _CELL_IN * n
    size = 6 if narrow else 8
    there = np.asarray(seen) >= sure
    for (j, k), value in np.ndenumerate(sigma):
        if j == k or not there[j]:
            shade, alpha = GRID, 1.0 if j == k else 0.5
        elif value < sure:
            shade, alpha = (FORMULA, 0.75) if value < same else (SERIES[4], 0.45)
            number = f"{value:.0f}" if narrow else f"{value:.1f}"
            ax.text(k, j, number, ha="center", va="center", fontsize=7)
        else:
            continue
        ax.add_patch(Rectangle((k - 0.5, j - 0.5), 1, 1, facecolor=shade, alpha=alpha, linewidth=0))
    ax.set_xlim(-0.5, n - 0.5)
    ax.set_ylim(n - 0.5, -0.5)
    words = [plain(name) for name in names]
    rows = [word if one else f"{word} (not seen)" for word, one in zip(words, there, strict=True)]
    ax.set_xticks(range(n), words, rotation=60, ha="right", rotation_mode="anchor", fontsize=size)
    ax.set_yticks(range(n), rows, fontsize=size)
    ax.set_xticks(np.arange(n + 1) - 0.5, minor=True)
    ax.set_yticks(np.arange(n + 1) - 0.5, minor=True)
    ax.grid(False)
    ax.grid(True, which="minor", color=GRID, linewidth=0.6)
    ax.tick_params(which="both", length=0)
    label(ax, f"imitated by\n(σ apart, where below {sure:.1f}; dark: below {same:g})", "true")
    return ax


def plot_map(ax: Axes | None, plane: xr.Dataset) -> Axes:
    """Light on one plane, on a logarithmic scale."""
    ax, quantity = axes_for(ax), plane.attrs["quantity"]
    light = plane[quantity]
    image = light_map(ax, plane.x_m.values, plane.y_m.values, light.values, float(np.nanmax(light.values)))
    unit = light.attrs["units"]
    words = f"{plain(quantity)}, {SHORT_UNITS.get(unit, unit)}"
    ax.figure.colorbar(image, ax=ax, extend="min", label=words)
    label(ax, "x (m)", "y (m)", f"z = {float(plane.z_m):g} m, {float(plane.wavelength_nm):g} nm")
    return ax


def plot_picture(ax: Axes | None, taken: Picture) -> Axes:
    """A camera view, exposed for the eye."""
    ax = axes_for(ax)
    ax.imshow(as_seen(taken))
    ax.set_axis_off()
    ax.set_title("; ".join(map(str, taken.notes)), fontsize=8, fontweight="normal")
    return ax


def plot_positions(ax: Axes | None, places: xr.Dataset) -> Axes:
    """Light of single positions against their distance, with errors."""
    ax, quantity = axes_for(ax), places.attrs["quantity"]
    value, unit = places[quantity], places[quantity].attrs["units"]
    error = SIGMAS * places[f"{quantity}_stderr"].values
    ax.errorbar(
        places.z_m.values, value.values, np.where(np.isfinite(error), error, 0), fmt="o", color=RENDER
    )
    ax.set_yscale("log")
    label(ax, "z (m)", f"{plain(quantity)}, {SHORT_UNITS.get(unit, unit)}")
    return ax


def plot_formula_error(ax: Axes | None, planes: Sequence[PlaneComparison]) -> Axes:
    """Relative error of the formula against the radius, with three standard errors."""
    ax = axes_for(ax)
    ax.axhspan(-0.05, 0.05, color=GRID, alpha=0.8, linewidth=0)
    for shade, plane in zip(SERIES, (planes[k] for k in evenly(len(planes), _LINES)), strict=False):
        ring = plane.profile
        with np.errstate(divide="ignore", invalid="ignore"):
            error, noise = (
                ring.formula / ring.render - 1,
                SIGMAS * ring.stderr * ring.formula / ring.render**2,
            )
        known = np.isfinite(error) & np.isfinite(noise)
        r, error, noise = ring.r_m[known], error[known], noise[known]
        banded(ax, r, error, noise, alpha=0.2, color=shade, label=f"z = {plane.z_m:g} m")
    percent_axis(ax.yaxis)
    ax.legend()
    label(ax, "radius (m)", "formula / render \N{MINUS SIGN} 1", "Error of the formula")
    return ax


def plot_readings(ax: Axes | None, readings: Readings) -> Axes:
    """Readings against their distance from the lamp; those of air apart."""
    ax = axes_for(ax)
    away = np.sqrt(readings.x_m**2 + readings.y_m**2 + readings.z_m**2)
    media = np.unique(readings.medium).tolist()
    for medium, shade in zip(media, SERIES, strict=False):
        here = readings.medium == medium
        error = np.where(np.isfinite(readings.stderr[here]), readings.stderr[here], 0.0)
        ax.errorbar(
            away[here], readings.value[here], error, fmt="o", markersize=3.5, color=shade, label=medium
        )
    if np.all(readings.value > 0):
        ax.set_yscale("log")
    if len(media) > 1:
        ax.legend()
    what = plain(readings.quantity) or "value"
    label(ax, "distance from the lamp (m)", f"{what} ({readings.units or readings.scale})", "Readings")
    return ax


def plot_residuals(ax: Axes | None, readings: Readings, sigma: Array) -> Axes:
    """What is left of every reading, in standard errors, against its distance from the lamp."""
    ax = axes_for(ax)
    ax.axhspan(-2, 2, color=GRID, alpha=0.8, linewidth=0)
    away = np.sqrt(readings.x_m**2 + readings.y_m**2 + readings.z_m**2)
    ax.plot(away, sigma, "o", color=RENDER, markersize=3.5)
    label(ax, "distance from the lamp (m)", "reading \N{MINUS SIGN} model (σ)", "What the model leaves")
    return ax


def plot_lines(
    ax: Axes | None,
    x: Array,
    lines: Mapping[str, tuple[Array, Array | None]],
    words: tuple[str, str, str],
    *,
    log: bool = False,
    dashed: Sequence[str] = (),
) -> Axes:
    """Values with their standard errors against one coordinate.

    Parameters
    ----------
    x : array, shape (n,)
    lines : mapping of (value, stderr), arrays of shape (n,)
        By what the legend calls them.
    words : label of x, label of y, title
    dashed : sequence of str
        Lines of the formula, in the colour of the line before.
    """
    ax, number = axes_for(ax), -1
    for name, (value, stderr) in lines.items():
        number += name not in dashed
        shade, style = SERIES[number % _LINES], DASH if name in dashed else "solid"
        if stderr is not None:
            error = np.where(np.isfinite(stderr), stderr, 0)
            ax.fill_between(x, value - error, value + error, color=shade, alpha=0.25, linewidth=0)
        marker = "o" if len(x) < 3 else ""
        ax.plot(x, value, color=shade, linestyle=style, marker=marker, label=name)
    if log:
        ax.set_yscale("log")
    if len(lines) > 1:
        ax.legend()
    label(ax, *words)
    return ax


def plot_sweep(ax: Axes | None, data: xr.Dataset, axes: Sequence[str], name: str) -> Axes:
    """A quantity against the longest axis, a line per step of the next, all else at its first step, which
    the title says."""
    order = sorted(axes, key=lambda a: (data[a].dtype.kind not in "fi", -data.sizes[a]))
    along, hue = order[0], next((a for a in order[1:] if data.sizes[a] > 1), None)
    x = data[along].values
    at = np.asarray(x if x.dtype.kind in "fi" else np.arange(len(x)), float)
    lines = {}
    for step in range(1 if hue is None else min(data.sizes[hue], _LINES)):
        kept = {along} if hue is None else {along, hue}
        first = {dim: 0 for dim in data[name].dims if dim not in kept} | ({} if hue is None else {hue: step})
        value, error = (data[n].isel(first).values if n in data else None for n in (name, f"{name}_stderr"))
        assert value is not None
        lines["" if hue is None else f"{hue} = {data[hue].values[step]}"] = (value, error)
    held = [dim for dim in data[name].dims if dim not in {along, hue} and data.sizes[dim] > 1]
    at_first = ", ".join(f"{dim} = {data[dim].values[0]}" for dim in held)
    title = f"{plain(name)}\nat {at_first}" if held else plain(name)
    unit = {n: u for n in (along, name) if (u := data[n].attrs.get("units", "1")) != "1"}
    x_words = f"{along} ({unit[along]})" if along in unit else along
    ax = plot_lines(ax, at, lines, (x_words, unit.get(name, ""), title))
    if x.dtype.kind not in "fi":
        ax.set_xticks(at, [str(v) for v in x])
    return ax


def plot_ratios(ax: Axes | None, names: Sequence[str], part: Array, words: tuple[str, str]) -> Axes:
    """Points about a line at 1: what is known over what is asked for; infinite: unknown."""
    ax = axes_for(ax)
    known = np.where(np.isfinite(part), part, np.nan)
    ax.plot(range(len(names)), known, "o", color=RENDER, markersize=8)
    ax.set_xlim(-0.5, len(names) - 0.5)
    for k in np.flatnonzero(~np.isfinite(part)).tolist():
        ax.text(k, 1.1, "unknown", ha="center", va="bottom", color=MUTED, rotation=90)
    ax.axhline(1, color=FORMULA, linestyle=DASH)
    ax.set_yscale("log")
    ax.set_xticks(range(len(names)), [plain(name) for name in names])
    label(ax, "", *words)
    plain_log_axis(ax.yaxis)
    return ax


def plot_chances(ax: Axes | None, names: Sequence[str], chance: Array, what: str) -> Axes:
    """Bars of chances, per cent."""
    ax = axes_for(ax)
    ax.bar(range(len(names)), 100 * np.asarray(chance), color=RENDER)
    ax.set_ylim(0, 100)
    ax.set_xticks(range(len(names)), [plain(name) for name in names])
    label(ax, "", f"{what} (%)", "")
    return ax
