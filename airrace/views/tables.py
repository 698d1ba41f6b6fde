"""Tables of ready texts, as lines of text and as HTML for notebooks: a column of names, then columns of numbers."""

from collections.abc import Sequence

from airrace.views.plain_text import escaped

STYLE = "text-align: right; padding: 0 0.6em; white-space: nowrap"


def text_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return columns side by side, names to the left and numbers to the right, without rules."""
    widths = [max(len(cell) for cell in column) for column in zip(heads, *rows, strict=True)]
    return "\n".join(_line(row, widths) for row in (heads, *rows))


def html_table(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return the columns as an HTML table; whatever the texts hold is escaped."""
    head = "".join(_cell("th", text, first=not number) for number, text in enumerate(heads))
    body = "".join(
        f"<tr>{''.join(_cell('td', text, first=not number) for number, text in enumerate(row))}</tr>" for row in rows
    )
    caption = f'<caption style="text-align: left; font-weight: bold">{escaped(title)}</caption>' if title else ""
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = row
    numbers = [text.rjust(width) for text, width in zip(others, widths[1:], strict=True)]
    return "  ".join([first.ljust(widths[0]), *numbers]).rstrip()


def _cell(tag: str, text: str, *, first: bool) -> str:
    style = STYLE.replace("right", "left") if first else STYLE
    return f'<{tag} style="{style}">{escaped(text)}</{tag}>'
