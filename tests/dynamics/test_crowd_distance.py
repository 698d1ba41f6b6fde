"""The distance to a crowd: exact by plane geometry, smooth for the solver, with a way out of an area."""

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.dynamics.crowd_distance import CrowdKind, crowd_observation, crowd_values
from airrace.dynamics.point_mass import PointMassState
from airrace.track.limits import Crowd, CrowdShape
from airrace.track.polygons import Point, distance, inside

KEEP = 80.0
TRACK = (Point(0.0, 0.0), Point(200.0, 0.0), Point(260.0, 150.0))
# an L: one of its corners bulges inwards
VILLAGE = (
    Point(0.0, 0.0),
    Point(0.0, 300.0),
    Point(120.0, 300.0),
    Point(120.0, 100.0),
    Point(320.0, 100.0),
    Point(320.0, 0.0),
)
CROWDS = {
    "point": Crowd("one", CrowdShape.POINT, (Point(30.0, -40.0),), KEEP, height=5.0),
    "line": Crowd("row", CrowdShape.LINE, TRACK, KEEP, height=5.0),
    "area": Crowd("village", CrowdShape.AREA, VILLAGE, KEEP, height=5.0),
}
coordinates = st.floats(-500.0, 700.0)
places = st.builds(Point, coordinates, coordinates)
heights = st.floats(0.0, 400.0)
names = st.sampled_from(sorted(CROWDS))
STATES = PointMassState.quantities()


def seen(crowd: Crowd, place: Point, height: float, *, exact: bool) -> tuple[float, np.ndarray]:
    """Distance, and its gradient in north, east and down."""
    observation = crowd_observation(STATES, CrowdKind.of(crowd), exact=exact)
    x = ca.SX.sym("x", len(STATES))
    b = np.array(crowd_values(crowd))
    value = observation.values(x, b)
    both = ca.Function("both", [x], [value, ca.jacobian(value, x)[:3]])
    state = np.zeros(len(STATES))
    state[:4] = place.north, place.east, -height, 80.0
    found, gradient = both(state)
    return float(found), np.asarray(gradient).ravel()


def measured(crowd: Crowd, place: Point, height: float) -> float:
    ground = distance(place, crowd.corners, closed=crowd.shape is CrowdShape.AREA)
    return math.hypot(ground, height - crowd.height) if crowd.slant else ground


@given(names, places, heights)
def test_exact_distance_is_that_of_plane_geometry(name: str, place: Point, height: float) -> None:
    crowd = CROWDS[name]
    assert seen(crowd, place, height, exact=True)[0] == pytest.approx(measured(crowd, place, height), abs=1e-9)


@given(names, places, st.booleans(), heights)
def test_stand_in_is_nearly_exact_where_the_limit_acts(name: str, place: Point, slant: bool, height: float) -> None:
    crowd = dataclasses.replace(CROWDS[name], slant=slant)
    truth = measured(crowd, place, height)
    if truth > 0.9 * KEEP:
        assert seen(crowd, place, height, exact=False)[0] == pytest.approx(truth, abs=0.005 * KEEP)


@given(places)
def test_over_ground_the_stand_in_is_negative_within_an_area_and_leads_out(place: Point) -> None:
    crowd = dataclasses.replace(CROWDS["area"], slant=False)
    to_border = min(
        distance(place, edge, closed=False) for edge in zip(VILLAGE, VILLAGE[1:] + VILLAGE[:1], strict=True)
    )
    if inside(place, VILLAGE) and to_border > 1.0:
        value, gradient = seen(crowd, place, 20.0, exact=False)
        assert value == pytest.approx(-to_border, abs=0.005 * KEEP)
        assert 0.5 < np.linalg.norm(gradient[:2]) < 1.1
        step = 0.5 * gradient[:2] / np.linalg.norm(gradient[:2])
        assert seen(crowd, Point(place.north + step[0], place.east + step[1]), 20.0, exact=False)[0] > value


@given(st.sampled_from(["line", "area"]), places, st.booleans())
def test_stand_in_has_the_slopes_of_a_distance(name: str, place: Point, slant: bool) -> None:
    crowd = dataclasses.replace(CROWDS[name], slant=slant)
    if min(distance(place, (corner,), closed=False) for corner in crowd.corners) > 0.01:
        _, gradient = seen(crowd, place, 60.0, exact=False)
        assert np.isfinite(gradient).all()
        assert np.linalg.norm(gradient) < 1.05


def test_order_of_the_corners_of_an_area_does_not_matter() -> None:
    crowd = CROWDS["area"]
    turned = dataclasses.replace(crowd, corners=crowd.corners[::-1])
    for place in (Point(60.0, 60.0), Point(200.0, 200.0), Point(-50.0, -20.0)):
        both = [seen(one, place, 30.0, exact=False)[0] for one in (crowd, turned)]
        assert both[0] == pytest.approx(both[1], abs=1e-9)
    assert set(crowd_values(turned)) == set(crowd_values(crowd))


def test_height_counts_in_space_and_not_over_ground() -> None:
    above = seen(CROWDS["point"], Point(30.0, -40.0), 105.0, exact=True)[0]
    assert above == pytest.approx(100.0)
    ground = dataclasses.replace(CROWDS["point"], slant=False)
    assert seen(ground, Point(30.0, -40.0), 105.0, exact=True)[0] == pytest.approx(0.0)
