"""Figures of a sweep: profiles against a varied parameter, where the formula holds, maps side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from textwrap import fill

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from lightfield.arrays import evenly
from lightfield.maps.dataset import brightest
from lightfield.report.regime import colours_named, error_cells
from lightfield.report.style import (
    MUTED,
    NARROW,
    SERIES,
    SHORT_UNITS,
    WIDTH,
    banded,
    extent_of,
    figure,
    label,
    percent_axis,
    plain_log_axis,
    say_why_empty,
)
from lightfield.studies.compare.rings import SIGMAS
from lightfield.sweep.results import axes_of
from lightfield.wording import capital, plain

_MOST_LINES, _MOST_TILES, _FEW_TILES = 6, 5, 2
#: Where a scale of light begins, as a part of its end, at the lowest and at the highest (chosen).
_DEEPEST, _SHALLOWEST = 1e-4, 0.5
#: A scale of less than two decades has ticks between them.
_FEW_TICKS = 100.0
#: Dimensions of colours, of which one alone is drawn.
_COLOURS = ("wavelength_nm", "band")
#: Letters of a note to an inch.
_LETTERS = 14
#: Of a number that no case has.
_UNTOLD = "not told of any case:\na spot without an edge on the plane,\nor of too few cells"


def figures_of(data: xr.Dataset) -> dict[str, Callable[..., Figure]]:
    """What to draw a sweep with, by name; maps only where the store holds them."""
    maps = {"maps": tiles_figure} if data.attrs["quantity"] in data else {}
    return {"profiles": profiles_figure, "formula": formula_figure, **maps}


def profiles_figure(data: xr.Dataset, narrow: bool = False) -> Figure:
    """Derived quantities against the longest axis, colours for the next, the rest held at its middle step.

    Parameters
    ----------
    data : xarray.Dataset
        From `lightfield.sweep.results.open_store`.
    """
    along, hue = _two_axes(data)
    held, rest = _hold(data, {along, hue, *_map_dims(data)})
    quantity, plane = data.attrs["quantity"], _plane(held)
    middle, chosen = held.sizes[plane] // 2, evenly(held.sizes[hue], _MOST_LINES)
    panels = {
        f"on_axis_{quantity}": f"{capital(plain(quantity))} on the axis",
        "half_width_m": "Half width of the spot",
        "plane_power": "Integral over the plane",
        "formula_error_on_axis": "Error of the formula on the axis",
    }
    rows = 4 if narrow else 2
    with figure(*((NARROW, 11.6) if narrow else (WIDTH, 6.4))) as fig:
        for axis, name in zip(fig.subplots(rows, 4 // rows, sharex=True).ravel(), panels, strict=True):
            for line, step in enumerate(chosen):
                at = held.isel({hue: step} if hue == plane else {hue: step, plane: middle})
                _line(axis, at, along, name, SERIES[line], _step_name(held, hue, step))
            units = held[name].attrs.get("units", "1")
            label(axis, "", "" if units == "1" else SHORT_UNITS.get(units, units), panels[name])
            _scale(axis, name)
        for axis in fig.axes[3:4] if narrow else fig.axes[2:4]:
            axis.set_xlabel(_axis_name(held, along))
            if _is_log(held[along].values):
                axis.set_xscale("log")
            _text_ticks(axis, held, along)
        handles, names = fig.axes[0].get_legend_handles_labels()
        fig.legend(
            handles, names, title=_axis_name(held, hue), fontsize=8.5, title_fontsize=8.5,
            loc="outside lower center" if narrow else "outside right upper", ncols=2 if narrow else 1,
        )  # fmt: skip
        where = "" if hue == plane else f"{_axis_name(held, plane)} = {_step_name(held, plane, middle)}"
        cut = [*_cut(held, hue, chosen), *_first_of(held)]
        _note(fig, [where, *rest, *cut, f"bands: {SIGMAS:g} standard errors"])
    return fig


def _scale(axis: Axes, name: str) -> None:
    """The upright axis of a profile: per cent, decades, or none where nothing is drawn."""
    if not any(np.isfinite(line.get_ydata()).any() for line in axis.lines):
        say_why_empty(axis, _UNTOLD)
        axis.set_yticks([])  # its scale of steps is that of the panels beside it
    elif name.startswith("formula_error"):
        axis.axhline(0, color=MUTED, linewidth=0.8)
        percent_axis(axis.yaxis)
    elif name != "half_width_m" and _spans_a_decade(axis):
        axis.set_yscale("log")


def formula_figure(data: xr.Dataset, narrow: bool = False) -> Figure:
    """Where the formula holds: its error on the axis over two axes, one panel per plane.

    Parameters
    ----------
    data : xarray.Dataset
        From `lightfield.sweep.results.open_store`.
    """
    along, up = _two_axes(data)
    held, rest = _hold(data, {along, up, *_map_dims(data)})
    plane = _plane(held)
    panels = [0] if up == plane else evenly(held.sizes[plane], 4)
    columns, lines = evenly(held.sizes[along], 5 if narrow else 14), evenly(held.sizes[up], 12)
    wide = 2 if len(panels) > 1 and len(columns) <= 7 and not narrow else 1
    rows = -(-len(panels) // wide)
    with figure(NARROW if narrow else WIDTH, 1.3 + rows * (0.6 + max(1.1, 0.3 * len(lines)))) as fig:
        axes = fig.subplots(rows, wide, squeeze=False, sharex=True, sharey=True)
        for axis in axes.ravel()[len(panels) :]:
            axis.set_axis_off()
        for axis, panel in zip(axes.ravel(), panels, strict=False):
            at = held.isel({along: columns, up: lines})
            at = at if up == plane else at.isel({plane: panel})
            error = _flat(at["formula_error_on_axis"], up, along)
            error_cells(axis, error, _flat(at["formula_error_on_axis_stderr"], up, along), 8.5)
            axis.set_xticks(range(len(columns)), [_step_name(held, along, i) for i in columns])
            axis.set_yticks(range(len(lines)), [_step_name(held, up, j) for j in lines])
            title = "" if up == plane else f"{_axis_name(held, plane)} = {_step_name(held, plane, panel)}"
            label(axis, "", "", title)
        for axis in axes[-1]:
            axis.set_xlabel(_axis_name(held, along))
        fig.supylabel(_axis_name(held, up), fontsize=10)
        colours_named(fig, narrow)
        cut = [*_cut(held, along, columns), *_cut(held, up, lines)]
        cut += [*([] if up == plane else _cut(held, plane, panels)), *_first_of(held)]
        what = "error of the closed-form model on the axis, in %"
        _note(fig, [what, "?: noise leaves it open", *rest, *cut])
    return fig


def tiles_figure(data: xr.Dataset, narrow: bool = False) -> Figure:
    """Maps side by side over two axes, on one logarithmic scale.

    Parameters
    ----------
    data : xarray.Dataset
        From `lightfield.sweep.results.open_store`.
    """
    quantity = data.attrs["quantity"]
    along, up = _two_axes(data)
    held, rest = _hold(data, {along, up, *_map_dims(data)})
    plane, middle = _plane(held), held.sizes[_plane(held)] // 2
    most = _FEW_TILES if narrow else _MOST_TILES
    columns, lines = evenly(held.sizes[along], most), evenly(held.sizes[up], most)
    chosen = held[quantity].isel({along: columns, up: lines}).isel(wavelength_nm=0, missing_dims="ignore")
    chosen = chosen.isel(band=0, missing_dims="ignore")
    if up != plane:
        chosen = chosen.isel({plane: middle})
    row, column = chosen.dims[-2:]
    values = chosen.transpose(up, along, row, column).values
    low, top = _scale_of(values)
    width = NARROW if narrow else min(WIDTH, 2.2 + 1.75 * len(columns))
    shape = _extent(held, column, row)
    tall = float(np.clip((shape[3] - shape[2]) / (shape[1] - shape[0]), 0.2, 1.6)) if shape else 1.0
    with figure(width, 1.2 + (0.16 + 1.45 * tall) * len(lines)) as fig:
        axes = fig.subplots(len(lines), len(columns), squeeze=False, sharex=True, sharey=True)
        for (j, i), axis in np.ndenumerate(axes):
            shown = axis.imshow(
                np.maximum(values[len(lines) - 1 - j, i], 0.1 * low), origin="lower", cmap="magma",
                norm=LogNorm(low, top), extent=_extent(held, column, row),
            )  # fmt: skip
            axis.grid(False)
            axis.tick_params(labelsize=7.5)
            if j == 0:
                axis.set_title(_step_name(held, along, columns[i]), fontsize=9.5, loc="center")
            if i == 0:
                axis.set_ylabel(_step_name(held, up, lines[len(lines) - 1 - j]), fontsize=9.5)
        where = "bottom" if narrow else "right"
        bar = fig.colorbar(shown, ax=axes, shrink=0.8, aspect=30, location=where)
        if top < _FEW_TICKS * low:
            plain_log_axis(bar.ax.xaxis if narrow else bar.ax.yaxis)
        unit = held[quantity].attrs["units"]
        bar.set_label(f"{plain(quantity)} ({SHORT_UNITS.get(unit, unit)})", fontsize=9)
        fig.supxlabel(f"columns: {_axis_name(held, along)}", fontsize=9.5)
        fig.supylabel(f"rows: {_axis_name(held, up)}", fontsize=9.5)
        inside = "panels: x to the right and y up, m" if shape else ""
        where = "" if up == plane else f"{_axis_name(held, plane)} = {_step_name(held, plane, middle)}"
        cut = [*_cut(held, along, columns), *_cut(held, up, lines)]
        cut += [*([] if up == plane else _cut(held, plane, [middle])), *_first_of(held)]
        _note(fig, [where, inside, *rest, *cut])
    return fig


def _scale_of(values: np.ndarray) -> tuple[float, float]:
    """Ends of a logarithmic scale: the least light, `_DEEPEST` of the most at least, and the most."""
    lit = values[np.isfinite(values) & (values > 0)]
    low, top = (float(lit.min()), float(lit.max())) if len(lit) else (0.5, 1.0)
    return float(np.clip(low, _DEEPEST * top, _SHALLOWEST * top)), top


# -- choosing what is drawn --------------------------------------------------------------------------


def _map_dims(data: xr.Dataset) -> list[str]:
    """Dimensions that are not varied parameters."""
    return [str(dim) for dim in data.dims if dim not in axes_of(data)]


def _plane(data: xr.Dataset) -> str:
    return "z_m" if "z_m" in data.dims else "plane"


def _two_axes(data: xr.Dataset) -> tuple[str, str]:
    """The axis to draw along (the longest of numbers), and that for colours or rows (planes if none)."""
    axes = sorted(axes_of(data), key=lambda a: (data[a].dtype.kind not in "fi", -data.sizes[a]))
    several = [name for name in axes if data.sizes[name] > 1] or axes
    return several[0], several[1] if len(several) > 1 else _plane(data)


def _hold(data: xr.Dataset, kept: set[str]) -> tuple[xr.Dataset, list[str]]:
    """Every other axis at its middle step, and what that is; the brightest wavelength or band comes first."""
    notes = []
    for name in _COLOURS:
        if name in data.plane_power.dims:
            first = brightest(data.plane_power, name)
            data = data.isel({name: [first, *(k for k in range(data.sizes[name]) if k != first)]})
    for name in axes_of(data):
        if name not in kept:
            step = data.sizes[name] // 2
            notes.append(f"{_axis_name(data, name)} = {_step_name(data, name, step)}")
            data = data.isel({name: step})
    return data, notes


def _cut(data: xr.Dataset, name: str, chosen: Sequence[int]) -> list[str]:
    """What a figure leaves out of a dimension, in words."""
    there = data.sizes[name]
    return [f"{len(chosen)} of {there} steps of {name}"] if len(chosen) < there else []


def _first_of(data: xr.Dataset) -> list[str]:
    """Which wavelength or band alone is drawn, where there are several: see `_hold`."""
    return [
        f"{_axis_name(data, name)} = {_step_name(data, name, 0)} alone, of {data.sizes[name]}"
        for name in _COLOURS
        if data.sizes.get(name, 1) > 1
    ]


def _line(axis: Axes, data: xr.Dataset, along: str, name: str, colour: str, text: str) -> None:
    values, noise = _flat(data[name], along), SIGMAS * _flat(data[f"{name}_stderr"], along)
    x = data[along].values if data[along].dtype.kind in "fi" else np.arange(len(values))
    spread = np.where(np.isfinite(noise), noise, 0)
    banded(axis, np.asarray(x, float), values, spread, color=colour, label=text, marker="o", markersize=3)


def _flat(variable: xr.DataArray, *dims: str) -> np.ndarray:
    """Values over the named dimensions, the first of whatever else is left (bands)."""
    others = {dim: 0 for dim in variable.dims if dim not in dims}
    return np.asarray(variable.isel(others).transpose(*dims).values, float)


def _extent(data: xr.Dataset, column: str, row: str) -> tuple[float, float, float, float] | None:
    if column != "x_m" or row != "y_m":
        return None
    return extent_of(data.x_m.values, data.y_m.values)


# -- words -------------------------------------------------------------------------------------------


def _axis_name(data: xr.Dataset, name: str) -> str:
    unit = data[name].attrs.get("units", "") if name in data.coords else ""
    text = "z" if name == "z_m" else name
    return text if unit in ("", "1") else f"{text} ({unit})"


def _step_name(data: xr.Dataset, name: str, step: int) -> str:
    value = data[name].values[step] if name in data.coords else step
    return f"{value:.3g}" if isinstance(value, float | np.floating) else str(value)


def _text_ticks(axis: Axes, data: xr.Dataset, name: str) -> None:
    values = data[name].values
    if values.dtype.kind not in "fi":
        axis.set_xticks(range(len(values)), [str(v) for v in values])
    elif values.dtype.kind == "i":
        axis.set_xticks(values[evenly(len(values), _MOST_LINES)])


def _spans_a_decade(axes: Axes) -> bool:
    """Do its lines? Of less, a logarithmic axis has no round numbers to show."""
    values = np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.lines] or [np.empty(0)])
    lit = values[np.isfinite(values) & (values > 0)]
    return bool(lit.size and lit.max() >= 10 * lit.min())


def _is_log(values: np.ndarray) -> bool:
    """Steps of equal ratio over more than a decade."""
    if values.dtype.kind not in "fi" or len(values) < 3 or values.min() <= 0:
        return False
    return bool(np.allclose(np.diff(np.log(values), 2), 0, atol=1e-6) and values.max() > 10 * values.min())


def _note(fig: Figure, parts: Sequence[str]) -> None:
    text = "; ".join(part for part in parts if part)
    fig.suptitle(fill(text, int(_LETTERS * fig.get_figwidth())), x=0.01, ha="left", fontsize=9, color=MUTED)
