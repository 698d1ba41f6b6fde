"""Formulas of the pages as MathML, which browsers draw by themselves: no script, and nothing to fetch."""

import html
import re

from latex2mathml.converter import convert

INLINE = re.compile(r'<span class="arithmatex">\\\((.+?)\\\)</span>', re.DOTALL)
BLOCK = re.compile(r'<div class="arithmatex">\\\[(.+?)\\\]</div>', re.DOTALL)


def with_formulas(page: str) -> str:
    """A page of HTML with the formulas that the extension `arithmatex` has marked turned into MathML."""
    page = BLOCK.sub(lambda found: convert(_latex(found[1]), display="block"), page)
    return INLINE.sub(lambda found: convert(_latex(found[1])), page)


def _latex(marked: str) -> str:
    return html.unescape(marked).strip()
