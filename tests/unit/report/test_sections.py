"""Tables of pages: words from the left, numbers from the right; code is set as code, markup stays text."""

from __future__ import annotations

from lightfield.report.sections import Section, Table, study_page


def test_columns_of_words_are_read_from_the_left():
    rows = [
        ["4.5 m", "least attenuation", "400\N{EN DASH}450 nm", "> 60 m", "beyond all asked"],
        ["8.5 m", "\N{EN DASH}", "\N{MINUS SIGN}3", "31.1 m", "5 m"],
    ]
    table = Table("", ["at", "rule", "band", "data", "up to"], rows)
    assert table.texts == [False, True, False, False, False]


def test_commands_are_code_and_markup_is_text():
    page = study_page("t", "v", ["as `band` says"], [Section("s", text=["<b> & `link`"])])
    assert "as <code>band</code> says" in page
    assert "&lt;b&gt; &amp; <code>link</code>" in page and "<b>" not in page


def test_long_names_of_columns_may_break_and_captions_do_not_scroll_with_their_table():
    table = Table("What it is.", ["on_axis_irradiance"], [["1"]])
    page = study_page("t", "v", (), [Section("s", tables=[table])])
    assert "on_<wbr>axis_<wbr>irradiance" in page
    assert page.index("What it is.") < page.index('<div class="scroll">') < page.index("<table")
