"""Tables of what a flight comes near to: the planned line, and pylons that an optimum passes closely."""

import math
import textwrap
from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from airrace.cli.tables import PAGE, plain_table, rendered
from airrace.results import Flight
from airrace.results.clearances import Clearance, NearMiss, near_misses
from airrace.results.legs import passings_around

NEAR_MISSES = textwrap.fill(
    "warning: the rules measure the wing tips at the instant of a passing alone; right before or after it, or at other "
    "gates, the wing comes as close to pylons as told above.",
    PAGE,
)
"""The sentence that goes with the table of near misses."""


def planned_table(planned: Flight, clearances: Sequence[Clearance]) -> Table:
    """Return a table of the least distances of a planned flight."""
    title = f"least distances of the line that is {planned.source.remark}"
    table = plain_table(title, ("from",), ("distance\nm", "required\nm", "north\nm", "east\nm", "height\nm"), ())
    table.add_column("between")
    for one in clearances:
        before, after = passings_around(planned, one.time)
        numbers = (_number(one.north, 0), _number(one.east, 0), _number(one.height, 0))
        between = f"{before.name} and {after.name}"
        table.add_row(Text(_thing(one)), f"{one.distance:.1f}", f"{one.required:.1f}", *numbers, Text(between))
    return table


def near_misses_text(flight: Flight) -> str:
    """Return the table of the near misses of a flight, with a sentence; empty where there are none."""
    misses = near_misses(flight)
    return f"{rendered(near_miss_table(misses), columns=PAGE)}\n{NEAR_MISSES}" if misses else ""


def near_miss_table(misses: Sequence[NearMiss]) -> Table:
    """Return a table of near misses."""
    table = plain_table("near misses", ("pylon of",), ("distance\nm", "required\nm", "time\ns"), ())
    table.add_column("where")
    for one in misses:
        away = one.clearance
        numbers = (f"{away.distance:.2f}", f"{away.required:.2f}", f"{away.time:.2f}")
        table.add_row(Text(away.name), *numbers, Text(one.where))
    return table


def _thing(one: Clearance) -> str:
    return f"wing to {one.text}" if one.kind == "pylon" else one.text


def _number(value: float, digits: int) -> str:
    return f"{value:z.{digits}f}" if math.isfinite(value) else "-"
