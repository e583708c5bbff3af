"""The page of a study: a sentence that answers, then sections with figures, words and tables."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from lightfield.report.page import PageFigure, fill


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
