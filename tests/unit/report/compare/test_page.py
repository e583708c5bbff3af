"""The page of a comparison stands alone, says the verdict first, and follows the theme."""

import re
from html.parser import HTMLParser
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from lightfield.maps.dataset import to_dataset
from lightfield.report.compare.figures import maps_figure, radial_figure
from lightfield.report.compare.page import (
    comparison_page,
    concise,
    plus_minus,
    terminal_table,
    write_comparison,
)
from lightfield.report.page import to_svg
from lightfield.studies.compare.in_a_sentence import in_a_sentence
from lightfield.studies.compare.maps import compare


@pytest.fixture(scope="module")
def case(make, light):
    dataset = to_dataset(make(pixels=25, planes=(4.5, 8.5), glow=0.03))
    return dataset, compare(dataset, lambda scene, x, y, z, wavelength: light(scene, x, y, z))


@pytest.fixture(scope="module")
def html(case):
    dataset, comparison = case
    return comparison_page(comparison, dataset.attrs)


class Tags(HTMLParser):
    """Every start tag with its attributes."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))


def tags(html):
    parser = Tags()
    parser.feed(html)
    return parser.found


def test_page_needs_nothing_from_outside(html):
    for tag, attrs in tags(html):
        assert tag not in ("script", "link", "iframe")
        for name in ("src", "href", "xlink:href"):
            reference = attrs.get(name)
            assert reference is None or reference.startswith(("#", "data:")), (tag, reference)
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)


def test_references_inside_the_drawings_are_unique_and_resolved(html):
    ids = [attrs["id"] for _, attrs in tags(html) if "id" in attrs]
    assert len(ids) == len(set(ids))
    used = set(re.findall(r"url\(#([^)]+)\)", html)) | {
        attrs["xlink:href"][1:] for _, attrs in tags(html) if attrs.get("xlink:href", "").startswith("#")
    }
    assert used <= set(ids)


def test_verdict_is_the_first_sentence(case, html):
    body = html[html.index("<body>") :]
    assert body.index(in_a_sentence(case[1])) < body.index("<p>")


def test_drawings_follow_the_theme(html):
    assert "prefers-color-scheme: dark" in html
    drawings = "".join(re.findall(r"<svg.*?</svg>", html, flags=re.DOTALL))
    assert drawings.count("var(--ink)") > 20
    assert "#1f2429" not in drawings, "ink is a variable, so that it turns light on dark paper"


@pytest.mark.usefixtures("undrawn")
def test_files_are_written_with_the_page_first(case, tmp_path):
    dataset, comparison = case
    files = write_comparison(comparison, dataset.attrs, tmp_path)
    assert [f.name for f in files] == [
        "index.html",
        "compare_maps_525nm.png",
        "compare_radial_525nm.png",
        "compare_axial_525nm.png",
    ]
    assert all(f.read_bytes()[:4] == b"\x89PNG" for f in files[1:])


def test_same_comparison_same_page(case, undrawn, monkeypatch):
    """And the same drawing of one figure, whose parts have names."""
    dataset, comparison = case
    pages = {comparison_page(comparison, dataset.attrs) for _ in range(2)}
    drawings = {to_svg(radial_figure(comparison.planes), "radial") for _ in range(2)}
    assert len(pages) == len(drawings) == 1


@pytest.mark.usefixtures("undrawn")
def test_scene_names_cannot_inject_markup(make, light):
    dataset = to_dataset(make(pixels=9, planes=(4.5,), name="<b>tank</b>"))
    comparison = compare(dataset, lambda scene, x, y, z, wavelength: light(scene, x, y, z))
    html = comparison_page(comparison, dataset.attrs)
    assert "<b>tank" not in html
    assert "&lt;b&gt;tank" in html


def test_terminal_table_has_a_row_per_plane(case):
    console = Console(width=80, record=True, file=StringIO())
    console.print(terminal_table(case[1], 525.0))
    text = console.export_text()
    assert "Irradiance at 525 nm, W/(m² nm)" in text
    assert all(f"\n{z} " in text.replace("\n ", "\n") for z in ("4.5", "8.5"))
    assert "…" not in text, "nothing is cut at 80 columns"


@pytest.mark.parametrize(
    ("value", "stderr", "text"),
    [
        (0.0330, 0.0003, "0.0330(3)"),
        (-4.83, 0.9, "−4.8(9)"),
        (9.03e-3, 9e-5, "9.03(9)e−3"),
        (123.4, 20.0, "123(20)"),
        (2e-5, 3e-4, "0(3)e−4"),
        (0.5, float("nan"), "0.5"),
    ],
)
def test_concise_errors(value, stderr, text):
    assert concise(value, stderr) == text


@pytest.mark.parametrize(
    ("value", "stderr", "text"),
    [
        (0.0330, 0.0003, "0.0330 ± 0.0003"),
        (9.03e-3, 9e-5, "(9.03 ± 0.09)e−3"),
        (-4.83, 0.9, "−4.8 ± 0.9"),
        (123.4, 20.0, "123 ± 20"),
        (0.5, float("nan"), "0.5"),
        (float("nan"), 1.0, "–"),
        (2e-5, 3e-4, "(0 ± 3)e−4"),
    ],
)
def test_errors_decide_the_digits(value, stderr, text):
    assert plus_minus(value, stderr) == text


def test_many_planes_are_not_all_drawn_and_that_is_said(make, light):
    several = compare(
        to_dataset(make(pixels=9, planes=tuple(range(2, 10)))),
        lambda scene, x, y, z, wavelength: light(scene, x, y, z),
    )
    assert "5 of 8 planes" in maps_figure(several.planes, several.units, several.quantity).get_supxlabel()
    assert radial_figure(several.planes).get_suptitle() == "5 of 8 planes"
    narrow = maps_figure(several.planes, several.units, several.quantity, narrow=True)
    assert "3 of 8 planes" in narrow.get_supxlabel()
    assert len([axis for axis in narrow.axes if axis.images]) == 9


@pytest.mark.usefixtures("undrawn")
def test_the_worst_band_comes_first(make, light):
    """Bands stood by wavelength: the one that matters was the last of six, and nowhere named."""
    dataset = to_dataset(
        make(pixels=9, planes=(4.5, 8.5), noise=1e-3, detector__bands_nm=[[500, 550], [600, 650]])
    )

    def dim_in_red(scene, x, y, z, wavelength):
        return light(scene, x, y, z) * (0.7 if np.mean(wavelength.wavelength_nm) > 600 else 0.99)

    comparison = compare(dataset, dim_in_red)
    assert [plane.wavelength_nm for plane in comparison.worst] == [625.0, 525.0]
    html = comparison_page(comparison, dataset.attrs)
    assert html.index("625 nm, plane by plane") < html.index("525 nm, plane by plane")
    assert re.search(r" Worst at 625 nm: 3\d % too low on the axis at ", in_a_sentence(comparison))
    alone = compare(dataset.isel(wavelength_nm=[0]), dim_in_red)
    assert "Worst" not in in_a_sentence(alone) and "Which band" not in comparison_page(alone, dataset.attrs)
