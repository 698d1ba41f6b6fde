"""The legs and laps of a flight as tables: loads, heights and energy; speeds and what the flight comes near to."""

import math
from collections.abc import Iterator, Sequence

from rich.table import Table
from rich.text import Text

from airrace.cli.tables import plain_table
from airrace.quantities import KNOT
from airrace.results import Flight, laps_of
from airrace.results.leg_facts import LegFacts, Range, leg_facts


def leg_tables(flight: Flight) -> Iterator[Table]:
    """Yield the tables, of at most 80 columns, of all that is told of every leg."""
    facts = leg_facts(flight)
    yield _loads_table(facts)
    yield _speeds_table(facts)


def laps_line(flight: Flight) -> str:
    """Return the lap times in a line; empty for a race of one lap."""
    laps = laps_of(flight)
    if len(laps) < 2:
        return ""
    return "laps: " + ", ".join(f"{lap.number}: {_number(lap.time, 3)} s" for lap in laps)


def _loads_table(facts: Sequence[LegFacts]) -> Table:
    rows = [
        (
            one.leg.name,
            _number(one.leg.time, 3),
            *_pair(one.n_z, 1.0, 2),
            *_pair(one.height, 1.0, 1),
            _number(math.degrees(one.roll_rate), 0),
            _number(one.energy_in, 0),
            _number(one.energy_out, 0),
        )
        for one in facts
    ]
    numbers = ("time\ns", "load\nleast g", "load\nmost g", "height\nleast m", "height\nmost m", "roll\ndeg/s")
    return plain_table("legs", ("leg to",), (*numbers, "energy\nstart m", "energy\nend m"), rows)


def _speeds_table(facts: Sequence[LegFacts]) -> Table:
    """Least and greatest speeds in knots, and the clearance with the least margin."""
    numbers = ("ground\nkt", "true\nkt", "indicated\nkt", "nearest\nm", "required\nm")
    table = plain_table("legs: speeds and clearances", ("leg to",), numbers, ())
    table.add_column("to")
    for one in facts:
        speeds = [_span(values, KNOT) for values in (one.V_K, one.V_A, one.V_I)]
        nearest = one.clearances[0] if one.clearances else None
        where = "" if nearest is None else f"{nearest.text} at {nearest.time:.2f} s"
        distances = ("-", "-") if nearest is None else (f"{nearest.distance:.1f}", f"{nearest.required:.1f}")
        table.add_row(Text(one.leg.name), *speeds, *distances, Text(where))
    return table


def _pair(values: Range, unit: float, digits: int) -> tuple[str, str]:
    return _number(values.least / unit, digits), _number(values.greatest / unit, digits)


def _span(values: Range, unit: float) -> str:
    least, greatest = _pair(values, unit, 0)
    return f"{least} - {greatest}" if math.isfinite(values.least) else "-"


def _number(value: float, digits: int) -> str:
    return f"{value:z.{digits}f}" if math.isfinite(value) else "-"
