"""The flights as the script of a report is told of them."""

from collections.abc import Mapping, Sequence

from airrace.report.contents import Contents, FlightContents
from airrace.report.course_contents import course_contents
from airrace.report.differences import difference_of, started
from airrace.report.shown import colours_of, histories_shown, strips_of
from airrace.results import Flight
from airrace.results.comparison import Comparison
from airrace.results.glossary import BODY_ATTITUDE
from airrace.views.map_model import MapModel


def contents_of(flights: Sequence[Flight], comparisons: Sequence[Comparison], seen: MapModel) -> Contents:
    """Return all that the script is told of some flights.

    Args:
        flights: the first is what the page is about, the others are its ghosts.
        comparisons: of the others with the first, in their order.
        seen: the course of the first from above.
    """
    first = flights[0]
    return Contents(
        course=course_contents(seen, places_passed(first)),
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
