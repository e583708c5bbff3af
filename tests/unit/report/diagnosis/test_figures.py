"""Figures of readings and what a model leaves of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from lightfield.diagnosis.verdict.parts import Rung
from lightfield.fitting.fitted_curves import FittedCurve
from lightfield.report.diagnosis.curves import curve_figure
from lightfield.report.diagnosis.figures import data_figure, residual_map
from lightfield.report.diagnosis.ladder import ladder_figure
from lightfield.report.diagnosis.single_places import place_map
from lightfield.report.diagnosis.view import DrawnReadings, Prediction, ReadingsView
from lightfield.report.style import figure, legend_below


@pytest.mark.parametrize("draw", [residual_map, place_map])
def test_readings_set_aside_stand_out_on_the_map(draw: Callable[[ReadingsView], Figure]) -> None:
    """In the colour of their misfit: a strut's shadow, which was the finding, was tiny dots."""
    x, out = np.linspace(-1, 1, 9), np.arange(9) == 4
    one = np.ones(9)
    readings = DrawnReadings(
        x, 0 * x, 2 * one, 525 * one, one - 0.5 * out, 0.1 * one, ["water"] * 9, out, 0.0 * x
    )
    dots = draw(ReadingsView(readings, [Prediction("base", one)])).axes[0].collections[0]
    sizes, rings = dots.get_sizes(), np.asarray(dots.get_linewidths())
    assert sizes[out].min() > sizes[~out].max() and rings[out].min() > 3 * rings[~out].max()
    assert dots.get_array()[out] == pytest.approx(-5.0)


def test_a_band_that_is_wide_leaves_its_curve_to_be_seen() -> None:
    """Of a lamp that was not read on its axis, to which intensities are told, it was four times the curve."""
    at = np.linspace(0, 12, 40)
    lost = FittedCurve(
        "lamp.profile_departure", "angle (deg)", "", at, 1 - 0.05 * at, 3.0 * at, 0.9 + 0 * at, 1.0
    )
    upper, lower = curve_figure((lost,)).axes
    assert upper.get_ylim() == pytest.approx((0.4 - 0.3, 1.0 + 0.3))
    assert lower.get_ylim()[1] > 2 * 36.0


def _floors(count: int) -> list[Rung]:
    names = ["base", *(f"+ beam profile {k}" for k in range(1, count))]
    return [
        Rung(label=name, effects=[], error_percent=9.0 - k, chi2_per_dof=1.0, held_out_percent=None,
             parameters={}, scene="")
        for k, name in enumerate(names)
    ]  # fmt: skip


@pytest.mark.parametrize(("count", "narrow"), [(2, False), (8, False), (2, True), (8, True)])
def test_names_of_many_rungs_do_not_run_into_each_other(count: int, narrow: bool) -> None:
    axis = ladder_figure(_floors(count), 1.0, narrow).axes[0]
    many = count > 2
    assert [label.get_rotation() > 0 for label in axis.get_xticklabels()] == [many] * count
    # In a narrow figure of many there is room for the first number and the last.
    assert len(axis.texts) == (2 if many and narrow else count)


@pytest.mark.parametrize("width", [4.3, 10.0])
def test_a_legend_is_no_wider_than_its_figure(width: float) -> None:
    """Seven effects were named in one line, and both of its ends were cut off."""
    with figure(width, 4.0) as fig:
        axes = fig.subplots()
        for name in ("base", " + ".join(["attenuation profile"] * 7), "readings", "left out"):
            axes.plot([0, 1], [0, 1], label=name)
        legend_below(fig, axes)
        fig.canvas.draw()
        box = fig.legends[0].get_window_extent()
    assert box.x0 >= 0 and box.x1 <= fig.bbox.x1


@pytest.mark.parametrize("narrow", [False, True])
def test_every_curve_is_titled_with_its_effect(narrow: bool) -> None:
    """Two panels said by how much they change the readings, and not what they are of."""
    at = np.linspace(0, 12, 40)
    two = [
        FittedCurve(field, "", "", at, 1 - 0.05 * at, 0.01 + 0 * at, 0.9 + 0 * at, 0.16)
        for field in ("lamp.profile_departure", "water.absorption_departure")
    ]
    titles = [one.get_title("left") + one.get_title() for one in curve_figure(two, narrow).axes[::2]]
    for title, name in zip(titles, ("beam profile", "attenuation profile"), strict=True):
        assert title.splitlines() == [name, "changing the readings by 16 % rms"]


def _view(places: list[tuple[float, float, float]], departs: float = 0.0) -> ReadingsView:
    """Readings at places (x, y, z) of which those above the axis are too dark by so much of a sigma."""
    x, y, z = np.array(places).T
    one, none = np.ones(len(x)), np.zeros(len(x), bool)
    value = one - 0.1 * departs * (y > 0)
    readings = DrawnReadings(x, y, z, 525 * one, value, 0.1 * one, ["water"] * len(x), none, 0.0 * x)
    return ReadingsView(readings, [Prediction("base", one)])


@pytest.mark.parametrize(("narrow", "drawn"), [(False, [1, 2, 3, 4, 5]), (True, [2, 3, 4])])
def test_scans_are_drawn_before_single_places(narrow: bool, drawn: list[int]) -> None:
    """Of an axis read at nine distances with three scans across, two of the scans were not drawn."""
    axis = [(0.0, 0.0, z) for z in (1, 2.2, 2.4, 2.6, 2.8, 5)]
    scans = [(x, 0.0, z) for z in (2.0, 3.0, 4.0) for x in np.linspace(-0.5, 0.5, 9)]
    fig = data_figure(_view([*axis, *scans]), narrow)
    assert [t for one in fig.axes if (t := one.get_title("left"))] == [f"z = {z} m" for z in drawn]


def test_of_a_cross_the_arm_is_drawn_along_which_the_model_misses() -> None:
    """What lay in y alone was drawn over x, where nothing was wrong."""
    arm = np.linspace(-0.5, 0.5, 9)
    cross = [(a, 0.0, z) for z in (2.0, 3.0) for a in arm] + [(0.0, a, z) for z in (2.0, 3.0) for a in arm]
    assert _view(cross).scan_axis == "x_m"
    fig = data_figure(_view(cross, departs=5.0))
    assert {one.get_xlabel() for one in fig.axes if one.get_xlabel()} == {"y (m)"}


def test_a_line_goes_once_through_a_place_that_was_read_again() -> None:
    """At another time the lamp was dimmer: the line fell to the second reading and went on from there."""
    view = _view([(x, 0.0, 2.0) for x in (-0.2, 0.0, 0.0, 0.2)])
    value = np.array([1.0, 1.0, 0.8, 1.0])
    (line,) = data_figure(ReadingsView(view.readings, [Prediction("base", value)])).axes[0].lines[:1]
    assert line.get_xdata().tolist() == [-0.2, 0.0, 0.2] and line.get_ydata()[1] == pytest.approx(0.9)
