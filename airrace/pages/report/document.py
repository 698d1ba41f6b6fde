"""A document to be filed: tables and figures on numbered pages of A4, as one HTML file that loads nothing."""

import string
from collections.abc import Iterable, Sequence

from airrace.pages.report.script import FOLDER
from airrace.pages.views.plain_text import escape_html
from airrace.pages.views.tables import Table

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{body}
</body>
</html>
"""
WIDE = 12
"""The number of columns from which on a table is set smaller."""


def document_page(title: str, parts: Iterable[str], mark: str) -> str:
    """Return a document.

    Args:
        title: of the file.
        parts: HTML, in order; empty ones are left out.
        mark: stands below every page, to tell which document it belongs to; letters, digits and spaces.
    """
    if not all(letter.isalnum() or letter == " " for letter in mark):
        raise ValueError(f"{mark!r} would have to be escaped in CSS")
    style = string.Template((FOLDER / "style" / "document.css").read_text(encoding="utf-8")).substitute(mark=mark)
    return _PAGE.format(title=escape_html(title), style=style, body="\n".join(filter(None, parts)))


def chapter(title: str, *parts: str, new_page: bool = False) -> str:
    """Return a section with a heading."""
    begins = ' class="new-page"' if new_page else ""
    return f"<section{begins}><h2>{escape_html(title)}</h2>{''.join(parts)}</section>"


def table_block(table: Table, *, columns: bool = False) -> str:
    """Return a table with title and notes, in two columns if asked for; empty where it has neither rows nor notes."""
    if not table.rows and not table.notes:
        return ""
    title = f"<h3>{escape_html(table.title[:1].upper() + table.title[1:])}</h3>" if table.title else ""
    html = table.html(inline=False) if table.rows else ""
    if sum(column.visible for column in table.columns) >= WIDE:
        html = html.replace("<table>", '<table class="wide">', 1)
    if columns:
        html = f'<div class="columns">{html}</div>'
    return title + html + "".join(f'<p class="note">{escape_html(note)}</p>' for note in table.notes)


def facts_block(pairs: Sequence[tuple[str, str]]) -> str:
    """Return names and what they stand for; empty texts are left out."""
    rows = (f"<dt>{escape_html(name)}</dt><dd>{escape_html(text)}</dd>" for name, text in pairs if text)
    return f"<dl>{''.join(rows)}</dl>"


def list_block(texts: Iterable[str]) -> str:
    """Return clauses as sentences, one below the other."""
    sentences = (f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}" for text in texts)
    return f"<ul>{''.join(f'<li>{escape_html(sentence)}</li>' for sentence in sentences)}</ul>"


def figure_block(address: str, words: str) -> str:
    """Return a picture whose data are in its address, and what is to be seen for those who do not see it."""
    return f'<figure><img src="{address}" alt="{escape_html(words)}"></figure>'


def signature_block(names: Iterable[str]) -> str:
    """Return places for the signatures of some people."""
    return "".join(
        f'<div class="signature"><p>{escape_html(name)}</p><p>place, date</p><p>signature</p></div>' for name in names
    )


def known_block(title: str, texts: Sequence[str]) -> str:
    """Return what has to be known first, in a frame; empty where there is nothing."""
    return f'<div class="known"><h3>{escape_html(title)}</h3>{list_block(texts)}</div>' if texts else ""
