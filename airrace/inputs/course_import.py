"""A course sketched from placemarks: a track file that can be checked, and gone on with.

A line between two places, no longer than `WIDEST`, is a gate between its two pylons, and so are two points that are
called alike but for `left` and `right`; any other point is a single pylon. Areas are the airspace, where they are
called so, else people. Elements are flown in the order of the file: gates in the direction of the way, pylons on the
outside of the turn.
"""

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from airrace.inputs.placemarks import Placemark, Shape
from airrace.logs.recording import refuse
from airrace.records import record
from airrace.track.course import Origin
from airrace.track.geodetic import metres
from airrace.track.polygons import Point

WIDEST = 60.0
"""The length beyond which a line is no gate, m."""
CROWD_DISTANCE = 100.0
"""The distance that is asked for around people until the file says better, m."""
RESERVED = frozenset({"true", "false", "null", "yes", "no", "on", "off", "y", "n"})
"""Words that YAML may take for something other than a text."""
SIDES = re.compile(r"^(?P<name>.*?)[ _-]*\b(?P<side>left|right|l|r)$", re.IGNORECASE)


@record
class _Sketch:
    """An element: its name, its two pylons or its only one, as the file has them and in metres."""

    name: str
    places: tuple[tuple[float, float], ...]
    points: tuple[Point, ...]

    @property
    def middle(self) -> Point:
        count = len(self.points)
        return Point(sum(one.north for one in self.points) / count, sum(one.east for one in self.points) / count)


def sketched_course(path: str, title: str, marks: Sequence[Placemark]) -> str:
    """Return the text of a track file.

    Args:
        path: of the file with the placemarks, for messages.
        title: the name of the course.
        marks: the placemarks, in the order flown.

    Raises:
        InputError: they hold no two elements.
    """
    origin = Origin(*(math.radians(one) for one in marks[0].places[0]))
    elements, skipped = _elements(marks, origin)
    if len(elements) < 2:
        refuse(path, 0, "holds no two gates or pylons: expected points, or lines from pylon to pylon")
    latitude, longitude = marks[0].places[0]
    lines = [
        f"# Sketched from {' '.join(path.split())}. Look at it with `airrace check`, and put right what no",
        "# placemark says: the order and its laps, which way gates are flown and on which side pylons are passed, the",
        "# rules, the aircraft, and the elevation of the origin.",
        "schema: airrace/track/1",
        f"name: {_quoted(title)}",
        "aircraft: edge540",
        f"origin: {{latitude_deg: {latitude:.8f}, longitude_deg: {longitude:.8f}, elevation_m: 0}}",
        "rules: {n_z_max: 10, floor_m: 10, start_speed_max_kt: 200}",
        "gates:",
        *(_element(elements, index) for index in range(len(elements))),
        *_areas(marks),
        "course:",
        f"  start: {elements[0].name}",
        f"  lap: [{', '.join(one.name for one in elements[1:])}]",
        *(f"# not taken over: {_quoted(one.name)}, a {one.shape.value} of {len(one.places)} places" for one in skipped),
    ]
    return "\n".join(lines) + "\n"


def _elements(marks: Sequence[Placemark], origin: Origin) -> tuple[list[_Sketch], list[Placemark]]:
    """Return the elements, and the placemarks of which none became one."""
    partners = _partners(marks)
    names: set[str] = set()
    found: list[_Sketch] = []
    skipped: list[Placemark] = []
    for index, mark in enumerate(marks):
        if mark.shape is Shape.AREA or index in partners.values():
            continue
        places, name = mark.places, mark.name
        if index in partners:
            places, name = (*places, *marks[partners[index]].places), _base(mark)[0]
        points = _points(places, origin)
        wide = len(points) == 2 and math.hypot(points[1].north - points[0].north, points[1].east - points[0].east)
        if len(points) > 2 or (len(points) == 2 and not 0.0 < wide <= WIDEST):
            skipped.append(mark)
            continue
        found.append(_Sketch(_key(name or f"g{len(found)}", names), places, points))
    return found, skipped


def _partners(marks: Sequence[Placemark]) -> Mapping[int, int]:
    """Return the right pylon of every left one, by their numbers."""
    sides = {(_base(mark)): index for index, mark in enumerate(marks) if mark.shape is Shape.POINT}
    return {index: sides[(name, "r")] for (name, side), index in sides.items() if side == "l" and (name, "r") in sides}


def _base(mark: Placemark) -> tuple[str, str]:
    """Return the name without its side, and the side: `l`, `r` or nothing."""
    found = SIDES.match(mark.name)
    return (found["name"], found["side"][0].lower()) if found else (mark.name, "")


def _points(places: Sequence[tuple[float, float]], origin: Origin) -> tuple[Point, ...]:
    latitude, longitude = np.radians(np.array(places, np.float64)).T
    north, east, _ = metres(latitude, longitude, origin)
    return tuple(Point(float(n), float(e)) for n, e in zip(north, east, strict=True))


def _element(elements: Sequence[_Sketch], index: int) -> str:
    """Return the line of an element."""
    one = elements[index]
    before, after = elements[max(index - 1, 0)].middle, elements[min(index + 1, len(elements) - 1)].middle
    way = Point(after.north - before.north, after.east - before.east)
    if len(one.points) == 1:
        side = _outside(before, one.middle, after, way)
        return f"  {one.name}: {{type: pylon, {_degrees(one.places[0])}, pass_side_deg: {side:.0f}}}"
    left, right = one.points
    # the axis is a quarter turn to the left of the way from the left pylon to the right one
    forward = (right.east - left.east) * way.north - (right.north - left.north) * way.east
    places = one.places if forward >= 0.0 else one.places[::-1]
    pylons = ", ".join(f"{{{_degrees(place)}}}" for place in places)
    return f"  {one.name}: {{type: level, pylons: [{pylons}]}}"


def _outside(before: Point, here: Point, after: Point, way: Point) -> float:
    """Return the azimuth away from the inside of the turn at a pylon, deg; to the right of a straight way."""
    north = 2.0 * here.north - before.north - after.north
    east = 2.0 * here.east - before.east - after.east
    if math.hypot(north, east) < 0.02 * math.hypot(way.north, way.east):
        north, east = -way.east, way.north
    return math.degrees(math.atan2(east, north)) % 360.0


def _areas(marks: Sequence[Placemark]) -> list[str]:
    areas = [mark for mark in marks if mark.shape is Shape.AREA]
    airspace = next((mark for mark in areas if "airspace" in mark.name.lower()), None)
    names: set[str] = set()
    lines: list[str] = []
    for mark in areas:
        corners = ", ".join(f"{{{_degrees(place)}}}" for place in mark.places)
        if mark is not airspace:
            name = _key(mark.name or "crowd", names)
            lines.append(
                f"  {name}: {{polygon: [{corners}], distance_m: {CROWD_DISTANCE:g}}} # the distance is a guess"
            )
    lines = ["crowd:", *lines] if lines else []
    if airspace is not None:
        lines.append(f"airspace: [{', '.join(f'{{{_degrees(place)}}}' for place in airspace.places)}]")
    return lines


def _degrees(place: tuple[float, float]) -> str:
    return f"latitude_deg: {place[0]:.8f}, longitude_deg: {place[1]:.8f}"


def _key(name: str, taken: set[str]) -> str:
    """Return a name as a key that nothing else bears."""
    plain = "_".join(re.findall(r"[A-Za-z0-9]+", name))[:40] or "g"
    plain = f"g_{plain}" if plain[0].isdigit() or plain.lower() in RESERVED else plain
    number, key = 2, plain
    while key in taken:
        key, number = f"{plain}_{number}", number + 1
    taken.add(key)
    return key


def _quoted(title: str) -> str:
    """Return a title as YAML text in one line."""
    plain = " ".join("".join(letter if letter.isprintable() else " " for letter in title).split())[:100]
    return "'" + plain.replace("'", "''") + "'"
