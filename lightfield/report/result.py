"""The page of any answer that has none of its own: its sentence, its figures, its table, its text."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lightfield.report.page import Section, Table, page_figure, study_page
from lightfield.report.style import NARROW, figure

if TYPE_CHECKING:
    import pandas as pd

#: Rows of a table that a page shows.
_MOST_ROWS = 60


class Answer(Protocol):
    """What the page needs of an answer; `lightfield.api.result.Result` is one."""

    details: Any

    @property
    def headline(self) -> str: ...
    def plot(self, ax: Axes | None = None) -> Axes: ...
    def summary(self) -> pd.DataFrame: ...


def result_page(answer: Answer, title: str, *draw: Callable[..., Figure], scene_toml: str = "") -> str:
    """The page.

    Parameters
    ----------
    draw : callable
        Figures of the answer's details; without any, what the answer plots.
    """
    drawn = [page_figure(f"figure{k}", "", title, one, answer.details) for k, one in enumerate(draw)]
    if not draw:
        drawn = [page_figure("figure0", "", title, _plotted, answer)]
    table = answer.summary()
    rows = [[_cell(value) for value in row] for row in table.head(_MOST_ROWS).itertuples(index=False)]
    words = [k for k, name in enumerate(table.columns) if any(map(_is_text, table[name]))]
    rest = f" The first {_MOST_ROWS} of {len(table)} rows." if len(table) > _MOST_ROWS else ""
    shown = Table(f"The numbers.{rest}", [str(name) for name in table.columns], rows, words)
    section = Section("Answer", drawn, (), (shown,))
    return study_page(title, answer.headline, (), [section], scene_toml)


def _plotted(answer: Answer, narrow: bool = False) -> Figure:
    with figure(*((NARROW, 3.6) if narrow else (8.0, 4.6))) as drawing:
        answer.plot(drawing.subplots())
    return drawing


def _is_text(value: object) -> bool:
    return isinstance(value, str | bool | np.bool_)


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
