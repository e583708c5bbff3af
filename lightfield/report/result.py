"""The page of any answer that has none of its own: its sentence, its figures, its table, its text."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lightfield.report.page import page_figure
from lightfield.report.sections import Section, Table, study_page, write_study
from lightfield.report.style import NARROW, figure

if TYPE_CHECKING:
    import pandas as pd

#: Rows of a table that a page shows.
MOST_ROWS = 60


class Answer(Protocol):
    """What the page needs of an answer; `lightfield.api.result.Result` is one."""

    @property
    def headline(self) -> str: ...
    def plot(self, ax: Axes | None = None) -> Axes: ...
    def summary(self) -> pd.DataFrame: ...


def write_result(
    answer: Answer,
    path: str | os.PathLike[str],
    title: str,
    figures: Sequence[Figure] | None = None,
    scene_toml: str = "",
    narrow: Sequence[Figure] = (),
) -> Path:
    """Write the page, whole or not at all.

    Parameters
    ----------
    figures : sequence of Figure, optional
        Default: what the answer plots.
    narrow : sequence of Figure, optional
        The first of them once more, for a telephone.
    """
    if figures is None:
        both = []
        for size in ((8.0, 4.6), (NARROW, 3.6)):
            with figure(*size) as drawing:
                answer.plot(drawing.subplots())
            both.append(drawing)
        figures, narrow = both[:1], both[1:]
    drawn = [
        page_figure(one, f"figure{k}", "", title, narrow[k] if k < len(narrow) else None)
        for k, one in enumerate(figures)
    ]
    table = answer.summary()
    rows = [[_cell(value) for value in row] for row in table.head(MOST_ROWS).itertuples(index=False)]
    words = [k for k, name in enumerate(table.columns) if any(map(_is_text, table[name]))]
    rest = f" The first {MOST_ROWS} of {len(table)} rows." if len(table) > MOST_ROWS else ""
    shown = Table(f"The numbers.{rest}", [str(name) for name in table.columns], rows, words)
    section = Section("Answer", drawn, (), (shown,))
    return write_study(study_page(title, answer.headline, (), [section], scene_toml), path)


def _is_text(value: object) -> bool:
    return isinstance(value, str | bool | np.bool_)


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
