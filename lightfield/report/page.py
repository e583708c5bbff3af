"""Self-contained HTML pages: no network, light and dark, printable.

The page of a study is a sentence that answers, then sections with figures, words and tables.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
from matplotlib.figure import Figure

from lightfield.report.style import to_svg
from lightfield.version import __version__
from lightfield.wording import rounded

_FOLDER = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class SideBySide:
    """What to see in two panels, which stand one above the other on a telephone."""

    left: str
    right: str


@dataclass(frozen=True)
class PageFigure:
    """A figure on a page.

    Parameters
    ----------
    svg : str
        SVG element.
    caption : str or SideBySide
        One or two sentences: what to see.
    alt : str
        What it shows, for those who cannot see it.
    narrow : str
        The same with one panel a row, for a telephone; "": it scrolls in its box there.
    """

    svg: str
    caption: str | SideBySide
    alt: str
    narrow: str = ""


def page_figure(
    name: str,
    caption: str | SideBySide,
    alt: str,
    draw: Callable[..., Figure],
    *shown: object,
    narrow: bool = True,
) -> PageFigure:
    """What `draw` draws of `shown`, made ready for a page: wide, and for a telephone where it can be narrow.

    Parameters
    ----------
    name : str
        Different for every figure of the page.
    """
    small = to_svg(draw(*shown, narrow=True), f"{name}-narrow") if narrow else ""
    return PageFigure(to_svg(draw(*shown), name), caption, alt, small)


def three_digits(value: float | None) -> str:
    """Three significant digits, written out below a million; a dash for what is unknown."""
    return "–" if value is None or not math.isfinite(value) else rounded(value, 3)


def fill(template: str, **values: Any) -> str:
    """Page from a template in `templates/`; `title` and `verdict` are always needed."""
    environment = Environment(
        loader=FileSystemLoader(_FOLDER),
        autoescape=select_autoescape(("html",)),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    common = {
        "version": __version__,
        "css": (_FOLDER / "page.css").read_text(encoding="utf-8"),
        "tag": None,
        "provenance": (),
        "scene_toml": "",
    }
    return environment.get_template(template).render({**common, **values})


@dataclass(frozen=True)
class Table:
    """Cells as text, and what they are."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    #: Which columns beside the first hold words: those, too, are read from the left.
    words: Collection[int] = ()


@dataclass(frozen=True)
class Section:
    """One question and its answer."""

    title: str
    figures: Sequence[PageFigure] = ()
    text: Sequence[str] = ()
    tables: Sequence[Table] = ()


def study_page(
    title: str,
    verdict: str,
    lead: Sequence[str],
    sections: Sequence[Section],
    scene_toml: str = "",
    provenance: Sequence[tuple[str, str]] = (),
) -> str:
    """A self-contained page."""
    provenance = provenance or ([("scene", "below")] if scene_toml else [])
    return fill(
        "study.html",
        title=title, verdict=verdict, lead=lead, sections=sections,
        scene_toml=scene_toml, provenance=provenance,
    )  # fmt: skip
