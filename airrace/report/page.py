"""A report as one file: style, script and contents in a page that can load nothing from anywhere.

The page's own policy says so to the browser: only the script and the styles whose hashes it names run or apply, and
there is no address from which anything could be fetched. Pictures exist only as data within the page.
"""

import base64
import functools
import hashlib
import html
import string
from collections.abc import Sequence
from pathlib import Path

from airrace.records import record
from airrace.report.contents import Contents
from airrace.report.script import LIBRARIES, page_script
from airrace.report.sections import number
from airrace.views.plain_text import escaped, plain

FOLDER = Path(__file__).parent
STYLES = (
    LIBRARIES / "uplot" / "uPlot.min.css",
    *(FOLDER / "style" / name for name in ("page.css", "scene.css", "print.css")),
)


@record
class Reading:
    """A number of the present instant that is shown over the scene; `wraps` as of a strip."""

    title: str
    history: str
    unit: str
    digits: int = 0
    wraps: float = 0.0


@record
class Page:
    """The page of a report: its texts, readings, drawing and tables, and what its script is told.

    Attributes:
        title, subtitle: plain text of any length.
        race_time: of the first flight, s.
        verdict: plain text: whether the flight is certified, or what else it is.
        good: whether the verdict is a good one.
        readings: what is shown of the present instant.
        plan: the drawing of the course from above, for browsers that draw nothing in space; SVG.
        sections: the tables, HTML.
        footer: plain text.
        contents: what the script is told.
    """

    title: str
    subtitle: str
    race_time: float
    verdict: str
    good: bool
    readings: Sequence[Reading]
    plan: str
    sections: Sequence[str]
    footer: str
    contents: Contents

    def as_html(self) -> str:
        """Return the whole page as HTML."""
        style, script = page_style(), page_script()
        return _template().substitute(
            policy=policy(style, script),
            title=html.escape(plain(self.title)),
            heading=escaped(self.title),
            subtitle=escaped(self.subtitle),
            race_time=number(self.race_time, 3),
            verdict=f'<div class="verdict {"good" if self.good else "bad"}">{escaped(self.verdict)}</div>',
            readings="".join(_reading(one) for one in self.readings),
            plan=self.plan,
            sections="\n".join(self.sections),
            footer=escaped(self.footer),
            style=style,
            contents=self.contents.as_json(),
            script=script,
        )


def policy(style: str, script: str) -> str:
    """Return the content security policy of a page with this style and this script.

    Attributes `style` are allowed within elements, for drawings carry them; they cannot load anything either.
    """
    return "; ".join((
        "default-src 'none'",
        f"script-src {_hash(script)}",
        f"style-src-elem {_hash(style)}",
        "style-src-attr 'unsafe-inline'",
        "img-src data:",
        "base-uri 'none'",
        "form-action 'none'",
    ))  # fmt: skip


@functools.cache
def page_style() -> str:
    """Return the style sheet of a report."""
    return "\n".join(path.read_text(encoding="utf-8") for path in STYLES)


@functools.cache
def _template() -> string.Template:
    return string.Template((FOLDER / "page.html").read_text(encoding="utf-8"))


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def _reading(one: Reading) -> str:
    attributes = f'data-history="{html.escape(one.history)}" data-digits="{one.digits}" data-wraps="{one.wraps:g}"'
    unit = f"<small>{html.escape(one.unit)}</small>" if one.unit else ""
    return f"<div><dt>{html.escape(one.title)}</dt><dd><span {attributes}></span>{unit}</dd></div>"
