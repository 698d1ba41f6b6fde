"""Flights as the script of a report reads them: histories, strips, colours and differences."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from airrace.quantities import KNOT
from airrace.records import record
from airrace.report.contents import Contents, FlightContents, Scale, Strip, TimeDifference, course_contents
from airrace.report.page import Reading
from airrace.results import Flight
from airrace.results.comparison import SHARES, Comparison
from airrace.results.flight import BODY_ATTITUDE
from airrace.results.legs import Leg, way
from airrace.trajectory import Array
from airrace.views.map_model import MapModel

DEGREE = math.pi / 180.0


@record
class Drawn:
    """A strip as it is planned: histories of a flight with their unit, `factor` in SI units or radians.

    Attributes:
        lines: name of a history and what it is called, the main one first.
        limited: those of them whose limits are drawn.
        digits, wraps, least: as of `airrace.report.contents.Strip`, in the unit.
    """

    title: str
    unit: str
    factor: float
    lines: tuple[tuple[str, str], ...]
    limited: tuple[str, ...] = ()
    digits: int = 0
    wraps: float | None = None
    least: float = 1.0


STRIPS = (
    Drawn("Speed", "kt", KNOT, (("V_I", "indicated"), ("V_A", "true"), ("V_K", "over ground")), ("V_K",), least=5.0),
    Drawn("Height", "m", 1.0, (("height", "above the origin"),), ("height",), least=5.0),
    Drawn("Load factor", "g", 1.0, (("n_z", "up"), ("n_y", "sideways")), ("n_z",), digits=1),
    Drawn("Bank", "°", DEGREE, (("mu", "right wing down"),), wraps=360.0),
    Drawn("Roll rate", "°/s", DEGREE, (("p_Kbar", "to the right"),), ("p_Kbar",), least=10.0),
    Drawn("Climb", "°", DEGREE, (("gamma", "upwards"),), least=5.0),
    Drawn("Angles", "°", DEGREE, (("alpha_A", "attack"), ("beta_A", "sideslip")), ("alpha_A", "beta_A"), digits=1),
    Drawn(
        "Surfaces",
        "°",
        DEGREE,
        (("eta", "elevator"), ("xi", "ailerons"), ("zeta", "rudder")),
        ("eta", "xi", "zeta"),
        digits=1,
    ),
    Drawn("Power lever", "%", 0.01, (("delta_T", "power"),), least=5.0),
    Drawn("Energy height", "m", 1.0, (("h_E", "above the origin"),), least=5.0),
)
"""The strips of a report, from top to bottom."""

COLOURS = (
    Scale("Load factor", "n_z", "g", 1),
    Scale("Speed", "V_I", "kt", 0),
    Scale("Roll rate", "p_Kbar", "°/s", 0, signed=True),
    Scale("Energy height", "h_E", "m", 0),
)
READINGS = (
    Reading("Indicated", "V_I", "kt"),
    Reading("Height", "height", "m"),
    Reading("Load factor", "n_z", "g", 1),
    Reading("Bank", "mu", "°", 0, 360.0),
    Reading("Roll rate", "p_Kbar", "°/s"),
    Reading("Climb", "gamma", "°"),
)


def histories_shown(flight: Flight) -> dict[str, Array]:
    """Return all histories that a report shows of a flight, by name, in the units in which they are shown."""
    return {
        name: flight[name] / drawn.factor for drawn in STRIPS for name, _ in drawn.lines if name in flight
    }  # fmt: skip


def strips_of(flights: Sequence[Flight]) -> list[Strip]:
    """Return the strips of which some flight knows something; limits are those of the first flight."""
    return [_strip(drawn, flights[0]) for drawn in STRIPS if any(_known(drawn, flight) for flight in flights)]


def colours_of(flight: Flight) -> list[Scale]:
    """Return the scales by which the line of a flight can be coloured."""
    return [scale for scale in COLOURS if scale.history in flight]


def _known(drawn: Drawn, flight: Flight) -> bool:
    return any(name in flight for name, _ in drawn.lines)


def _strip(drawn: Drawn, flight: Flight) -> Strip:
    return Strip(
        title=drawn.title,
        unit=drawn.unit,
        digits=drawn.digits,
        lines=drawn.lines,
        limits=_limits(drawn, flight),
        wraps=drawn.wraps,
        least=drawn.least,
    )


def _limits(drawn: Drawn, flight: Flight) -> list[tuple[float, str]]:
    """Return the bounds that are finite, each once."""
    bounds: dict[float, str] = {}
    for name in drawn.limited:
        allowed = flight.limit(name)
        for value, what in ((allowed.lower, "at least"), (allowed.upper, "at most")):
            if math.isfinite(value):
                bounds.setdefault(round(value / drawn.factor, 6), what)
    return list(bounds.items())


def started(flight: Flight) -> float:
    """Return when the clock of a flight starts, s: at its first passing, or where that is missing at its first time."""
    found = flight.crossings and flight.crossings[0].found
    return flight.crossings[0].time if found else float(flight.time[0])


def difference_of(comparison: Comparison, number: int) -> TimeDifference:
    """Return what the other flight has lost along the course, and when the reference was there.

    Args:
        comparison: of two flights.
        number: of the other flight.
    """
    reference = comparison.reference
    times = [np.array([reference.crossings[0].time]), *(_times(reference, leg.reference) for leg in comparison.legs)]
    time, lost = np.concatenate(times), comparison.progress.difference
    known = np.isfinite(time)
    return TimeDifference(number, time[known] - started(reference), lost[known])


def _times(flight: Flight, leg: Leg) -> Array:
    """Return when the shares of a leg were flown, its beginning left out, s; NaN where the leg was not flown."""
    if not leg.flown:
        return np.full(len(SHARES) - 1, np.nan)
    flown = way(flight, leg)
    return np.interp(SHARES[1:], flown / flown[-1], flight.time[leg.rows])


def contents_of(flights: Sequence[Flight], comparisons: Sequence[Comparison], map_: MapModel) -> Contents:
    """Return all that the script is told of some flights.

    Args:
        flights: the first is what the page is about, the others are its ghosts.
        comparisons: of the others with the first, in their order.
        map_: the race of the first from above.
    """
    first = flights[0]
    return Contents(
        course=course_contents(map_, places_passed(first)),
        flights=[flight_contents(*one) for one in zip(flights, short_labels(flights), strict=True)],
        strips=strips_of(flights),
        colours=colours_of(first),
        differences=[difference_of(one, number) for number, one in enumerate(comparisons, start=1)],
    )


def short_labels(flights: Sequence[Flight]) -> list[str]:
    """Return labels without what they all begin with, up to a colon: stages alone, where all flights are of one run."""
    files = {flight.label.rpartition(":")[0] for flight in flights}
    return [flight.label.rpartition(":")[2] if len(files) == 1 else flight.label for flight in flights]


def flight_contents(flight: Flight, label: str) -> FlightContents:
    """Return the contents of one flight under a label, with its clock beginning at its first passing."""
    begin = started(flight)
    pose = {"north": flight["x"], "east": flight["y"], "height": flight["height"]}
    attitude = {f"q{i}": flight[name] for i, name in enumerate(BODY_ATTITUDE)}
    return FlightContents(
        label=label,
        aircraft=flight.aircraft.name,
        span=flight.aircraft.airframe.b,
        race_time=flight.race_time,
        passings=[(one.name, one.time - begin) for one in flight.crossings if one.found],
        time=flight.time - begin,
        histories={**pose, **attitude, **histories_shown(flight)},
    )


def places_passed(flight: Flight) -> Mapping[str, tuple[float, float, float]]:
    """Return where elements were passed first: north, east, height (m), by their names."""
    places: dict[str, tuple[float, float, float]] = {}
    for one in flight.crossings:
        if one.found:
            places.setdefault(one.passage.element.name, (one.value("x"), one.value("y"), one.value("height")))
    return places
