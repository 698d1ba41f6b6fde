"""A document to be filed: tables and figures on numbered pages of A4, as one HTML file that loads nothing."""

import math
import string
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from airrace.pages.report.script import FOLDER
from airrace.pages.views.drawing import Figure, figure_address
from airrace.pages.views.plain_text import escape_html
from airrace.pages.views.tables import Cell, Table, Value

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


@dataclass(frozen=True)
class Part:
    """A part of a document, for people and for programs.

    Attributes:
        html: what is printed.
        content: the same as plain values, numbers unrounded; None for a picture.
    """

    html: str
    content: object = None


@dataclass(frozen=True)
class Chapter:
    """Parts below a heading; it begins on a page of its own or not."""

    title: str
    parts: Sequence[Part]
    new_page: bool = False


@dataclass(frozen=True)
class Document:
    """A document: a first page with the contents, and numbered chapters.

    Attributes:
        title: of the file.
        first: on the first page.
        chapters: in their order; those without parts are left out.
        mark: stands below every page, to tell which document it belongs to; letters, digits and spaces.
    """

    title: str
    first: Sequence[Part]
    chapters: Sequence[Chapter]
    mark: str

    def html(self) -> str:
        """Return it as one file that loads nothing."""
        if not all(letter.isalnum() or letter == " " for letter in self.mark):
            raise ValueError(f"{self.mark!r} would have to be escaped in CSS")
        template = string.Template((FOLDER / "style" / "document.css").read_text(encoding="utf-8"))
        chapters = [chapter for chapter in self.chapters if chapter.parts]
        entries = (
            f'<li><a href="#chapter-{number}">{escape_html(chapter.title)}</a></li>'
            for number, chapter in enumerate(chapters, 1)
        )
        body = [part.html for part in self.first]
        body.append(f"<nav><h3>Contents</h3><ol>{''.join(entries)}</ol></nav>")
        for number, chapter in enumerate(chapters, 1):
            begins = ' class="new-page"' if chapter.new_page else ""
            heading = f'<h2 id="chapter-{number}">{number} {escape_html(chapter.title)}</h2>'
            body.append(f"<section{begins}>{heading}{''.join(part.html for part in chapter.parts)}</section>")
        style = template.substitute(mark=self.mark)
        return _PAGE.format(title=escape_html(self.title), style=style, body="\n".join(filter(None, body)))

    def as_object(self) -> dict[str, object]:
        """Return all that is in it but its pictures."""
        chapters = [chapter for chapter in self.chapters if chapter.parts]
        return {
            "title": self.title,
            "first_page": _contents(self.first),
            "chapters": [
                {"number": number, "title": chapter.title, "parts": _contents(chapter.parts)}
                for number, chapter in enumerate(chapters, 1)
            ],
        }


def _contents(parts: Iterable[Part]) -> list[object]:
    return [part.content for part in parts if part.content is not None]


def table_part(table: Table, *, columns: bool = False) -> Part:
    """Return a table without the columns in which nothing is known; see `table_block`."""
    if table.rows:
        table = table.without_empty_columns()
    visible = [(number, column) for number, column in enumerate(table.columns) if column.visible]
    rows: list[list[Value]] = []
    for row in table.rows:
        values: list[Value] = []
        for number, column in visible:
            cell = row[number]
            value = cell.value if isinstance(cell, Cell) else cell
            if isinstance(cell, Cell) and cell.text is not None:
                value = cell.text
            elif isinstance(value, float):
                value = column.factor * value if math.isfinite(value) else None
            values.append(value)
        rows.append(values)
    heads = [f"{column.name} {column.unit}".strip() for _, column in visible]
    content = {"title": table.title, "columns": heads, "rows": rows, "notes": list(table.notes)}
    return Part(table_block(table, columns=columns), content)


def facts_part(pairs: Sequence[tuple[str, str]]) -> Part:
    """Return names and what they stand for; empty texts are left out."""
    return Part(facts_block(pairs), {name: text for name, text in pairs if text})


def list_part(texts: Sequence[str]) -> Part:
    """Return clauses as sentences, one below the other."""
    return Part(list_block(texts), list(texts))


def note_part(text: str) -> Part:
    """Return a sentence in small print."""
    return Part(f'<p class="note">{escape_html(text)}</p>', text)


def known_part(title: str, texts: Sequence[str]) -> Part:
    """Return what has to be known first, in a frame; empty where there is nothing."""
    return Part(known_block(title, texts), list(texts) or None)


def picture_part(figure: Figure, words: str) -> Part:
    """Return a picture, and what is to be seen for those who do not see it."""
    return Part(figure_block(figure_address(figure), words))


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
