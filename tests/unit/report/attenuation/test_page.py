"""The page of a study of attenuation says what the terminal says, and of this water alone."""

from __future__ import annotations

import re
from functools import partial
from typing import Any

import numpy as np
import pytest

from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.render.diffuse.source import response_for
from lightfield.report.attenuation.figures import hidden_figure, percent_figure
from lightfield.report.attenuation.page import attenuation_page
from lightfield.scene import Scene
from lightfield.studies.attenuation.study import Attenuation, attenuation
from lightfield.studies.attenuation.text import as_text


def study(colours: int, **head: Any) -> Attenuation:
    """Of light that falls by 0.1 per m and as 1/z^2 at all colours."""
    axes = np.array([4.5, 5.5, 6.5]), np.linspace(420.0, 660.0, colours), ["water", "air"]
    z, colour, medium = (v.ravel() for v in np.meshgrid(*axes, indexing="ij"))
    value = np.exp(-np.where(medium == "water", 0.1, 0.0) * z) / z**2
    table = Readings.from_arrays(
        z_m=z, wavelength_nm=colour, medium=medium, value=value, stderr=0.003 * value, metadata=head
    )
    return attenuation(table, Scene.from_dict({"water": {"base": "pure"}}))


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("published", [[], [[460.0, 480.0, 0.1]]])
def test_only_what_was_published_of_this_water_is_shaded(published: list[list[float]]) -> None:
    found = study(3, published_attenuation=published)
    for axis in percent_figure(found.apparent[0]).axes:
        spans = [[patch.get_x(), patch.get_x() + patch.get_width()] for patch in axis.patches]
        assert np.allclose(spans, [row[:2] for row in published])
    page = attenuation_page(found)
    assert "tow tank" not in page and ("Grey: " in page) == bool(published)


def test_no_legend_lies_over_a_curve() -> None:
    """Five curves one above the other leave no free corner: the legend of the distances is under its axes."""
    figure = percent_figure(study(6).apparent[0])
    figure.canvas.draw()
    axes = figure.axes[1]
    legend = axes.get_legend()
    assert legend.get_window_extent().y1 < axes.get_window_extent().y0


@pytest.mark.usefixtures("undrawn")
def test_page_and_terminal_show_the_same_wavelengths() -> None:
    found = study(35)
    (said,) = re.findall(r"\((\d+) of 35 wavelengths are shown\)", as_text(found))
    assert f"{said} of 35 wavelengths; the figure above shows all" in attenuation_page(found)
    assert "wavelengths are shown" not in as_text(study(25))  # four rows are not worth a gap


@pytest.mark.usefixtures("undrawn")
def test_between_walls_k_need_not_lie_above_absorption() -> None:
    """White walls 0.5 m beside a wide beam send back more the farther away it is: K is below the absorption
    of 0.1 per m, and its line is bent. The page said that K lies above it, and not why the line bends."""
    tank = {"width_m": 1.0, "depth_m": 1.0, "length_m": 12.0, "wall_albedo": 0.7}
    water = {"absorption_per_m": 0.1}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 20.0}, "water": water, "tank": tank})
    trace, z = partial(response_for, photons=50_000), np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0])
    light = direct_field(scene, 0 * z, 0 * z, z) + trace(scene, 0 * z, 0 * z, z).light(scene, [None])[0]
    value = np.r_[light, direct_field(scene, 0 * z, 0 * z, z, medium=np.ones(6, bool))]
    table = Readings.from_arrays(
        z_m=np.r_[z, z], value=value, stderr=0.003 * value, medium=np.repeat(["water", "air"], 6)
    )
    found = attenuation(table, scene, trace)
    assert found.apparent[0].K_per_m[0] < 0.05
    page, said = attenuation_page(found), as_text(found)
    assert "K lies between" not in page and "may leave K below absorption" in page
    assert "do not fit" in said and "walls or a surface send back bends the line" in said
    assert found.scattered is not None
    figure = hidden_figure(found.apparent[0], found.scattered, found.content)
    figure.canvas.draw()
    for axes in figure.axes:  # the line of c lay under a legend
        assert axes.get_legend().get_window_extent().y1 < axes.get_window_extent().y0
