"""Ticks in per cent say what they stand at."""

from __future__ import annotations

import pytest

from lightfield.report.style import figure, percent_axis


@pytest.mark.parametrize("limits", [(0.88, 1.05), (0.0, 1.0), (-0.03, 0.01)])
def test_every_tick_is_labelled_with_its_own_value(limits: tuple[float, float]) -> None:
    with figure() as fig:
        axes = fig.subplots()
        axes.set_ylim(*limits)
        percent_axis(axes.yaxis)
        fig.canvas.draw()
        words = [label.get_text() for label in axes.get_yticklabels()]
        places = axes.get_yticks()
    for text, at in zip(words, places, strict=True):
        number = float(text.removesuffix(" %").replace("\N{MINUS SIGN}", "-"))
        assert number == pytest.approx(100 * at, abs=1e-9)
