"""Figure of what is left where nothing explains the readings, nor any local unknown: over each coordinate."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from lightfield.arrays import Array
from lightfield.report.diagnosis.view import ReadingsView
from lightfield.report.style import DATA, GRID, MUTED, NARROW, RENDER, WIDTH, figure, label, legend_below
from lightfield.scene.lamp.frame import angle_from_axis

#: Neighbours that make one mean, and means at most. Chosen by eye: their error is a third of a reading's.
_EACH, _MOST = 9, 12
#: Bands are drawn so wide, in standard errors.
_BAND = 2.0
_SECONDS = 60.0


def rest_figure(view: ReadingsView, narrow: bool = False) -> Figure:
    """What the last rung leaves over time, angle, distance and signal, with the means of neighbours.

    A line within its band of nothing says that the rest is no function of that coordinate.

    Parameters
    ----------
    view : ReadingsView
    narrow : bool, optional
        Below each other, for a telephone.
    """
    used = ~view.readings.left_out
    rest, along = view.residual_sigma(-1)[used], _coordinates(view)
    size = (NARROW, 0.6 + 2.2 * len(along)) if narrow else (WIDTH, 3.2)
    with figure(*size) as fig:
        grid = (len(along), 1) if narrow else (1, len(along))
        panels = fig.subplots(*grid, squeeze=False, sharey=True).ravel()
        for axis, (name, at) in zip(panels, along.items(), strict=True):
            axis.axhspan(-2, 2, color=GRID, alpha=0.7, linewidth=0)
            axis.axhline(0, color=MUTED, linewidth=0.8)
            axis.plot(at[used], rest, ".", color=DATA, markersize=3, label="readings")
            middle, mean, stderr = means_of_neighbours(at[used], rest)
            low, high = mean - _BAND * stderr, mean + _BAND * stderr
            axis.fill_between(middle, low, high, color=RENDER, alpha=0.25, linewidth=0)
            axis.plot(middle, mean, color=RENDER, label="mean of neighbours, with two standard errors")
            if name.startswith("signal"):
                axis.set_xscale("log")
            axis.grid(False, axis="y")
            label(axis, name, "", "")
        panels[0].set_ylabel("reading \N{MINUS SIGN} model (σ)")
        legend_below(fig, panels[0])
    return fig


def means_of_neighbours(at: Array, rest: Array) -> tuple[Array, Array, Array]:
    """Where neighbours along a coordinate lie, the mean of what they have left, and its error by their own
    scatter; what has one place is not parted.

    Parameters
    ----------
    at, rest : arrays, shape (n,)

    Returns
    -------
    three arrays, shape (m,)
        At least two readings make a mean.
    """
    order = np.argsort(at, kind="stable")
    parts = min(max(len(at) // _EACH, 1), _MOST)
    edges = np.quantile(at[order], np.linspace(0.0, 1.0, parts + 1)[1:-1])
    cell = np.searchsorted(edges, at[order], side="right")
    groups = [order[cell == k] for k in np.unique(cell) if np.count_nonzero(cell == k) > 1]
    middle = np.array([at[rows].mean() for rows in groups])
    mean = np.array([rest[rows].mean() for rows in groups])
    stderr = np.array([rest[rows].std(ddof=1) / np.sqrt(len(rows)) for rows in groups])
    return middle, mean, stderr


def _coordinates(view: ReadingsView) -> dict[str, Array]:
    """Coordinates that vary, by the name of their axis, each of shape (n,)."""
    readings, model = view.readings, view.predictions[-1].value
    signal = model / np.nanmax(model)
    angle = np.degrees(angle_from_axis(readings.x_m, readings.y_m, readings.z_m))
    every = {
        "time (minutes)": readings.time_s / _SECONDS,
        "angle (degrees)": angle,
        "z (m)": readings.z_m,
        "signal (over the largest)": np.where(signal > 0, signal, np.nan),
    }
    return {name: at for name, at in every.items() if np.isfinite(at).all() and np.ptp(at) > 0}
