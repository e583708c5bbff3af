"""Formulas as drawings made by Matplotlib while the site is built: no network and no scripts to read them."""

from __future__ import annotations

import re
from io import StringIO
from typing import TYPE_CHECKING

from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx
    from sphinx.writers.html import HTML5Translator

#: What LaTeX calls otherwise than Matplotlib does.
_WORDS = {r"\text{": r"\mathrm{", r"\mathsf": r"\mathrm", r"\!": ""}
_SIZE_PT = 11.5


def drawn(formula: str) -> str:
    """A formula as an SVG element in the colour of the text around it."""
    for ours, theirs in _WORDS.items():
        formula = formula.replace(ours, theirs)
    out = StringIO()
    text = f"${' '.join(formula.split())}$"
    depth = math_to_image(text, out, prop=FontProperties(size=_SIZE_PT), dpi=72, format="svg")
    svg = out.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(<g id="patch_1">.*?</g>)', "", svg, flags=re.DOTALL)  # the paper behind it
    key = f"m{abs(hash(formula)) % 10**10}-"
    svg = re.sub(r'(id="|href="#)', rf"\1{key}", svg)
    style = f"vertical-align:{-depth:.2f}pt;fill:currentColor;max-width:none"
    return svg.replace("<svg ", f'<svg role="img" aria-label="formula" style="{style}" ', 1)


def inline(self: HTML5Translator, node: nodes.math) -> None:
    """In a line of text."""
    from docutils.nodes import SkipNode

    self.body.append(drawn(node.astext()))
    raise SkipNode


def display(self: HTML5Translator, node: nodes.math_block) -> None:
    """On a line of its own, that scrolls where it is too long for the page."""
    from docutils.nodes import SkipNode

    large = node.astext().replace(r"\frac", r"\dfrac")
    self.body.append(f'<div class="math" style="overflow-x:auto;text-align:center">{drawn(large)}</div>')
    raise SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this."""
    app.add_html_math_renderer("mathtext", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
