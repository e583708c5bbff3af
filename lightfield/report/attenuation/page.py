"""A study of attenuation as a page."""

from __future__ import annotations

from lightfield.report.attenuation.figures import content_figure, hidden_figure, lines_figure, percent_figure
from lightfield.report.page import Section, SideBySide, Table, page_figure, study_page
from lightfield.studies.attenuation.apparent import Apparent
from lightfield.studies.attenuation.constituents import LEVELS
from lightfield.studies.attenuation.study import Attenuation, Content
from lightfield.studies.attenuation.text import (
    content_head,
    content_rows,
    content_sentences,
    fit_sentence,
    headline,
    note_sentences,
    published_sentences,
    scattered_sentences,
    scene_sentences,
    table_head,
    table_rows,
)
from lightfield.wording import capital, plain


def attenuation_page(found: Attenuation) -> str:
    """The page."""
    first = found.apparent[0]
    sections = [_apparent(one, k) for k, one in enumerate(found.apparent)]
    if found.scattered is not None:
        where = "so K lies between absorption and beam attenuation."
        if first.ratios.scene.reflects:
            where = "and light that comes back from walls or a surface, which may leave K below absorption."
        caption = SideBySide(
            f"scattered light that still arrives hides a part of the loss, {where}",
            "the waters that the layout allows, with one standard error.",
        )
        hidden = page_figure(
            "hidden", caption, "K beside a and c; a against b as told",
            hidden_figure, first, found.scattered, found.content,
        )  # fmt: skip
        sections.append(
            Section(
                "What K hides", (hidden,), (*scattered_sentences(found.scattered), *scene_sentences(found))
            )
        )
    if found.content is not None:
        sections.append(_content(found.content))
    if found.notes:
        sections.append(Section("Assumed, or left out", text=note_sentences(found)))
    scene = first.ratios.scene
    lead = (
        "Readings in water divided by readings in air at the same places, or by the formula where there "
        "are none. Errors are standard errors; those of a stay at a distance, and of a lamp that flickers, "
        "are common to all wavelengths.",
    )
    title = f"{scene.name or 'Water'}: attenuation"
    return study_page(title, headline(found), lead, sections, scene.to_toml())


def _content(found: Content) -> Section:
    caption = (
        "Maximum of the likelihood, intervals of 68 % (thick) and 95 % (thin). Diamonds: with another phase "
        "function. All models see the same readings."
    )
    drawing = page_figure("content", caption, "Each constituent by each model", content_figure, found)
    table = Table(
        f"{capital(LEVELS)}, from the profile of the likelihood.", content_head(found), content_rows(found)
    )
    return Section("Constituents", (drawing,), content_sentences(found), (table,))


def _apparent(one: Apparent, number: int) -> Section:
    quantity = plain(str(one.ratios.scene.detector.quantity))
    rows, there = table_rows(one), len(one.K_per_m)
    cut = f" {len(rows)} of {there} wavelengths; the figure above shows all." if len(rows) < there else ""
    grey = " Grey: the wavelengths of what was published of this water." if one.ratios.published else ""
    return Section(
        f"Apparent attenuation, {quantity}",
        (
            page_figure(
                f"percent{number}",
                f"Bands of one standard error.{grey}",
                "Light lost per metre and over each distance, against wavelength",
                percent_figure,
                one,
            ),
            page_figure(
                f"lines{number}",
                SideBySide(
                    "logarithms of the ratios with their fitted lines.",
                    "what the lines leave, and in orange the error of each stay that all wavelengths share, "
                    "as fitted.",
                ),
                "Logarithm of water over air against distance, and residuals",
                lines_figure,
                one,
            ),
        ),
        (fit_sentence(one), *published_sentences(one)),
        (Table(f"± is one standard error.{cut}", table_head(one), rows),),
    )
