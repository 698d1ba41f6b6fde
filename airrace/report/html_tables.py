"""Tables and lists of a report as HTML; every text is escaped here."""

import math
from collections.abc import Iterable, Sequence

from airrace.records import record
from airrace.views.plain_text import escaped

DASH = "\N{EN DASH}"
"""Stands where nothing is known."""


@record
class Head:
    """The head of a column.

    Attributes:
        title: what stands in it.
        unit: its unit; empty without one.
        text: whether its cells are words, which are set to the left, rather than numbers.
    """

    title: str
    unit: str = ""
    text: bool = False


@record
class Cell:
    """A cell that is more than its text.

    Attributes:
        text: what stands in it.
        time: s, to which a click on it leads; None for nowhere.
        flight: the number of the flight that a box in it shows and hides; None without a box.
        bad: whether it tells of something that should not be.
    """

    text: str
    time: float | None = None
    flight: int | None = None
    bad: bool = False


@record
class Row:
    """Cells of a row; `passing` is the number of the passing that begins what it tells of, None where there is none."""

    cells: Sequence[Cell | str]
    passing: int | None = None


def number(value: float, digits: int, *, signed: bool = False) -> str:
    """Return a number as people read it; a dash where there is none."""
    if not math.isfinite(value):
        return DASH
    return with_minus(f"{value:{'+' if signed else ''}z.{digits}f}")


def with_minus(text: str) -> str:
    """Return a number's text with a minus sign instead of a hyphen."""
    return text.replace("-", "\N{MINUS SIGN}")


def table(heads: Sequence[Head], rows: Iterable[Row], caption: str = "") -> str:
    """Return a table that scrolls within its place where it is too wide."""
    head = "".join(f'<th scope="col"{_class(one)}>{escaped(one.title)}{_unit(one.unit)}</th>' for one in heads)
    body = "".join(_row(row, heads) for row in rows)
    told = f"<caption>{escaped(caption)}</caption>" if caption else ""
    return f'<div class="scroll"><table>{told}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def section(title: str, body: str, *, half: bool = False) -> str:
    """Return a part of the page with a heading; `body` is HTML."""
    width = " half" if half else ""
    return f'<section class="panel{width}"><h2>{escaped(title)}</h2>{body}</section>'


def note(text: str) -> str:
    """Return a sentence below a table."""
    return f'<p class="note">{escaped(text)}</p>' if text else ""


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return a list of names and what they stand for."""
    entries = "".join(f"<dt>{escaped(name)}</dt><dd>{escaped(text)}</dd>" for name, text in pairs)
    return f'<dl class="facts">{entries}</dl>'


def folded(title: str, text: str) -> str:
    """Return a longer text that is unfolded by a click."""
    return f"<details><summary>{escaped(title)}</summary><pre>{escaped(text)}</pre></details>"


def _row(row: Row, heads: Sequence[Head]) -> str:
    passing = "" if row.passing is None else f' data-passing="{row.passing}"'
    cells = "".join(_cell(cell, head) for cell, head in zip(row.cells, heads, strict=True))
    return f"<tr{passing}>{cells}</tr>"


def _cell(cell: Cell | str, head: Head) -> str:
    one = cell if isinstance(cell, Cell) else Cell(cell)
    text = escaped(one.text)
    if one.time is not None:
        text = f'<button data-time="{one.time:.6f}" title="To this instant">{text}</button>'
    if one.flight is not None:
        text = f'<label><input type="checkbox" data-flight="{one.flight}" checked> {text}</label>'
    return f"<td{_class(head, bad=one.bad)}>{text}</td>"


def _class(head: Head, *, bad: bool = False) -> str:
    names = [name for name, holds in (("text", head.text), ("no", bad)) if holds]
    return f' class="{" ".join(names)}"' if names else ""


def _unit(unit: str) -> str:
    return f"<small>{escaped(unit)}</small>" if unit else ""
