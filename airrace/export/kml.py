"""KML 2.2 with Google's extension for moving things, and KMZ, which is KML in a zip archive.

Gates, people and lines are plain placemarks, and so is the line flown: viewers without the extension show them, too.
The flight in time is a `gx:Track` with angles; all of its `when` come before all `gx:coord`, as its schema demands.
"""

import io
import math
import zipfile
from collections.abc import Sequence
from datetime import datetime
from xml.etree import ElementTree as ET

from airrace.export.globe import Feature, Shape, compass, courses, features, printable, stamp
from airrace.results import Flight

KML, GX = "http://www.opengis.net/kml/2.2", "http://www.google.com/kml/ext/2.2"
COLOURS = ("ffb27200", "ff005ed5", "ff739e00", "ffa779cc", "ff009fe6", "ffe9b456")
"""The colours of the flights, taken in turn: alpha, blue, green, red, two hexadecimal digits each."""
KINDS = {
    "gate": "ff222222",
    "pylon": "ff222222",
    "manoeuvre": "ff222222",
    "crowd": "ff2b39c0",
    "safety line": "ff0b86b8",
    "airspace": "ff8b5634",
}
ZIPPED = (2000, 1, 1, 12, 0, 0)
"""The date of the file in the archive, so that equal flights give equal archives."""


def kml(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a document with the courses and the flights.

    Args:
        flights: on the globe.
        begin: when their clocks start.
    """
    ET.register_namespace("", KML)
    ET.register_namespace("gx", GX)
    root = ET.Element(_k("kml"))
    document = ET.SubElement(root, _k("Document"))
    _text(document, "name", ", ".join(dict.fromkeys(printable(one.course.name) for one in flights)))
    for kind, colour in KINDS.items():
        _style(document, _style_name(kind), colour, 3.0)
    for number in range(len(flights)):
        _style(document, f"flight{number}", COLOURS[number % len(COLOURS)], 2.5)
    for course in courses(flights):
        folder = _folder(document, printable(course.name))
        for feature in features(course):
            _placemark(folder, feature)
    for number, flight in enumerate(flights):
        _flight(document, flight, begin, f"#flight{number}")
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def kmz(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return the document that `kml` returns, zipped."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as zipped:
        entry = zipfile.ZipInfo("doc.kml", ZIPPED)
        entry.compress_type = zipfile.ZIP_DEFLATED
        zipped.writestr(entry, kml(flights, begin))
    return archive.getvalue()


def _flight(document: ET.Element, flight: Flight, begin: datetime, style: str) -> None:
    """Add the folder of a flight: the line, the track in time, and a point for every passing."""
    folder = _folder(document, printable(flight.label))
    places = _places(flight)
    line = _named(folder, f"{printable(flight.label)}, line", style)
    _coordinates(line, "LineString", places, absolute=True)
    moving = _named(folder, printable(flight.label), style)
    track = ET.SubElement(moving, f"{{{GX}}}Track")
    _text(track, "altitudeMode", "absolute")
    for time in flight.time.tolist():
        _text(track, "when", stamp(begin, time))
    for place in places:
        ET.SubElement(track, f"{{{GX}}}coord").text = place.replace(",", " ")
    if flight.has("psi", "theta", "phi"):
        for psi, theta, phi in zip(*(flight[name].tolist() for name in ("psi", "theta", "phi")), strict=True):
            angles = f"{compass(psi):.2f} {math.degrees(theta):.2f} {math.degrees(phi):.2f}"
            ET.SubElement(track, f"{{{GX}}}angles").text = angles
    passings = _folder(folder, "passings")
    for crossing in flight.crossings:
        if crossing.found:
            here = flight.at([crossing.time])
            mark = _named(passings, f"{printable(crossing.name)} {crossing.time:.3f} s", style)
            _coordinates(mark, "Point", _places(here), absolute=True)


def _places(flight: Flight) -> list[str]:
    columns = (flight["longitude"], flight["latitude"], flight["altitude"])
    rows = zip(*(one.tolist() for one in columns), strict=True)
    return [f"{math.degrees(east):.8f},{math.degrees(north):.8f},{up:.2f}" for east, north, up in rows]


def _placemark(folder: ET.Element, feature: Feature) -> None:
    mark = _named(folder, printable(feature.name) or feature.kind, f"#{_style_name(feature.kind)}", feature.note)
    places = [f"{east:.8f},{north:.8f}" for east, north in feature.places]
    if feature.shape is not Shape.AREA:
        _coordinates(mark, "Point" if feature.shape is Shape.POINT else "LineString", places, absolute=False)
        return
    outline = ET.SubElement(ET.SubElement(mark, _k("Polygon")), _k("outerBoundaryIs"))
    ring = ET.SubElement(outline, _k("LinearRing"))
    _text(ring, "coordinates", " ".join([*places, places[0]]))


def _named(parent: ET.Element, name: str, style: str, note: str = "") -> ET.Element:
    mark = ET.SubElement(parent, _k("Placemark"))
    _text(mark, "name", name)
    if note:
        _text(mark, "description", note)
    _text(mark, "styleUrl", style)
    return mark


def _coordinates(mark: ET.Element, shape: str, places: Sequence[str], *, absolute: bool) -> None:
    geometry = ET.SubElement(mark, _k(shape))
    if absolute:
        _text(geometry, "altitudeMode", "absolute")
    elif shape == "LineString":
        _text(geometry, "tessellate", "1")
    _text(geometry, "coordinates", " ".join(places))


def _style(document: ET.Element, name: str, colour: str, width: float) -> None:
    style = ET.SubElement(document, _k("Style"), id=name)
    line = ET.SubElement(style, _k("LineStyle"))
    _text(line, "color", colour)
    _text(line, "width", f"{width:g}")
    area = ET.SubElement(style, _k("PolyStyle"))
    _text(area, "color", "40" + colour[2:])


def _style_name(kind: str) -> str:
    return kind.replace(" ", "-")


def _folder(parent: ET.Element, name: str) -> ET.Element:
    folder = ET.SubElement(parent, _k("Folder"))
    _text(folder, "name", name)
    return folder


def _text(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, _k(tag)).text = text


def _k(tag: str) -> str:
    return f"{{{KML}}}{tag}"
