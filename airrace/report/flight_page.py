"""The page about flights, whatever their sources; what only runs know is handed in as further sections."""

import math
from collections.abc import Sequence

import numpy as np

from airrace.quantities import KNOT, Quantity
from airrace.report.flight_contents import READINGS, contents_of, started
from airrace.report.page import Page
from airrace.report.sections import DASH, Cell, Head, TableRow, note, number, section, table
from airrace.results import Flight, laps_of
from airrace.results.clearances import near_misses
from airrace.results.comparison import Comparison, LegComparison, compare_flights, conditions
from airrace.results.leg_facts import LegFacts, Range, leg_facts
from airrace.trajectory import Trajectory
from airrace.views.map_model import map_model
from airrace.views.plan_svg import plan_svg

FLIGHTS = (
    Head("flight", text=True),
    Head("aircraft", text=True),
    Head("race time", "s"),
    Head("difference", "s"),
    Head("state", text=True),
)
LEGS = (
    Head("to", text=True),
    Head("at", "s"),
    Head("leg", "s"),
    Head("indicated", "kt"),
    Head("over ground", "kt"),
    Head("load factor", "g"),
    Head("height", "m"),
    Head("roll rate", "°/s, most"),
    Head("energy height", "m, at the end"),
    Head("nearest", "m"),
    Head("required", "m"),
    Head("to what", text=True),
)
LOST = (
    Head("leg to", text=True),
    Head("lost", "s"),
    Head("in all", "s"),
    Head("by the way", "s"),
    Head("by speed", "s"),
    Head("what it flies otherwise", text=True),
)


def flights_section(flights: Sequence[Flight]) -> str:
    """Return a table of all flights with their race times; empty where there is only one."""
    if len(flights) < 2:
        return ""
    first = flights[0]
    rows = [
        TableRow((
            Cell(flight.label, flight=place),
            flight.aircraft.name,
            number(flight.race_time, 3),
            "" if flight is first else number(flight.race_time - first.race_time, 3, signed=True),
            flight.source.verdict or "recorded",
        ))
        for place, flight in enumerate(flights)
    ]  # fmt: skip
    told = "The first flight is the one that the page is about; the others fly beside it on the same clock."
    return section("Flights", table(FLIGHTS, rows) + note(told))


def legs_section(flight: Flight) -> str:
    """Return a table of what a flight does leg by leg, and of what it comes near to."""
    rows = [TableRow(_leg(flight, facts), passing=i) for i, facts in enumerate(leg_facts(flight))]
    return section("Legs", table(LEGS, rows) + note(" ".join(filter(None, (_laps(flight), _near_misses(flight))))))


def comparison_section(comparison: Comparison) -> str:
    """Return a table of the legs on which another flight loses its time, and of what it flies otherwise there."""
    label = comparison.other.label
    rows = [TableRow(_lost(leg, comparison)) for leg in comparison.by_loss]
    others = [
        f"{what[:1].upper()}{what[1:]}: {its} against {mine}."
        for what, mine, its in conditions(comparison.reference, comparison.other)
    ]
    told = f"Positive where it is slower than {comparison.reference.label}; the legs on which it loses most come first."
    return section(f"Where {label} loses and wins", table(LOST, rows) + note(" ".join((told, *others))))


def _leg(flight: Flight, facts: LegFacts) -> tuple[Cell | str, ...]:
    leg, begin = facts.leg, started(flight)
    nearest = facts.clearances[0] if facts.clearances else None
    return (
        Cell(leg.name, time=leg.before.time - begin) if leg.before.found else leg.name,
        number(leg.after.time - begin, 3),
        number(leg.time, 3),
        _span(facts.V_I, KNOT, 0),
        _span(facts.V_K, KNOT, 0),
        _span(facts.n_z, 1.0, 1),
        _span(facts.height, 1.0, 0),
        number(math.degrees(facts.roll_rate), 0),
        number(facts.energy_out, 0),
        DASH if nearest is None else number(nearest.distance, 1),
        DASH if nearest is None else number(nearest.required, 1),
        "" if nearest is None else nearest.text,
    )


def _lost(leg: LegComparison, comparison: Comparison) -> tuple[Cell | str, ...]:
    before = leg.reference.before
    otherwise = ", ".join(one.text for one in leg.differences)
    return (
        Cell(leg.name, time=before.time - started(comparison.reference)) if before.found else leg.name,
        "a tie" if leg.tie else number(leg.difference, 3, signed=True),
        number(leg.cumulative, 3, signed=True),
        number(leg.by_way, 3, signed=True),
        number(leg.by_speed, 3, signed=True),
        otherwise,
    )


def _span(values: Range, unit: float, digits: int) -> str:
    """Return a range as a text, from the least to the greatest value; a dash where nothing is known."""
    least, greatest = number(values.least / unit, digits), number(values.greatest / unit, digits)
    return least if least == greatest else f"{least} … {greatest}"


def _near_misses(flight: Flight) -> str:
    """Return a sentence about the pylons that the wing passes closely; empty where there are none."""
    misses = [
        f"{one.clearance.name} ({number(one.clearance.distance, 2)} m, {one.where})" for one in near_misses(flight)
    ]
    return f"The wing passes pylons closer than their own passing allows: {'; '.join(misses)}." if misses else ""


def _laps(flight: Flight) -> str:
    laps = laps_of(flight)
    if len(laps) < 2:
        return ""
    return "Laps: " + ", ".join(f"{lap.number} in {number(lap.time, 3)} s" for lap in laps) + "."


def flight_page(flights: Sequence[Flight], sections: Sequence[str] = (), footer: str = "") -> Page:
    """Return the page about some flights.

    Args:
        flights: the first is what the page is about, the others fly beside it as its ghosts.
        sections: HTML of further sections, which stand below the legs; empty ones are left out.
        footer: plain text.

    Raises:
        UsageError: a flight is of a course with other passings.
    """
    first = flights[0]
    comparisons = [compare_flights(first, other) for other in flights[1:]]
    seen = map_model(first.race)
    return Page(
        title=first.course.name,
        subtitle=_subtitle(first),
        race_time=first.race_time,
        verdict=first.source.verdict or "recorded",
        good=not first.source.doubtful,
        readings=[one for one in READINGS if one.history in first],
        plan=plan_svg(seen, _ground_track(first)),
        sections=[one for one in (*_flight_sections(flights, comparisons), *sections) if one],
        footer=footer,
        contents=contents_of(flights, comparisons, seen),
    )


def _flight_sections(flights: Sequence[Flight], comparisons: Sequence[Comparison]) -> list[str]:
    return [flights_section(flights), legs_section(flights[0]), *(comparison_section(one) for one in comparisons)]


def _subtitle(flight: Flight) -> str:
    """Return a line that says which aircraft flies, at which stage, and in which wind."""
    wind = flight.air.wind
    blowing = "calm air"
    if wind is not None and wind.speed > 0.0:
        blowing = f"wind {wind.speed / KNOT:.0f} kt from {round(math.degrees(wind.origin)) % 360:03d}°"
    return ", ".join(text for text in (flight.aircraft.name, flight.source.stage, blowing) if text)


def _ground_track(flight: Flight) -> Trajectory:
    """Return as much of a flight as the drawing from above needs, as one phase."""
    shown = (Quantity("x", "m"), Quantity("y", "m"), Quantity("V_K", "m/s"))
    last = len(flight.time) - 1
    return Trajectory(
        phases=(flight.label,),
        first_node=np.array([0, last]),
        durations=np.array([flight.time[-1] - flight.time[0]]),
        time=flight.time,
        states=shown,
        state=np.stack([flight[one.name] for one in shown]),
        controls=(),
        control=np.zeros((0, last)),
    )
