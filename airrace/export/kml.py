"""KML 2.2 with Google's extension for moving things, and KMZ, which is KML in a zip archive.

Gates, people and lines are plain placemarks, and so is the flight path: viewers without the extension show them, too.
The flight in time is a `gx:Track` with angles; all of its `when` come before all `gx:coord`, as its schema demands.
"""

import io
import math
import zipfile
from collections.abc import Sequence
from datetime import datetime
from xml.etree import ElementTree as ET

from airrace.export.globe import Feature, Shape, add_element, compass, courses, features, places, printable, stamp
from airrace.results import Flight

KML, GX = "http://www.opengis.net/kml/2.2", "http://www.google.com/kml/ext/2.2"
COLOURS = ("ffb27200", "ff005ed5", "ff739e00", "ffa779cc", "ff009fe6", "ffe9b456")
"""The colours of the flights, taken in turn: alpha, blue, green, red, two hexadecimal digits each."""
KINDS = {
    "gate": "ff222222",
    "pylon": "ff222222",
    "manoeuvre": "ff222222",
    "crowd": "ff2b39c0",
    "obstacle": "ff555555",
    "safety line": "ff0b86b8",
    "airspace": "ff8b5634",
}


def kml(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a document with the courses and the flights.

    Args:
        flights: on the globe.
        begin: when their clocks start.
    """
    return content_of(kml_document(flights, begin))


def content_of(document: ET.Element) -> bytes:
    """Return a document as the content of a file."""
    root = ET.Element("kml", {"xmlns": KML, "xmlns:gx": GX})
    root.append(document)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def kml_document(flights: Sequence[Flight], begin: datetime) -> ET.Element:
    """Return the document, to which more can be added; arguments are those of `kml`."""
    document = ET.Element("Document")
    add_element(document, "name", ", ".join(dict.fromkeys(printable(one.course.name) for one in flights)))
    styles = {kind.replace(" ", "-"): (colour, 3.0) for kind, colour in KINDS.items()}
    styles |= {f"flight{number}": (COLOURS[number % len(COLOURS)], 2.5) for number in range(len(flights))}
    for name, (colour, width) in styles.items():
        style = add_element(document, "Style", id=name)
        line = add_element(style, "LineStyle")
        add_element(line, "color", colour)
        add_element(line, "width", f"{width:g}")
        add_element(add_element(style, "PolyStyle"), "color", "40" + colour[2:])
    for course in courses(flights):
        folder = _folder(document, printable(course.name))
        for feature in features(course):
            _add_feature(folder, feature)
    for number, flight in enumerate(flights):
        _add_flight(_folder(document, printable(flight.label)), flight, begin, f"#flight{number}")
    return document


def kmz(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return the document that `kml` returns, zipped."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as zipped:
        entry = zipfile.ZipInfo("doc.kml", (2000, 1, 1, 12, 0, 0))  # a date, so that equal flights give equal archives
        entry.compress_type = zipfile.ZIP_DEFLATED
        zipped.writestr(entry, kml(flights, begin))
    return archive.getvalue()


def _add_flight(folder: ET.Element, flight: Flight, begin: datetime, style: str) -> None:
    """Add the line of a flight, its track in time, and a point for every passing."""
    label, line = printable(flight.label), _coordinates(flight)
    _add_geometry(_placemark(folder, f"{label}, line", style), "LineString", line, absolute=True)
    track = add_element(_placemark(folder, label, style), "gx:Track")
    add_element(track, "altitudeMode", "absolute")
    for time in flight.time.tolist():
        add_element(track, "when", stamp(begin, time))
    for place in line:
        add_element(track, "gx:coord", place.replace(",", " "))
    if flight.has("psi", "theta", "phi"):
        for psi, theta, phi in zip(*(flight[name].tolist() for name in ("psi", "theta", "phi")), strict=True):
            angles = f"{compass(psi):.2f} {math.degrees(theta):.2f} {math.degrees(phi):.2f}"
            add_element(track, "gx:angles", angles)
    passings = _folder(folder, "passings")
    for crossing in flight.crossings:
        if crossing.found:
            mark = _placemark(passings, f"{printable(crossing.name)} {crossing.time:.3f} s", style)
            _add_geometry(mark, "Point", _coordinates(flight.at([crossing.time])), absolute=True)


def _coordinates(flight: Flight) -> list[str]:
    return [f"{east:.8f},{north:.8f},{up:.2f}" for east, north, up in places(flight)]


def _add_feature(folder: ET.Element, feature: Feature) -> None:
    style = f"#{feature.kind.replace(' ', '-')}"
    mark = _placemark(folder, printable(feature.name) or feature.kind, style, feature.note)
    corners = [f"{east:.8f},{north:.8f}" for east, north in feature.places]
    if feature.shape is not Shape.AREA:
        _add_geometry(mark, "Point" if feature.shape is Shape.POINT else "LineString", corners, absolute=False)
        return
    ring = add_element(add_element(add_element(mark, "Polygon"), "outerBoundaryIs"), "LinearRing")
    add_element(ring, "coordinates", " ".join([*corners, corners[0]]))


def _placemark(parent: ET.Element, name: str, style: str, note: str = "") -> ET.Element:
    mark = add_element(parent, "Placemark")
    add_element(mark, "name", name)
    if note:
        add_element(mark, "description", note)
    add_element(mark, "styleUrl", style)
    return mark


def _add_geometry(mark: ET.Element, shape: str, corners: Sequence[str], *, absolute: bool) -> None:
    geometry = add_element(mark, shape)
    if absolute:
        add_element(geometry, "altitudeMode", "absolute")
    elif shape == "LineString":
        add_element(geometry, "tessellate", "1")
    add_element(geometry, "coordinates", " ".join(corners))


def _folder(parent: ET.Element, name: str) -> ET.Element:
    folder = add_element(parent, "Folder")
    add_element(folder, "name", name)
    return folder
