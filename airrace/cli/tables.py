"""Tables and pictures as text for stdout, with or without a terminal behind it."""

import codecs
import io
import math
import sys

from rich.console import Console, RenderableType

from airrace.views.tables import Table
from airrace.views.terminal import PlainConsole

UNLIMITED_WIDTH = 200
"""Columns that are enough for every table where no terminal sets a limit."""
PAGE = 80
"""Columns of a page: of tables that are wrapped to it where nobody's terminal sets a limit."""


def render(content: Table | RenderableType, *, columns: int = UNLIMITED_WIDTH) -> str:
    """Return a table or a picture as text for stdout.

    Without a terminal the text is plain, whatever the environment says of colours; where stdout takes no Unicode, rules
    are of ASCII.

    A terminal too narrow for a table wraps its lines: a number cut short would be a wrong one.

    Args:
        content: what is shown.
        columns: to use where there is no terminal; more where the content cannot be narrower.
    """
    drawing = content.rich() if isinstance(content, Table) else content
    terminal = sys.stdout.isatty()
    written = io.BytesIO()
    text = io.TextIOWrapper(written, encoding=_encoding(), errors="backslashreplace", newline="\n")
    console = PlainConsole(
        file=text,
        force_terminal=terminal,
        no_color=None if terminal else True,
        width=None if terminal else columns,
        highlight=False,
    )
    narrowest = console.measure(drawing, options=console.options.update(max_width=UNLIMITED_WIDTH)).minimum
    console.width = max(console.width, narrowest)
    console.print(drawing)
    text.flush()
    return "\n".join(line.rstrip() for line in written.getvalue().decode(_encoding()).splitlines())


def takes_unicode() -> bool:
    """Return whether stdout can show more than ASCII."""
    return _encoding().startswith("utf")


def full_columns(table: Table) -> int:
    """Return the columns that a table takes where nothing limits it."""
    return PlainConsole(file=io.StringIO(), width=10_000).measure(table.rich()).maximum  # columns that limit no table


def terminal_columns() -> int | None:
    """Return the columns of the terminal behind stdout; None if there is none."""
    return Console().width if sys.stdout.isatty() else None


def number(value: float, digits: int) -> str:
    """Return a number with so many decimals, a dash where it is not finite."""
    return f"{value:z.{digits}f}" if math.isfinite(value) else "-"


def _encoding() -> str:
    """Return the encoding of stdout, as Python spells it."""
    return codecs.lookup(sys.stdout.encoding or "utf-8").name
