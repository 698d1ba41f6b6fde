"""Observations at gates, and the distance from crowds."""

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from airrace.model.dynamics.observations import (
    CrossingParameters,
    CrossingValues,
    CrowdKind,
    crossing_observation,
    crowd_observation,
    crowd_values,
)
from airrace.model.dynamics.outer_loop import FlightPathState
from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.frames import quaternion
from airrace.model.track.course import Crowd, CrowdShape
from airrace.model.track.polygons import Point, distance, inside
from airrace.optimal_control.quantities import Quantity

HALF_SPAN = 3.7
OBSERVATION = crossing_observation(FlightPathState.quantities())


def gate(heading: float, bank: float = 0.0, *, bank_tolerance: float = 10.0, crossing: float = 60.0) -> list[float]:
    """A gate at (100, 50); angles in degrees."""
    mu_0 = math.radians(bank)
    return list(
        CrossingParameters(
            centre_north=100.0,
            centre_east=50.0,
            axis_north=math.cos(math.radians(heading)),
            axis_east=math.sin(math.radians(heading)),
            bank_cos=math.cos(mu_0),
            bank_sin=math.sin(mu_0),
            bank_tan=math.tan(math.radians(bank_tolerance)),
            crossing_tan=math.tan(math.radians(crossing)),
            half_span=HALF_SPAN,
        ).join()
    )


def seen(
    place: list[float],
    *,
    north: float = 100.0,
    east: float = 50.0,
    height: float = 20.0,
    course: float = 0.0,
    climb: float = 0.0,
    bank: float = 0.0,
) -> CrossingValues[float]:
    """Angles in degrees."""
    q0, q1, q2, q3 = quaternion(*(math.radians(one) for one in (course, climb, bank)))
    state = FlightPathState(x=north, y=east, z=-height, V_K=90.0, q0=q0, q1=q1, q2=q2, q3=q3)
    return CrossingValues[float].split(np.array(OBSERVATION.values(state.join(), place)).ravel().tolist())


degrees = st.floats(-179.0, 179.0)
metres = st.floats(-50.0, 50.0)


@given(degrees, degrees, st.floats(-85.0, 85.0), degrees, st.sampled_from([0.0, 90.0, -90.0, 180.0]), metres, metres)
def test_values_are_those_of_the_geometry(
    heading: float, course: float, climb: float, bank: float, mu_0: float, north: float, east: float
) -> None:
    at = {"north": 100.0 + north, "east": 50.0 + east, "course": course, "climb": climb, "bank": bank}
    values, excess = seen(gate(heading, mu_0), **at), math.radians(bank - mu_0)
    R = Rotation.from_euler("ZYX", [course, climb, bank], degrees=True).as_matrix()
    axis = np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading))])
    side, d, wing = np.array([-axis[1], axis[0]]), np.array([north, east]), HALF_SPAN * R[:2, 1]
    level = math.cos(math.radians(climb))
    expected = {"along": axis @ d, "right": side @ d, "height": 20.0, "speed": 90.0, "attitude_norm": 1.0}
    expected |= {"right_wing": side @ (d + wing), "left_wing": side @ (d - wing)}
    expected |= {"bank_sine": level * math.sin(excess), "bank_cosine": level * math.cos(excess)}
    expected |= {"climb_sine": -R[2, 0], "course_sine": side @ R[:2, 0], "course_cosine": axis @ R[:2, 0]}
    assert {name: getattr(values, name) for name in expected} == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("bank", [90.0, -90.0], ids=["right", "left"])
def test_knife_edge_is_met_on_the_prescribed_wing_only(bank: float) -> None:
    right_one, other = seen(gate(0.0, bank), bank=bank), seen(gate(0.0, bank), bank=-bank)
    assert (right_one.bank_sine, right_one.bank_cosine) == (pytest.approx(0.0, abs=1e-12), pytest.approx(1.0))
    assert right_one.bank_excess_right < 0.0
    assert right_one.bank_excess_left < 0.0
    assert other.bank_cosine == pytest.approx(-1.0)
    assert other.bank_excess_right > 0.0
    assert other.bank_excess_left > 0.0


@pytest.mark.parametrize(("bank", "legal"), [(9.9, True), (-9.9, True), (10.1, False), (-10.1, False), (175.0, False)])
def test_bank_tolerance_is_kept_exactly_where_no_excess_shows(bank: float, legal: bool) -> None:
    values = seen(gate(0.0, bank_tolerance=10.0), bank=bank, climb=5.0)
    assert (values.bank_excess_right <= 0.0 and values.bank_excess_left <= 0.0) is legal


def test_excess_bank_names_its_side() -> None:
    right_wing_low, left_wing_low = seen(gate(0.0), bank=20.0), seen(gate(0.0), bank=-20.0)
    assert right_wing_low.bank_excess_right > 0.0 > right_wing_low.bank_excess_left
    assert left_wing_low.bank_excess_left > 0.0 > left_wing_low.bank_excess_right


@pytest.mark.parametrize(
    ("course", "legal"), [(59.9, True), (-59.9, True), (60.1, False), (-60.1, False), (180.0, False)]
)
def test_crossing_angle_is_kept_exactly_where_no_excess_shows(course: float, legal: bool) -> None:
    values = seen(gate(0.0, crossing=60.0), course=course)
    assert (values.course_excess_right <= 0.0 and values.course_excess_left <= 0.0) is legal


def test_pylon_left_of_the_track_has_both_wing_tips_on_its_right() -> None:
    # flying east, 10 m south of the pylon: south is to the right of the track, so the pylon stands on the left
    values = seen(gate(0.0), north=90.0, course=90.0, bank=-60.0)
    assert values.beside_right == pytest.approx(10.0 + HALF_SPAN * 0.5, rel=1e-6)
    assert values.beside_left == pytest.approx(10.0 - HALF_SPAN * 0.5, rel=1e-6)


@given(st.floats(-180.0, 180.0), st.floats(-80.0, 80.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_distance_beside_a_pylon_knows_no_axis_and_is_normal_to_the_track(
    course: float, climb: float, ahead: float, to_right: float
) -> None:
    c, s = math.cos(math.radians(course)), math.sin(math.radians(course))
    north, east = 100.0 + ahead * c - to_right * s, 50.0 + ahead * s + to_right * c
    one = seen(gate(0.0), north=north, east=east, course=course, climb=climb)
    other = seen(gate(77.0), north=north, east=east, course=course, climb=climb)
    assert one.beside_right == other.beside_right
    assert 0.5 * (one.beside_right + one.beside_left) == pytest.approx(to_right, abs=1e-3)
    assert one.beside_right - one.beside_left == pytest.approx(2.0 * HALF_SPAN, rel=1e-4)


def test_everything_is_finite_in_vertical_flight() -> None:
    assert all(math.isfinite(value) for value in seen(gate(0.0), climb=90.0).join())


def test_any_model_with_a_flight_path_can_be_observed() -> None:
    shuffled = tuple(reversed(PointMassState.quantities()))
    q0, q1, q2, q3 = quaternion(0.3, 0.1, -0.7)
    path = {"x": 12.0, "y": -5.0, "z": -30.0, "V_K": 70.0, "q0": q0, "q1": q1, "q2": q2, "q3": q3}
    plain = OBSERVATION.values([path[one.name] for one in FlightPathState.quantities()], gate(10.0))
    richer = crossing_observation(shuffled).values([path.get(one.name, 9.0) for one in shuffled], gate(10.0))
    assert np.array(richer) == pytest.approx(np.array(plain), rel=1e-14)


def test_model_without_a_flight_path_cannot_be_observed() -> None:
    with pytest.raises(KeyError, match="V_K"):
        crossing_observation(tuple(one for one in FlightPathState.quantities() if one.name != "V_K"))


def test_declarations_match_the_shapes_of_the_function() -> None:
    assert OBSERVATION.values.size1_in(1) == len(OBSERVATION.parameters)
    assert OBSERVATION.values.size1_out(0) == len(OBSERVATION.quantities)
    assert all(isinstance(one, Quantity) and one.text for one in OBSERVATION.quantities)


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


def crowd_distance(crowd: Crowd, place: Point, height: float, *, exact: bool) -> tuple[float, np.ndarray]:
    """Distance, and its gradient in north, east and down."""
    observation = crowd_observation(STATES, CrowdKind.from_crowd(crowd), exact=exact)
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
    assert crowd_distance(crowd, place, height, exact=True)[0] == pytest.approx(
        measured(crowd, place, height), abs=1e-9
    )


@given(names, places, st.booleans(), heights)
def test_stand_in_is_nearly_exact_where_the_limit_acts(name: str, place: Point, slant: bool, height: float) -> None:
    crowd = dataclasses.replace(CROWDS[name], slant=slant)
    truth = measured(crowd, place, height)
    if truth > 0.9 * KEEP:
        assert crowd_distance(crowd, place, height, exact=False)[0] == pytest.approx(truth, abs=0.005 * KEEP)


@given(places)
def test_over_ground_the_stand_in_is_negative_within_an_area_and_leads_out(place: Point) -> None:
    crowd = dataclasses.replace(CROWDS["area"], slant=False)
    to_border = min(
        distance(place, edge, closed=False) for edge in zip(VILLAGE, VILLAGE[1:] + VILLAGE[:1], strict=True)
    )
    if inside(place, VILLAGE) and to_border > 1.0:
        value, gradient = crowd_distance(crowd, place, 20.0, exact=False)
        assert value == pytest.approx(-to_border, abs=0.005 * KEEP)
        assert 0.5 < np.linalg.norm(gradient[:2]) < 1.1
        step = 0.5 * gradient[:2] / np.linalg.norm(gradient[:2])
        assert crowd_distance(crowd, Point(place.north + step[0], place.east + step[1]), 20.0, exact=False)[0] > value


@given(st.sampled_from(["line", "area"]), places, st.booleans())
def test_stand_in_has_the_slopes_of_a_distance(name: str, place: Point, slant: bool) -> None:
    crowd = dataclasses.replace(CROWDS[name], slant=slant)
    if min(distance(place, (corner,), closed=False) for corner in crowd.corners) > 0.01:
        _, gradient = crowd_distance(crowd, place, 60.0, exact=False)
        assert np.isfinite(gradient).all()
        assert np.linalg.norm(gradient) < 1.05


def test_order_of_the_corners_of_an_area_does_not_matter() -> None:
    crowd = CROWDS["area"]
    turned = dataclasses.replace(crowd, corners=crowd.corners[::-1])
    for place in (Point(60.0, 60.0), Point(200.0, 200.0), Point(-50.0, -20.0)):
        both = [crowd_distance(one, place, 30.0, exact=False)[0] for one in (crowd, turned)]
        assert both[0] == pytest.approx(both[1], abs=1e-9)
    assert set(crowd_values(turned)) == set(crowd_values(crowd))


def test_height_counts_in_space_and_not_over_ground() -> None:
    above = crowd_distance(CROWDS["point"], Point(30.0, -40.0), 105.0, exact=True)[0]
    assert above == pytest.approx(100.0)
    ground = dataclasses.replace(CROWDS["point"], slant=False)
    assert crowd_distance(ground, Point(30.0, -40.0), 105.0, exact=True)[0] == pytest.approx(0.0)
