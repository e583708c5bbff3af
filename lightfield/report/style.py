"""How every figure looks, and how it gets into a page: as SVG that follows the page's light or dark theme."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.image import imsave
from matplotlib.rcsetup import cycler
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, PercentFormatter

from lightfield.arrays import Array
from lightfield.storage.files import atomic_path

# One colour, one meaning, in every figure. No two are told apart by red against green alone: what is green is
# bluish and lighter. In a page each is replaced by the CSS variable of its name.
INK, MUTED, GRID, PAPER = "#1f2429", "#67707a", "#dde2e7", "#fefefe"
RENDER, FORMULA, DATA, GOOD, BAD = "#0b6bb8", "#c8501e", "#2b3138", "#0a7d8c", "#b3261e"
SERIES = (RENDER, FORMULA, "#1fa187", "#8a5bb0", "#b8860c", "#5c6f82")
_THEMED = {
    INK: "ink",
    MUTED: "muted",
    GRID: "grid",
    PAPER: "paper",
    RENDER: "render",
    FORMULA: "formula",
    DATA: "data",
    GOOD: "good",
    BAD: "bad",
    SERIES[2]: "series-3",
    SERIES[3]: "series-4",
    SERIES[4]: "series-5",
    SERIES[5]: "series-6",
}
#: Units of light as people write them, by those of a data set.
SHORT_UNITS = {
    "W m-2 nm-1": "W/(m² nm)",
    "W m-2 sr-1 nm-1": "W/(m² sr nm)",
    "W nm-1": "W/nm",
    "W sr-1 nm-1": "W/(sr nm)",
}
#: Of lines by the formula.
DASH = (0, (5, 2))
WIDTH = 10.0  # inches of a figure that fills the page
NARROW = 4.3  # inches of a figure on a telephone
#: Inches that a letter takes in a figure, in the widest of the page's fonts, and letters that the mark of a
#: legend takes with its gaps. Chosen by eye.
LETTER, _MARK = 0.075, 8
_PAGE_PIXELS = 1020
_PNG_DPI = 150
#: Of Matplotlib, while a figure is made.
STYLE: Any = {
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": cycler(color=SERIES),
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.6,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 9.5,
    "figure.facecolor": PAPER,
    "figure.dpi": 100,
    "savefig.facecolor": PAPER,
    "svg.fonttype": "none",
    "axes.formatter.limits": (-3, 4),
}


@contextmanager
def figure(width: float = WIDTH, height: float = 4.0) -> Iterator[Figure]:
    """New figure in our style, outside pyplot's global list; draw inside the block.

    Parameters
    ----------
    width, height : float, inches
    """
    with matplotlib.rc_context(STYLE):
        yield Figure(figsize=(width, height), layout="constrained")


@contextmanager
def panels(
    count: int,
    height: float,
    *,
    narrow: bool = False,
    each: float = 3.3,
    ratios: Sequence[float] | None = None,
    sharey: bool = False,
) -> Iterator[tuple[Figure, list[Axes]]]:
    """New figure with panels side by side; narrow: one panel a row, as a telephone shows them.

    Parameters
    ----------
    height : float, inches
        Of the row.
    each : float, inches
        Height of a panel of the narrow figure.
    ratios : sequence of float, optional
        Widths of the panels of the row.
    """
    with figure(*((NARROW, 0.3 + each * count) if narrow else (WIDTH, height))) as fig:
        if narrow:
            found = fig.subplots(count, 1, squeeze=False, sharey=sharey)[:, 0]
        else:
            found = fig.subplots(1, count, squeeze=False, sharey=sharey, width_ratios=ratios)[0]
        yield fig, list(found)


def save_png(fig: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure as PNG on white paper, whole or not at all."""
    with matplotlib.rc_context(STYLE), atomic_path(path) as temporary:
        FigureCanvasAgg(fig)
        with _laid_out(fig, _PNG_DPI):
            fig.savefig(temporary, dpi=_PNG_DPI, format="png")
    return Path(path)


@contextmanager
def _laid_out(fig: Figure, dpi: float) -> Iterator[None]:
    """The figure with its parts in place, for which Matplotlib itself would draw it once more, unseen."""
    engine, own = fig.get_layout_engine(), fig.dpi
    if engine is not None:
        fig.dpi = dpi
        engine.execute(fig)
        fig.dpi = own
        fig.set_layout_engine(None)
    try:
        yield
    finally:
        if engine is not None:
            fig.set_layout_engine(engine)


def save_pixels(pixels: np.ndarray, path: Path) -> Path:
    """Write sRGB bytes, shape (height, width, 3), as PNG, whole or not at all."""
    with atomic_path(path) as temporary:
        imsave(temporary, pixels, format="png")
    return path


def to_svg(fig: Figure, name: str) -> str:
    """Figure as an SVG element for a page, its colours replaced by the theme's variables.

    Parameters
    ----------
    name : str
        Different for every figure of a page: it keeps their internal references apart.
    """
    buffer = StringIO()
    with matplotlib.rc_context(STYLE):
        FigureCanvasSVG(fig)
        with _laid_out(fig, fig.dpi):
            fig.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    # Numbered as they come: Matplotlib makes them of random numbers, and of places before these are rounded.
    numbers: dict[str, int] = {}
    named = re.compile(r'(?<= id=")[^"]+|(?<=url\(#)[^)]+|(?<=href="#)[^"]+')
    svg = named.sub(lambda found: f"{name}-{numbers.setdefault(found[0], len(numbers))}", svg)
    # Width from the page, height from the drawing's own proportions.
    svg = re.sub(r'<svg ([^>]*?)width="[^"]*" height="[^"]*"', r"<svg \1", svg, count=1)
    shape = f'role="img" style="max-width: {_PAGE_PIXELS * fig.get_figwidth() / WIDTH:.0f}px"'
    svg = re.sub(r"<svg ([^>]*?)>", rf"<svg \1 {shape}>", svg, count=1)
    svg = re.sub(r"'DejaVu Sans'(, [^;\"]*)?", "var(--sans)", svg)
    for colour, variable in _THEMED.items():
        svg = svg.replace(colour, f"var(--{variable})")
    return svg


def extent_of(x_m: np.ndarray, y_m: np.ndarray) -> tuple[float, float, float, float]:
    """Edges of a map of evenly spaced cells by their centres, m, as `imshow` takes them; one alone is 1 m."""
    half_x, half_y = (0.5 * float(np.diff(c).mean()) if c.size > 1 else 0.5 for c in (x_m, y_m))
    return float(x_m[0] - half_x), float(x_m[-1] + half_x), float(y_m[0] - half_y), float(y_m[-1] + half_y)


def percent_axis(axis: Axis) -> None:
    """Ticks of a part of one in per cent, with as many digits as their range needs."""
    axis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))


def plain_log_axis(axis: Axis) -> None:
    """1-2-5 ticks in plain digits on a logarithmic axis of a decade or two."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def label(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Set both axis labels and the title."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title)


def say_why_empty(axes: Axes, why: str) -> None:
    """In a panel that has nothing to show, why."""
    axes.text(0.5, 0.5, why, ha="center", va="center", fontsize=9, color=MUTED, transform=axes.transAxes)


def banded(
    axes: Axes,
    x: Array,
    value: Array,
    error: Array,
    *,
    least: float = -np.inf,
    alpha: float = 0.25,
    **line: Any,
) -> None:
    """A curve in the band of its errors.

    Parameters
    ----------
    least : float
        The band ends below at this part of the value, so that a logarithmic axis can show it.
    **line
        Of the curve: colour, label, ...
    """
    low = value - error if np.isinf(least) else np.maximum(value - error, least * value)
    axes.fill_between(x, low, value + error, color=line["color"], alpha=alpha, linewidth=0)
    axes.plot(x, value, **line)


def legend_below(fig: Figure, *of: Axes, columns: int = 4, title: str | None = None) -> None:
    """One legend for several axes, under the figure, where it lies over no curve.

    Parameters
    ----------
    columns : int
        At most, where there is room for them. Longer names than the figure is wide go on in a next line.
    """
    found = dict[str, Artist]()
    room = int(fig.get_figwidth() / LETTER)
    for axes in of:
        handles, names = axes.get_legend_handles_labels()
        found |= {fill(name, room - _MARK): one for name, one in zip(names, handles, strict=True)}
    longest = max((len(line) for name in found for line in name.splitlines()), default=0)
    ncols = max(1, min(columns, len(found), room // (longest + _MARK)))
    fig.legend(list(found.values()), list(found), loc="outside lower center", ncols=ncols, title=title)


def legend_under(axes: Axes, columns: int = 2, title: str | None = None) -> None:
    """Legend of one of several axes, under its label, where it lies over no curve."""
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=columns, title=title)
