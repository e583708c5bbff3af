"""Figure of the curves that a diagnosis has fitted, with their errors."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

import numpy as np
from matplotlib.figure import Figure

from lightfield.diagnosis.verdict.parts import LeftOver
from lightfield.diagnosis.verdict.speech import UNITS
from lightfield.diagnosis.verdict.words.effects import changes
from lightfield.fitting import effects
from lightfield.fitting.curves import field_of
from lightfield.fitting.fitted_curves import PLACES, FittedCurve
from lightfield.report.style import (
    DASH,
    DATA,
    FORMULA,
    LETTER,
    MUTED,
    NARROW,
    RENDER,
    WIDTH,
    figure,
    label,
    legend_below,
    percent_axis,
)
from lightfield.wording import plain

#: Bands are drawn so wide, in standard errors.
_BAND = 2.0
#: Beyond what a curve and the model without it take on, a band is drawn by this part of that.
_ROOM = 0.5
#: Inches beside a panel that its axis takes, and by which letters of a title are wider. Chosen by eye.
_AXIS_IN, _BOLD = 0.7, 1.2
#: Local unknowns that are drawn beside each other, and how far their bands, over the farthest departure.
_SHOWN, _REACH = 2, 1.5


def _effect(curve: FittedCurve) -> str:
    """The effect that a curve is of."""
    of_field = {field_of(one.forms[0].amplitudes[0].path): name for name, one in effects.curves().items()}
    return plain(of_field[curve.field])


def curve_figure(curves: Sequence[FittedCurve], narrow: bool = False) -> Figure:
    """A panel per curve: above with the model that lacks it, below its band of two standard errors alone.

    Parameters
    ----------
    curves : sequence of FittedCurve
        At least one, as `fitting.fitted_curves` gives them.
    narrow : bool, optional
        Below each other, for a telephone.
    """
    count = len(curves)
    size = (NARROW, 0.8 + 4.0 * count) if narrow else (WIDTH if count > 1 else 6.0, 4.2)
    letters = int((size[0] / (1 if narrow else count) - _AXIS_IN) / (_BOLD * LETTER))
    with figure(*size) as fig:
        # One after the other: each part has a place and a title of its own.
        grid = (count, 1) if narrow else (1, count)
        parts = fig.subfigures(*grid, squeeze=False).ravel()
        axes = [part.subplots(2, 1, sharex=True, height_ratios=(2.2, 1)) for part in parts]
        for (upper, lower), curve in zip(axes, curves, strict=True):
            wide = _BAND * curve.stderr
            upper.fill_between(
                curve.at, curve.value - wide, curve.value + wide, color=RENDER, alpha=0.25, linewidth=0
            )
            upper.plot(curve.at, curve.without, color=FORMULA, linestyle=DASH, label="without the curve")
            marker = "o" if len(curve.at) < PLACES else ""  # of planes: between them there is nothing
            upper.plot(curve.at, curve.value, color=RENDER, marker=marker, label="fitted curve")
            upper.set_ylabel(curve.quantity)
            upper.set_title(f"{_effect(curve)}\n{fill(changes(curve.rms), letters)}")
            # As below: a band that leaves nothing to be seen of the curve is told by the panel under it.
            both = np.array([*curve.value, *curve.without])
            room = max(_ROOM * float(np.ptp(both)), _BAND * float(curve.stderr.min()))
            low, high = upper.get_ylim()
            upper.set_ylim(max(low, both.min() - room), min(high, both.max() + room))
            lower.fill_between(
                curve.at, -wide, wide, color=RENDER, alpha=0.25, linewidth=0, label="two standard errors"
            )
            lower.axhline(0, color=MUTED, linewidth=0.8)
            lower.set_xlabel(curve.coordinate)
            lower.set_ylabel("its error")
        legend_below(fig, *axes[0])
    return fig


def left_figure(left: Sequence[LeftOver], narrow: bool = False) -> Figure:
    """What nothing explains: what a local unknown makes of the light along its coordinate, the best first.

    Parameters
    ----------
    left : sequence of LeftOver
        At least one.
    narrow : bool, optional
        Below each other, for a telephone.
    """
    shown = left[:_SHOWN]
    count = len(shown)
    with figure(*((NARROW, 0.5 + 2.7 * count) if narrow else (WIDTH if count > 1 else 6.0, 3.4))) as fig:
        grid = (count, 1) if narrow else (1, count)
        for axes, one in zip(fig.subplots(*grid, squeeze=False, sharey=True).ravel(), shown, strict=True):
            factor, wide = np.array(one.factor), _BAND * np.array(one.stderr)
            axes.fill_between(one.at, factor - wide, factor + wide, color=RENDER, alpha=0.25, linewidth=0)
            axes.plot(one.read_at, one.read, ".", color=DATA, markersize=3, label="readings over the model")
            axes.plot(one.at, factor, color=RENDER, label="with the unknown")
            axes.axhline(1, color=MUTED, linewidth=0.8)
            percent_axis(axes.yaxis)
            what = f"{plain(one.name)}: {one.removed_percent:.0f} % of what is left"
            if one.coordinate == "signal":  # over decades
                axes.set_xscale("log")
            unit = UNITS.get(one.coordinate, "over the largest")
            label(axes, f"{one.coordinate} ({unit})", "light that is left", what)
        # Where the readings do not tell a parameter the band would leave nothing to be seen of the rest.
        reach = 1 + _REACH * max(np.abs(np.array([*one.factor, *one.read]) - 1).max() for one in shown)
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, 2 - reach), min(high, reach))
        legend_below(fig, axes)
    return fig
