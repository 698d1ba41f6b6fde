"""Lines on the ground and the climb angle, as the legs of a race watch them."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.dynamics.point_mass import PointMassState
from airrace.dynamics.surroundings import climb_observation, line_observation, line_values, safety_line_values
from airrace.frames import quaternion
from airrace.track.limits import SafetyLine
from airrace.track.polygons import Point, to_right

STATES = PointMassState.quantities()
coordinates = st.floats(-900.0, 900.0)
places = st.builds(Point, coordinates, coordinates)
angles = st.floats(-3.1, 3.1)


ORIGIN = Point(0.0, 0.0)


def state(place: Point = ORIGIN, heading: float = 0.0, climb: float = 0.0, bank: float = 0.0) -> np.ndarray:
    q = quaternion(heading, climb, bank)
    return np.array([place.north, place.east, -20.0, 80.0, *q, 1.0, 1.0, 0.0, 0.0])


@given(places, places, places)
def test_line_measures_the_distance_to_its_right(start: Point, end: Point, place: Point) -> None:
    if math.hypot(end.north - start.north, end.east - start.east) > 1.0:
        seen = float(line_observation(STATES).values(state(place), line_values(start, end, right=True)))
        assert seen == pytest.approx(to_right(start, end, place), abs=1e-8)


@given(places, st.booleans())
def test_allowed_side_of_a_safety_line_is_positive(place: Point, keep_right: bool) -> None:
    line = SafetyLine("beach", Point(10.0, -20.0), Point(110.0, 60.0), keep_right)
    seen = float(line_observation(STATES).values(state(place), safety_line_values(line)))
    side = to_right(line.start, line.end, place)
    assert seen == pytest.approx(side if keep_right else -side, abs=1e-9)


@given(angles, st.floats(-math.pi / 2, math.pi / 2), angles)
def test_exact_climb_is_the_climb_angle_of_the_attitude(heading: float, climb: float, bank: float) -> None:
    seen = climb_observation(STATES, exact=True).values(state(heading=heading, climb=climb, bank=bank), [])
    assert float(seen) == pytest.approx(climb, abs=1e-7)


@given(angles, st.floats(-math.pi / 2, math.pi / 2), angles)
def test_rounded_climb_stays_below_the_exact_one_by_less_than_a_milliradian(
    heading: float, climb: float, bank: float
) -> None:
    attitude = state(heading=heading, climb=climb, bank=bank)
    rounded, exact = (float(climb_observation(STATES, exact=one).values(attitude, [])) for one in (False, True))
    assert abs(rounded) <= abs(exact) + 1e-12
    assert abs(exact - rounded) < 1.1e-3


def test_rounded_climb_has_slopes_on_the_vertical() -> None:
    observation = climb_observation(STATES, exact=False)
    x = ca.SX.sym("x", len(STATES))
    slopes = ca.Function("slopes", [x], [ca.hessian(observation.values(x, []), x)[0]])
    assert np.isfinite(np.asarray(slopes(state(climb=math.pi / 2)))).all()
