"""Tables for people. Units of the cockpit appear here and in no lower layer; each column names its own."""

import codecs
import io
import math
import sys
from collections.abc import Sequence

from rich import box
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from airrace.views.plain_console import PlainConsole

# Columns that are enough for every table where no terminal sets a limit.
UNLIMITED_WIDTH = 200
FULL_WIDTH = 10_000
"""The columns that limit no table when it is measured."""
PAGE = 80
"""The columns of a page: of tables that are wrapped to it where nobody's terminal sets a limit."""


def rendered(content: RenderableType, *, columns: int = UNLIMITED_WIDTH) -> str:
    """Return a table or a picture as text for stdout.

    Without a terminal the text is plain, whatever the environment says of colours; where stdout takes no Unicode, rules
    are of ASCII.

    A terminal too narrow for a table wraps its lines: a number cut short would be a wrong one.

    Args:
        content: what is shown.
        columns: to use where there is no terminal; more where the content cannot be narrower.
    """
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
    narrowest = console.measure(content, options=console.options.update(max_width=UNLIMITED_WIDTH)).minimum
    console.width = max(console.width, narrowest)
    console.print(content)
    text.flush()
    return "\n".join(line.rstrip() for line in written.getvalue().decode(_encoding()).splitlines())


def takes_unicode() -> bool:
    """Return whether stdout can show more than ASCII."""
    return _encoding().startswith("utf")


def full_columns(table: Table) -> int:
    """Return the columns that a table takes where nothing limits it."""
    return PlainConsole(file=io.StringIO(), width=FULL_WIDTH).measure(table).maximum


def terminal_columns() -> int | None:
    """Return the columns of the terminal behind stdout; None if there is none."""
    return Console().width if sys.stdout.isatty() else None


def plain_table(title: str, names: Sequence[str], numbers: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table of ready texts: columns of names on the left, of numbers on the right."""
    table = empty_table(title, *names)
    add_numbers(table, *numbers)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table


def _encoding() -> str:
    """Return the encoding of stdout, as Python spells it."""
    return codecs.lookup(sys.stdout.encoding or "utf-8").name


def empty_table(title: str, *names: str) -> Table:
    table = Table(
        title=Text(title), title_justify="left", box=box.SIMPLE, pad_edge=False, collapse_padding=True, show_edge=False
    )
    for name in names:
        table.add_column(name, no_wrap=True)
    return table


def add_numbers(table: Table, *names: str) -> None:
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)


def number(value: float, digits: int) -> str:
    """Return a number with so many decimals, a dash where it is not finite."""
    return f"{value:z.{digits}f}" if math.isfinite(value) else "-"
