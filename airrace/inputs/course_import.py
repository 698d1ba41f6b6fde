"""A course from placemarks of other programs (KML, GPX, GeoJSON): a track file that can be checked, and gone on with.

A line between two places, no longer than `GATE_WIDTH_MAX`, is a gate between its two pylons, and so are two points that
are called alike but for `left` and `right`; any other point is a single pylon. Areas are the airspace, where they are
called so, else people. Elements follow one another as in the file: gates in the direction of the way, pylons on the
outside of the turn.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import yaml

from airrace.errors import Finding, InputError
from airrace.inputs.document import read_content
from airrace.inputs.nodes import LIMITS
from airrace.logs.reading import xml_tree
from airrace.logs.recording import refuse
from airrace.records import record
from airrace.standard_streams import name_of
from airrace.track.course import Origin
from airrace.track.geodetic import metres
from airrace.track.polygons import Point

GATE_WIDTH_MAX = 60.0
"""The length beyond which a line is no gate, m."""
SIDES = re.compile(r"^(?P<name>.*?)[ _-]*\b(?P<side>left|right|l|r)$", re.IGNORECASE)
NOTICE = """\
# Sketched from {path}. Look at it with `airrace check`, and put right what no placemark says:
# the order and its laps, which way gates are passed and on which side pylons are passed, the rules, the aircraft,
# the distance from people, and the elevation of the origin.
"""


class PlacemarkShape(Enum):
    """The shape of a placemark: its places are one point, the corners of a line, or those of an area."""

    POINT = "point"
    LINE = "line"
    AREA = "area"


@record
class Placemark:
    """A place with a name.

    Attributes:
        name: what it is called; often empty.
        shape: what its places are.
        places: latitude and longitude, degrees, of every corner; an area's outline is not closed.
    """

    name: str
    shape: PlacemarkShape
    places: tuple[tuple[float, float], ...]


def read_placemarks(path: Path) -> list[Placemark]:
    """Return the placemarks of a file, in its order: KML, GPX (waypoints and routes) or GeoJSON.

    Raises:
        InputError: there is no such file, it is damaged or too large, or it holds no placemarks.
    """
    findings: list[Finding] = []
    name, content = name_of(path), read_content(path, findings)
    if content is None:
        raise InputError(findings)
    if content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        root = xml_tree(name, content)
        found = list(_of_gpx(name, root) if root.tag == "gpx" else _of_kml(name, root))
    else:
        found = list(_of_geojson(name, content))
    if not found:
        refuse(name, 0, "holds no placemarks; expected KML, GPX or GeoJSON with points, lines or areas")
    if len(found) > LIMITS.placemarks:
        refuse(name, 0, f"holds {len(found)} placemarks; at most {LIMITS.placemarks} are read")
    return found


def _of_kml(path: str, root: Element) -> Iterator[Placemark]:
    shapes = {"Point": PlacemarkShape.POINT, "LineString": PlacemarkShape.LINE, "LinearRing": PlacemarkShape.AREA}
    for mark in root.iter("Placemark"):
        holes = {ring for hole in mark.iter("innerBoundaryIs") for ring in hole.iter("LinearRing")}
        for one in mark.iter():
            if one.tag in shapes and one not in holes:
                places = [text.split(",") for text in (one.findtext("coordinates") or "").split()]
                yield from _placemark(path, mark.findtext("name"), shapes[one.tag], places)


def _of_gpx(path: str, root: Element) -> Iterator[Placemark]:
    for one in root.iter():
        if one.tag in ("wpt", "rtept"):
            place = one.get("lon", ""), one.get("lat", "")
            yield from _placemark(path, one.findtext("name"), PlacemarkShape.POINT, [place])


def _of_geojson(path: str, content: bytes) -> Iterator[Placemark]:
    try:
        root: Any = json.loads(content)  # Any: whatever the file holds; what does not fit raises
        for entry in root["features"] if root["type"] == "FeatureCollection" else [root]:
            properties: Any = entry.get("properties") or {}
            yield from _geometry(path, properties.get("name"), entry.get("geometry") or {"type": ""})
    except json.JSONDecodeError as error:
        refuse(path, error.lineno, f"is neither KML, GPX nor GeoJSON: {error.msg}")
    except (AttributeError, KeyError, IndexError, TypeError, ValueError, RecursionError):
        refuse(path, 0, "is no GeoJSON as RFC 7946 has it: expected a FeatureCollection with geometries")


def _geometry(path: str, name: object, geometry: Any) -> Iterator[Placemark]:  # Any: JSON, see above
    places: Any = geometry.get("coordinates")
    match geometry["type"]:
        case "Point":
            yield from _placemark(path, name, PlacemarkShape.POINT, [places])
        case "LineString":
            yield from _placemark(path, name, PlacemarkShape.LINE, places)
        case "Polygon":
            yield from _placemark(path, name, PlacemarkShape.AREA, places[0])
        case "GeometryCollection":
            for one in geometry["geometries"]:
                yield from _geometry(path, name, one)
        case _:
            return


def _placemark(
    path: str, name: object, shape: PlacemarkShape, places: Sequence[Sequence[object]]
) -> Iterator[Placemark]:
    """Yield a placemark if its places (longitude first) make one; the outline of an area is opened."""
    corners = [_place(path, place[1::-1]) for place in places]
    if shape is PlacemarkShape.AREA and len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if len(corners) >= {PlacemarkShape.POINT: 1, PlacemarkShape.LINE: 2, PlacemarkShape.AREA: 3}[shape]:
        yield Placemark(" ".join(str(name or "").split()), shape, tuple(corners))


def _place(path: str, texts: Sequence[object]) -> tuple[float, float]:
    try:
        latitude, longitude = (float(str(text)) for text in texts)
    except ValueError:
        refuse(path, 0, f"`{', '.join(str(text)[:20] for text in texts)}` is no latitude and longitude")
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and math.isfinite(latitude + longitude)):
        refuse(path, 0, f"{latitude:g}, {longitude:g} is no latitude and longitude, in degrees")
    return latitude, longitude


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


def sketch_course(path: str, title: str, marks: Sequence[Placemark]) -> str:
    """Return the text of a track file.

    Args:
        path: of the file with the placemarks, for messages.
        title: the name of the course.
        marks: the placemarks, in race order.

    Raises:
        InputError: they hold no two elements.
    """
    latitude, longitude = marks[0].places[0]
    elements, skipped = _elements(marks, Origin(math.radians(latitude), math.radians(longitude)))
    if len(elements) < 2:
        refuse(path, 0, "holds no two gates or pylons: expected points, or lines from pylon to pylon")
    areas = [mark for mark in marks if mark.shape is PlacemarkShape.AREA]
    airspace = next((mark for mark in areas if "airspace" in mark.name.lower()), None)
    names: set[str] = set()
    crowd = {
        _key(mark.name or "crowd", names): {
            "polygon": _degrees(mark.places),
            "distance_m": 100.0,
        }  # until the file says better
        for mark in areas
        if mark is not airspace
    }
    track = {
        "schema": "airrace/track/1",
        "name": _printable(title),
        "aircraft": "edge540",
        "origin": {**_degrees([(latitude, longitude)])[0], "elevation_m": 0},
        "rules": {"n_z_max": 10, "floor_m": 10, "start_speed_max_kt": 200},
        "gates": {one.name: _element(elements, index) for index, one in enumerate(elements)},
        **({"crowd": crowd} if crowd else {}),
        **({"airspace": _degrees(airspace.places)} if airspace else {}),
        "course": {"start": elements[0].name, "lap": [one.name for one in elements[1:]]},
    }
    text = yaml.safe_dump(track, sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)
    for one in skipped:
        text += f"# not taken over: '{_printable(one.name)}', a {one.shape.value} of {len(one.places)} places\n"
    return NOTICE.format(path=_printable(path)) + text


def _elements(marks: Sequence[Placemark], origin: Origin) -> tuple[list[_Sketch], list[Placemark]]:
    """Return the elements, and the placemarks of which none became one."""
    sides = {_base(mark): index for index, mark in enumerate(marks) if mark.shape is PlacemarkShape.POINT}
    partners = {
        index: sides[name, "r"] for (name, side), index in sides.items() if side == "l" and (name, "r") in sides
    }
    names: set[str] = set()
    found: list[_Sketch] = []
    skipped: list[Placemark] = []
    for index, mark in enumerate(marks):
        if mark.shape is PlacemarkShape.AREA or index in partners.values():
            continue
        places, name = mark.places, mark.name
        if index in partners:
            places, name = (*places, *marks[partners[index]].places), _base(mark)[0]
        latitude, longitude = np.radians(np.array(places, np.float64)).T
        north, east, _ = metres(latitude, longitude, origin)
        points = tuple(Point(float(n), float(e)) for n, e in zip(north, east, strict=True))
        width = len(points) == 2 and math.hypot(points[1].north - points[0].north, points[1].east - points[0].east)
        if len(points) > 2 or (len(points) == 2 and not 0.0 < width <= GATE_WIDTH_MAX):
            skipped.append(mark)
            continue
        found.append(_Sketch(_key(name or f"g{len(found)}", names), places, points))
    return found, skipped


def _base(mark: Placemark) -> tuple[str, str]:
    """Return the name without its side, and the side: `l`, `r` or nothing."""
    found = SIDES.match(mark.name)
    return (found["name"], found["side"][0].lower()) if found else (mark.name, "")


def _element(elements: Sequence[_Sketch], index: int) -> Mapping[str, object]:
    """Return the keys of an element."""
    one = elements[index]
    before, after = elements[max(index - 1, 0)].middle, elements[min(index + 1, len(elements) - 1)].middle
    way = Point(after.north - before.north, after.east - before.east)
    if len(one.points) == 1:
        return {"type": "pylon", **_degrees(one.places)[0], "pass_side_deg": _outside(before, one.middle, after, way)}
    left, right = one.points
    # the axis is a quarter turn to the left of the way from the left pylon to the right one
    forward = (right.east - left.east) * way.north - (right.north - left.north) * way.east
    return {"type": "level", "pylons": _degrees(one.places if forward >= 0.0 else one.places[::-1])}


def _outside(before: Point, here: Point, after: Point, way: Point) -> int:
    """Return the azimuth away from the inside of the turn at a pylon, deg; to the right of a straight way."""
    north = 2.0 * here.north - before.north - after.north
    east = 2.0 * here.east - before.east - after.east
    if math.hypot(north, east) < 0.02 * math.hypot(way.north, way.east):
        north, east = -way.east, way.north
    return round(math.degrees(math.atan2(east, north)) % 360.0)


def _degrees(places: Sequence[tuple[float, float]]) -> list[dict[str, float]]:
    return [{"latitude_deg": round(one[0], 8), "longitude_deg": round(one[1], 8)} for one in places]


def _key(name: str, names: set[str]) -> str:
    """Return a name as a key that nothing else bears."""
    plain = "_".join(re.findall(r"[A-Za-z0-9]+", name))[:40] or "g"
    plain = f"g_{plain}" if plain[0].isdigit() else plain
    number, key = 2, plain
    while key in names:
        key, number = f"{plain}_{number}", number + 1
    names.add(key)
    return key


def _printable(text: str) -> str:
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())[:100]
