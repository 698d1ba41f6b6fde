"""GeoJSON (RFC 7946): the course, the flight paths, and their passings."""

import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from itertools import pairwise

import numpy as np

from airrace.files.export.globe import (
    Corner,
    Feature,
    Shape,
    courses,
    cut_area,
    cut_line,
    features,
    places,
    printable,
    stamp,
    unwrap,
)
from airrace.flights.results import Flight, TimedCrossing


def geojson(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a collection of features; positions are longitude, latitude (degrees) and altitude (m)."""
    return collection(flight_entries(flights, begin))


def flight_entries(flights: Sequence[Flight], begin: datetime) -> list[dict[str, object]]:
    """Return the features of the courses, the flights and their passings; arguments are those of `geojson`."""
    entries: list[dict[str, object]] = []
    for course in courses(flights):
        entries += map(_on_course, features(course))
    for flight in flights:
        entries.append(_line(flight, begin))
        entries += [_passing(flight, crossing) for crossing in flight.crossings if crossing.found]
    return entries


def collection(entries: Sequence[Mapping[str, object]]) -> bytes:
    """Return features as the content of a file."""
    return (json.dumps({"type": "FeatureCollection", "features": entries}, allow_nan=False) + "\n").encode()


def _on_course(of_course: Feature) -> dict[str, object]:
    corners = [list(place) for place in of_course.places]
    properties: dict[str, object] = {"kind": of_course.kind, "name": printable(of_course.name), "note": of_course.note}
    if of_course.height:
        properties["height_m"] = of_course.height
    match of_course.shape:
        case Shape.POINT:
            return feature("Point", corners[0], properties)
        case Shape.LINE:
            return feature(*_line_geometry(cut_line(corners)), properties)
        case Shape.AREA:
            ring = unwrap(corners)
            area = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise([*ring, ring[0]]))
            pieces = cut_area(corners if area > 0.0 else corners[::-1])  # an outline runs counterclockwise
            polygons = [[[*ring, ring[0]]] for ring in pieces]
            if len(polygons) == 1:
                return feature("Polygon", polygons[0], properties)
            return feature("MultiPolygon", polygons, properties)


def _line_geometry(pieces: list[list[Corner]]) -> tuple[str, object]:
    return ("LineString", pieces[0]) if len(pieces) == 1 else ("MultiLineString", pieces)


def _line(flight: Flight, begin: datetime) -> dict[str, object]:
    lines: list[list[Corner]] = []
    times: list[list[float]] = []
    corners = [[*place, when] for place, when in zip(_positions(flight), flight.time.tolist(), strict=True)]
    for piece in cut_line(corners):
        lines.append([[round(lon, 8), round(lat, 8), round(up, 8)] for lon, lat, up, _ in piece])
        times.append([round(when, 4) for *_, when in piece])
    return feature(
        *_line_geometry(lines),
        {
            "kind": "flight",
            "name": printable(flight.label),
            "track": printable(flight.course.name),
            "aircraft": printable(flight.aircraft.name),
            "stage": flight.source.stage or None,
            "status": None if flight.source.status is None else flight.source.status.value,
            "certified": flight.source.certified,
            **flight.stamp.properties(),
            "race_time_s": flight.race_time if np.isfinite(flight.race_time) else None,
            "begin": stamp(begin, 0.0),
            "time_s": times[0] if len(times) == 1 else times,
        },
    )


def _passing(flight: Flight, crossing: TimedCrossing) -> dict[str, object]:
    values = {name: crossing.value(name) for name in ("height", "V_K", "V_A", "V_I", "n_z", "mu", "gamma")}
    numbers = {name: round(value, 6) for name, value in values.items() if np.isfinite(value)}
    properties = {"kind": "passing", "name": crossing.name, "flight": printable(flight.label), "time_s": crossing.time}
    (place,) = _positions(flight.at([crossing.time]))
    return feature("Point", place, properties | numbers)


def _positions(flight: Flight) -> list[list[float]]:
    return [[round(east, 8), round(north, 8), round(up, 3)] for east, north, up in places(flight)]


def feature(kind: str, coordinates: object, properties: Mapping[str, object]) -> dict[str, object]:
    """Return a feature: its geometry and properties."""
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}
