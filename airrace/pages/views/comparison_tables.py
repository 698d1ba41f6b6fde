"""Two flights held against each other, for people: tables of laps and legs, and what costs the slower one its time."""

import math
from collections.abc import Sequence
from dataclasses import replace

from airrace.flights.results.comparison import Comparison, Difference, LegComparison
from airrace.flights.results.cost_to_go import EXIT, CostToGoLoss
from airrace.flights.results.flight import Flight
from airrace.flights.results.sectors import JOINT, SectorTimes, sector_times
from airrace.flights.results.time_loss import WORDS, Cause, Loss, Part
from airrace.optimal_control.quantities import KNOT
from airrace.pages.views.tables import RACE, Cell, Column, Table, Units, Value

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
    legs: Sequence[LegComparison],
    title: str = "",
    *,
    begin: float | None = None,
    notes: Sequence[str] = (),
    units: Units = RACE,
) -> Table:
    """Return a table of the time lost on legs, and of what the other flight does differently there.

    Args:
        legs: in the order of the rows.
        title: stands above it.
        begin: the time at which a report's clock starts, s, to which a click on a leg leads; None without one. A report
            has the sum of the times lost, too, and words for a tie.
        notes: sentences that belong to it.
        units: of speeds and lengths in words.
    """
    rows: list[tuple[Cell | Value, ...]] = []
    for leg in legs:
        before, name, loss = leg.reference.before, Cell(leg.name), Cell(leg.difference)
        if begin is not None:
            name = replace(name, time=before.time - begin if before.found else None)
            loss = replace(loss, text="a tie" if leg.tie else None)
        times = (leg.reference.time, leg.flight.time, loss, leg.tie, leg.cumulative, leg.by_way, leg.by_speed)
        differences = ("; " if begin is None else ", ").join(
            difference_text(difference, units) for difference in leg.differences
        )
        rows.append((name, leg.reference.lap, *times, differences))
    return Table(title, _LEGS if begin is None else _LEGS_OF_REPORT, rows, notes)


def difference_text(difference: Difference, units: Units = RACE) -> str:
    """Return what a flight does otherwise, in words."""
    return difference.words.format(difference_value(difference, units))


def difference_value(difference: Difference, units: Units = RACE) -> str:
    """Return by how much a flight does otherwise, with the unit."""
    apart, unit = abs(difference.value - difference.reference), difference.unit
    if unit == "kt":
        apart, unit = apart * KNOT * units.per_m_s, units.speed
    elif unit == "m":
        apart, unit = apart * units.per_m, units.length
    return f"{apart:.{difference.digits}f} {unit}"


def loss_head(loss: Loss) -> str:
    """Return how much is lost, and where, in words."""
    text = f"{loss.hundredths / 100.0:.2f} s from {loss.begin} to {loss.end}"
    turning_point = loss.turning_point
    if not turning_point:
        return text if len(loss.legs) == 1 else f"{text}, {len(loss.legs)} legs"
    peak = round(100.0 * sum(leg.difference for leg in loss.legs[:turning_point]))
    back = peak - loss.hundredths
    first, second = ("lost", "won back after it") if peak > 0 else ("won", "lost after it")
    lost, name = f"{abs(peak) / 100.0:.2f} s {first}", loss.legs[turning_point - 1].name
    return f"{text}: {lost} to {name}, {abs(back) / 100.0:.2f} s {second}"


def part_text(part: Part, units: Units = RACE) -> str:
    """Return a part of a loss in words."""
    costs, wins = WORDS[part.cause]
    facts = ", ".join(difference_text(fact, units) for fact in part.facts)
    amount = f"{abs(part.hundredths) / 100.0:.2f} s"
    text = f"{amount} by {costs}" if part.hundredths >= 0 else f"{amount} won by {wins}"
    return f"{text} ({facts})" if facts else text


def loss_text(loss: Loss, units: Units = RACE) -> str:
    """Return a loss in words, what the pilot flies before what the aircraft is."""
    clauses = [part_text(part, units) for part in loss.parts if part.hundredths]
    clauses += [difference_text(fact, units) for fact in loss.leaving]
    separator = "; " if loss.turning_point else ": "
    return separator.join([loss_head(loss), *(["; ".join(clauses)] if clauses else [])])


def recorded_sectors(flights: Sequence[Flight]) -> SectorTimes | None:
    """Return the sectors of those flights that were recorded; None for fewer than two."""
    recorded = [flight for flight in flights if not flight.source.stage]
    return sector_times(recorded) if len(recorded) > 1 else None


_SECTORS = (
    Column("leg to", key="passing"),
    Column(key="lap"),
    Column("best", "s", ".3f", "best_s"),
    Column("of", key="best_flight"),
    Column("mean", "s", ".3f", "mean_s"),
    Column("deviation", "s", ".3f", "deviation_s", rank=1),
    Column("spread", "s", ".3f", "spread_s"),
    Column("best race", key="best_race_flight", wraps=True),
)


def sectors_table(sectors: SectorTimes, title: str = "", notes: Sequence[str] = ()) -> Table:
    """Return a table of many flights sector by sector; `best race` names the flight of each of its sectors."""
    rows: list[tuple[Value, ...]] = []
    for place, sector in enumerate(sectors.sectors):
        best, chosen = sectors.flights[sector.best].label, "-"
        if sectors.choice:
            chosen = sectors.flights[sectors.choice[place]].label
        times = (sector.mean, sector.deviation, sector.spread)
        rows.append((sector.name, sector.lap, sector.best_time, best, *times, chosen))
    return Table(title, _SECTORS, rows, notes)


def sectors_notes(sectors: SectorTimes, units: Units = RACE) -> list[str]:
    """Return sentences on the best race of sectors that fit together, and on the sum of the best ones."""
    fastest, joint = sectors.fastest, JOINT
    notes = [f"The sum of the best sectors is {sectors.sum_of_best:.3f} s, whether they fit together or not."]
    height, aside, energy = (
        f"{metres * units.per_m:.0f} {units.length}" for metres in (joint.height, joint.aside, joint.energy)
    )
    alike = (
        f"speed within {joint.speed * units.per_m_s:.0f} {units.speed}, height within {height}, place within {aside}, "
        f"course and climb within {math.degrees(joint.heading):.0f} deg, and at most {energy} more energy height"
    )
    if not sectors.choice:
        return notes
    pieces = ", ".join(f"{flight.label} to {name}" for flight, name in sectors.pieces)
    gain = fastest.race_time - sectors.best_race
    text = f"The best race of sectors that fit together takes {sectors.best_race:.3f} s: {pieces}"
    if len(sectors.pieces) > 1:
        text += f"; {gain:.3f} s less than {fastest.label}"
    return [f"{text}.", f"Sectors fit together where both flights make the passing alike: {alike}.", *notes]


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
        way, height, lift = (leg.parts.get(cause.value) for cause in (Cause.WAY, Cause.HEIGHT, Cause.LIFT))
        of_energy = [leg.parts.get(cause.value) for cause in (Cause.DRAG, Cause.POWER, Cause.ENERGY)]
        energy = sum(part for part in of_energy if part is not None) if any(of_energy) else None
        rows.append((leg.leg.name, leg.amount, leg.deviation, way, height, lift, energy, leg.parts[EXIT]))
    rows.append(("race", loss.start + loss.total, None, *[None] * 5))
    notes = ["`end` is what the state at the end of a leg costs behind it: a slow entry is lost on the leg before."]
    return Table(title or f"lost by {loss.flight.label}, by the cost to go", _COSTS, rows, notes)
