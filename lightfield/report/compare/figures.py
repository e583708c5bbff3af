"""Figures of render against formula at one wavelength: maps, radial profiles, along the axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure

from lightfield.report.style import (
    FORMULA,
    GRID,
    INK,
    MUTED,
    NARROW,
    RENDER,
    WIDTH,
    figure,
    label,
    percent_axis,
    plain_log_axis,
)
from lightfield.studies.compare.maps import PlaneComparison
from lightfield.studies.compare.rings import ERROR_LEVELS, SIGMAS

MOST_PLANES, MOST_NARROW = 5, 3
FLAT = 0.6  # height over width under which a panel has no room beside it for words
ERROR_SCALE = 0.50  # the colours of error maps end here
CONTOURS = dict(zip(ERROR_LEVELS, ((0, (2, 2)), "solid"), strict=True))
SHORT_UNITS = {"W m-2 nm-1": "W/(m² nm)", "W m-2 sr-1 nm-1": "W/(m² sr nm)"}


def maps_figure(planes: Sequence[PlaneComparison], units: str, quantity: str, narrow: bool = False) -> Figure:
    """Rows: render, formula, error of the formula with contours where it is beyond 5 % and 10 %.

    `narrow`: a plane is a row, and these three its columns.
    """
    there = len(planes)
    planes = _at_most(planes, MOST_NARROW if narrow else MOST_PLANES)
    n, tall = len(planes), _height_of(planes)
    flat = tall < FLAT
    if narrow:
        size = NARROW, 2.3 + n * (1.2 * tall + 0.5)
    else:
        size = max(4.4, 1.3 + 1.74 * n), (3.0 + 5.4 * tall if flat else 1.2 + 4.5 * tall)
    with figure(*size) as fig:
        if narrow:
            axes = fig.subplots(n, 3, squeeze=False, sharex=True, sharey=True).T
        else:
            axes = fig.subplots(3, n, squeeze=False, sharex=True, sharey=True)
        for column, plane in enumerate(planes):
            extent, peak = _extent(plane), float(np.nanmax(plane.render))
            for row, values in enumerate((plane.render, plane.formula)):
                light = axes[row, column].imshow(
                    values / peak if peak > 0 else values,
                    origin="lower",
                    extent=extent,
                    cmap="magma",
                    vmin=0,
                    vmax=1,
                )
            axes[0, column].set_title(f"z = {plane.z_m:g} m", loc="center", pad=16)
            axes[0, column].annotate(
                f"100 % = {peak:.2g}",
                (1.0 if flat and not narrow else 0.5, 1.04),
                xycoords="axes fraction",
                ha="right" if flat and not narrow else "center",
                fontsize=8.5,
                color=MUTED,
            )
            error = axes[2, column].imshow(
                np.where(plane.render > 0, plane.ratio - 1, np.nan),
                origin="lower",
                extent=extent,
                cmap="RdBu_r",
                vmin=-ERROR_SCALE,
                vmax=ERROR_SCALE,
            )
            _contours(axes[2, column], plane)
            if not narrow:
                axes[2, column].set_xlabel("x (m)")
        for row, name in enumerate(("render", "formula", "formula / render \N{MINUS SIGN} 1")):
            if narrow:
                axes[row, -1].set_xlabel(f"x (m)\n{name.replace(' / render', '/render')}", fontsize=8.5)
            elif flat:  # no room for words beside a low panel
                axes[row, 0].annotate(name, (0, 1.06), xycoords="axes fraction", fontsize=8.5, color=MUTED)
            else:
                axes[row, 0].set_ylabel(f"{name}\n\ny (m)")
        for axis in axes[0, :] if narrow else axes[:, 0] if flat else ():
            axis.set_ylabel("y (m)")
        for axis in axes.ravel():
            axis.grid(False)
            axis.set_aspect("equal")
            axis.tick_params(labelsize=8.5)
        unit = f"{quantity.replace('_', ' ')}, 100 % in {SHORT_UNITS.get(units, units)}"
        scales: list[Axis]
        if narrow or flat:
            below: dict[str, Any] = {"location": "bottom", "aspect": 30 if narrow else 50, "shrink": 0.9}
            bar = fig.colorbar(light, ax=axes.ravel().tolist(), pad=0.02, **below)
            other = fig.colorbar(error, ax=axes.ravel().tolist(), extend="both", pad=0.02, **below)
            scales = [bar.ax.xaxis, other.ax.xaxis]
        else:
            bar = fig.colorbar(light, ax=axes[:2, :], location="right", shrink=0.8, aspect=30, pad=0.015)
            other = fig.colorbar(error, ax=axes[2, :], location="right", extend="both", aspect=15, pad=0.015)
            scales = [bar.ax.yaxis, other.ax.yaxis]
        for scale in scales:
            percent_axis(scale)
        bar.set_label(unit, fontsize=9)
        other.set_label("error of the formula", fontsize=9)
        drawn = f"{n} of {there} planes. " if n < there else ""
        noise = f"after {SIGMAS:g} standard errors of noise"
        fig.supxlabel(
            f"{drawn}Contours: error beyond 5 % (dashed)\nand 10 % (solid) {noise}"
            if narrow
            else f"{drawn}Contours: error beyond 5 % (dashed) and 10 % (solid) {noise}",
            fontsize=8 if narrow else 9,
            color=MUTED,
        )
    return fig


def radial_figure(planes: Sequence[PlaneComparison], narrow: bool = False) -> Figure:
    """Profiles over rings with three-sigma bands, and the error of the formula below."""
    there = len(planes)
    planes = _at_most(planes, MOST_NARROW if narrow else MOST_PLANES)
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
            upper.plot(
                profile.r_m, profile.formula / scale, color=FORMULA, linestyle=(0, (5, 2)), label="formula"
            )
            upper.set_yscale("log")
            upper.set_ylim(1e-3, 1.6)
            upper.set_title(f"z = {plane.z_m:g} m")
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.where(profile.render > 0, profile.formula / profile.render, np.nan)
                noise = np.where(profile.render > 0, ratio * band / profile.render, np.nan)
            error_band(lower, profile.r_m, ratio - 1, noise)
            if not narrow or column == len(planes) - 1:
                lower.set_xlabel("r (m)")
            if narrow or not column:
                upper.set_ylabel("relative" if narrow else "relative to the render's\nbrightest ring")
                lower.set_ylabel("error" if narrow else "error of the formula")
                lower.set_ylim(-0.52, 0.32)
        axes[0, 0].legend(loc="lower left")
        if len(planes) < there:
            fig.suptitle(f"{len(planes)} of {there} planes", x=0.01, ha="left", fontsize=9, color=MUTED)
    return fig


def axial_figure(planes: Sequence[PlaneComparison], narrow: bool = False) -> Figure:
    """Along the tank: brightness on the axis, half width, and the light that the formula lacks."""
    z = np.array([plane.z_m for plane in planes])
    with figure(*((NARROW, 8.4) if narrow else (WIDTH, 3.5))) as fig:
        axis, width, lost = fig.subplots(*((3, 1) if narrow else (1, 3)))
        render = np.array([plane.axis.render[0] for plane in planes])
        stderr = np.array([plane.axis.stderr[0] for plane in planes])
        formula = np.array([plane.axis.formula[0] for plane in planes])
        unit = render[0] / 100 if render[0] > 0 else 1.0
        axis.errorbar(
            z, render / unit, SIGMAS * stderr / unit, color=RENDER, marker="o", markersize=4, label="render"
        )
        axis.plot(
            z, formula / unit, color=FORMULA, linestyle=(0, (5, 2)), marker="s", markersize=4, label="formula"
        )
        axis.set_yscale("log")
        axis.legend(loc="lower left")
        label(axis, "z (m)", "% of the render at the first plane", "On the axis")
        plain_log_axis(axis.yaxis)

        for name, spots, colour, dash in (
            ("render", [p.render_spot for p in planes], RENDER, "solid"),
            ("formula", [p.formula_spot for p in planes], FORMULA, (0, (5, 2))),
        ):
            along_x = np.array([spot.hwhm_x_m for spot in spots])
            along_y = np.array([spot.hwhm_y_m for spot in spots])
            error = SIGMAS * np.array([spot.stderr.get("hwhm_x_m", 0.0) for spot in spots])
            width.errorbar(
                z, along_x, error, color=colour, linestyle=dash, marker="o", markersize=4, label=f"{name}, x"
            )
            if np.nanmax(np.abs(along_y / along_x - 1), initial=0) > 0.02:
                width.plot(
                    z,
                    along_y,
                    color=colour,
                    linestyle=dash,
                    marker="^",
                    markersize=4,
                    alpha=0.6,
                    label=f"{name}, y",
                )
        width.set_ylim(bottom=0)
        width.legend(loc="lower right")
        label(width, "z (m)", "half width at half maximum (m)", "Width of the spot")

        share = np.array([plane.lost for plane in planes])
        noise = SIGMAS * np.array([plane.lost_stderr for plane in planes])
        lost.bar(
            z, share, width=0.55 * (np.min(np.diff(z)) if z.size > 1 else 1.0), color=FORMULA, alpha=0.85
        )
        lost.errorbar(z, share, noise, fmt="none", ecolor=INK, capsize=3)
        lost.axhline(0, color=MUTED, linewidth=0.8)
        percent_axis(lost.yaxis)
        known = share[np.isfinite(share)]
        lost.set_ylim(1.15 * known.min(initial=0), max(1.15 * known.max(initial=0), 0.05))
        for at, value in zip(z, share, strict=True):
            lost.annotate(
                f"{100 * value:.1f} %" if np.isfinite(value) else "no light",
                (at, value if np.isfinite(value) else 0.0),
                (0, 5),
                textcoords="offset points",
                ha="center",
                fontsize=9,
            )
        label(lost, "z (m)", "part of the light on the plane", "Light that the formula lacks")
    return fig


def error_band(axis: Axes, x: np.ndarray, error: np.ndarray, noise: np.ndarray) -> None:
    """Relative error with its noise band over the zones of 5 % and 10 %."""
    for level, alpha in zip(reversed(ERROR_LEVELS), (0.45, 0.8), strict=True):
        axis.axhspan(-level, level, color=GRID, alpha=alpha, linewidth=0)
    axis.axhline(0, color=MUTED, linewidth=0.8)
    axis.fill_between(x, error - noise, error + noise, color=FORMULA, alpha=0.25, linewidth=0)
    axis.plot(x, error, color=FORMULA)
    axis.grid(False, axis="y")
    percent_axis(axis.yaxis)


def _contours(axis: Axes, plane: PlaneComparison) -> None:
    beyond = plane.smooth_excess()
    for level, dash in CONTOURS.items():
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
    shapes = [(e[3] - e[2]) / (e[1] - e[0]) for e in map(_extent, planes)]
    return float(np.clip(max(shapes, default=1.0), 0.2, 1.6))


def _extent(plane: PlaneComparison) -> tuple[float, float, float, float]:
    half_x, half_y = (0.5 * (np.diff(c).mean() if c.size > 1 else 1.0) for c in (plane.x_m, plane.y_m))
    return (plane.x_m[0] - half_x, plane.x_m[-1] + half_x, plane.y_m[0] - half_y, plane.y_m[-1] + half_y)


def _at_most(planes: Sequence[PlaneComparison], count: int) -> list[PlaneComparison]:
    """First, last and evenly chosen planes between."""
    if len(planes) <= count:
        return list(planes)
    return [planes[i] for i in np.unique(np.linspace(0, len(planes) - 1, count).round().astype(int))]
