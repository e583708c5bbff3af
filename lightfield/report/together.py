"""Which of several effects a layout would make certain, as a page."""

from __future__ import annotations

from textwrap import fill

from matplotlib.figure import Figure

from lightfield.diagnosis.certainty import Outlook
from lightfield.diagnosis.expected import ABOUT, HEAD, Together
from lightfield.report.page import Section, Table, page_figure, study_page
from lightfield.report.style import BAD, FORMULA, GOOD, INK, MUTED, NARROW, WIDTH, figure, label, percent_axis
from lightfield.wording import plain

_SHADES = {
    Outlook.CERTAIN: GOOD, Outlook.SIMPLEST: GOOD, Outlook.PERHAPS: FORMULA,
    Outlook.NO: BAD, Outlook.NOT_SEEN: MUTED,
}  # fmt: skip


def chances_figure(made: Together, narrow: bool = False) -> Figure:
    """A bar for every effect: the chance that it is certain, and beyond it that it is the simplest."""
    names = [plain(one.effect) for one in made.expected]
    with figure(NARROW if narrow else WIDTH, 1.1 + 0.42 * len(names)) as fig:
        axes = fig.subplots()
        for k, one in enumerate(made.expected):
            y, shade = len(names) - k, _SHADES[one.level]
            axes.barh(y, max(one.named, one.certain), height=0.55, color=shade, alpha=0.35)
            axes.barh(y, one.certain, height=0.55, color=shade)
            known = one.level.is_claimed
            words = one.level if known else one.in_words([o.effect for o in made.expected])
            at = max(one.named, one.certain)
            inside = at > 0.5
            axes.annotate(
                words,
                (at if not inside else 0.0, y),
                (6, 0),
                textcoords="offset points",
                va="center",
                fontsize=9.5,
                color="white" if one.certain > 0.5 else INK,  # on the dark bar, or beside it
            )
        axes.set_yticks(range(len(names), 0, -1), names)
        axes.set_xlim(0, 1)
        axes.grid(False, axis="y")
        percent_axis(axes.xaxis)
        words = "chance to be certain (dark), or at least the simplest explanation (light)"
        label(axes, fill(words, 46) if narrow else words, "")
    return fig


def together_page(made: Together) -> str:
    """The page."""
    chances = page_figure(
        "chances", "All effects act at once; of each, the worst rival decides.",
        "Chance of every effect to be certain", chances_figure, made,
    )  # fmt: skip
    table = Table(" ".join((*ABOUT, *made.about_curves)), HEAD[:-1], [row[:-1] for row in made.rows()], (5,))
    sizes = "; ".join(made.sizes(one) for one in made.expected)
    told = [f"Asked about: {sizes}."]
    if made.assumed:
        told.append(f"Assumed: {'; '.join(map(str, made.assumed))}.")
    return study_page(
        "Which effects would be certain?",
        made.headline,
        (),
        [Section("Effect by effect", (chances,), told, (table,))],
    )
