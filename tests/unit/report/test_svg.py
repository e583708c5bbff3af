"""A figure in a page is the same to the last byte whenever it is drawn."""

from __future__ import annotations

import re

from lightfield.report.style import figure, to_svg


def drawn(moved: float) -> str:
    """A line, cut off where its axes end."""
    with figure(3.0, 2.0) as fig:
        fig.set_layout_engine(None)
        axes = fig.add_axes((0.1 + moved, 0.1, 0.8, 0.8))
        axes.plot([0.0, 1.0, 2.0], [0.0, 1.0, 4.0])
        axes.set_xlim(0.5, 1.5)
    return to_svg(fig, "one")


def test_a_figure_is_the_same_bytes_again():
    """The layout may move axes in the last digits of a float, which no drawing shows."""
    assert drawn(0.0) == drawn(1e-14)


def test_what_a_figure_refers_to_is_in_it_under_its_own_name():
    svg = drawn(0.0)
    ids = re.findall(r' id="([^"]*)"', svg)
    used = {*re.findall(r"url\(#([^)]*)\)", svg), *re.findall(r'href="#([^"]*)"', svg)}
    assert used and used <= set(ids)
    assert len(set(ids)) == len(ids) and all(one.startswith("one-") for one in ids)
