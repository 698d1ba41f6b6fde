"""GeoJSON (RFC 7946): the course, the flight paths, and their passings."""

import json
from collections.abc import Mapping, Sequence
from datetime import datetime

import numpy as np

from airrace.export.globe import Feature, Shape, courses, features, places, printable, stamp
from airrace.results import Flight, TimedCrossing


def geojson(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a collection of features; positions are longitude, latitude (degrees) and altitude (m).

    Args:
        flights: on the globe.
        begin: when their clocks start.
    """
    entries = [_on_course(feature) for course in courses(flights) for feature in features(course)]
    for flight in flights:
        entries.append(_line(flight, begin))
        entries.extend(_passing(flight, one) for one in flight.crossings if one.found)
    return (json.dumps({"type": "FeatureCollection", "features": entries}, allow_nan=False) + "\n").encode()


def _on_course(feature: Feature) -> dict[str, object]:
    corners = [list(place) for place in feature.places]
    properties = {"kind": feature.kind, "name": printable(feature.name), "note": feature.note}
    match feature.shape:
        case Shape.POINT:
            return _feature("Point", corners[0], properties)
        case Shape.LINE:
            return _feature("LineString", corners, properties)
        case Shape.AREA:
            following = [*corners[1:], corners[0]]
            area = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, following, strict=True))
            ring = corners if area > 0.0 else corners[::-1]  # an outline runs counterclockwise
            return _feature("Polygon", [[*ring, ring[0]]], properties)


def _line(flight: Flight, begin: datetime) -> dict[str, object]:
    return _feature(
        "LineString",
        _positions(flight),
        {
            "kind": "flight",
            "name": printable(flight.label),
            "track": printable(flight.course.name),
            "aircraft": printable(flight.aircraft.name),
            "stage": flight.source.stage or None,
            "status": None if flight.source.status is None else flight.source.status.value,
            "certified": flight.source.certified,
            "race_time_s": flight.race_time if np.isfinite(flight.race_time) else None,
            "begin": stamp(begin, 0.0),
            "time_s": np.round(flight.time, 4).tolist(),
        },
    )


def _passing(flight: Flight, crossing: TimedCrossing) -> dict[str, object]:
    values = {name: crossing.value(name) for name in ("height", "V_K", "V_A", "V_I", "n_z", "mu", "gamma")}
    numbers = {name: round(value, 6) for name, value in values.items() if np.isfinite(value)}
    properties = {"kind": "passing", "name": crossing.name, "flight": printable(flight.label), "time_s": crossing.time}
    (place,) = _positions(flight.at([crossing.time]))
    return _feature("Point", place, properties | numbers)


def _positions(flight: Flight) -> list[list[float]]:
    return [[round(east, 8), round(north, 8), round(up, 3)] for east, north, up in places(flight)]


def _feature(kind: str, coordinates: object, properties: Mapping[str, object]) -> dict[str, object]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}
