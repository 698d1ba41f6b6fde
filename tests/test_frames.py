"""Rotations, quaternions and the sign conventions of the frames."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.frames import angle_between, angles, normalised, product, quaternion, quaternion_rates, rotation

HALF = math.sqrt(0.5)
any_angle = st.floats(-3.1, 3.1)
climbs = st.floats(-1.5, 1.5)
attitudes = st.builds(quaternion, any_angle, climbs, any_angle)
rates = st.tuples(*[st.floats(-7.0, 7.0)] * 3)


@given(attitudes, st.floats(0.1, 10.0))
def test_rotation_is_orthonormal_and_right_handed_whatever_the_length(q: list[float], length: float) -> None:
    R = np.array(rotation([length * component for component in q]))
    gram = R @ R.T
    assert gram == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-12)


@given(attitudes, st.tuples(*[st.floats(-100.0, 100.0)] * 3))
def test_rotation_preserves_length(q: list[float], v: tuple[float, float, float]) -> None:
    assert np.linalg.norm(np.array(rotation(q)) @ v) == pytest.approx(np.linalg.norm(v), rel=1e-12, abs=1e-12)


@given(any_angle, climbs, any_angle)
def test_angles_make_the_round_trip_through_the_quaternion(chi: float, gamma: float, mu: float) -> None:
    assert angles(rotation(quaternion(chi, gamma, mu))) == pytest.approx((chi, gamma, mu), abs=1e-9)


@given(attitudes, attitudes)
def test_product_composes_rotations(p: list[float], q: list[float]) -> None:
    assert np.array(rotation(product(p, q))) == pytest.approx(np.array(rotation(p)) @ np.array(rotation(q)), abs=1e-12)


@given(attitudes)
def test_opposite_quaternions_are_one_attitude(q: list[float]) -> None:
    assert np.array(rotation([-component for component in q])) == pytest.approx(np.array(rotation(q)), abs=1e-14)


@given(attitudes, st.floats(0.1, 10.0))
def test_normalising_gives_unit_length_and_keeps_the_attitude(q: list[float], length: float) -> None:
    stretched = [length * component for component in q]
    unit = normalised(stretched)
    assert math.hypot(*unit) == pytest.approx(1.0, rel=1e-14)
    assert np.array(rotation(unit)) == pytest.approx(np.array(rotation(stretched)), abs=1e-13)


@given(attitudes, rates)
def test_quaternion_rates_turn_the_matrix_by_the_rates_in_the_rotated_frame(
    q: list[float], omega: tuple[float, float, float]
) -> None:
    p, q_rate, r = omega
    cross = np.array([[0.0, -r, q_rate], [r, 0.0, -p], [-q_rate, p, 0.0]])
    step = 1e-6
    q_dot = quaternion_rates(q, *omega)
    after = rotation([a + step * b for a, b in zip(q, q_dot, strict=True)])
    before = rotation([a - step * b for a, b in zip(q, q_dot, strict=True)])
    R_dot = (np.array(after) - np.array(before)) / (2.0 * step)
    assert R_dot == pytest.approx(np.array(rotation(q)) @ cross, abs=1e-7)


@given(attitudes, rates)
def test_quaternion_rates_keep_the_length(q: list[float], omega: tuple[float, float, float]) -> None:
    assert np.dot(q, quaternion_rates(q, *omega)) == pytest.approx(0.0, abs=1e-12)


def test_quaternion_rates_are_half_the_product_with_the_rates() -> None:
    q = quaternion(0.3, -0.4, 1.9)
    half = [0.5 * component for component in product(q, [0.0, 1.0, -2.0, 3.0])]
    assert quaternion_rates(q, 1.0, -2.0, 3.0) == pytest.approx(half, abs=1e-15)


def test_course_counts_from_north_to_east() -> None:
    R = rotation(quaternion(math.pi / 2, 0.0, 0.0))
    assert [R[0][0], R[1][0], R[2][0]] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)


def test_climb_points_the_velocity_up() -> None:
    R = rotation(quaternion(0.0, 0.5, 0.0))
    assert [R[0][0], R[1][0], R[2][0]] == pytest.approx([math.cos(0.5), 0.0, -math.sin(0.5)], abs=1e-15)


@pytest.mark.parametrize(
    ("mu", "R32", "R33"),
    [
        (0.0, 0.0, 1.0),
        (math.pi / 2, 1.0, 0.0),
        (-math.pi / 2, -1.0, 0.0),
        (math.pi, 0.0, -1.0),
        (math.pi / 4, HALF, HALF),
    ],
    ids=["level", "knife edge right", "knife edge left", "inverted", "banked right"],
)
def test_bank_shows_in_the_last_row(mu: float, R32: float, R33: float) -> None:
    R = rotation(quaternion(1.1, 0.0, mu))
    assert [R[2][1], R[2][2]] == pytest.approx([R32, R33], abs=1e-15)


def test_right_bank_lowers_the_right_wing() -> None:
    R = rotation(quaternion(0.0, 0.0, 0.3))
    assert R[2][1] > 0.0  # down component of the right wing


def test_rotation_serves_symbols_and_numbers_alike() -> None:
    q = ca.SX.sym("q", 4)
    R = rotation(ca.vertsplit(q))
    function = ca.Function("R", [q], [ca.vertcat(*(ca.horzcat(*row) for row in R))])
    numbers = [0.3, -0.2, 0.9, 0.4]
    assert np.array(function(numbers)) == pytest.approx(np.array(rotation(numbers)), abs=1e-15)


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_angle_between_is_the_shortest_turn(a: float, b: float) -> None:
    turn = angle_between(a, b)
    assert abs(turn) <= math.pi
    assert math.cos(b + turn) == pytest.approx(math.cos(a), abs=1e-9)
    assert math.sin(b + turn) == pytest.approx(math.sin(a), abs=1e-9)
