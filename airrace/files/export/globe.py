"""Flights and courses on the globe, for formats that know latitude and longitude alone.

Lines and areas that cross the antimeridian are cut in two there, as RFC 7946 (section 3.1.9) wants it; two corners that
are more than half a turn apart are joined the shorter way.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from enum import Enum
from itertools import pairwise
from xml.etree import ElementTree as ET

import numpy as np

from airrace.errors import UsageError
from airrace.flights.results import Basis, Flight, History
from airrace.flights.results.flight import GLOSSARY
from airrace.model.track.course import Course, Origin, geodetic
from airrace.model.track.polygons import Point

BEGIN = datetime(2000, 1, 1, 12, tzinfo=UTC)
"""The instant at which a flight starts that knows none: viewers want a date, and an optimum has none."""
FLIGHT_COLOURS = ((0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233))
"""The colours of the flights in turn: red, green, blue [Okabe, Ito]."""
FEATURE_COLOURS = {
    "gate": (34, 34, 34),
    "pylon": (34, 34, 34),
    "manoeuvre": (34, 34, 34),
    "crowd": (192, 57, 43),
    "obstacle": (85, 85, 85),
    "safety line": (184, 134, 11),
    "airspace": (52, 86, 139),
}


class Shape(Enum):
    """The shape that the places of a feature form."""

    POINT = "point"
    LINE = "line"
    AREA = "area"


@dataclass(frozen=True)
class Feature:
    """A feature of a course on the globe.

    Attributes:
        kind: a key of `FEATURE_COLOURS`.
        shape: that `places` form.
        places: longitude and latitude, degrees, of every corner; an area's outline is not closed.
        note: a sentence about it; often empty.
        height: of what stands there, m; 0 for what lies on the ground.
    """

    kind: str
    name: str
    shape: Shape
    places: tuple[tuple[float, float], ...]
    note: str = ""
    height: float = 0.0


def clock_start(flights: Sequence[Flight]) -> datetime:
    """Return when the clocks of flights that are shown together start: that of the first one that knows it."""
    return next((flight.source.begins for flight in flights if flight.source.begins is not None), BEGIN)


def on_globe(flight: Flight, origin: Origin | None) -> Flight:
    """Return the flight with latitude, longitude and altitude.

    Args:
        flight: of any course.
        origin: where the track's frame lies; None for that of its course.

    Raises:
        UsageError: the course has none.
    """
    origin = origin or flight.course.origin
    if not origin.has_coordinates:
        raise UsageError(
            f"the course of {flight.label} has no origin on the globe; say where it lies with --origin LAT,LON,ELEV"
        )
    latitude, longitude = geodetic(flight["x"], flight["y"], origin)
    columns = {"latitude": latitude, "longitude": longitude, "altitude": flight["height"] + origin.elevation}
    histories = {name: History(GLOSSARY[name], values, Basis.DERIVED) for name, values in columns.items()}
    race = replace(flight.race, course=replace(flight.course, origin=origin))
    return replace(flight, race=race, histories={**flight.histories, **histories})


def features(course: Course) -> Iterator[Feature]:
    """Yield gates, pylons, people, obstacles, lines and borders of a course whose origin is known."""
    elements = {passage.element.name: passage.element for passage in course.passages}
    for name, element in elements.items():
        drawing = element.drawing()
        kind = "manoeuvre" if not element.stands else "gate" if drawing.window else "pylon"
        if drawing.across is not None:
            top = drawing.post_height if drawing.posts else 0.0
            yield _feature(course, kind, name, Shape.LINE, drawing.across, height=top)
        elif drawing.posts or element.place is not None:
            posts = drawing.posts or (Point(*(element.place or (0.0, 0.0))),)
            top = drawing.post_height if drawing.posts else 0.0
            yield _feature(course, kind, name, Shape.POINT, posts[:1], height=top)
    for crowd in course.crowd:
        note = f"keep {crowd.distance:g} m away, measured {'in space' if crowd.slant else 'over ground'}"
        yield _feature(course, "crowd", crowd.name, Shape(crowd.shape.value), crowd.corners, note)
    for obstacle in course.obstacles:
        note = f"{obstacle.height:g} m high, keep the wing {obstacle.clearance:g} m away"
        shape = Shape.AREA if len(obstacle.outline) > 1 else Shape.POINT
        yield _feature(course, "obstacle", obstacle.name, shape, obstacle.outline, note, obstacle.height)
    for line in course.safety_lines:
        note = f"keep to the {'right' if line.keep_right else 'left'}, at least {line.margin:g} m away"
        yield _feature(course, "safety line", line.name, Shape.LINE, (line.start, line.end), note)
    if course.airspace:
        yield _feature(course, "airspace", "airspace", Shape.AREA, course.airspace)


def _feature(
    course: Course,
    kind: str,
    name: str,
    shape: Shape,
    corners: Sequence[Point],
    note: str = "",
    height: float = 0.0,
) -> Feature:
    north, east = np.array([corner.north for corner in corners]), np.array([corner.east for corner in corners])
    latitude, longitude = geodetic(north, east, course.origin)
    places = zip(np.degrees(longitude).tolist(), np.degrees(latitude).tolist(), strict=True)
    return Feature(kind, name, shape, tuple(places), note, height)


def courses(flights: Sequence[Flight]) -> list[Course]:
    """Return the different courses of some flights."""
    distinct: list[Course] = []
    for flight in flights:
        if flight.course not in distinct:
            distinct.append(flight.course)
    return distinct


def all_histories(flights: Sequence[Flight]) -> dict[str, History]:
    """Return the declarations of all histories that some of the flights have."""
    histories: dict[str, History] = {}
    for flight in flights:
        histories |= flight.histories
    return histories


def places(flight: Flight) -> list[tuple[float, float, float]]:
    """Return longitude and latitude, degrees, and altitude, m, of a flight on the globe at all of its times."""
    columns = (np.degrees(flight["longitude"]), np.degrees(flight["latitude"]), flight["altitude"])
    return list(zip(*(column.tolist() for column in columns), strict=True))


def add_element(parent: ET.Element, tag: str, text: str | None = None, **attributes: str) -> ET.Element:
    """Return a new last child of an element of XML."""
    child = ET.SubElement(parent, tag, attributes)
    child.text = text
    return child


def stamp(begin: datetime, seconds: float) -> str:
    """Return an instant as ISO 8601, UTC, to the millisecond."""
    when = begin.astimezone(UTC) + timedelta(milliseconds=round(1000.0 * seconds))
    return when.strftime("%Y-%m-%dT%H:%M:%S.") + f"{when.microsecond // 1000:03d}Z"


def compass(angle: float) -> float:
    """Return an angle as degrees from 0 up to, not including, 360."""
    return math.degrees(angle) % 360.0


def printable(text: str) -> str:
    """Return a name in one line, without characters that XML and viewers cannot take."""
    letters = [letter if letter.isprintable() else " " for letter in text]
    return " ".join("".join(letters).split())


Corner = list[float]
"""Longitude and latitude, degrees, and further numbers that are interpolated like these."""


def cut_line(corners: Sequence[Corner]) -> list[list[Corner]]:
    """Return the pieces of a line, each on one side of the antimeridian; a line that stays on its side is one piece."""
    pieces = [[corners[0]]]
    for begin, end in pairwise(corners):
        if abs(end[0] - begin[0]) > 180.0:
            side = math.copysign(180.0, begin[0])
            crossing = _interpolate(begin, [end[0] + 2.0 * side, *end[1:]], side)
            pieces[-1].append(crossing)
            pieces.append([[-side, *crossing[1:]]])
        pieces[-1].append(end)
    return pieces


def cut_area(ring: Sequence[Corner]) -> list[list[Corner]]:
    """Return the pieces of an area, none of them closed, in the sense of rotation of the given one."""
    corners = unwrap(ring)
    farthest = max((corner[0] for corner in corners), key=abs)
    if abs(farthest) <= 180.0:
        return [list(ring)]
    side = math.copysign(180.0, farthest)
    pieces: list[list[Corner]] = []
    for inner in (True, False):
        piece: list[Corner] = []
        for begin, end in pairwise([*corners, corners[0]]):
            has_begin, has_end = (abs(begin[0]) <= 180.0) == inner, (abs(end[0]) <= 180.0) == inner
            if has_begin:
                piece.append(begin)
            if has_begin != has_end:
                piece.append(_interpolate(begin, end, side))
        if not inner:
            piece = [[lon - 2.0 * side, *values] for lon, *values in piece]
        pieces.append(piece)
    return [piece for piece in pieces if len(piece) > 2]


def unwrap(ring: Sequence[Corner]) -> list[Corner]:
    """Return corners whose longitudes go on beyond half a turn, without a jump."""
    corners = [list(ring[0])]
    for lon, *values in ring[1:]:
        corners.append([corners[-1][0] + math.remainder(lon - corners[-1][0], 360.0), *values])
    return corners


def _interpolate(begin: Corner, end: Corner, longitude: float) -> Corner:
    share = (longitude - begin[0]) / (end[0] - begin[0])
    return [longitude, *(a + share * (b - a) for a, b in zip(begin[1:], end[1:], strict=True))]
