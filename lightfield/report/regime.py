"""Where the formula holds: optical thickness against albedo, one panel per receiver."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from lightfield.arrays import Array
from lightfield.report.style import MUTED, NARROW, WIDTH, figure, label
from lightfield.studies.regime import ERRORS, undecided
from lightfield.wording import capital, minus

#: From blue to orange, light enough for dark numbers: told apart by those who see no red and green.
_COLOURS = ("#6ea6d8", "#c3dbef", "#f3dd9b", "#e2905a")
_NAMES = ("within 5 %", "within 10 %", "within 25 %", "worse")


def regime_figure(dataset: xr.Dataset, narrow: bool = False) -> Figure:
    """Class of every grid point with its error in per cent; `?` where noise leaves the class open.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `lightfield.studies.regime.regime_map`.
    narrow : bool
        For a telephone.
    """
    receivers, albedos, depths = (dataset[name].values for name in ("receiver", "albedo", "optical_depth"))
    error, stderr = dataset.formula_error.values, dataset.formula_error_stderr.values
    with figure(
        NARROW if narrow else WIDTH,
        (1.7 if narrow else 1.2) + 0.36 * len(albedos) * len(receivers) + 0.75 * len(receivers),
    ) as fig:
        axes = fig.subplots(len(receivers), 1, squeeze=False, sharex=True)[:, 0]
        for i, (axis, receiver) in enumerate(zip(axes, receivers, strict=True)):
            error_cells(axis, error[i], stderr[i], 6.5 if narrow else 9, whole=narrow)
            axis.set_xticks(range(len(depths)), [f"{d:g}" for d in depths])
            axis.set_yticks(range(len(albedos)), [f"{a:g}" for a in albedos])
            label(axis, "", "albedo b / c", capital(str(receiver)))
        axes[-1].set_xlabel("optical thickness c z")
        colours_named(fig, narrow)
        gap, then = ("\n", "\n") if narrow else (" ", "; ")
        title = f"Error of beam × inverse square × Beer-Lambert{gap}on the axis, in %"
        if undecided(error, stderr).any():
            title += f"{then}?: noise leaves the colour open"
        fig.suptitle(title, x=0.01, ha="left", fontsize=9.5, color=MUTED)
    return fig


def error_cells(axis: Axes, error: Array, stderr: Array, size: float, whole: bool = False) -> None:
    """Draw errors of the formula as coloured cells, in per cent; `?` where noise leaves the class open.

    Parameters
    ----------
    size : float, points
        Of the numbers.
    whole : bool
        For narrow cells.
    """
    which = np.where(np.isnan(error), np.nan, np.searchsorted(ERRORS, np.abs(error)))
    classes = BoundaryNorm([-0.5, 0.5, 1.5, 2.5, 3.5], 4)
    axis.imshow(which, origin="lower", aspect="auto", cmap=ListedColormap(_COLOURS), norm=classes)
    unsure = undecided(error, stderr)
    for row, column in np.ndindex(*error.shape):
        text = percent_text(float(error[row, column]), whole) + ("?" if unsure[row, column] else "")
        axis.text(column, row, text, ha="center", va="center", fontsize=size, color="#101418")
    axis.grid(False)
    axis.tick_params(length=0)


def colours_named(fig: Figure, narrow: bool) -> None:
    """Legend of the classes below the figure."""
    handles = [Patch(color=c, label=n) for c, n in zip(_COLOURS, _NAMES, strict=True)]
    fig.legend(handles=handles, loc="outside lower center", ncols=2 if narrow else 4)


def percent_text(error: float, whole: bool = False) -> str:
    """Error in per cent, short enough for a cell; `whole`: for a narrow one."""
    if np.isnan(error):
        return "–"
    value = 100 * error
    if whole and abs(value) >= 0.5:
        return minus(f"{max(value, -99.0):.0f}")
    if abs(value) < 0.05:
        return "0"
    text = (
        f"{value:.1f}"
        if abs(value) < 9.95
        else f"{value:.0f}"
        if value > -99.5
        else f"{max(value, -99.9):.1f}"
    )
    return minus(text)
