"""GPX 1.1: gates and pylons as waypoints, a track for every flight."""

from collections.abc import Sequence
from datetime import datetime
from xml.etree import ElementTree as ET

from airrace.files.export.globe import add_element, courses, features, places, printable, stamp
from airrace.flights.results import Flight


def gpx(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a document with the elements of the courses and the flights."""
    root = ET.Element("gpx", {"xmlns": "http://www.topografix.com/GPX/1/1", "version": "1.1", "creator": "airrace"})
    for course in courses(flights):
        for feature in features(course):
            if feature.kind in ("gate", "pylon", "manoeuvre"):
                east, north = (sum(degrees) / len(degrees) for degrees in zip(*feature.places, strict=True))
                point = add_element(root, "wpt", lat=f"{north:.8f}", lon=f"{east:.8f}")
                add_element(point, "ele", f"{course.origin.elevation:.2f}")
                add_element(point, "name", printable(feature.name))
                add_element(point, "type", feature.kind)
    for flight in flights:
        track = add_element(root, "trk")
        add_element(track, "name", printable(flight.label))
        add_element(track, "desc", printable(flight.stamp.text))
        segment = add_element(track, "trkseg")
        for time, (east, north, up) in zip(flight.time.tolist(), places(flight), strict=True):
            point = add_element(segment, "trkpt", lat=f"{north:.8f}", lon=f"{east:.8f}")
            add_element(point, "ele", f"{up:.2f}")
            add_element(point, "time", stamp(begin, time))
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)
