"""Figures of render against formula at one wavelength: maps, radial profiles, along the axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from lightfield.arrays import Array, evenly
from lightfield.report.style import (
    DASH,
    FORMULA,
    GRID,
    INK,
    MUTED,
    NARROW,
    RENDER,
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
from lightfield.studies.compare.maps import PlaneComparison
from lightfield.studies.compare.rings import ERROR_LEVELS, SIGMAS
from lightfield.wording import plain

_MOST_PLANES, _MOST_NARROW = 5, 3
_FLAT = 0.6  # height over width under which a panel has no room beside it for words
#: Where the colours of error maps end, and where a formula is mostly farther off than that.
_ERROR_SCALE, _FAR_OFF = 0.50, 1.0
#: Part of the brightest cell's light that cells of the spot have at least. Chosen: as errors count elsewhere.
_OF_SPOT = 0.05
#: Errors that profiles show, at least and at most.
_LEAST_SHOWN, _MOST_SHOWN = (-0.52, 0.32), (-1.05, 2.0)
_CONTOURS = dict(zip(ERROR_LEVELS, ((0, (2, 2)), "solid"), strict=True))


def maps_figure(planes: Sequence[PlaneComparison], units: str, quantity: str, narrow: bool = False) -> Figure:
    """Rows: render, formula, error of the formula with contours where it is beyond 5 % and 10 %.

    `narrow`: a plane is a row, and these three its columns.
    """
    there = len(planes)
    planes = [planes[k] for k in evenly(there, _MOST_NARROW if narrow else _MOST_PLANES)]
    n, tall = len(planes), _height_of(planes)
    flat = tall < _FLAT
    if narrow:
        size = NARROW, 2.3 + n * (1.2 * tall + 0.5)
    else:
        size = max(4.4, 1.3 + 1.74 * n), (3.0 + 5.4 * tall if flat else 1.2 + 4.5 * tall)
    with figure(*size) as fig:
        shape = (n, 3) if narrow else (3, n)
        axes = fig.subplots(*shape, squeeze=False, sharex=True, sharey=True)
        axes = axes.T if narrow else axes
        scale = _error_scale(planes)
        for column, plane in enumerate(planes):
            light, error = _plane_maps(axes[:, column], plane, scale, right=flat and not narrow)
        _name_maps(axes, narrow, flat)
        bar, other = _colour_bars(fig, axes, light, error, narrow, flat)
        bar.set_label(f"{plain(quantity)}, 100 % in {SHORT_UNITS.get(units, units)}", fontsize=9)
        other.set_label("error of the formula", fontsize=9)
        drawn = f"{n} of {there} planes. " if n < there else ""
        gap = "\n" if narrow or n < 3 else " "
        fig.supxlabel(
            f"{drawn}Contours, if any: error beyond 5 % (dashed){gap}and 10 % (solid) after {SIGMAS:g} "
            "standard errors of noise",
            fontsize=8 if narrow else 9,
            color=MUTED,
        )
    return fig


def _error_scale(planes: Sequence[PlaneComparison]) -> float:
    """Where colours of errors end: farther off where most of the spot on a plane would have the last one."""
    with np.errstate(invalid="ignore"):
        off = [np.abs(p.ratio - 1)[p.render > _OF_SPOT * np.nanmax(p.render)] for p in planes]
    return _FAR_OFF if any(np.median(one) > _ERROR_SCALE for one in off if one.size) else _ERROR_SCALE


def _plane_maps(axes: Any, plane: PlaneComparison, scale: float, right: bool) -> tuple[AxesImage, AxesImage]:
    """Render, formula and error of one plane; what is 100 % stands above, in the middle or on the right."""
    extent, peak = extent_of(plane.x_m, plane.y_m), float(np.nanmax(plane.render))
    for axis, values in zip(axes[:2], (plane.render, plane.formula), strict=True):
        shares = values / peak if peak > 0 else values
        light = axis.imshow(shares, origin="lower", extent=extent, cmap="magma", vmin=0, vmax=1)
    axes[0].set_title(f"z = {plane.z_m:g} m", loc="center", pad=16)
    axes[0].annotate(
        f"100 % = {peak:.2g}", (1.0 if right else 0.5, 1.04), xycoords="axes fraction",
        ha="right" if right else "center", fontsize=8.5, color=MUTED,
    )  # fmt: skip
    error = axes[2].imshow(
        np.where(plane.render > 0, plane.ratio - 1, np.nan), origin="lower", extent=extent, cmap="RdBu_r",
        vmin=-scale, vmax=scale,
    )  # fmt: skip
    _contours(axes[2], plane)
    return light, error


def _name_maps(axes: Any, narrow: bool, flat: bool) -> None:
    """What a row of maps shows (a column, where the figure is narrow), and lengths along their edges."""
    over = "/" if narrow else " / "
    for row, name in enumerate(("render", "formula", f"formula{over}render \N{MINUS SIGN} 1")):
        if narrow:
            axes[row, -1].set_xlabel(f"x (m)\n{name}", fontsize=8.5)
        elif flat:  # no room for words beside a low panel
            axes[row, 0].annotate(name, (0, 1.06), xycoords="axes fraction", fontsize=8.5, color=MUTED)
        else:
            axes[row, 0].set_ylabel(f"{name}\n\ny (m)")
    for axis in axes[0, :] if narrow else axes[:, 0] if flat else ():
        axis.set_ylabel("y (m)")
    for axis in () if narrow else axes[2, :]:
        axis.set_xlabel("x (m)")
    for axis in axes.ravel():
        axis.grid(False)
        axis.set_aspect("equal")
        axis.tick_params(labelsize=8.5)


def _colour_bars(
    fig: Figure, axes: Any, light: AxesImage, error: AxesImage, narrow: bool, flat: bool
) -> tuple[Colorbar, Colorbar]:
    """Scales of light and of error in per cent: beside their rows, or below where there is no room."""
    if narrow or flat:
        below: dict[str, Any] = {"location": "bottom", "aspect": 30 if narrow else 50, "shrink": 0.9}
        bar = fig.colorbar(light, ax=axes.ravel().tolist(), pad=0.02, **below)
        other = fig.colorbar(error, ax=axes.ravel().tolist(), extend="both", pad=0.02, **below)
    else:
        bar = fig.colorbar(light, ax=axes[:2, :], location="right", shrink=0.8, aspect=30, pad=0.015)
        other = fig.colorbar(error, ax=axes[2, :], location="right", extend="both", aspect=15, pad=0.015)
    for one in (bar, other):
        percent_axis(one.ax.xaxis if narrow or flat else one.ax.yaxis)
    return bar, other


def radial_figure(planes: Sequence[PlaneComparison], narrow: bool = False) -> Figure:
    """Profiles over rings with three-sigma bands, and the error of the formula below."""
    there = len(planes)
    planes = [planes[k] for k in evenly(there, _MOST_NARROW if narrow else _MOST_PLANES)]
    with figure(*((NARROW, 0.5 + 3.2 * len(planes)) if narrow else (WIDTH, 4.4))) as fig:
        if narrow:
            stack = fig.subplots(
                2 * len(planes), 1, squeeze=False, sharex=True, height_ratios=(1.35, 1) * len(planes)
            )
            axes = stack.reshape(len(planes), 2).T
        else:
            axes = fig.subplots(
                2, len(planes), squeeze=False, sharex=True, sharey="row", height_ratios=(1.35, 1)
            )
        low, high = _LEAST_SHOWN
        for column, plane in enumerate(planes):
            upper, lower, profile = axes[0, column], axes[1, column], plane.profile
            scale = float(np.nanmax(profile.render)) or np.nan  # an empty panel where no light was rendered
            band = SIGMAS * np.where(np.isfinite(profile.stderr), profile.stderr, 0)
            upper.fill_between(
                profile.r_m,
                np.maximum(profile.render - band, 1e-30 * scale) / scale,
                (profile.render + band) / scale,
                color=RENDER,
                alpha=0.3,
                linewidth=0,
            )
            upper.plot(profile.r_m, profile.render / scale, color=RENDER, label="render")
            upper.plot(profile.r_m, profile.formula / scale, color=FORMULA, linestyle=DASH, label="formula")
            upper.set_yscale("log")
            upper.set_ylim(1e-3, 1.6)
            upper.set_title(f"z = {plane.z_m:g} m")
            if len(profile.r_m) < 2:
                say_why_empty(upper, "no two rings of cells about\nthe axis lie on the plane")
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.where(profile.render > 0, profile.formula / profile.render, np.nan)
                noise = np.where(profile.render > 0, ratio * band / profile.render, np.nan)
            error_band(lower, profile.r_m, ratio - 1, noise)
            told = (ratio - 1)[np.isfinite(ratio) & (noise < 1)]
            low, high = min(low, 1.1 * told.min(initial=0)), max(high, 1.1 * told.max(initial=0))
            if not narrow or column == len(planes) - 1:
                lower.set_xlabel("r (m)")
            if narrow or not column:
                upper.set_ylabel("relative" if narrow else "relative to the render's\nbrightest ring")
                lower.set_ylabel("error" if narrow else "error of the formula")
        for lower in axes[1]:
            lower.set_ylim(max(low, _MOST_SHOWN[0]), min(high, _MOST_SHOWN[1]))
        axes[0, 0].legend(loc="lower left")
        if len(planes) < there:
            fig.suptitle(f"{len(planes)} of {there} planes", x=0.01, ha="left", fontsize=9, color=MUTED)
    return fig


def axial_figure(planes: Sequence[PlaneComparison], narrow: bool = False) -> Figure:
    """Along the tank: brightness on the axis, half width, and the light that the formula lacks."""
    z = np.array([plane.z_m for plane in planes])
    with figure(*((NARROW, 8.4) if narrow else (WIDTH, 3.5))) as fig:
        axis, width, lost = fig.subplots(*((3, 1) if narrow else (1, 3)))
        _on_axis(axis, z, planes)
        _half_widths(width, z, planes)
        _lacking_light(lost, z, planes)
        room = lost.get_xlim()
        for panel in (axis, width):
            panel.set_xlim(room)
    return fig


def _on_axis(axis: Axes, z: Array, planes: Sequence[PlaneComparison]) -> None:
    """Light on the axis, in per cent of the render at the first plane."""
    render = np.array([plane.axis.render[0] for plane in planes])
    stderr = np.array([plane.axis.stderr[0] for plane in planes])
    formula = np.array([plane.axis.formula[0] for plane in planes])
    unit = render[0] / 100 if render[0] > 0 else 1.0
    axis.errorbar(
        z, render / unit, SIGMAS * stderr / unit, color=RENDER, marker="o", markersize=4, label="render"
    )
    axis.plot(z, formula / unit, color=FORMULA, linestyle=DASH, marker="s", markersize=4, label="formula")
    axis.set_yscale("log")
    axis.legend(loc="lower left")
    missed = ", ".join(f"{at:g}" for at in z[~np.isfinite(formula)])
    if missed:
        axis.annotate(
            f"the axis meets no cell at {missed} m", (0.98, 0.97), xycoords="axes fraction", ha="right",
            va="top", fontsize=8.5, color=MUTED,
        )  # fmt: skip
    label(axis, "z (m)", "% of the render at the first plane", "On the axis")
    plain_log_axis(axis.yaxis)


def _half_widths(axis: Axes, z: Array, planes: Sequence[PlaneComparison]) -> None:
    """Half widths of the spot along x, and along y where these differ."""
    for name, spots, colour, dash in (
        ("render", [p.render_spot for p in planes], RENDER, "solid"),
        ("formula", [p.formula_spot for p in planes], FORMULA, DASH),
    ):
        along_x = np.array([spot.hwhm_x_m for spot in spots])
        along_y = np.array([spot.hwhm_y_m for spot in spots])
        error = SIGMAS * np.array([spot.stderr.get("hwhm_x_m", 0.0) for spot in spots])
        drawn: dict[str, Any] = {"color": colour, "linestyle": dash, "markersize": 4}
        axis.errorbar(z, along_x, error, marker="o", label=f"{name}, x", **drawn)
        if np.nanmax(np.abs(along_y / along_x - 1), initial=0) > 0.02:
            axis.plot(z, along_y, marker="^", alpha=0.6, label=f"{name}, y", **drawn)
    label(axis, "z (m)", "half width at half maximum (m)", "Width of the spot")
    if not np.isfinite([p.render_spot.hwhm_x_m for p in planes]).any():
        say_why_empty(axis, "the spot has no edge\non these planes,\nor too few cells")
        axis.set(xticks=[], yticks=[])
        return
    axis.set_ylim(0, 1.05 * axis.get_ylim()[1])
    axis.legend(loc="lower right")


def _lacking_light(axis: Axes, z: Array, planes: Sequence[PlaneComparison]) -> None:
    """Part of the light on every plane that the formula lacks."""
    share = np.array([plane.lost for plane in planes])
    noise = SIGMAS * np.array([plane.lost_stderr for plane in planes])
    axis.bar(z, share, width=0.55 * (np.min(np.diff(z)) if z.size > 1 else 1.0), color=FORMULA, alpha=0.85)
    axis.errorbar(z, share, noise, fmt="none", ecolor=INK, capsize=3)
    axis.axhline(0, color=MUTED, linewidth=0.8)
    percent_axis(axis.yaxis)
    known = share[np.isfinite(share)]
    axis.set_ylim(1.15 * known.min(initial=0), max(1.15 * known.max(initial=0), 0.05))
    for at, value in zip(z, share, strict=True):
        text, height = (f"{100 * value:.1f} %", value) if np.isfinite(value) else ("no light", 0.0)
        axis.annotate(text, (at, height), (0, 5), textcoords="offset points", ha="center", fontsize=9)
    label(axis, "z (m)", "part of the light on the plane", "Light that the formula lacks")


def error_band(axis: Axes, x: np.ndarray, error: np.ndarray, noise: np.ndarray) -> None:
    """Relative error with its noise band over the zones of 5 % and 10 %."""
    for level, alpha in zip(reversed(ERROR_LEVELS), (0.45, 0.8), strict=True):
        axis.axhspan(-level, level, color=GRID, alpha=alpha, linewidth=0)
    axis.axhline(0, color=MUTED, linewidth=0.8)
    banded(axis, x, error, noise, color=FORMULA)
    axis.grid(False, axis="y")
    percent_axis(axis.yaxis)


def _contours(axis: Axes, plane: PlaneComparison) -> None:
    beyond = plane.smooth_excess()
    for level, dash in _CONTOURS.items():
        if np.nanmax(beyond) > level > np.nanmin(beyond):
            axis.contour(
                plane.x_m,
                plane.y_m,
                beyond,
                levels=[level],
                colors="black",
                linestyles=[dash],
                linewidths=1.1,
            )


def _height_of(planes: Sequence[PlaneComparison]) -> float:
    """Height of a map over its width, within what a page can bear."""
    shapes = [(e[3] - e[2]) / (e[1] - e[0]) for e in (extent_of(p.x_m, p.y_m) for p in planes)]
    return float(np.clip(max(shapes, default=1.0), 0.2, 1.6))
