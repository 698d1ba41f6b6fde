"""The map from which all pictures of a course are drawn: gates, pylons, people, lines, borders, wind, coloured tracks.

Places are north and east of the track's origin, m.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from airrace.flights.results.comparison import Comparison
from airrace.flights.results.flight import Flight, legs_of
from airrace.flights.results.planned import is_planned, planned_flight
from airrace.flights.results.time_loss import loss_along
from airrace.model.environment import StaticWind
from airrace.model.track.course import Course, Crowd, Direction, Obstacle, SafetyLine
from airrace.model.track.element import Element
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.tables import RACE, Units
from airrace.procedure.planning.route_decisions import PLANNED_MAX, place
from airrace.race import Race

LEAST_EXTENT = 200.0
"""The extent of a course that stands on one spot, m."""
MAST = 3.0
"""The radius of a mast in a picture, m."""
BEYOND = 0.4
"""The share of the course's extent in which people and borders beside it are still shown."""


def coordinates(points: Iterable[Point]) -> Array:
    """Return north and east of some points, shape (n, 2), m."""
    return np.array([[point.north, point.east] for point in points])


@dataclass(frozen=True)
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

    @property
    def stroke(self) -> Array | None:
        """The ends of a stroke across the way through it, shape (2, 2), m; None for what is drawn as a dot."""
        across = self.element.drawing().across
        return None if across is None else coordinates(across)


@dataclass(frozen=True, eq=False)
class Way:
    """A track: north and east, shape (n, 2), m; of a flight or `planned`, or else straight from place to place."""

    lap: int
    line: Array
    planned: bool


@dataclass(frozen=True, eq=False)
class MapLine:
    """A safety line.

    Attributes:
        line: its name, its margin, m, and the side to keep to.
        ends: two points of it, shape (2, 2), m; it has no ends itself.
        along, forbidden: unit vectors from the first point to the second, and to the forbidden side, shape (2,).
        legs: the names of the elements on the way to which it holds.
    """

    line: SafetyLine
    ends: Array
    along: Array
    forbidden: Array
    legs: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class MapModel:
    """A race from above.

    Attributes:
        race: course, aircraft and air.
        marks: the elements that have a place, in the order of their first passings.
        ways: the tracks, in race order.
        lines: the safety lines.
        airspace: its border, closed, shape (n, 2), m; None where it has none.
        south, north, west, east: the frame to show, m.
    """

    race: Race
    marks: tuple[Mark, ...]
    ways: tuple[Way, ...]
    lines: tuple[MapLine, ...]
    airspace: Array | None
    south: float
    north: float
    west: float
    east: float

    @property
    def name(self) -> str:
        """The name of the course."""
        return self.race.course.name

    @property
    def crowd(self) -> tuple[Crowd, ...]:
        """Where people are."""
        return self.race.course.crowd

    @property
    def obstacles(self) -> list[tuple[Obstacle, Array]]:
        """The obstacles with their outlines, closed, shape (n, 2), m; that of a mast is drawn larger than it is."""
        return [(obstacle, _outline(obstacle)) for obstacle in self.race.course.obstacles]

    @property
    def wind(self) -> StaticWind | None:
        """The wind; None in calm air."""
        wind = self.race.air.wind
        return None if wind is None or wind.speed == 0.0 else wind

    def with_track(self, line: Array, *, dashed: bool = False) -> "MapModel":
        """Return the map with a flight track, shape (n, 2), m, in the place of the planned ones, within its frame."""
        (south, west), (north, east) = line.min(axis=0).tolist(), line.max(axis=0).tolist()
        return replace(
            self,
            ways=(Way(1, line, planned=not dashed),),
            south=min(south, self.south),
            north=max(north, self.north),
            west=min(west, self.west),
            east=max(east, self.east),
        )

    def with_ghost(self, line: Array) -> "MapModel":
        """Return the map with one more flight track, dashed, of the same shape."""
        return replace(self, ways=(*self.ways, Way(1, line, planned=False)))


def map_model(race: Race, planned: Flight | None = None) -> MapModel:
    """Return all there is to see of a race.

    Tracks are those of the planned flight, before anything is optimised, on very long courses straight.

    Args:
        race: course, aircraft and air.
        planned: of `planned_flight`, where it is at hand.
    """
    course = race.course
    marks = _marks(course)
    long = len(course.passages) > PLANNED_MAX
    ways = _straight_ways(course) if long else _planned_ways(planned_flight(race) if planned is None else planned)
    lines = tuple(_line(course, line) for line in course.safety_lines)
    airspace = coordinates((*course.airspace, course.airspace[0])) if course.airspace else None
    beside = [*(line.ends for line in lines), *(coordinates(crowd.corners) for crowd in course.crowd)]
    beside += [_outline(obstacle) for obstacle in course.obstacles]
    frame = _frame(marks, ways, beside if airspace is None else [*beside, airspace])
    return MapModel(race, marks, ways, lines, airspace, *frame)


def _outline(obstacle: Obstacle) -> Array:
    drawn_obstacle = obstacle if len(obstacle.outline) > 1 else replace(obstacle, radius=MAST)
    return coordinates((*drawn_obstacle.outline, drawn_obstacle.outline[0]))


def _line(course: Course, line: SafetyLine) -> MapLine:
    ends = coordinates((line.start, line.end))
    along = ends[1] - ends[0]
    along = along / np.hypot(*along)
    right = np.array([-along[1], along[0]])
    legs: dict[str, None] = {}  # in order, each once
    for passage in course.passages:
        if line.name in [safety_line.name for safety_line in passage.safety_lines]:
            legs[passage.element.name] = None
    return MapLine(line, ends, along, -right if line.keep_right else right, tuple(legs))


def _marks(course: Course) -> tuple[Mark, ...]:
    marks: dict[str, Mark] = {}
    for number, passage in enumerate(course.passages):
        name, where = passage.element.name, place(passage)
        if where is None:
            continue
        quad, slash, half = name.rpartition("/")  # of the two gates of a quad the first carries its name
        label = name if not slash or half not in ("1", "2") else quad if half == "1" else ""
        mark = marks.get(name) or Mark(label, passage.element, where[0], where[1], ())
        reverse = passage.direction is Direction.REVERSE  # a gate still to be planned has the course of its axis
        heading = passage.element.course(Direction.REVERSE if reverse else Direction.FORWARD)
        marks[name] = replace(mark, passings=(*mark.passings, (number, heading)))
    return tuple(marks.values())


def _planned_ways(flight: Flight) -> tuple[Way, ...]:
    """Return the ways of a planned flight, leg by leg; where it is straight, from one known place to the next."""
    ways: list[Way] = []
    before: list[NDArray[np.int64]] = []
    for leg in legs_of(flight):
        is_planned_leg = is_planned(flight, leg.rows)
        if not is_planned_leg and leg.after.passage.element.place is None:
            before.append(leg.rows)
            continue
        rows = np.unique(np.concatenate([*before, leg.rows]))
        before = []
        line = np.stack([flight["x"][rows], flight["y"][rows]], axis=1)
        if np.isfinite(line).all():
            # A point every 10 m.
            count = max(2, 2 + int(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() / 10.0))
            thinned = np.unique(np.linspace(0, len(line) - 1, count).round().astype(np.int64))
            ways.append(Way(leg.lap, line[thinned] if is_planned_leg else line[[0, -1]], is_planned_leg))
    return tuple(ways)


def _straight_ways(course: Course) -> tuple[Way, ...]:
    """Return straight ways from place to place, a lap at a time."""
    ways: list[Way] = []
    last: list[tuple[float, float]] = []
    for lap, passages in groupby(course.passages, key=lambda passage: passage.lap):
        places = [where[:2] for passage in passages if (where := place(passage)) is not None]
        if len(last + places) > 1:
            ways.append(Way(lap, np.array(last + places), planned=False))
        last = (last + places)[-1:]
    return tuple(ways)


def _frame(marks: Sequence[Mark], ways: Sequence[Way], beside: Sequence[Array]) -> tuple[float, float, float, float]:
    """Return south, north, west and east of a course, with what lies beside it as long as that does not dwarf it."""
    tracks = [*(np.array([[mark.north, mark.east]]) for mark in marks), *(way.line for way in ways)]
    points = np.concatenate(tracks) if tracks else np.zeros((1, 2))
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    extent = max(float(np.ptp(points, axis=0).max()), LEAST_EXTENT)
    least = np.minimum(points.min(axis=0), middle - 0.5 * LEAST_EXTENT)
    largest = np.maximum(points.max(axis=0), middle + 0.5 * LEAST_EXTENT)
    if beside:
        corners = np.concatenate(beside)
        least = np.clip(corners.min(axis=0), least - BEYOND * extent, least)
        largest = np.clip(corners.max(axis=0), largest, largest + BEYOND * extent)
    return float(least[0]), float(largest[0]), float(least[1]), float(largest[1])


def round_length(metres: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(metres))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= metres)


SPEED_COLOURS = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#d8c00f")
"""From slow to fast."""
LOSS_COLOURS = ("#08519c", "#4292c6", "#9ecae1", "#bdbdbd", "#fdae6b", "#f16913", "#a63603")
"""From winning to losing: blue and orange differ for all eyes, and are the darker, the more it is."""
LARGEST = 95.0
"""The percentile of the rates of loss that has the last colour."""
STILL = 2e-4
"""The rate of loss that has the last colour at least, s/m: 0.02 s in 100 m are within the noise of a log."""


@dataclass(frozen=True, eq=False)
class ColouredTrack:
    """A track with a value at each of its places.

    Attributes:
        line: north and east, m, shape (n, 2).
        values: shape (n,); NaN where nothing is known.
        least, greatest: the values that have the first and the last colour.
        colours: from the least value to the greatest.
        ends: both values in words.
    """

    line: Array
    values: Array
    least: float
    greatest: float
    colours: tuple[str, ...]
    ends: tuple[str, str]

    def pieces(self) -> Iterator[tuple[Array, str]]:
        """Yield the pieces of one colour each."""
        middle = 0.5 * (self.values[1:] + self.values[:-1])
        share = (np.nan_to_num(middle) - self.least) / max(self.greatest - self.least, 1e-9)
        number = np.clip((share * len(self.colours)).astype(np.int64), 0, len(self.colours) - 1)
        number[np.isnan(middle)] = -1
        begins = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(number)]
        for begin, end in pairwise(begins):
            if number[begin] >= 0:
                yield self.line[begin : end + 1], self.colours[int(number[begin])]


def by_speed(line: Array, speed: Array) -> ColouredTrack:
    """Return a track, shape (n, 2), in the colours of its speed, m/s, shape (n,)."""
    least, greatest = float(speed.min()), float(speed.max())
    ends = f"{least / KNOT:.0f} kt", f"{greatest / KNOT:.0f} kt"
    return ColouredTrack(line, speed, least, greatest, SPEED_COLOURS, ends)


def by_loss(comparison: Comparison, units: Units = RACE) -> ColouredTrack:
    """Return the track of the other flight in the colours of the time that it loses at a place."""
    line, rate = loss_along(comparison)
    finite_rates = np.abs(rate[np.isfinite(rate)])
    most = max(float(np.percentile(finite_rates, LARGEST)), STILL) if len(finite_rates) else STILL
    lost = 100.0 * most / units.per_m
    ends = f"wins {lost:.2f} s in 100 {units.length}", f"loses {lost:.2f} s"
    return ColouredTrack(line, rate, -most, most, LOSS_COLOURS, ends)
