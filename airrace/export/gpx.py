"""GPX 1.1: gates and pylons as waypoints, a track for every flight."""

import math
from collections.abc import Sequence
from datetime import datetime
from xml.etree import ElementTree as ET

from airrace.export.globe import courses, features, printable, stamp
from airrace.results import Flight

GPX = "http://www.topografix.com/GPX/1/1"


def gpx(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a document with the elements of the courses and the flights.

    Args:
        flights: on the globe.
        begin: when their clocks start.
    """
    ET.register_namespace("", GPX)
    root = ET.Element(_g("gpx"), version="1.1", creator="airrace")
    for course in courses(flights):
        for feature in features(course):
            middle = [sum(one) / len(feature.places) for one in zip(*feature.places, strict=True)]
            if feature.kind in ("gate", "pylon", "manoeuvre"):
                point = ET.SubElement(root, _g("wpt"), lat=f"{middle[1]:.8f}", lon=f"{middle[0]:.8f}")
                _text(point, "ele", f"{course.origin.elevation:.2f}")
                _text(point, "name", printable(feature.name))
                _text(point, "type", feature.kind)
    for flight in flights:
        track = ET.SubElement(root, _g("trk"))
        _text(track, "name", printable(flight.label))
        segment = ET.SubElement(track, _g("trkseg"))
        names = ("latitude", "longitude", "altitude")
        rows = zip(flight.time.tolist(), *(flight[name].tolist() for name in names), strict=True)
        for time, latitude, longitude, altitude in rows:
            place = {"lat": f"{math.degrees(latitude):.8f}", "lon": f"{math.degrees(longitude):.8f}"}
            point = ET.SubElement(segment, _g("trkpt"), place)
            _text(point, "ele", f"{altitude:.2f}")
            _text(point, "time", stamp(begin, time))
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def _text(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, _g(tag)).text = text


def _g(tag: str) -> str:
    return f"{{{GPX}}}{tag}"
