"""The tables of a footprint: the longest falls, and how near to people impacts and glides come."""

import math

from airrace.environment.atmosphere import StaticWind
from airrace.quantities import KNOT
from airrace.results import Flight
from airrace.results.flight import passings_around
from airrace.safety.footprint import NOT_AN_AUTHORITYS, Footprint
from airrace.views.tables import Column, Table

_FALLS = (
    *(Column("free fall"), Column("way", "m", ".0f"), Column("from", "s", ".2f"), Column("speed", "kt", ".0f")),
    *(Column("height", "m", ".0f"), Column("leg", wraps=True)),
)
_FALL_NAMES = {"vacuum": "in vacuum", "drag": "with drag", "level": "V sqrt(2h/g)"}
_PEOPLE = (
    *(Column("people", wraps=True), Column("rule", "m", ".0f"), Column("least", "m", ".0f")),
    *(Column("from", "s", ".2f"), Column("leg", wraps=True), Column("hit", "s", ".2f")),
    *(Column("area", "m2", ".0f"), Column("glide", "s", ".1f"), Column("turn", "s", ".1f")),
)
_HOW_TO_READ = (
    "least: distance of the nearest impact, half the span taken off. hit: for how long a fall that begins meanwhile "
    "hits people; area: of theirs under the footprint. glide: for how long a glide straight on leads over them; turn: "
    "for how long they lie within reach of a glide behind a turn."
)
NO_PEOPLE = "the course names no people (key `crowd`): no distance from them was measured"


def falls_table(found: Footprint, flight: Flight) -> Table:
    """Return the longest way over ground of every kind of fall."""
    rows: list[tuple[str | float, ...]] = []
    for key, way in found.lengths.items():
        row = int(way.argmax())
        state = (float(found.states.speed[row]) / KNOT, float(found.states.place[row, 2]))
        rows.append(
            (_FALL_NAMES[key], float(way[row]), float(found.time[row]), *state, leg_at(flight, found.time[row]))
        )
    return Table(f"{flight.label}: the longest ways over ground", _FALLS, rows)


def people_table(found: Footprint, flight: Flight) -> Table:
    """Return how near to people impacts and glides come; no row, and a note that says so, where there are none."""
    rows = [
        (
            *(one.crowd.name, one.crowd.distance, one.distance, one.time, leg_at(flight, one.time)),
            *(one.seconds, one.overlap, one.straight_seconds, one.turned_seconds),
        )
        for one in found.crowds
    ]
    return Table("impacts and people", _PEOPLE, rows, [_HOW_TO_READ if rows else NO_PEOPLE])


def facts(found: Footprint, flight: Flight) -> list[str]:
    """Return the numbers that a footprint rests on, and what it is not, a sentence each."""
    shortest, longest = found.reach.distance.min(), found.reach.distance.max()
    glide = f"without power: {found.glide.ratio:.1f} to 1 at {found.glide.speed / KNOT:.0f} kt ({found.glide_source})"
    return [
        f"{glide}, {shortest:.0f} to {longest:.0f} m straight on",
        f"drag area: {found.drag_area:.3g} m2 ({found.drag_source})",
        f"ground: flat, at the height of the course's origin; {wind_text(flight.air.wind)}",
        NOT_AN_AUTHORITYS,
    ]


def wind_text(wind: StaticWind | None) -> str:
    """Return a wind in words."""
    if wind is None or wind.speed == 0.0:
        return "still air"
    return f"wind {wind.speed / KNOT:.0f} kt from {math.degrees(wind.origin) % 360.0:.0f} degrees"


def leg_at(flight: Flight, time: float) -> str:
    """Return the leg on which a time lies, e.g. `1:g3 -> 1:g4`; empty where a passing is missing or none is near."""
    if not all(one.found for one in flight.crossings) or not math.isfinite(time):
        return ""
    before, after = passings_around(flight, time)
    return f"{before.name} -> {after.name}"
