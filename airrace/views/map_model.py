"""The scenery of a course from above: ways, gates, pylons, people, lines. All pictures of it are drawn from this."""

import itertools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airrace.planning.legs import PLANNED_MAX, place
from airrace.planning.race import Race
from airrace.records import record
from airrace.results.flight import Flight
from airrace.results.legs import legs_of
from airrace.results.planned import is_planned, planned_flight
from airrace.track.course import Course, Direction, Passage, SafetyLine
from airrace.track.element import Element
from airrace.trajectory import Array

SAMPLE = 10.0
"""The distance between the points of a planned way, m."""
LEAST_EXTENT = 200.0
"""The extent of a course that stands on one spot, m."""
BEYOND = 0.4
"""The share of the course's extent in which people and borders beside it are still shown."""


@record
class Mark:
    """An element at its place on the ground.

    Attributes:
        label: its name; empty where another mark on the same spot carries it.
        passings: the number of each, counted over the race from 0, the start, and the course through the element (rad;
            None where it has none).
    """

    label: str
    element: Element
    north: float
    east: float
    passings: tuple[tuple[int, float | None], ...]

    @property
    def headings(self) -> list[float]:
        """The different courses through the element, rad."""
        courses = {round(heading, 9): heading for _, heading in self.passings if heading is not None}
        return list(courses.values())


@record
class Way:
    """A part of a lap: north and east, shape (n, 2), m; either `planned` or straight from place to place."""

    lap: int
    line: Array
    planned: bool


@record
class MapModel:
    """A course from above, and the frame to show: least and largest north and east, m."""

    course: Course
    marks: tuple[Mark, ...]
    ways: tuple[Way, ...]
    lines: tuple[SafetyLine, ...]
    south: float
    north: float
    west: float
    east: float


def map_model(race: Race, planned: Flight | None = None) -> MapModel:
    """Return all there is to see of a course.

    Ways are those of the planned flight, before anything is optimised, on very long courses straight.

    Args:
        race: whose course it is.
        planned: of `planned_flight`, where it is at hand.
    """
    course = race.course
    marks = _marks(course)
    long = len(course.passages) > PLANNED_MAX
    ways = _straight(course) if long else _planned(planned_flight(race) if planned is None else planned)
    lines = {line.name: line for passage in course.passages for line in passage.safety_lines}
    south, north, west, east = _frame(course, marks, ways, tuple(lines.values()))
    return MapModel(course, marks, ways, tuple(lines.values()), south, north, west, east)


def _marks(course: Course) -> tuple[Mark, ...]:
    """Return one mark per element that has a place, in the order first flown."""
    marks: dict[str, Mark] = {}
    for number, passage in enumerate(course.passages):
        name, where = passage.element.name, place(passage)
        if where is None:
            continue
        if name not in marks:
            marks[name] = Mark(_label(name), passage.element, where[0], where[1], ())
        marks[name] = replace(marks[name], passings=(*marks[name].passings, (number, _heading(passage))))
    return tuple(marks.values())


def _label(name: str) -> str:
    """Return the name at a mark; of the two gates of a quad the first carries its name."""
    quad, slash, number = name.rpartition("/")
    if not slash or number not in ("1", "2"):
        return name
    return quad if number == "1" else ""


def _heading(passage: Passage) -> float | None:
    """Return the course through an element, rad; of a gate still to be planned, its axis."""
    reverse = passage.direction is Direction.REVERSE
    return passage.element.course(Direction.REVERSE if reverse else Direction.FORWARD)


def _planned(flight: Flight) -> tuple[Way, ...]:
    """Return the ways of a planned flight, leg by leg; where it is straight, from one known place to the next."""
    ways: list[Way] = []
    before: list[NDArray[np.int64]] = []
    for leg in legs_of(flight):
        planned = is_planned(flight, leg.rows)
        if not planned and leg.after.passage.element.place is None:
            before.append(leg.rows)
            continue
        rows = np.unique(np.concatenate([*before, leg.rows]))
        before = []
        line = np.stack([flight["x"][rows], flight["y"][rows]], axis=1)
        if np.isfinite(line).all():
            ways.append(Way(leg.lap, _thinned(line) if planned else line[[0, -1]], planned))
    return tuple(ways)


def _thinned(line: Array) -> Array:
    """Return about every tenth metre of a line, and both of its ends."""
    count = max(2, 2 + int(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() / SAMPLE))
    return line[np.unique(np.linspace(0, len(line) - 1, count).round().astype(np.int64))]


def _straight(course: Course) -> tuple[Way, ...]:
    """Return straight ways from place to place, a lap at a time."""
    ways: list[Way] = []
    last: list[tuple[float, float]] = []
    for lap, passages in itertools.groupby(course.passages, key=lambda passage: passage.lap):
        places = [where[:2] for passage in passages if (where := place(passage)) is not None]
        if len(last + places) > 1:
            ways.append(Way(lap, np.array(last + places), planned=False))
        last = (last + places)[-1:]
    return tuple(ways)


def _frame(
    course: Course, marks: tuple[Mark, ...], ways: tuple[Way, ...], lines: tuple[SafetyLine, ...]
) -> tuple[float, float, float, float]:
    """Return the frame of the course, with what lies beside it as long as that does not dwarf it."""
    flown = [*(np.array([[mark.north, mark.east]]) for mark in marks), *(way.line for way in ways)]
    points = np.concatenate(flown) if flown else np.zeros((1, 2))
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    extent = max(float(np.ptp(points, axis=0).max()), LEAST_EXTENT)
    least = np.minimum(points.min(axis=0), middle - 0.5 * LEAST_EXTENT)
    largest = np.maximum(points.max(axis=0), middle + 0.5 * LEAST_EXTENT)
    beside = [*course.airspace, *(end for line in lines for end in (line.start, line.end))]
    beside += [corner for crowd in course.crowd for corner in crowd.corners]
    if beside:
        corners = np.array([[corner.north, corner.east] for corner in beside])
        least = np.clip(corners.min(axis=0), least - BEYOND * extent, least)
        largest = np.clip(corners.max(axis=0), largest, largest + BEYOND * extent)
    return float(least[0]), float(largest[0]), float(least[1]), float(largest[1])


def round_length(metres: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(metres))
    return max(one * power for one in (1.0, 2.0, 5.0) if one * power <= metres)
