"""The comparison of render and formula as a table, for the terminal and as a page."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.box import SIMPLE_HEAD
from rich.table import Table

from lightfield.report.compare.figures import axial_figure, maps_figure, radial_figure
from lightfield.report.page import fill, page_figure, three_digits
from lightfield.report.style import SHORT_UNITS, save_png
from lightfield.storage.files import write_text
from lightfield.studies.compare.in_a_sentence import in_a_sentence
from lightfield.studies.compare.maps import Comparison, PlaneComparison
from lightfield.studies.compare.rings import BEYOND, ERROR_LEVELS
from lightfield.wording import capital, minus, plain

_HEAD = (
    "z (m)",
    "on the axis",
    "formula there",
    "half width (m)",
    "formula (m)",
    "width y/x",
    "light lacking",
    "5 % to r (m)",
    "10 % to r (m)",
)
_TERMINAL_HEAD = ("z m", "on axis", "formula off", "hwhm m", "formula", "lacking", "5% to", "10% to")
_PROVENANCE = {
    "seed": "seed",
    "photons": "photons traced",
    "requested_relative_error": "requested relative error",
    "reached_relative_error": "reached relative error",
    "scene_digest": "scene digest",
    "source": "made by",
}


def rows(planes: Sequence[PlaneComparison]) -> list[list[str]]:
    """Cells of the table as text, one row per plane, in the order of `_HEAD`."""
    return [
        [
            f"{plane.z_m:g}",
            plus_minus(plane.axis.render[0], plane.axis.stderr[0]),
            _off_axis(plane),
            plus_minus(plane.render_spot.hwhm_m, plane.render_spot.stderr.get("hwhm_m", math.nan)),
            three_digits(plane.formula_spot.hwhm_m),
            plus_minus(plane.render_spot.ellipticity, plane.render_spot.stderr.get("ellipticity", math.nan)),
            plus_minus(100 * plane.lost, 100 * plane.lost_stderr, " %"),
            *(_radius(plane, level) for level in ERROR_LEVELS),
        ]
        for plane in planes
    ]


def terminal_table(comparison: Comparison, wavelength_nm: float) -> Table:
    """Table of one wavelength that fits a terminal of 80 columns; 1.234(5) means 1.234 ± 0.005."""
    units = SHORT_UNITS.get(comparison.units, comparison.units)
    quantity = capital(plain(comparison.quantity))
    title = f"{quantity} at {wavelength_nm:g} nm, {units}; 1.234(5) is 1.234 ± 0.005"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for head in _TERMINAL_HEAD:
        table.add_column(head, justify="right", no_wrap=True)
    for plane in comparison.at(wavelength_nm):
        spot = plane.render_spot
        table.add_row(
            f"{plane.z_m:g}",
            concise(plane.axis.render[0], plane.axis.stderr[0]),
            concise(100 * plane.axis_error, 100 * plane.axis_error_stderr) + " %",
            concise(spot.hwhm_m, spot.stderr.get("hwhm_m", math.nan)),
            three_digits(plane.formula_spot.hwhm_m),
            concise(100 * plane.lost, 100 * plane.lost_stderr) + " %",
            *(_radius(plane, level) for level in ERROR_LEVELS),
            style="yellow" if plane.told_on_axis == BEYOND else None,
        )
    return table


def comparison_page(comparison: Comparison, attributes: Mapping[str, Any]) -> str:
    """Page of a comparison.

    Parameters
    ----------
    attributes : mapping
        Global attributes of the data set: provenance and energy.
    """
    bands = []
    for wavelength in (plane.wavelength_nm for plane in comparison.worst):
        planes = comparison.at(wavelength)
        key = f"w{wavelength:g}".replace(".", "p")
        figures = [
            page_figure(
                f"{key}-maps",
                "Light on each plane, rendered and by the formula, and the error of the formula. Inside "
                "a dashed line it is within 5 %, inside a solid one within 10 %; a plane without lines is "
                "on one side of both. Looking at the lamp: +x is right, +y up.",
                "Maps of render, formula and relative error on each plane",
                maps_figure,
                planes,
                comparison.units,
                comparison.quantity,
            ),
            page_figure(
                f"{key}-radial",
                "Means over rings around the lamp's axis, with bands of three standard errors. Grey zones: "
                "5 % and 10 %.",
                "Radial profiles of render and formula and the error of the formula",
                radial_figure,
                planes,
            ),
        ]
        if len(planes) > 1:
            figures.append(
                page_figure(
                    f"{key}-axial",
                    "Along the tank. All carry three standard errors, mostly smaller than the symbol.",
                    "Brightness on the axis, half width and lost light against distance",
                    axial_figure,
                    planes,
                )
            )
        body = [
            [
                {"text": cell, "over": index == 2 and plane.told_on_axis == BEYOND}
                for index, cell in enumerate(row)
            ]
            for plane, row in zip(planes, rows(planes), strict=True)
        ]
        bands.append({"name": f"{wavelength:g} nm", "rows": body, "figures": figures})
    unit = SHORT_UNITS.get(comparison.units, comparison.units)
    return fill(
        "compare.html",
        title=f"{comparison.scene.name or 'Scene'}: the formula against the render",
        verdict=in_a_sentence(comparison),
        worst=[
            (f"{plane.wavelength_nm:g} nm", _off_axis(plane), f"{plane.z_m:g} m")
            for plane in comparison.worst
        ],
        bands=bands,
        table_head=[f"{head} ({unit})" if head == "on the axis" else head for head in _HEAD],
        energy=energy_rows(attributes),
        provenance=[(text, attributes[name]) for name, text in _PROVENANCE.items() if name in attributes],
        scene_toml=attributes.get("scene_toml", ""),
    )


def _off_axis(plane: PlaneComparison) -> str:
    """How far the formula is off on the axis of a plane."""
    return plus_minus(100 * plane.axis_error, 100 * plane.axis_error_stderr, " %", sign=True)


def write_comparison(
    comparison: Comparison, attributes: Mapping[str, Any], folder: str | os.PathLike[str]
) -> list[Path]:
    """Write the page and its figures as PNG into a folder; the page comes first in the result."""
    target = Path(folder)
    files = [write_text(target / "index.html", comparison_page(comparison, attributes))]
    for wavelength in comparison.wavelengths_nm:
        planes = comparison.at(wavelength)
        drawings = {
            "maps": maps_figure(planes, comparison.units, comparison.quantity),
            "radial": radial_figure(planes),
        }
        if len(planes) > 1:
            drawings["axial"] = axial_figure(planes)
        for name, drawing in drawings.items():
            files.append(save_png(drawing, target / f"compare_{name}_{wavelength:g}nm.png"))
    return files


def energy_rows(attributes: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Energy balance as shares of the emitted power."""
    emitted = float(attributes.get("energy_emitted", 0.0))
    names = {
        "absorbed": "absorbed by the water",
        "walls": "absorbed by walls and floor",
        "escaped": "left the water",
        "unfinished": "still under way at the flight limit",
        "roulette": "added by the roulette (zero on average)",
    }
    if emitted <= 0:
        return []
    table = [
        (text, f"{round(100 * float(attributes[f'energy_{name}']) / emitted, 2) + 0.0:.2f} %")  # no -0.00
        for name, text in names.items()
        if f"energy_{name}" in attributes
    ]
    if "energy_closure" in attributes:
        table.append(("closure (accounted for, less emitted)", f"{float(attributes['energy_closure']):+.1e}"))
    return table


class Rounded(NamedTuple):
    """A value and its standard error in units of a power of ten, both to so many decimals."""

    value: float
    stderr: float
    decimals: int
    power: int

    @classmethod
    def of(cls, value: float, stderr: float) -> Rounded | None:
        """Both to the first digit of the error; None where no error is known."""
        if not (math.isfinite(value) and math.isfinite(stderr) and stderr > 0):
            return None
        larger = max(abs(value), stderr)
        power = math.floor(math.log10(larger)) if value and larger < 0.01 else 0
        decimals = max(power - math.floor(math.log10(stderr)), 0)
        return cls(value / 10**power, stderr / 10**power, decimals, power)


def plus_minus(value: float, stderr: float, unit: str = "", sign: bool = False) -> str:
    """Value ± standard error, both to the first digit of the error; three digits when no error is known."""
    if not math.isfinite(value):
        return "–"
    plus, both = "+" if sign else "", Rounded.of(value, stderr)
    if both is None:
        text = f"{value:{plus}.3g}"
    else:
        text = f"{both.value:{plus}.{both.decimals}f} ± {both.stderr:.{both.decimals}f}"
        text = f"({text})e{both.power}" if both.power else text
    return minus(f"{text}{unit}")


def concise(value: float, stderr: float) -> str:
    """Value with its standard error in the last digit, 1.234(5)."""
    both = Rounded.of(value, stderr)
    if both is None:
        return plus_minus(value, stderr)
    digits = round(both.stderr * 10**both.decimals)
    power = f"e{both.power}" if both.power else ""
    return minus(f"{both.value:.{both.decimals}f}({digits}){power}")


def _radius(plane: PlaneComparison, level: float) -> str:
    radius, _, is_left = plane.within(level)
    if math.isnan(radius):
        return "–"
    if math.isinf(radius):
        return f"> {plane.profile.r_m[-1]:.2f}"
    return f"{radius:.2f}" if is_left else f"≥ {radius:.2f}"
