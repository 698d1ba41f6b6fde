"""Placemarks of other programs: points, lines and areas with names, from KML, GPX, GeoJSON, OpenAir and SeeYou CUP.

Parts of a geometry of several (`MultiGeometry`, `MultiPolygon`, ...) are placemarks of the same name; two points are a
line. What has no geometry of these kinds, and the holes of areas, is returned as such, so that it can be reported.
"""

import io
import json
import math
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from airrace.errors import Finding, InputError
from airrace.files.inputs.course_words import Subject, is_label, subject_in
from airrace.files.inputs.document import read_content
from airrace.files.inputs.nodes import PLACEMARKS_MAX, SIZE_MAX
from airrace.files.inputs.openair import read_openair
from airrace.files.inputs.seeyou import read_cup
from airrace.flights.logs.foreign_formats import foreign_format, refuse_foreign
from airrace.flights.logs.reading import DAMAGES, archive_entry, text_encoding
from airrace.flights.logs.recording import refuse
from airrace.flights.logs.xml_document import xml_tree
from airrace.runtime.standard_streams import name_of

NAMES = ("name", "title", "label")
"""Attributes that name a feature, in any case of their letters."""
HINTS = ("kind", "type", "category", "class", "folder", "layer", "sym")
"""Attributes that say what a feature is, likewise."""
HINT_SEPARATOR = " / "
"""What stands between hints, from the innermost one."""
HOLE = "hole in an area"
"""The hint of a hole: it is filled, so nothing is lost."""
NOTES = ("note", "description", "desc")
"""Attributes that say more, likewise."""

FORMATS = "KML, KMZ, GPX, GeoJSON, OpenAir or SeeYou CUP"
"""The formats of placemarks, for messages."""
RESTRICTED = ("R", "P", "Q", "D", "W", "TRA", "TSA", "TFR", "UNC", "OTHER")
"""The classes of airspace in OpenAir that may be set up for a race: restricted, prohibited, danger, temporary ones."""


class PlacemarkShape(Enum):
    """The shape of a placemark: its places are one point, the corners of a line, or those of an area; or none of it."""

    POINT = "point"
    LINE = "line"
    AREA = "area"
    OTHER = "other"


@dataclass(frozen=True)
class Placemark:
    """A place with a name.

    Attributes:
        name: what it is called; often empty.
        shape: what its places are.
        places: latitude and longitude, degrees, of every corner; an area's outline is not closed.
        hint: words beside it that may say what it is: of attributes, its style, and its folders from the innermost.
        note: its description.
        stated: its subject, where the format of the file says so.
        elevation: of the ground there above the sea, m; NaN where it is not known.
        joint: of which placemarks it was drawn; empty for what is one in its file.
    """

    name: str
    shape: PlacemarkShape
    places: tuple[tuple[float, float], ...] = ()
    hint: str = ""
    note: str = ""
    stated: Subject | None = None
    elevation: float = math.nan
    joint: str = ""

    @cached_property
    def named_subject(self) -> Subject | None:
        """The subject by the name alone, or as its format states it; None where neither does."""
        if self.stated is not None:
            return self.stated
        return subject_in(self.name) or (Subject.ELEMENT if is_label(self.name) else None)

    @cached_property
    def subject(self) -> Subject | None:
        """The subject by a word of the name, else by the innermost hint; a mere number or letter outweighs no hint."""
        return self.stated or subject_in(self.name) or self.hinted_subject or self.named_subject

    @cached_property
    def hinted_subject(self) -> Subject | None:
        """The subject by the first hint that names one; None for none."""
        return next(filter(None, map(subject_in, self.hint.split(HINT_SEPARATOR))), None)


@dataclass(frozen=True)
class _Label:
    """The words of a placemark: the path of its file for messages, its name, hints at its subject, and a note."""

    path: str
    name: str = ""
    hint: str = ""
    note: str = ""

    @classmethod
    def of(cls, path: str, name: object, *hints: object, note: object = None) -> "_Label":
        return cls(
            path, _one_line(name), _one_line(HINT_SEPARATOR.join(str(hint) for hint in hints if hint)), _one_line(note)
        )

    def placemarks(self, shape: PlacemarkShape, places: Sequence[Sequence[object]]) -> Iterator[Placemark]:
        """Yield a placemark if its places (longitude first) make one.

        The outline of an area is opened, and a line that ends where it begins is an area.
        """
        corners = [_place(self.path, place[1::-1]) for place in places]
        corners = [corner for corner, _ in groupby(corners)]  # repeated ones once
        closed = len(corners) > 1 and corners[0] == corners[-1]
        if shape is PlacemarkShape.LINE and closed and len(corners) > 3:
            shape = PlacemarkShape.AREA
        if shape is PlacemarkShape.AREA and closed:
            corners.pop()
        least = {PlacemarkShape.POINT: 1, PlacemarkShape.LINE: 2, PlacemarkShape.AREA: 3}[shape]
        if len(corners) >= least:
            yield Placemark(self.name, shape, tuple(corners), self.hint, self.note)
        else:
            yield Placemark(self.name, PlacemarkShape.OTHER, (), f"{shape.value} of {len(corners)} places")

    def unsupported(self, what: str, suffix: str = "") -> Placemark:
        """Return what is no placemark of a course; `what` it is."""
        return Placemark(f"{self.name}{suffix}", PlacemarkShape.OTHER, (), what)


@dataclass(frozen=True)
class PlacemarkFile:
    """The placemarks of a file, and what the file calls itself; empty where it says nothing."""

    title: str
    marks: list[Placemark]


def read_placemarks(path: Path) -> list[Placemark]:
    """Return the placemarks of a file, see `read_placemark_file`."""
    return read_placemark_file(path).marks


def read_placemark_file(path: Path) -> PlacemarkFile:
    """Return the placemarks of a file, in its order; of GPX waypoints, routes and tracks, of CUP its task first.

    Raises:
        InputError: there is no such file, it is damaged or too large, or it holds no placemarks.
    """
    findings: list[Finding] = []
    name, content = name_of(path), read_content(path, findings)
    if content is None:
        raise InputError(findings)
    if content.startswith(b"PK"):
        content = _unpack(name, content)
    content = _in_utf8(name, content)
    if content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        root = xml_tree(name, content)
        is_gpx = root.tag == "gpx"
        title = (_gpx_title if is_gpx else _kml_title)(root)
        marks = list((_of_gpx if is_gpx else _of_kml)(name, root))
    else:
        title, marks = _of_text(name, content)
    if all(mark.shape is PlacemarkShape.OTHER for mark in marks):
        refuse(name, 0, f"holds no placemarks; expected {FORMATS} with points, lines or areas")
    if len(marks) > PLACEMARKS_MAX:
        refuse(name, 0, f"holds {len(marks)} placemarks; at most {PLACEMARKS_MAX} are read")
    return PlacemarkFile(_FILE_SUFFIX.sub("", _one_line(title)), list(_joined(marks, _BY_POINTS)))


_FILE_SUFFIX = re.compile(r"\.(kml|kmz|gpx|geojson|json|cup|txt)$", re.IGNORECASE)
"""How names end that programs make of the names of files."""
_XML_ENCODING = re.compile(r"^(\s*<\?xml[^>]*?)\s+encoding=[\"'][^\"']*[\"']")


def _in_utf8(path: str, content: bytes) -> bytes:
    """Return a text of UTF-16 in UTF-8, without the encoding that its first line declares; others as they are."""
    encoding = text_encoding(content[:4096])
    if not encoding.startswith("utf-16"):
        return content
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        refuse(path, 0, f"is damaged UTF-16: {error.reason}")
    return _XML_ENCODING.sub(r"\1", text.removeprefix("\ufeff")).encode()


def _unpack(path: str, content: bytes) -> bytes:
    """Return the document of a KMZ, the first of its KML files."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            unpacked = archive.open(archive_entry(path, archive, (".kml",), "a KML document")).read(SIZE_MAX + 1)
    except DAMAGES as error:
        refuse(path, 0, f"is a damaged archive: {error}")
    if len(unpacked) > SIZE_MAX:
        refuse(path, 0, f"is too large unpacked: at most {SIZE_MAX} bytes are read")
    return unpacked


# KML


def _kml_title(root: Element) -> object:
    """Return the name of the document, or of the only folder in it."""
    title = next(filter(None, (element.findtext("name") for element in root)), None)
    inner = root.find("Document")
    if title or inner is None or len(inner.findall("Folder")) != 1:
        return title
    return inner.findtext("Folder/name")


def _of_kml(path: str, root: Element, folders: str = "") -> Iterator[Placemark]:
    for element in root:
        if element.tag == "Placemark":
            yield from _of_mark(path, element, folders)
        elif element.tag in ("NetworkLink", "GroundOverlay", "PhotoOverlay", "ScreenOverlay"):
            yield _Label.of(path, element.findtext("name")).unsupported(element.tag)
        else:
            is_folder = element.tag == "Folder" or (element.tag == "Document" and root.tag != "kml")
            inside = f"{element.findtext('name') or ''}{HINT_SEPARATOR}{folders}" if is_folder else folders
            yield from _of_kml(path, element, inside)


def _of_mark(path: str, mark: Element, folders: str) -> Iterator[Placemark]:
    attributes = {data.get("name", "").lower(): data.text for data in mark.iter("SimpleData")}
    attributes |= {data.get("name", "").lower(): data.findtext("value") for data in mark.iter("Data")}
    name = mark.findtext("name") or _first(attributes, NAMES)
    note = mark.findtext("description") or _first(attributes, NOTES)
    label = _Label.of(path, name, *_all(attributes, HINTS), mark.findtext("styleUrl"), folders, note=note)
    shapes = {"Point": PlacemarkShape.POINT, "LineString": PlacemarkShape.LINE, "LinearRing": PlacemarkShape.AREA}
    holes = {ring for hole in mark.iter("innerBoundaryIs") for ring in hole.iter("LinearRing")}
    parts: list[tuple[PlacemarkShape, list[list[str]]]] = []
    for element in mark.iter():
        if element in holes:
            yield label.unsupported(HOLE, ", a hole")
        elif element.tag in shapes:
            text = re.sub(r"\s*,\s*", ",", element.findtext("coordinates") or "")
            parts.append((shapes[element.tag], [place.split(",") for place in text.split()]))
        elif element.tag in ("Track", "Model"):
            yield label.unsupported("track of a flight" if element.tag == "Track" else "three-dimensional model")
    if not parts and not any(element.tag in ("Track", "Model") for element in mark.iter()):
        yield label.unsupported("placemark without a geometry")
    if [shape for shape, _ in parts] == [PlacemarkShape.POINT] * 2:
        parts = [(PlacemarkShape.LINE, [place for _, places in parts for place in places])]
    for shape, places in parts:
        yield from label.placemarks(shape, places)


# GPX


def _gpx_title(root: Element) -> object:
    return root.findtext("metadata/name") or root.findtext("name")


def _of_gpx(path: str, root: Element) -> Iterator[Placemark]:
    def placemarks(element: Element, shape: PlacemarkShape, points: Sequence[Element]) -> Iterator[Placemark]:
        name, *hints, note = (element.findtext(tag) for tag in ("name", "type", "sym", "desc"))
        places = [(point.get("lon", ""), point.get("lat", "")) for point in points]
        for mark in _Label.of(path, name, *hints, note=note).placemarks(shape, places):
            yield replace(mark, elevation=_elevation(points[0].findtext("ele"))) if points else mark

    for element in root:
        if element.tag == "wpt":
            yield from placemarks(element, PlacemarkShape.POINT, [element])
        elif element.tag == "rte":
            points = list(element.iter("rtept"))
            if subject_in(element.findtext("name") or "") in (None, Subject.ELEMENT):
                for point in points:
                    yield from placemarks(point, PlacemarkShape.POINT, [point])
            else:
                yield from placemarks(element, PlacemarkShape.LINE, points)
        elif element.tag == "trk":
            for segment in element.iter("trkseg"):
                points = list(segment.iter("trkpt"))
                is_flight = any(point.find("time") is not None for point in points)
                for mark in placemarks(element, PlacemarkShape.LINE, points):
                    yield replace(mark, stated=Subject.FLIGHT) if is_flight and mark.subject is None else mark


# OpenAir and SeeYou CUP


def _of_text(path: str, content: bytes) -> tuple[object, list[Placemark]]:
    """Return the title and the placemarks of a file that is no XML."""
    foreign = foreign_format(content[:4096])
    if foreign is not None and not foreign.is_course:
        refuse_foreign(path, foreign)
    if foreign is None or foreign.name.startswith("GeoJSON"):
        return _of_geojson(path, content)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", "replace")
    if foreign.name.startswith("OpenAir"):
        return None, list(_of_openair(path, text))
    return None, list(_joined(list(_of_cup(path, text)), (Subject.CROWD,)))  # it knows no lines


def _of_openair(path: str, text: str) -> Iterator[Placemark]:
    for airspace in read_openair(path, text):
        name = _one_line(airspace.name or airspace.kind)
        corners = [place for place, _ in groupby(airspace.corners)]
        if len(corners) > 1 and corners[0] == corners[-1]:
            corners.pop()
        if airspace.kind.upper() not in RESTRICTED and subject_in(name) is not Subject.AIRSPACE:
            yield Placemark(name, PlacemarkShape.OTHER, (), f"airspace of the class {airspace.kind[:20]}, no race area")
        elif len(corners) < 3:
            refuse(path, airspace.line, f"the airspace {name[:40]} has {len(corners)} corners; expected three at least")
        else:
            heights = f"{airspace.floor or 'no floor'} to {airspace.ceiling or 'no ceiling'}"
            yield Placemark(name, PlacemarkShape.AREA, tuple(corners), note=heights, stated=Subject.AIRSPACE)


def _of_cup(path: str, text: str) -> Iterator[Placemark]:
    for waypoint in read_cup(path, text):
        if waypoint.style in ("airfield", "outlanding"):
            yield Placemark(waypoint.name, PlacemarkShape.OTHER, (), f"an {waypoint.style}")
            continue
        place = (waypoint.latitude, waypoint.longitude)
        note, hint = _one_line(waypoint.note), waypoint.style
        yield Placemark(waypoint.name, PlacemarkShape.POINT, (place,), hint, note, elevation=waypoint.elevation)


def _joined(marks: Sequence[Placemark], subjects: Sequence[Subject]) -> Iterator[Placemark]:
    """Yield the placemarks, with points of one thing joined: their names differ in the last number."""
    corners: dict[tuple[Subject, str], list[Placemark]] = {}
    for mark in marks:
        subject = mark.subject
        if mark.shape is PlacemarkShape.POINT and subject is not None and subject in subjects:
            corners.setdefault((subject, _unnumbered(mark.name)), []).append(mark)
    joined = {id(mark): group for group in corners.values() if len(group) > 1 for mark in group}
    for mark in marks:
        group = joined.get(id(mark), [mark])
        if len(group) == 1:
            yield mark
        elif group[0] is mark:
            is_area = mark.subject is Subject.AIRSPACE and len(group) > 2
            shape = PlacemarkShape.AREA if is_area else PlacemarkShape.LINE
            places = tuple(corner.places[0] for corner in group)
            joint = f"{len(group)} points whose names differ in their last number or letter"
            yield replace(mark, name=_unnumbered(mark.name), shape=shape, places=places, joint=joint)


_BY_POINTS = (Subject.SAFETY_LINE, Subject.AIRSPACE)
"""What several points draw in any format: a single one would say nothing."""


def _unnumbered(name: str) -> str:
    return re.sub(r"[\s_.-]*(\d+|\b[A-Za-z])$", "", name) or name


# GeoJSON


def _of_geojson(path: str, content: bytes) -> tuple[object, list[Placemark]]:
    """Return the title and the placemarks of a document."""
    try:
        root: Any = json.loads(content)  # Any: JSON of any form; what does not fit raises
        kind = root["type"]
        if kind not in ("FeatureCollection", "Feature"):
            root = {"geometry": root}
        entries = root["features"] if kind == "FeatureCollection" else [root]
        title = root.get("name") if kind == "FeatureCollection" else None
        return title, [mark for entry in entries for mark in _of_feature(path, entry)]
    except json.JSONDecodeError as error:
        refuse(path, error.lineno, f"is neither KML, GPX nor GeoJSON: {error.msg}")
    except (AttributeError, KeyError, IndexError, TypeError, ValueError, RecursionError):
        refuse(path, 0, "is no GeoJSON as RFC 7946 has it: expected a FeatureCollection with geometries")


def _of_feature(path: str, entry: Any) -> Iterator[Placemark]:  # Any: JSON, see above
    values: Any = entry.get("properties") or {}
    properties = {str(key).lower(): value for key, value in values.items()}
    hints, note = _all(properties, HINTS), _first(properties, NOTES)
    label = _Label.of(path, _first(properties, NAMES), *hints, note=note)
    geometry: Any = entry.get("geometry")
    if geometry is None:
        yield label.unsupported("feature without a geometry")
    else:
        yield from _geometry(label, geometry)


def _geometry(label: _Label, geometry: Any) -> Iterator[Placemark]:  # Any: JSON, see above
    kind, places = geometry["type"], geometry.get("coordinates")
    match kind:
        case "Point":
            yield from label.placemarks(PlacemarkShape.POINT, [places])
        case "LineString":
            yield from label.placemarks(PlacemarkShape.LINE, places)
        case "MultiPoint" if len(places) == 2:
            yield from label.placemarks(PlacemarkShape.LINE, places)
        case "Polygon":
            yield from label.placemarks(PlacemarkShape.AREA, places[0])
            for _ in places[1:]:
                yield label.unsupported(HOLE, ", a hole")
        case "MultiPoint" | "MultiLineString" | "MultiPolygon":
            for part in places:
                yield from _geometry(label, {"type": kind.removeprefix("Multi"), "coordinates": part})
        case "GeometryCollection":
            for part in geometry["geometries"]:
                yield from _geometry(label, part)
        case _:
            yield label.unsupported(f"geometry of the type `{_one_line(kind)[:40]}`")


def _elevation(text: str | None) -> float:
    """Return an elevation, m; NaN for none, and for the 0 that programs write where they know none."""
    try:
        return float(text or 0.0) or math.nan
    except ValueError:
        return math.nan


def _first(attributes: Mapping[str, object], keys: Sequence[str]) -> object:
    return next(iter(_all(attributes, keys)), None)


def _all(attributes: Mapping[str, object], keys: Sequence[str]) -> list[object]:
    return [attributes[key] for key in keys if attributes.get(key) not in (None, "")]


def _one_line(text: object) -> str:
    return " ".join(("" if text is None else str(text)).split())


def _place(path: str, texts: Sequence[object]) -> tuple[float, float]:
    try:
        latitude, longitude = (float(str(text)) for text in texts)
    except ValueError:
        refuse(path, 0, f"`{', '.join(str(text)[:20] for text in texts)}` is no latitude and longitude")
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and math.isfinite(latitude + longitude)):
        refuse(path, 0, f"{latitude:g}, {longitude:g} is no latitude and longitude, in degrees")
    return latitude, longitude
