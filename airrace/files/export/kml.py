"""KML 2.2 with Google's extension for moving things, and KMZ, which is KML in a zip archive with a model beside it.

Gates, people and lines are plain placemarks, and so is the flight path: viewers without the extension show them, too.
The flight in time is a `gx:Track` with angles; all of its `when` come before all `gx:coord`, as its schema demands.
A `gx:Tour` follows the aircraft in real time.
"""

import io
import math
import zipfile
from collections.abc import Mapping, Sequence
from datetime import datetime
from xml.etree import ElementTree as ET

import numpy as np

from airrace.files.export.aircraft_model import collada
from airrace.files.export.globe import (
    FEATURE_COLOURS,
    FLIGHT_COLOURS,
    Feature,
    Shape,
    add_element,
    compass,
    courses,
    features,
    places,
    printable,
    stamp,
)
from airrace.flights.results import Flight

KML, GX = "http://www.opengis.net/kml/2.2", "http://www.google.com/kml/ext/2.2"
TOUR_STEP = 0.5
"""The time between two views of a tour, s."""
LOOK_TIME = 2.0
"""The time before and after a view between which the way gives the direction of the look, s: steady in a loop."""
RANGE, TILT = 80.0, 78.0
"""The distance of a tour's viewpoint behind the aircraft, m, and its angle from straight down, degrees."""


def kml(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a document with the courses and the flights."""
    return content_of(kml_document(flights, begin))


def content_of(document: ET.Element) -> bytes:
    """Return a document as the content of a file."""
    root = ET.Element("kml", {"xmlns": KML, "xmlns:gx": GX})
    root.append(document)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def kml_document(flights: Sequence[Flight], begin: datetime, models: Mapping[float, str] | None = None) -> ET.Element:
    """Return the document, to which more can be added.

    Args:
        flights, begin: see `kml`.
        models: paths of aircraft models by their span; None for none.
    """
    document = ET.Element("Document")
    add_element(document, "name", ", ".join(dict.fromkeys(printable(flight.course.name) for flight in flights)))
    styles = [(kind.replace(" ", "-"), colour, "3") for kind, colour in FEATURE_COLOURS.items()]
    for number in range(len(flights)):
        styles.append((f"flight{number}", FLIGHT_COLOURS[number % len(FLIGHT_COLOURS)], "2.5"))
    for name, (red, green, blue), width in styles:
        colour = f"{blue:02x}{green:02x}{red:02x}"
        style = add_element(document, "Style", id=name)
        line = add_element(style, "LineStyle")
        add_element(line, "color", "ff" + colour)
        add_element(line, "width", width)
        add_element(add_element(style, "PolyStyle"), "color", "40" + colour)
    for course in courses(flights):
        folder = _folder(document, printable(course.name))
        for feature in features(course):
            _add_feature(folder, feature)
    for number, flight in enumerate(flights):
        model = (models or {}).get(flight.aircraft.airframe.b, "")
        _add_flight(_folder(document, printable(flight.label)), flight, begin, f"#flight{number}", model)
        _add_tour(document, flight, begin)
    return document


def kmz(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return the document of `kml`, zipped, with a model for the aircraft of every span."""
    spans = dict.fromkeys(flight.aircraft.airframe.b for flight in flights)
    models = {span: f"models/aircraft{number}.dae" for number, span in enumerate(spans)}
    contents = {"doc.kml": content_of(kml_document(flights, begin, models))}
    contents |= {name: collada(span) for span, name in models.items()}
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, (2000, 1, 1, 12, 0, 0))  # a date, so that equal flights give equal archives
            entry.compress_type = zipfile.ZIP_DEFLATED
            zipped.writestr(entry, content)
    return archive.getvalue()


def _add_flight(folder: ET.Element, flight: Flight, begin: datetime, style: str, model: str) -> None:
    """Add the line of a flight, its track in time, with a model if there is one, and a point for every passing."""
    label, line = printable(flight.label), _coordinates(flight)
    _add_geometry(_placemark(folder, f"{label}, line", style), "LineString", line, "absolute")
    track = add_element(_placemark(folder, label, style, printable(flight.stamp.text)), "gx:Track")
    add_element(track, "altitudeMode", "absolute")
    for time in flight.time.tolist():
        add_element(track, "when", stamp(begin, time))
    for place in line:
        add_element(track, "gx:coord", place.replace(",", " "))
    if flight.has("psi", "theta", "phi"):
        for psi, theta, phi in zip(*(flight[name].tolist() for name in ("psi", "theta", "phi")), strict=True):
            angles = f"{compass(psi):.2f} {math.degrees(theta):.2f} {math.degrees(phi):.2f}"
            add_element(track, "gx:angles", angles)
        if model:
            add_element(add_element(add_element(track, "Model"), "Link"), "href", model)
    passings = _folder(folder, "passings")
    for crossing in flight.crossings:
        if crossing.found:
            mark = _placemark(passings, f"{printable(crossing.name)} {crossing.time:.3f} s", style)
            _add_geometry(mark, "Point", _coordinates(flight.at([crossing.time])), "absolute")


def _add_tour(document: ET.Element, flight: Flight, begin: datetime) -> None:
    """Add a tour that looks at the aircraft from behind, in the time of the flight."""
    first, last = float(flight.time[0]), float(flight.time[-1])
    time = np.append(np.arange(first, last, TOUR_STEP), last)
    before, after = (flight.at(np.clip(time + side, first, last)) for side in (-LOOK_TIME, LOOK_TIME))
    headings = np.arctan2(after["y"] - before["y"], after["x"] - before["x"])
    tour = add_element(document, "gx:Tour")
    add_element(tour, "name", f"behind {printable(flight.label)}")
    playlist = add_element(tour, "gx:Playlist")
    seconds = [0.0, *np.diff(time).tolist()]
    for when, duration, place, heading in zip(time, seconds, places(flight.at(time)), headings, strict=True):
        step = add_element(playlist, "gx:FlyTo")
        add_element(step, "gx:duration", f"{duration:.3f}")
        add_element(step, "gx:flyToMode", "smooth")
        look = add_element(step, "LookAt")
        add_element(add_element(look, "gx:TimeStamp"), "when", stamp(begin, float(when)))
        for tag, value in zip(("longitude", "latitude", "altitude"), place, strict=True):
            add_element(look, tag, f"{value:.8f}")
        for tag, value in (("heading", compass(float(heading))), ("tilt", TILT), ("range", RANGE)):
            add_element(look, tag, f"{value:.2f}")
        add_element(look, "altitudeMode", "absolute")


def _coordinates(flight: Flight) -> list[str]:
    return [f"{east:.8f},{north:.8f},{up:.2f}" for east, north, up in places(flight)]


def _add_feature(folder: ET.Element, feature: Feature) -> None:
    style = f"#{feature.kind.replace(' ', '-')}"
    mark = _placemark(folder, printable(feature.name) or feature.kind, style, feature.note)
    top = f",{feature.height:g}" if feature.height else ""
    corners = [f"{east:.8f},{north:.8f}{top}" for east, north in feature.places]
    if feature.shape is not Shape.AREA:
        mode = "relativeToGround" if top else ""
        _add_geometry(mark, "Point" if feature.shape is Shape.POINT else "LineString", corners, mode)
        return
    polygon = add_element(mark, "Polygon")
    if top:
        _raise(polygon)
    ring = add_element(add_element(polygon, "outerBoundaryIs"), "LinearRing")
    add_element(ring, "coordinates", " ".join([*corners, corners[0]]))


def _placemark(parent: ET.Element, name: str, style: str, note: str = "") -> ET.Element:
    mark = add_element(parent, "Placemark")
    add_element(mark, "name", name)
    if note:
        add_element(mark, "description", note)
    add_element(mark, "styleUrl", style)
    return mark


def _raise(geometry: ET.Element) -> None:
    """Let a geometry stand on the ground."""
    add_element(geometry, "extrude", "1")
    add_element(geometry, "altitudeMode", "relativeToGround")


def _add_geometry(mark: ET.Element, shape: str, corners: Sequence[str], mode: str) -> None:
    """Add a point or a line; its heights count by the mode, and without one it lies on the ground."""
    geometry = add_element(mark, shape)
    if mode == "relativeToGround":
        _raise(geometry)
    elif mode:
        add_element(geometry, "altitudeMode", mode)
    elif shape == "LineString":
        add_element(geometry, "tessellate", "1")
    add_element(geometry, "coordinates", " ".join(corners))


def _folder(parent: ET.Element, name: str) -> ET.Element:
    folder = add_element(parent, "Folder")
    add_element(folder, "name", name)
    return folder
