"""Placemarks of other programs, from KML, GPX and GeoJSON: named points, lines and areas on the globe."""

import json
import math
from collections.abc import Iterator, Sequence
from enum import Enum
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from airrace.inputs.document import SIZE_MAX
from airrace.logs.gpx_log import xml_tree
from airrace.logs.recording import refuse
from airrace.records import record
from airrace.standard_streams import STANDARD, name_of, read_bytes

PLACEMARKS_MAX = 1000
"""The largest number of placemarks that are read."""


class Shape(Enum):
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
    shape: Shape
    places: tuple[tuple[float, float], ...]


def read_placemarks(path: Path) -> list[Placemark]:
    """Return the placemarks of a file, in its order: KML, GPX (waypoints and routes) or GeoJSON.

    Raises:
        InputError: there is no such file, it is damaged or too large, or it holds no placemarks.
    """
    name = name_of(path)
    content = _content(path)
    if content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        root = xml_tree(name, content)
        found = list(_of_gpx(name, root) if root.tag == "gpx" else _of_kml(name, root))
    else:
        found = list(_of_geojson(name, content))
    if not found:
        refuse(name, 0, "holds no placemarks; expected KML, GPX or GeoJSON with points, lines or areas")
    if len(found) > PLACEMARKS_MAX:
        refuse(name, 0, f"holds {len(found)} placemarks; at most {PLACEMARKS_MAX} are read")
    return found


def _content(path: Path) -> bytes:
    try:
        if path != STANDARD and not path.is_file():
            refuse(str(path), 0, "is not a file" if path.exists() else "no such file")
        content = read_bytes(path, SIZE_MAX + 1)
    except OSError as error:
        refuse(name_of(path), 0, f"cannot be read: {error.strerror or error}")
    if len(content) > SIZE_MAX:
        refuse(name_of(path), 0, f"is too large: at most {SIZE_MAX} bytes are read")
    return content


def _of_kml(path: str, root: Element) -> Iterator[Placemark]:
    shapes = {"Point": Shape.POINT, "LineString": Shape.LINE, "LinearRing": Shape.AREA}
    for mark in root.iter("Placemark"):
        name = " ".join((mark.findtext("name") or "").split())
        holes = {ring for hole in mark.iter("innerBoundaryIs") for ring in hole.iter("LinearRing")}
        for one in mark.iter():
            if one.tag in shapes and one not in holes:
                places = [_place(path, text.split(",")[1::-1]) for text in (one.findtext("coordinates") or "").split()]
                yield from _placemark(name, shapes[one.tag], places)


def _of_gpx(path: str, root: Element) -> Iterator[Placemark]:
    for one in root.iter():
        if one.tag in ("wpt", "rtept"):
            place = _place(path, [one.get("lat", ""), one.get("lon", "")])
            yield Placemark(" ".join((one.findtext("name") or "").split()), Shape.POINT, (place,))


def _of_geojson(path: str, content: bytes) -> Iterator[Placemark]:
    try:
        root: Any = json.loads(content)  # Any: whatever the file holds; what does not fit raises
        entries = root["features"] if root["type"] == "FeatureCollection" else [root]
        for entry in entries:
            properties: Any = entry.get("properties") or {}
            geometry = entry.get("geometry") or {"type": ""}
            yield from _geometry(path, " ".join(str(properties.get("name") or "").split()), geometry)
    except json.JSONDecodeError as error:
        refuse(path, error.lineno, f"is neither KML, GPX nor GeoJSON: {error.msg}")
    except (AttributeError, KeyError, IndexError, TypeError, ValueError, RecursionError):
        refuse(path, 0, "is no GeoJSON as RFC 7946 has it: expected a FeatureCollection with geometries")


def _geometry(path: str, name: str, geometry: Any) -> Iterator[Placemark]:  # Any: JSON, see above
    places: Any = geometry.get("coordinates")
    match geometry["type"]:
        case "Point":
            yield Placemark(name, Shape.POINT, (_place(path, places[1::-1]),))
        case "LineString":
            yield from _placemark(name, Shape.LINE, [_place(path, one[1::-1]) for one in places])
        case "Polygon":
            yield from _placemark(name, Shape.AREA, [_place(path, one[1::-1]) for one in places[0]])
        case "GeometryCollection":
            for one in geometry["geometries"]:
                yield from _geometry(path, name, one)
        case _:
            return


def _placemark(name: str, shape: Shape, places: Sequence[tuple[float, float]]) -> Iterator[Placemark]:
    """Yield a line or an area if it is one; its outline is opened."""
    corners = tuple(places[:-1] if shape is Shape.AREA and len(places) > 1 and places[0] == places[-1] else places)
    least = {Shape.POINT: 1, Shape.LINE: 2, Shape.AREA: 3}[shape]
    if len(corners) >= least:
        yield Placemark(name, shape, corners)


def _place(path: str, texts: Sequence[object]) -> tuple[float, float]:
    try:
        latitude, longitude = (float(str(text)) for text in texts)
    except ValueError:
        refuse(path, 0, f"`{', '.join(str(text)[:20] for text in texts)}` is no latitude and longitude")
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and math.isfinite(latitude + longitude)):
        refuse(path, 0, f"{latitude:g}, {longitude:g} is no latitude and longitude, in degrees")
    return latitude, longitude
