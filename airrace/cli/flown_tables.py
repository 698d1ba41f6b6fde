"""A flown log as tables: its passings, the rules that it would break, and remarks."""

import math
import textwrap
from collections.abc import Iterator, Sequence

from rich.table import Table
from rich.text import Text

from airrace.cli.leg_tables import laps_line, leg_tables
from airrace.cli.tables import PAGE, plain_table, rendered
from airrace.logs.violations import Violation
from airrace.quantities import KNOT
from airrace.report.sections import penalty_text
from airrace.results import Flight
from airrace.runs.log_view import LogView


def flown_texts(flown: LogView, *, legs: bool = False) -> Iterator[str]:
    """Yield race time and passings, breaches and remarks; at most 80 columns wide.

    Args:
        flown: what is told.
        legs: whether every leg is told, too.
    """
    flight = flown.flight()
    yield rendered(_passings_table(flight), columns=PAGE)
    if flown.breaches:
        yield rendered(_breaches_table(flown.breaches), columns=PAGE)
    yield f"penalties of what is certain: {penalty_text(flown.penalty)}"
    if line := laps_line(flight):
        yield line
    if legs:
        yield from (rendered(table, columns=PAGE) for table in leg_tables(flight))
    notes = (textwrap.fill(f"note: {one}", PAGE, subsequent_indent=6 * " ") for one in flown.remarks)
    yield "\n".join(notes)


def _passings_table(flight: Flight) -> Table:
    race_time = f"{flight.race_time:.3f} s" if math.isfinite(flight.race_time) else "not finished"
    numbers = ("time\ns", "leg\ns", "ground\nkt", "height\nm", "load\ng", "bank\ndeg", "climb\ndeg")
    rows: list[tuple[str, ...]] = []
    before = math.nan
    for one in flight.crossings:
        values = (one.value("V_K") / KNOT, one.value("height"))
        angles = [math.degrees(one.value(name)) for name in ("mu", "gamma")]
        rows.append(
            (
                one.name,
                _number(one.time, 3),
                _number(one.time - before, 3),
                *(_number(value, 1) for value in values),
                _number(one.value("n_z"), 1),
                *(_number(angle, 0) for angle in angles),
            )
        )
        before = one.time
    return plain_table(f"{flight.label}: race time {race_time}, as flown", ("passing",), numbers, rows)


def _breaches_table(breaches: Sequence[Violation]) -> Table:
    """Return a table of the rules that would be broken; `+-` is the standard deviation of what was flown."""
    table = plain_table("rules that would be broken", ("at", "rule"), ("time\ns", "flown", "+-", "allowed"), ())
    for name in ("unit", "penalty", "certain"):
        table.add_column(name)
    for one in breaches:
        table.add_row(
            Text(one.passing or "flight"),
            one.rule,
            _number(one.time, 2),
            _number(one.value, 1),
            _number(one.deviation, 1),
            _number(one.limit, 1),
            one.unit,
            penalty_text(one.penalty),
            "yes" if one.certain else "no",
        )
    return table


def _number(value: float, digits: int) -> str:
    return f"{value:z.{digits}f}" if math.isfinite(value) else "-"
