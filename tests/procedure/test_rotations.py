"""Rotations between attitudes: how they are parted, and how long they take."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.model.environment import g0
from airrace.model.frames import product, quaternion, rotation
from airrace.model.track.course import Roll, Turning
from airrace.optimal_control.quantities import Interval
from airrace.procedure.planning.planning_model import PlanningModel, roll_time, rotation_time, rotation_vector, turn_by

PACE = PlanningModel(V=80.0, n=5.0, p=3.0)
attitudes = st.builds(quaternion, st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))


@given(attitudes, attitudes, st.floats(0.0, 1.0))
def test_rotation_leads_from_start_to_end_by_half_a_turn_at_most(
    start: list[float], end: list[float], part: float
) -> None:
    vector = rotation_vector(start, end)
    assert np.allclose(rotation(turn_by(start, vector, 1.0)), rotation(end), atol=1e-9)
    assert np.allclose(rotation(turn_by(start, vector, 0.0)), rotation(start), atol=1e-12)
    whole = math.hypot(*vector)
    assert whole <= math.pi + 1e-9
    on_the_way = turn_by(start, vector, part)
    assert math.hypot(*rotation_vector(start, on_the_way)) == pytest.approx(part * whole, abs=1e-6)
    assert math.hypot(*rotation_vector(on_the_way, end)) == pytest.approx((1.0 - part) * whole, abs=1e-6)


@given(attitudes, attitudes, attitudes)
def test_time_depends_neither_on_the_direction_of_north_nor_on_the_sign_of_a_quaternion(
    start: list[float], end: list[float], north: list[float]
) -> None:
    seconds = rotation_time(start, end, PACE)
    assert rotation_time(product(north, start), product(north, end), PACE) == pytest.approx(seconds, rel=1e-6, abs=1e-6)
    assert rotation_time(start, [-one for one in end], PACE) == pytest.approx(seconds, rel=1e-6)
    assert rotation_time(start, start, PACE) == pytest.approx(0.0, abs=1e-6)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5))
def test_rolling_takes_the_angle_over_the_roll_rate(bank: float, climb: float) -> None:
    start, end = quaternion(0.3, climb, 0.0), quaternion(0.3, climb, bank)
    assert rotation_time(start, end, PACE) == pytest.approx(abs(bank) / PACE.p, abs=1e-6)


def test_pulling_up_takes_the_angle_over_the_rate_of_the_load_factor_and_pushing_three_times_as_long() -> None:
    level, up, down = (quaternion(0.0, climb, 0.0) for climb in (0.0, 0.8, -0.8))
    seconds = rotation_time(level, up, PACE)
    assert seconds == pytest.approx(0.8 / (g0 * (PACE.n - 1.0) / PACE.V))
    assert rotation_time(level, down, PACE) == pytest.approx(3.0 * seconds)


def test_half_a_loop_is_pulled_and_a_vertical_roll_no_longer_than_asked_for_whatever_the_heading() -> None:
    rolls = itertools.product((math.pi, math.tau), ((Turning.RIGHT, 1), (Turning.LEFT, -1)))
    for chi, (angle, (turning, sign)) in itertools.product(np.radians(range(360)), list(rolls)):
        _, pitch, _ = rotation_vector(quaternion(chi, 0.0, 0.0), quaternion(chi + math.pi, 0.0, math.pi))
        assert pitch == pytest.approx(math.pi), chi
        begin = quaternion(chi, math.pi / 2, 0.0)
        end = product(begin, [math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0])
        seconds, rolled = roll_time(begin, end, Roll(angle, Interval(), turning=turning), PACE)
        assert rolled == pytest.approx(sign * angle), chi
        assert seconds == pytest.approx(angle / PACE.p, abs=1e-5), chi


@given(st.floats(0.1, 1.0), st.floats(-1e-3, 1e-3))
def test_time_does_not_jump_where_a_pull_becomes_a_push(yaw: float, pitch: float) -> None:
    start = quaternion(0.0, 0.0, 0.0)
    level = rotation_time(start, turn_by(start, (0.0, 0.0, yaw), 1.0), PACE)
    tilted = rotation_time(start, turn_by(start, (0.0, pitch, yaw), 1.0), PACE)
    assert tilted == pytest.approx(level, rel=3.0 * abs(pitch) / yaw + 1e-9)
