"""The tables of two flights held against each other: laps and legs."""

from collections.abc import Sequence
from dataclasses import replace

from airrace.flights.results.comparison import Comparison, LegComparison
from airrace.flights.results.cost_to_go import EXIT, CostToGoLoss
from airrace.flights.results.time_loss import Cause
from airrace.pages.views.tables import Cell, Column, Table, Value

_LAPS = (
    Column("lap", form="d", key="lap"),
    Column("reference", "s", ".3f", "reference_s"),
    Column("flight", "s", ".3f", "flight_s"),
    Column("lost", "s", "+z.3f", "difference_s"),
)


def laps_table(comparison: Comparison, title: str = "") -> Table:
    """Return a table of the laps of both flights."""
    laps = comparison.laps
    rows = [(reference.number, reference.time, lap.time, lap.time - reference.time) for reference, lap in laps]
    return Table(title, _LAPS, rows)


_LEGS = (
    Column("leg to", key="passing"),
    Column(key="lap"),
    Column(key="reference_s"),
    Column("time", "s", ".3f", "flight_s", rank=3),
    Column("lost", "s", "+z.3f", "difference_s"),
    Column(key="tie"),
    Column(key="cumulative_s"),
    Column("by way", "s", "+z.3f", "by_longer_way_s", rank=1),
    Column("by speed", "s", "+z.3f", "by_lower_speed_s", rank=2),
    Column("what differs", wraps=True),
)
_CUMULATIVE = 6  # the place of its column
_LEGS_OF_REPORT = (*_LEGS[:_CUMULATIVE], Column("in all", "s", "+z.3f"), *_LEGS[_CUMULATIVE + 1 :])


def lost_table(
    legs: Sequence[LegComparison], title: str = "", *, begin: float | None = None, notes: Sequence[str] = ()
) -> Table:
    """Return a table of the time lost on legs, and of what the other flight does differently there.

    Args:
        legs: in the order of the rows.
        title: stands above it.
        begin: the time at which a report's clock starts, s, to which a click on a leg leads; None without one. A report
            has the sum of the times lost, too, and words for a tie.
        notes: sentences that belong to it.
    """
    rows: list[tuple[Cell | Value, ...]] = []
    for leg in legs:
        before, name, loss = leg.reference.before, Cell(leg.name), Cell(leg.difference)
        if begin is not None:
            name = replace(name, time=before.time - begin if before.found else None)
            loss = replace(loss, text="a tie" if leg.tie else None)
        times = (leg.reference.time, leg.flight.time, loss, leg.tie, leg.cumulative, leg.by_way, leg.by_speed)
        differences = ("; " if begin is None else ", ").join(difference.text for difference in leg.differences)
        rows.append((name, leg.reference.lap, *times, differences))
    return Table(title, _LEGS if begin is None else _LEGS_OF_REPORT, rows, notes)


_COSTS = (
    Column("leg to", key="passing"),
    Column("lost", "s", "+z.3f", "lost_s"),
    Column("known to", "s", ".3f", "deviation_s", rank=1),
    Column("way", "s", "+z.3f"),
    Column("height", "s", "+z.3f", rank=3),
    Column("lift", "s", "+z.3f", rank=4),
    Column("energy", "s", "+z.3f", rank=2),
    Column("end", "s", "+z.3f"),
)


def cost_table(loss: CostToGoLoss, title: str = "") -> Table:
    """Return a table of what every leg cost by the cost to go; the rows add up to the difference of the race times."""
    rows: list[tuple[Cell | Value, ...]] = [("the start", loss.start, loss.samples[0].deviation, *[None] * 5)]
    for leg in loss.legs:
        causes = (Cause.WAY, Cause.HEIGHT, Cause.LIFT, Cause.ENERGY)
        way, height, lift, energy = (leg.parts.get(cause.value) for cause in causes)
        rows.append((leg.leg.name, leg.amount, leg.deviation, way, height, lift, energy, leg.parts[EXIT]))
    rows.append(("race", loss.start + loss.total, None, *[None] * 5))
    notes = ["`end` is what the state at the end of a leg costs behind it: a slow entry is lost on the leg before."]
    return Table(title or f"lost by {loss.flight.label}, by the cost to go", _COSTS, rows, notes)
