"""Positions: latitude and longitude mean the same places as metres, and no position means two."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from language_texts import RICH, TRACK, edited, findings_of, understood
from pymap3d import ned2geodetic

from airrace.track.gates import Gate, Manoeuvre
from airrace.track.polygons import Point

PHI, LAMBDA, HEIGHT = 45.08, 13.63, 250.0
ORIGIN = f"origin: {{latitude_deg: {PHI}, longitude_deg: {LAMBDA}, elevation_m: {HEIGHT}}}\n"
METRES = "    north_m: 0\n    east_m: 0\n"


def start(track: str) -> Gate:
    element = understood(track).race.course.passages[0].element
    assert isinstance(element, Gate)
    return element


def start_at(latitude: float, longitude: float) -> Gate:
    degrees = f"    latitude_deg: {latitude:.10f}\n    longitude_deg: {longitude:.10f}\n"
    return start(edited(TRACK, METRES, degrees) + ORIGIN)


@given(st.floats(-30_000, 30_000), st.floats(-30_000, 30_000))
def test_latitude_and_longitude_mean_the_same_place_as_metres_to_a_centimetre(north: float, east: float) -> None:
    down = 0.0
    for _ in range(3):  # at the origin's elevation, so deep below its horizon
        latitude, longitude, height = ned2geodetic(north, east, down, PHI, LAMBDA, HEIGHT)
        down += height - HEIGHT
    gate = start_at(latitude, longitude)
    assert math.hypot(gate.north - north, gate.east - east) < 0.01


def test_a_small_step_north_or_east_follows_the_ellipsoids_radii() -> None:
    """WGS 84: a = 6378137 m, f = 1/298.257223563; radii of curvature of meridian and prime vertical."""
    a, f, phi = 6378137.0, 1 / 298.257223563, math.radians(PHI)
    squared = f * (2 - f)
    prime = a / math.sqrt(1 - squared * math.sin(phi) ** 2)
    meridian = prime * (1 - squared) / (1 - squared * math.sin(phi) ** 2)
    step = math.radians(0.001)
    assert start_at(PHI + 0.001, LAMBDA).north == pytest.approx((meridian + HEIGHT) * step, abs=2e-3)
    assert start_at(PHI, LAMBDA + 0.001).east == pytest.approx((prime + HEIGHT) * math.cos(phi) * step, abs=2e-3)


def test_everything_that_has_a_position_takes_degrees() -> None:
    race = understood(RICH).race
    tower = next(crowd for crowd in race.course.crowd if crowd.name == "tower")
    assert tower.corners[0].north == pytest.approx(-1111.3, abs=0.5)
    assert tower.corners[0].east == pytest.approx(0.0, abs=1e-6)
    assert race.air.thermals[0].north == pytest.approx(555.7, abs=0.5)
    top = understood(edited(RICH, "east_max_m: 900", "latitude_deg: 45.08, longitude_deg: 13.63"))
    dive = next(passage.element for passage in top.race.course.passages if passage.name == "1:dive")
    assert isinstance(dive, Manoeuvre)
    assert Point(dive.north.lower, dive.east.upper) == Point(0.0, 0.0)


def finding(old: str, new: str, track: str = RICH) -> str:
    (found,) = findings_of(edited(track, old, new))
    return str(found)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "g0: {type: level, north_m: 0, east_m: 0,",
            "g0: {type: level, east_m: 0,",
            "t.yaml:11:3: gates.g0.north_m: missing; `east_m` needs `north_m` beside it",
        ),
        (
            "g0: {type: level, north_m: 0, east_m: 0,",
            "g0: {type: level, north_m: 0,",
            "t.yaml:11:3: gates.g0.east_m: missing; `north_m` needs `east_m` beside it",
        ),
        (
            "g0: {type: level, north_m: 0, east_m: 0,",
            "g0: {type: level,",
            (
                "t.yaml:11:3: gates.g0.north_m: missing; a position is `north_m` and `east_m`, or `latitude_deg` and "
                "`longitude_deg`"
            ),
        ),
        (
            "latitude_deg: 45.0887, longitude_deg: 13.6363,",
            "longitude_deg: 13.6363,",
            "t.yaml:12:3: gates.g1.latitude_deg: missing; `longitude_deg` needs `latitude_deg` beside it",
        ),
        (
            "latitude_deg: 45.0887, longitude_deg: 13.6363,",
            "north_m: 900, east_m: 500, longitude_deg: 13.6363,",
            (
                "t.yaml:12:48: gates.g1.longitude_deg: the position is given twice; keep north and east, or latitude "
                "and longitude"
            ),
        ),
        (
            "latitude_deg: 45.0887,",
            "latitude_deg: 46.0887,",
            (
                "t.yaml:12:35: gates.g1.latitude_deg: lies 112.1 km from the origin; at most 50 km, for the frame is "
                "flat"
            ),
        ),
        (
            "latitude_deg: 45.0887,",
            "latitude_deg: 95,",
            "t.yaml:12:35: gates.g1.latitude_deg: must be at least -90 and at most 90, not 95",
        ),
        (
            "east_max_m: 900",
            "east_max_m: 900, latitude_deg: 45.08, longitude_deg: 13.63",
            (
                "t.yaml:17:90: gates.dive.latitude_deg: is exact; not together with bounds of north or east, such as "
                "`north_min_m`"
            ),
        ),
        (
            "  - {north_m: -2000, east_m: 2000}",
            "  - {north_m: -2000}",
            "t.yaml:34:5: airspace.3.east_m: missing; `north_m` needs `east_m` beside it",
        ),
    ],
)
def test_a_position_that_is_not_one_is_refused_where_it_stands(old: str, new: str, message: str) -> None:
    assert finding(old, new) == message


def test_the_far_side_of_the_earth_is_not_near() -> None:
    """There, north and east of the origin are small again."""
    message = finding("latitude_deg: 45.0887, longitude_deg: 13.6363,", "latitude_deg: -45.08, longitude_deg: -166.37,")
    assert "km from the origin; at most 50 km" in message


def test_degrees_need_the_origins() -> None:
    found = findings_of(edited(RICH, "origin: {latitude_deg: 45.08, longitude_deg: 13.63, elevation_m: 12}\n", ""))
    assert [one.key for one in found] == [
        "environment.thermals.0.latitude_deg",
        "gates.g1.latitude_deg",
        "crowd.tower.point.latitude_deg",
    ]
    assert all("of the track's `origin`" in one.message for one in found)
    assert (found[1].line, found[1].column) == (11, 21)


def test_half_an_origin_is_none() -> None:
    (found,) = findings_of(TRACK + "origin: {latitude_deg: 45}\n")
    assert str(found) == "t.yaml:19:1: origin.longitude_deg: missing; `latitude_deg` needs `longitude_deg` beside it"
