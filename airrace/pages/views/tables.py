"""Tables: one model, shown as text, on a terminal, as HTML and Markdown, written as CSV and JSON; units for people.

Cells hold values for programs; columns and cells say how people see them.
"""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from airrace.errors import UsageError
from airrace.files.export.csv_cells import text_cell
from airrace.optimal_control.quantities import FOOT, KNOT
from airrace.pages.views.plain_text import escape_html, escape_markdown
from airrace.runtime.resources import extra

if TYPE_CHECKING:
    from pandas import DataFrame
    from rich.table import Table as RichTable

Value = str | float | None
"""What stands in a cell: words, or a number that the column formats; None or NaN where nothing is known."""

STYLE = "text-align: {}; padding: 0 0.6em; white-space: nowrap"
LEFT_OUT = "too narrow for: "
"""The beginning of the note on columns that are left out."""
ROWS_SHOWN = 40
"""The largest number of rows of a table of many results that people are shown where a file has them all."""
DASH, MINUS = "\N{EN DASH}", "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        name: stands above it, for people; empty where CSV and JSON alone have it.
        unit: of its numbers.
        form: of its numbers, as of `format`; empty for words, which are set to the left.
        key: its name in CSV and JSON; empty where people alone see it.
        factor: from its values to the unit that people see.
        missing: stands where nothing is known.
        wraps: whether its words are broken into lines where they are too long.
        rank: the place in the order in which columns are left out where a terminal is too narrow, from 1; 0 for never.
    """

    name: str = ""
    unit: str = ""
    form: str = ""
    key: str = ""
    factor: float = 1.0
    missing: str = "-"
    wraps: bool = False
    rank: int = 0

    @property
    def visible(self) -> bool:
        """Whether people see it."""
        return bool(self.name) or not self.key

    def text(self, value: Value) -> str:
        """Return what stands in a cell."""
        if isinstance(value, str):
            return value
        if value is None or not math.isfinite(value):
            return self.missing
        return format(value if self.factor == 1.0 else self.factor * value, self.form)

    def cell_text(self, cell: "Cell") -> str:
        """Return what people see of a cell."""
        return self.text(cell.value) if cell.text is None else cell.text

    def html(self, value: "Cell | Value") -> str:
        """Return what stands in a cell of a page; numbers have a typographic minus."""
        text = self.cell_text(value if isinstance(value, Cell) else Cell(value))
        if not self.form:
            return escape_html(text)
        return escape_html(DASH if text == "-" else text.replace("-", MINUS))


@dataclass(frozen=True)
class Cell:
    """A cell that is more than its value.

    Attributes:
        value: as of any other cell.
        text: what people see instead of it; None for the value as the column formats it.
        time: s, to which a click on it leads in a report; None for nowhere.
        flight: number of the flight that a box in it shows and hides in a report; None without a box.
        bad: whether it tells of something that should not be.
    """

    value: Value
    text: str | None = None
    time: float | None = None
    flight: int | None = None
    bad: bool = False


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        title: stands above it; often empty.
        columns: from left to right.
        rows: as many cells as there are columns.
        notes: sentences that belong to it.
        by_leg: whether row `i` tells of leg `i`, to which it leads in a report.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell | Value]]
    notes: Sequence[str] = ()
    by_leg: bool = False

    def texts(self) -> list[list[str]]:
        """Return what people see, the heads first: the texts of the cells, row by row."""
        heads = [f"{column.name} {column.unit}".strip() for column in self.columns if column.visible]
        return [heads, *([column.cell_text(cell) for column, cell in row] for row in self._visible_rows())]

    def narrowed(self) -> "Table | None":
        """Return the table without the column that is left out next, and a note of it; None where all have to stay."""
        ranks = [column.rank for column in self.columns if column.visible and column.rank]
        if not ranks:
            return None
        dropped = next(column for column in self.columns if column.visible and column.rank == min(ranks))
        places = [place for place, column in enumerate(self.columns) if column is not dropped]
        head = f"{dropped.name} {dropped.unit}".strip()
        begun = bool(self.notes) and self.notes[-1].startswith(LEFT_OUT)
        notes = [*self.notes[:-1], f"{self.notes[-1]}, {head}"] if begun else [*self.notes, f"{LEFT_OUT}{head}"]
        return replace(
            self,
            columns=[self.columns[place] for place in places],
            rows=[[row[place] for place in places] for row in self.rows],
            notes=notes,
        )

    def shortened(self) -> "Table":
        """Return the first rows alone where there are many, with a note of how many `--output` writes beside them."""
        left = len(self.rows) - ROWS_SHOWN
        more = (f"{left} more; --output writes all",) if left > 0 else ()
        return replace(self, rows=self.rows[:ROWS_SHOWN], notes=(*self.notes, *more))

    def text(self) -> str:
        """Return columns side by side, names to the left and numbers to the right, without rules."""
        texts, columns = self.texts(), [column for column in self.columns if column.visible]
        widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
        lines = [
            "  ".join(
                cell.rjust(width) if column.form else cell.ljust(width)
                for column, cell, width in zip(columns, line, widths, strict=True)
            )
            for line in texts
        ]
        return "\n".join([*(line.rstrip() for line in lines), *self.notes])

    def html(self, *, inline: bool = True) -> str:
        """Return a `table` element; all texts are escaped.

        Args:
            inline: whether it carries its style, its title and its notes itself, as notebooks need it.
        """
        lines: list[str] = []
        for number, row in enumerate(self._visible_rows()):
            place = f' data-passing="{number}"' if self.by_leg else ""
            lines.append(f"<tr{place}>{''.join(_html_cell(column, cell, inline) for column, cell in row)}</tr>")
        head, caption, notes = "", "", ""
        for column in self.columns:
            if column.visible:
                unit = f" <small>{escape_html(column.unit)}</small>" if column.unit else ""
                head += f'<th scope="col"{_style(column, inline)}>{escape_html(column.name)}{unit}</th>'
        if inline:
            bold = '<caption style="text-align: left; font-weight: bold">'
            caption = f"{bold}{escape_html(self.title)}</caption>" if self.title else ""
            notes = "".join(f"<p>{escape_html(note)}</p>" for note in self.notes)
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>{notes}"

    def markdown(self) -> str:
        """Return the cells as a table of GitHub's Markdown."""
        heads, *lines = [" | ".join(map(escape_markdown, row)) for row in self.texts()]
        rules = "|".join("---:" if column.form else "---" for column in self.columns if column.visible)
        return "\n".join([f"| {heads} |", f"|{rules}|", *(f"| {line} |" for line in lines)])

    def csv(self, form: str = "", end: str = "\n") -> str:
        """Return comma-separated values below the columns' keys; nothing stands where nothing is known.

        Texts are those of `csv_cells.text_cell`.

        Args:
            form: of all numbers; empty for full precision.
            end: of the lines.
        """
        text = io.StringIO(newline="")
        writer = csv.writer(text, lineterminator=end)
        heads, *rows = self._data_rows()
        writer.writerow([_csv_cell(head, "") for head in heads])
        for row in rows:
            writer.writerow([_csv_cell(value, form) for value in row])
        return text.getvalue()

    def without_empty_columns(self) -> "Table":
        """Return the table without the columns in which nothing is known in any row."""

        def is_known(cell: "Cell | Value") -> bool:
            value = cell.value if isinstance(cell, Cell) else cell
            return value not in (None, "") and not (isinstance(value, float) and math.isnan(value))

        kept = [number for number in range(len(self.columns)) if any(is_known(row[number]) for row in self.rows)]
        columns = [self.columns[number] for number in kept]
        return replace(self, columns=columns, rows=[[row[number] for number in kept] for row in self.rows])

    def objects(self) -> list[dict[str, Value]]:
        """Return the rows as objects by the columns' keys, for JSON."""
        heads, *rows = self._data_rows()
        objects = [dict(zip(map(str, heads), row, strict=True)) for row in rows]
        for fields in objects:
            for key, value in fields.items():
                if isinstance(value, float) and not math.isfinite(value):
                    fields[key] = None
        return objects

    def dataframe(self, index: str) -> "DataFrame":
        """Return a data frame of pandas by the columns' keys.

        Args:
            index: the key of the column that is its index.

        Raises:
            UsageError: pandas is not installed.
        """
        pandas: Any = extra("pandas", "a data frame")  # Any: without pandas there are no types
        heads, *rows = self._data_rows()
        return pandas.DataFrame(rows, columns=heads).set_index(index)

    def rich(self) -> "RichTable":
        """Return the table for a terminal."""
        from rich import box  # imported here, for most tables are not drawn and rich takes 0.05 s to load
        from rich.cells import cell_len
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(
            title=Text(self.title),
            title_justify="left",
            box=box.SIMPLE,
            pad_edge=False,
            collapse_padding=True,
            show_edge=False,
        )
        columns = [column for column in self.columns if column.visible]
        texts = zip(*self.texts(), strict=True)
        for column, (_, *cells) in zip(columns, texts, strict=True):
            head = f"{column.name}\n{column.unit}" if column.unit else column.name
            justify, overflow = "right" if column.form else "left", "fold" if column.wraps else "ellipsis"
            # Of words that stay on one line rich would otherwise take the longest one for the least width.
            lines = [line for text in (head, *cells) for line in text.split("\n")]
            least = None if column.wraps else max(map(cell_len, lines))
            table.add_column(head, justify=justify, no_wrap=not column.wraps, overflow=overflow, min_width=least)
        for row in self._visible_rows():
            table.add_row(*(Text(column.cell_text(cell), "bold red" if cell.bad else "") for column, cell in row))
        if self.notes:
            table.caption, table.caption_justify = Text("\n".join(self.notes)), "left"
        return table

    def _visible_rows(self) -> Iterator[list[tuple[Column, Cell]]]:
        """Yield what people see, row by row."""
        for row in self.rows:
            pairs = zip(self.columns, row, strict=True)
            cells = ((column, value) for column, value in pairs if column.visible)
            yield [(column, value if isinstance(value, Cell) else Cell(value)) for column, value in cells]

    def _data_rows(self) -> Iterator[list[Value]]:
        """Yield what CSV and JSON have: the columns' keys, then the values, row by row."""
        yield [column.key for column in self.columns if column.key]
        for row in self.rows:
            pairs = zip(self.columns, row, strict=True)
            yield [value.value if isinstance(value, Cell) else value for column, value in pairs if column.key]


def _csv_cell(value: Value, form: str) -> Value:
    if isinstance(value, str):
        return text_cell(value)
    return format(value + 0.0, form) if form and isinstance(value, float) else value


def _html_cell(column: Column, cell: Cell, inline: bool) -> str:
    """Return a cell with what a report's script finds it by."""
    text = column.html(cell)
    if cell.time is not None:
        text = f'<button data-time="{cell.time:.6f}" title="To this instant">{text}</button>'
    if cell.flight is not None:
        text = f'<label><input type="checkbox" data-flight="{cell.flight}" checked> {text}</label>'
    head = "" if inline else f' data-head="{escape_html(f"{column.name} {column.unit}".strip())}"'
    return f"<td{head}{_style(column, inline, bad=cell.bad)}>{text}</td>"


def _style(column: Column, inline: bool, *, bad: bool = False) -> str:
    if inline:
        return f' style="{STYLE.format("right" if column.form else "left")}"'
    classes = " ".join(name for name, applies in (("text", not column.form), ("no", bad)) if applies)
    return f' class="{classes}"' if classes else ""


@dataclass(frozen=True)
class Units:
    """Units of speed and length.

    Attributes:
        speed, length: how they are written.
        per_m_s, per_m: how many of them are one metre per second, and one metre.
    """

    speed: str
    length: str
    per_m_s: float
    per_m: float


RACE = Units("kt", "m", 1.0 / KNOT, 1.0)
UNITS = {"kt-m": RACE, "kt-ft": Units("kt", "ft", 1.0 / KNOT, 1.0 / FOOT), "kmh-m": Units("km/h", "m", 3.6, 1.0)}
"""The choices by name; `kt-m` are those of the rules of air races."""


def units_named(name: str) -> Units:
    """Return the units of a name.

    Raises:
        UsageError: there are none.
    """
    if name not in UNITS:
        raise UsageError(f"there are no units {name!r}; known are {', '.join(UNITS)}")
    return UNITS[name]
