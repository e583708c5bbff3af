"""Tables of pages: words from the left, numbers from the right; code is set as code, markup stays text."""

from __future__ import annotations

from lightfield.report.page import PageFigure, Section, SideBySide, Table, study_page


def test_columns_of_words_are_read_from_the_left():
    rows = [["4.5 m", "least attenuation", "31.1 m"], ["8.5 m", "–", "not found"]]
    page = study_page("t", "v", (), [Section("s", tables=[Table("", ["at", "rule", "up to"], rows, (1,))])])
    assert '<th scope="col" class="text">rule</th><th scope="col">up to</th>' in page
    assert '<td class="text">least attenuation</td><td>31.1 m</td>' in page
    assert '<td class="text">–</td><td>not found</td>' in page


def test_what_stands_side_by_side_stands_one_above_the_other_on_a_telephone():
    seen = PageFigure("<svg></svg>", SideBySide("light.", "its error."), "alt", "<svg></svg>")
    page = study_page("t", "v", (), [Section("s", (seen,))])
    assert '<figcaption class="wide">Left: light. Right: its error.</figcaption>' in page
    assert '<figcaption class="narrow">Above: light. Below: its error.</figcaption>' in page


def test_commands_are_code_and_markup_is_text():
    page = study_page("t", "v", ["as `band` says"], [Section("s", text=["<b> & `link`"])])
    assert "as <code>band</code> says" in page
    assert "&lt;b&gt; &amp; <code>link</code>" in page and "<b>" not in page


def test_long_names_of_columns_may_break_and_captions_do_not_scroll_with_their_table():
    table = Table("What it is.", ["on_axis_irradiance"], [["1"]])
    page = study_page("t", "v", (), [Section("s", tables=[table])])
    assert "on_<wbr>axis_<wbr>irradiance" in page
    assert page.index("What it is.") < page.index('<div class="scroll">') < page.index("<table")
