"""CZML for Cesium: the course, and the flights in time with their attitude and a model of the aircraft.

Cesium counts heights from the ellipsoid; those of the course are written as they are, so where the terrain of a viewer
hides a flight, the undulation of the geoid at that place has to be added to the elevation of `--origin`.
"""

import base64
import json
import math
from collections.abc import Sequence
from datetime import datetime
from html import escape

import numpy as np

from airrace.files.export.aircraft_model import glb
from airrace.files.export.globe import (
    FEATURE_COLOURS,
    FLIGHT_COLOURS,
    Feature,
    Shape,
    courses,
    features,
    places,
    printable,
    stamp,
)
from airrace.flights.results import Flight
from airrace.flights.results.attitude import path_axes, quaternions
from airrace.flights.results.flight import BODY_ATTITUDE
from airrace.optimal_control.trajectory import Array

PYLON_RADII = (0.4, 2.5)
"""The radii of what stands at a point, at its top and at its foot, m: those of the races' pylons, about."""


def czml(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a document with the courses and the flights."""
    first = min(float(flight.time[0]) for flight in flights)
    last = max(float(flight.time[-1]) for flight in flights)
    interval = f"{stamp(begin, first)}/{stamp(begin, last)}"
    name = ", ".join(dict.fromkeys(printable(flight.course.name) for flight in flights))
    clock = {"interval": interval, "currentTime": stamp(begin, first), "multiplier": 1, "range": "LOOP_STOP"}
    packets: list[object] = [{"id": "document", "name": name, "version": "1.0", "clock": clock}]
    for course in courses(flights):
        for feature in features(course):
            packets.append(_feature(f"thing-{len(packets) - 1}", feature, course.origin.elevation))
    packets += [_flight(f"flight-{number}", flight, begin, number) for number, flight in enumerate(flights)]
    return (json.dumps(packets, allow_nan=False) + "\n").encode()


def _flight(key: str, flight: Flight, begin: datetime, number: int) -> dict[str, object]:
    positions = np.column_stack([flight.time, places(flight)])
    colour = {"rgba": [*FLIGHT_COLOURS[number % len(FLIGHT_COLOURS)], 255]}
    packet: dict[str, object] = {
        "id": key,
        "name": printable(flight.label),
        # Viewers take it as HTML.
        "description": escape(f"{flight.race_time:.3f} s; {printable(flight.stamp.text)}"),
        "availability": f"{stamp(begin, float(flight.time[0]))}/{stamp(begin, float(flight.time[-1]))}",
        "position": {
            "epoch": stamp(begin, 0.0),
            "interpolationAlgorithm": "LAGRANGE",
            "interpolationDegree": 1,
            "cartographicDegrees": np.round(positions, 9).ravel().tolist(),
        },
        "path": {"width": 3, "leadTime": 1e6, "trailTime": 1e6, "material": {"solidColor": {"color": colour}}},
        "point": {"pixelSize": 8, "color": colour},
        "label": {"text": printable(flight.label), "font": "12pt sans-serif", "pixelOffset": {"cartesian2": [0, -20]}},
    }
    if flight.has(*BODY_ATTITUDE):
        model = base64.b64encode(glb(flight.aircraft.airframe.b)).decode()
        packet["model"] = {"gltf": f"data:model/gltf-binary;base64,{model}", "minimumPixelSize": 48}
        q = np.stack([flight.time, *_fixed_attitude(flight)], axis=1)
        packet["orientation"] = {"epoch": stamp(begin, 0.0), "unitQuaternion": np.round(q, 9).ravel().tolist()}
    return packet


def _fixed_attitude(flight: Flight) -> tuple[Array, Array, Array, Array]:
    """Return quaternions (x, y, z, scalar last) from the body's axes (forward, left, up) to axes fixed in the earth."""
    R_OB = path_axes([flight[name] for name in BODY_ATTITUDE])
    flip = np.diag([1.0, -1.0, -1.0])
    origin = flight.course.origin
    R_EO = earth_axes(origin.latitude or 0.0, origin.longitude or 0.0)
    q0, q1, q2, q3 = quaternions(np.einsum("ij,jkn,kl->iln", R_EO, R_OB, flip))
    return q1, q2, q3, q0


def earth_axes(latitude: float, longitude: float) -> Array:
    """Return `R_EO`, from components north, east, down at a place (rad) to components fixed in the earth, (3, 3)."""
    sp, cp, sl, cl = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
    return np.array([[-sp * cl, -sl, -cp * cl], [-sp * sl, cl, -cp * sl], [cp, 0.0, -sp]])


def _feature(key: str, feature: Feature, up: float) -> dict[str, object]:
    name = printable(f"{feature.kind} {feature.name}")
    packet: dict[str, object] = {"id": key, "name": name, "description": escape(feature.note)}
    corners = [*feature.places, *(feature.places[:1] if feature.shape is Shape.AREA else ())]
    positions = [number for east, north in corners for number in (east, north, up)]
    colour = {"rgba": [*FEATURE_COLOURS[feature.kind], 255]}
    top = feature.height
    if top and feature.shape is Shape.POINT:
        (east, north), *_ = feature.places
        fill = {"length": top, "topRadius": PYLON_RADII[0], "bottomRadius": PYLON_RADII[1]}
        standing = {"cylinder": fill | {"material": {"solidColor": {"color": colour}}}}
        return packet | {"position": {"cartographicDegrees": [east, north, up + 0.5 * top]}} | standing
    if top:
        raised = [number for east, north in corners for number in (east, north, up + top)]
        wall = {"positions": {"cartographicDegrees": raised}, "minimumHeights": {"array": [up] * len(corners)}}
        return packet | {"wall": wall | {"material": {"solidColor": {"color": {"rgba": [*colour["rgba"][:3], 96]}}}}}
    if feature.shape is Shape.POINT:
        return packet | {"position": {"cartographicDegrees": positions}, "point": {"pixelSize": 8, "color": colour}}
    line = {"positions": {"cartographicDegrees": positions}, "width": 4, "clampToGround": True}
    return packet | {"polyline": line | {"material": {"solidColor": {"color": colour}}}}
