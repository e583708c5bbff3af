"""The page of a study: a sentence that answers, then sections with figures, words and tables."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lightfield.report.page import PageFigure, fill, write_page


@dataclass(frozen=True)
class Table:
    """Cells as text, and what they are."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def texts(self) -> list[bool]:
        """Which columns hold words, which are read from the left."""
        cells = ([row[k] for row in self.rows if k < len(row)] for k in range(len(self.head)))
        return [any(_is_text(cell) for cell in column) for column in cells]


#: A cell with a number and its unit begins so.
_NUMBER = re.compile(r"[\d+\-\N{MINUS SIGN}\N{EN DASH}<>±~(.]|$|beyond|never|unknown|none|about|not ")


def _is_text(cell: str) -> bool:
    return _NUMBER.match(cell.strip()) is None


@dataclass(frozen=True)
class Section:
    """One question and its answer."""

    title: str
    figures: Sequence[PageFigure] = ()
    text: Sequence[str] = ()
    tables: Sequence[Table] = ()


def study_page(
    title: str, verdict: str, lead: Sequence[str], sections: Sequence[Section], scene_toml: str = ""
) -> str:
    """A self-contained page."""
    provenance = [("scene", "below")] if scene_toml else []
    return fill(
        "study.html",
        title=title, verdict=verdict, lead=lead, sections=sections,
        scene_toml=scene_toml, provenance=provenance,
    )  # fmt: skip


def write_study(html: str, path: str | os.PathLike[str]) -> Path:
    """Write the page, whole or not at all."""
    return write_page(html, path)
