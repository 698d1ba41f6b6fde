"""The conditions in which two flights differ before anyone flies: stage, aircraft, air, rules, people, lines, gates."""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

from airrace.environment.air import Air
from airrace.quantities import KNOT, Interval
from airrace.results.flight import Flight
from airrace.track.course import Course, Rules
from airrace.track.limits import Crowd, SafetyLine


def _safety_lines(course: Course) -> tuple[SafetyLine, ...]:
    return tuple(dict.fromkeys(line for passage in course.passages for line in passage.safety_lines))


SURROUNDINGS: Mapping[str, Callable[[Course], Sequence[SafetyLine | Crowd]]] = {
    "safety lines": _safety_lines,
    "people": lambda course: course.crowd,
}
"""The things that a flight keeps away from, by the words for them."""
NAMED = 3
"""The greatest number of gates that are named as standing elsewhere."""


def conditions(reference: Flight, other: Flight) -> Iterator[tuple[str, str, str]]:
    """Yield every condition that differs: what it is, and how it is in the one flight and in the other, in words."""
    if reference.source.stage != other.source.stage:
        yield "stage", reference.source.stage or "as flown", other.source.stage or "as flown"
    if reference.aircraft != other.aircraft:
        first, second = reference.aircraft.name, other.aircraft.name
        yield ("aircraft", first, second) if first != second else ("aircraft", first, f"{second} with other numbers")
    if reference.air.wind != other.air.wind:
        yield "wind", _wind(reference.air), _wind(other.air)
    if dataclasses.replace(reference.air, wind=None) != dataclasses.replace(other.air, wind=None):
        yield "air of the day", _day(reference.air), _day(other.air)
    for field in dataclasses.fields(Rules):
        first, second = (getattr(flight.course.rules, field.name) for flight in (reference, other))
        if first != second:
            yield f"rules: {field.name}", _allowed(first), _allowed(second)
    for what, named in SURROUNDINGS.items():
        first, second = (named(flight.course) for flight in (reference, other))
        if first != second:
            names = [", ".join(one.name for one in some) or "none" for some in (first, second)]
            yield what, names[0], names[1] if names[0] != names[1] else f"{names[1]} otherwise"
    if moved := _moved(reference, other):
        yield "gates", "as in its course", f"otherwise: {moved}"


def _moved(reference: Flight, other: Flight) -> str:
    pairs = zip(reference.course.passages, other.course.passages, strict=True)
    names = dict.fromkeys(mine.element.name for mine, its in pairs if mine.element != its.element)
    return ", ".join([*list(names)[:NAMED], *(["..."] if len(names) > NAMED else [])])


def _wind(air: Air) -> str:
    if air.wind is None:
        return "none"
    return f"{air.wind.speed / KNOT:.0f} kt from {math.degrees(air.wind.origin) % 360.0:.0f} deg"


def _day(air: Air) -> str:
    thermals = f", {len(air.thermals)} thermals" if air.thermals else ""
    return f"{air.temperature_offset:+.1f} K and {air.pressure_offset / 100.0:+.1f} hPa from the standard{thermals}"


def _allowed(value: Interval | float) -> str:
    if isinstance(value, Interval):
        return f"{value.lower:g} to {value.upper:g}"
    return f"{value:g}"
