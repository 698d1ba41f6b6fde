"""The clearance of a flight from what it must keep away from: pylons, people, lines, borders, floor and ceiling.

A pylon is an upright of `PYLON_HEIGHT`; the distance is that of the wing, from tip to tip, seen from above, and above
its top the height is counted as well. All other distances are those of the aircraft's centre, as the rules measure it.
Where a flight knows no height, the slant distance from people is that over ground, and nothing is told of pylons.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from airrace.planning.clearances import beside_border, beside_line, ground_distance
from airrace.records import record
from airrace.results.attitude import path_axes
from airrace.results.flight import Flight
from airrace.results.glossary import BODY_ATTITUDE
from airrace.results.legs import Leg, legs_of
from airrace.track.element import Element
from airrace.track.limits import Crowd, SafetyLine
from airrace.track.passing import Passing, Tolerant
from airrace.track.polygons import Point
from airrace.trajectory import Array

PYLON_HEIGHT = 25.0
"""The height of the air-filled pylons of the races from 2014 to 2019, m."""


@record
class Clearance:
    """The least distance from one thing on one leg.

    Attributes:
        kind: `pylon`, `crowd`, `safety line`, `airspace`, `floor` or `ceiling`.
        name: of the thing; empty where there is but one of its kind.
        distance: m; negative beyond a line or a border.
        required: the least distance that the rules ask for, m.
        time: when, s after the start.
        north, east, height: where the aircraft is then, m.
    """

    kind: str
    name: str
    distance: float
    required: float
    time: float
    north: float
    east: float
    height: float

    @property
    def margin(self) -> float:
        """The distance that is left beyond the required one, m; negative where that is not kept."""
        return self.distance - self.required

    @property
    def text(self) -> str:
        """The thing from which the distance is measured, e.g. `pylon g3`."""
        return f"{self.kind} {self.name}".rstrip()


@record
class Distance:
    """The distance from one thing all along a flight, m, shape (n,); NaN where the flight does not tell.

    `legs` are the numbers of the legs on which it has to be kept; None for all.
    """

    kind: str
    name: str
    required: float
    values: Array
    legs: frozenset[int] | None = None


def distances(flight: Flight) -> tuple[Distance, ...]:
    """Return the distances from everything that the course names; empty where the flight does not tell its position."""
    if not flight.has("x", "y", "height"):
        return ()
    return (*pylons(flight), *surroundings(flight))


def surroundings(flight: Flight) -> Iterator[Distance]:
    """Yield the distances from people, safety lines, the border of the airspace, floor and ceiling.

    Args:
        flight: one that tells its position.
    """
    yield from _crowds(flight)
    yield from _lines(flight)
    yield from _borders(flight)


def least(flight: Flight, leg: Leg, known: Sequence[Distance]) -> tuple[Clearance, ...]:
    """Return the least distance from every thing that counts on a leg, that with the least margin first.

    Args:
        flight: whose leg it is.
        leg: a leg that was flown.
        known: what `distances` says of the flight.
    """
    found = [_least(flight, one, leg.rows) for one in known if one.legs is None or leg.number in one.legs]
    return tuple(sorted((one for one in found if one is not None), key=lambda one: one.margin))


def least_of_all(flight: Flight, known: Iterable[Distance]) -> tuple[Clearance, ...]:
    """Return the least distance from every thing on all legs together, in the order of `known`.

    Args:
        flight: all of whose passings are made.
        known: distances of the flight, e.g. `distances`.
    """
    legs = legs_of(flight)
    found = (
        _least(flight, one, np.concatenate([leg.rows for leg in legs if one.legs is None or leg.number in one.legs]))
        for one in known
    )
    return tuple(one for one in found if one is not None)


def at_row(flight: Flight, one: Distance, row: int) -> Clearance:
    """Return the distance at one time of a flight."""
    north, east, height = (float(flight[name][row]) for name in ("x", "y", "height"))
    away, time = float(one.values[row]), float(flight.time[row])
    return Clearance(one.kind, one.name, away, one.required, time, north, east, height)


def _least(flight: Flight, one: Distance, rows: NDArray[np.int64]) -> Clearance | None:
    """Return the least distance at some times; None where the flight tells none of them."""
    known = rows[np.isfinite(one.values[rows])]
    return at_row(flight, one, int(known[int(np.argmin(one.values[known]))])) if len(known) else None


def pylons(flight: Flight) -> Iterator[Distance]:
    """Yield the distance of the wing from the pylons of every element, in the order first flown; none where the flight
    tells its height nowhere.
    """
    elements: dict[str, Element] = {one.element.name: one.element for one in flight.course.passages}
    posts = [(element, post) for element in elements.values() for post in element.drawing().posts]
    if not posts or not np.isfinite(flight["height"]).any():
        return
    left, right = _wing_tips(flight)
    over = np.maximum(np.minimum(left[2], right[2]) - PYLON_HEIGHT, 0.0)
    for name, element in elements.items():
        away = [_from_wing(left, right, post) for one, post in posts if one is element]
        if away:
            yield Distance("pylon", name, _required(element), np.hypot(np.minimum.reduce(away), over))


def _required(element: Element) -> float:
    if isinstance(element, Tolerant) and element.passing is Passing.WINDOW:
        return element.tolerances.clearance
    return 0.0


def _wing_tips(flight: Flight) -> tuple[Array, Array]:
    """Return north, east and height of the left and of the right wing tip, each of shape (3, n), m; without an attitude
    those of the centre."""
    centre = np.stack([flight["x"], flight["y"], flight["height"]])
    if not flight.has(*BODY_ATTITUDE):
        return centre, centre
    wing = path_axes([flight[name] for name in BODY_ATTITUDE])[:, 1] * np.array([[1.0], [1.0], [-1.0]])
    half = 0.5 * flight.aircraft.airframe.b * wing
    return centre - half, centre + half


def _from_wing(left: Array, right: Array, post: Point) -> Array:
    """Return the distance of an upright from the wing, seen from above, m, shape (n,)."""
    place = np.array([[post.north], [post.east]])
    along = right[:2] - left[:2]
    squared = np.sum(along**2, axis=0)
    share = np.sum((place - left[:2]) * along, axis=0) / np.where(squared > 0.0, squared, 1.0)
    foot = left[:2] + np.clip(share, 0.0, 1.0) * along
    return np.hypot(*(place - foot))


def _crowds(flight: Flight) -> Iterator[Distance]:
    for crowd in flight.course.crowd:
        yield Distance("crowd", crowd.name, crowd.distance, _from_crowd(flight, crowd))


def _from_crowd(flight: Flight, crowd: Crowd) -> Array:
    ground = ground_distance(np.stack([flight["x"], flight["y"]], axis=1), crowd)
    if not crowd.slant:
        return ground
    above = flight["height"] - crowd.height
    return np.hypot(ground, np.where(np.isnan(above), 0.0, above))


def _lines(flight: Flight) -> Iterator[Distance]:
    """Yield the distance from every safety line, which counts on the legs that name it."""
    places = np.stack([flight["x"], flight["y"]], axis=1)
    legs: dict[str, set[int]] = {}
    lines: dict[str, SafetyLine] = {}
    for number, passage in enumerate(flight.course.passages[1:], start=1):
        for line in passage.safety_lines:
            lines[line.name] = line
            legs.setdefault(line.name, set()).add(number)
    for name, line in lines.items():
        yield Distance("safety line", name, line.margin, beside_line(places, line), frozenset(legs[name]))


def _borders(flight: Flight) -> Iterator[Distance]:
    course, height = flight.course, flight["height"]
    if course.airspace:
        places = np.stack([flight["x"], flight["y"]], axis=1)
        yield Distance("airspace", "", 0.0, beside_border(places, course.airspace))
    bounds: tuple[tuple[str, float, Callable[[float], Array]], ...] = (
        ("floor", course.rules.height.lower, lambda bound: height - bound),
        ("ceiling", course.rules.height.upper, lambda bound: bound - height),
    )
    for kind, bound, values in bounds:
        if np.isfinite(bound):
            yield Distance(kind, "", 0.0, values(bound))
