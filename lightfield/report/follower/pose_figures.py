"""Figures of poses: a sequence, and what a follower that believes the formula takes its place for."""

from __future__ import annotations

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lightfield.arrays import Array
from lightfield.report.follower.array_figures import SHOWN, WORDS
from lightfield.report.style import (
    BAD,
    DATA,
    GOOD,
    GRID,
    INK,
    MUTED,
    NARROW,
    PAPER,
    RENDER,
    SERIES,
    WIDTH,
    banded,
    figure,
    label,
    panels,
)
from lightfield.studies.follower.bias import BiasStudy
from lightfield.studies.follower.estimation.sequence import Poses
from lightfield.studies.follower.frames import POSE

#: Standard deviations that a bar or band spans to either side.
_SIGMAS = 2
#: Least length of an arrow of a map, m: shorter ones are dots.
_LEAST_ARROW_M = 0.005


def bias_figure(study: BiasStudy, narrow: bool = False) -> Figure:
    """Along the beam, against scattering, one panel per way to calibrate."""
    axis = study.axis
    calibrations, z, b = axis.calibration.values, axis.z_m.values, axis.scattering_per_m.values
    with panels(len(calibrations), 3.7, narrow=narrow, each=2.7, sharey=True) as (fig, each):
        for panel, name in zip(each, calibrations, strict=True):
            panel.axhspan(-0.3, 0.3, color=GRID, alpha=0.8, linewidth=0)
            panel.axhline(0, color=MUTED, linewidth=0.8)
            for k, distance in enumerate(z):
                one = axis.sel(calibration=name).isel(z_m=k)
                panel.errorbar(
                    b, one.bias_z.values, _SIGMAS * one.sigma_z.values, color=SERIES[k], marker="o",
                    markersize=4, capsize=2, label=f"z = {distance:g} m",
                )  # fmt: skip
            label(panel, "scattering b (1/m)", "", fill(str(name), 40 if narrow else 18))
            panel.title.set_fontsize(9.5)
        for panel in each if narrow else each[:1]:
            panel.set_ylabel("believed \N{MINUS SIGN} true distance (m)")
        each[0].set_yscale("symlog", linthresh=0.3, linscale=1.2)
        each[0].set_yticks([-1, -0.3, -0.1, 0, 0.1, 0.3, 1, 3])
        each[0].set_yticklabels(
            ["\N{MINUS SIGN}1", "\N{MINUS SIGN}0.3", "\N{MINUS SIGN}0.1", "0", "0.1", "0.3", "1", "3"]
        )
        each[0].legend(loc="best", fontsize=8.5)
    return fig


def plane_figure(study: BiasStudy, narrow: bool = False) -> Figure:
    """From above: where the follower is, and where it believes to be, in the scene's own water."""
    plane = study.plane
    x, z = np.meshgrid(plane.x_m.values, plane.z_m.values)
    ends = x + plane.bias_x.values  # [calibration, z, x]
    room = 0.1 * float(np.ptp(x) or 1.0)
    with panels(plane.sizes["calibration"], 4.4, narrow=narrow, each=3.4, sharey=True) as (fig, each):
        for panel, name in zip(each, plane.calibration.values, strict=True):
            one = plane.sel(calibration=name)
            dx, dz = one.bias_x.values, one.bias_z.values
            length = np.hypot(dx, dz)
            panel.plot(x.ravel(), z.ravel(), ".", color=MUTED, markersize=3)
            far = length > _LEAST_ARROW_M
            panel.quiver(
                x[far], z[far], dx[far], dz[far], length[far], cmap="YlOrRd", angles="xy",
                scale_units="xy", scale=1,
                width=0.012, clim=(0, 1), edgecolor=INK, linewidth=0.3,
            )  # fmt: skip
            panel.annotate(
                f"up to {length.max():.2f} m", (0.5, 0.02), xycoords="axes fraction", ha="center", fontsize=9,
                color=BAD if length.max() > 0.3 else GOOD,
            )  # fmt: skip
            label(panel, "x (m)", "", fill(str(name), 40 if narrow else 18))
            panel.set_xlim(min(x.min(), ends.min()) - room, max(x.max(), ends.max()) + room)
            panel.title.set_fontsize(9.5)
            panel.set_ylim(min(z.min() - 1, 3), z.max() + 3)
        for panel in each if narrow else each[:1]:
            panel.set_ylabel("distance from the lamp z (m)")
    return fig


def sequence_figure(poses: Poses, narrow: bool = False) -> Figure:
    """Every coordinate over time: single readings with their noise, the filter, and where light was lost."""
    at = [POSE.index(n) for n in poses.names]
    t = poses.time_s
    single = np.array([one.pose for one in poses.estimates])
    noise = np.array([
        np.full(len(at), np.nan) if one.noise_only is None else np.sqrt(np.diag(one.noise_only.covariance))
        for one in poses.estimates
    ])  # fmt: skip
    good = np.array([one.fits for one in poses.estimates])
    lit = np.array([not one.lost for one in poses.estimates])
    twofold = good & np.array([one.ambiguous for one in poses.estimates])
    kinds = (
        (good & ~twofold, DATA, DATA, "single readings"),
        (twofold, DATA, PAPER, "ambiguous"),
        (~good & lit, BAD, BAD, "do not fit"),
    )
    with figure(NARROW if narrow else WIDTH, 1.5 * len(at) + 0.6) as fig:
        each = fig.subplots(len(at), 1, sharex=True, squeeze=False)[:, 0]
        for k, (panel, name) in enumerate(zip(each, poses.names, strict=True)):
            unit, factor = SHOWN[name]
            unit, factor = ("m", 1.0) if unit == "mm" else (unit, factor)
            for keep, colour, inside, word in kinds:
                if keep.any():
                    panel.errorbar(
                        t[keep], factor * single[keep, at[k]], factor * noise[keep, k], fmt="o", markersize=3,
                        color=colour, markerfacecolor=inside, elinewidth=0.7, alpha=0.7, label=word,
                    )  # fmt: skip
            if poses.tracked is not None:
                way = factor * np.array([one.pose[at[k]] for one in poses.tracked])
                wide = factor * _SIGMAS * np.sqrt([one.total[k, k] for one in poses.tracked])
                limits = _around(panel, t, way, np.nan_to_num(wide, posinf=0.0))
                wide = np.nan_to_num(wide, posinf=float(np.ptp(limits)))  # of what is unknown, to the edges
                banded(panel, t, way, wide, alpha=0.2, color=RENDER, label="filter")
                panel.set_ylim(limits)
            for one, moment in zip(poses.estimates, t, strict=True):
                if one.lost:
                    panel.axvline(moment, color=BAD, alpha=0.3)
            label(panel, "", f"{WORDS[name]} ({unit})")
        if each[0].get_legend_handles_labels()[0]:  # none where no light was seen
            each[0].legend(loc="best", ncols=3, fontsize=7.5 if narrow else 8.5)
        each[-1].set_xlabel("time (s)")
    return fig


def _around(panel: Axes, x: Array, value: Array, wide: Array) -> tuple[float, float]:
    """Limits of the upright axis that hold what is drawn, and a band."""
    panel.update_datalim(np.column_stack([np.tile(x, 2), np.r_[value - wide, value + wide]]))
    panel.autoscale_view()
    return panel.get_ylim()
