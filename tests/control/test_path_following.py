"""The outer loop's law: nothing is asked for without an error, errors are countered, and the world has no left side."""

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.control.outer_loop import Commands, PathGains, errors, path_following, path_rate
from airrace.control.reference import ReferencePoint
from airrace.dynamics.outer_loop import FlightPathState
from airrace.environment.atmosphere import g0
from airrace.frames import product, quaternion, rotation

GAINS = PathGains()
HISTORIES = {
    "Phi": 0.0,
    "gain": 0.0,
    "Phi_reset": 0.0,
    "gain_reset": 0.0,
    "soft_n_z_dot": 0.7,
    "soft_p_dot": -0.4,
    "delta_T": 0.8,
    "delta_T_dot": 0.1,
}

angle, offset = st.floats(-3.1, 3.1), st.floats(-5.0, 5.0)


def point(
    chi: float, gamma: float, mu: float, V: float, n: tuple[float, float, float], p: float
) -> ReferencePoint[float]:
    """A reference that flies with the load factors `n`, all told."""
    q = quaternion(chi, gamma, mu)
    R = np.array(rotation(q))
    a = g0 * (R @ [n[0], n[1], -n[2]] + [0.0, 0.0, 1.0])
    return ReferencePoint(
        **dict(zip(("x", "y", "z"), (20.0, -30.0, -90.0), strict=True)),
        **dict(zip(("v_N", "v_E", "v_D"), (V * R[:, 0]).tolist(), strict=True)),
        **dict(zip(("a_N", "a_E", "a_D"), a.tolist(), strict=True)),
        **dict(zip(("q0", "q1", "q2", "q3"), q, strict=True)),
        n_y=n[1],
        n_z=n[2],
        soft_n_z=n[2],
        p_Kbar=p,
        soft_p=p,
        **HISTORIES,
    )


points = st.builds(
    point,
    angle,
    st.floats(-1.5, 1.5),
    angle,
    st.floats(50.0, 110.0),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5), st.floats(-3.0, 9.0)),
    st.floats(-5.0, 5.0),
)


def state_at(here: ReferencePoint[float], *, V_K: float | None = None) -> FlightPathState[float]:
    """The aircraft where and as the reference is."""
    V = math.sqrt(sum(one * one for one in here.velocity))
    q0, q1, q2, q3 = here.q
    return FlightPathState(x=here.x, y=here.y, z=here.z, V_K=V if V_K is None else V_K, q0=q0, q1=q1, q2=q2, q3=q3)


def moved(
    state: FlightPathState[float], right: float = 0.0, up: float = 0.0, forward: float = 0.0
) -> FlightPathState[float]:
    """The aircraft beside where it was, as its own wings see it, m."""
    step = np.array(rotation(state.q)) @ [forward, right, -up]
    return dataclasses.replace(state, x=state.x + step[0], y=state.y + step[1], z=state.z + step[2])


def turned(state: FlightPathState[float], p: float, q: float, r: float) -> FlightPathState[float]:
    """The aircraft in another attitude: a small rotation about its own axes, rad."""
    q0, q1, q2, q3 = product(state.q, (1.0, p / 2, q / 2, r / 2))
    return dataclasses.replace(state, q0=q0, q1=q1, q2=q2, q3=q3)


LEVEL = point(0.3, 0.0, 0.0, 80.0, (0.0, 0.0, 1.0), 0.0)
PULLING = point(0.3, 0.1, 0.9, 80.0, (0.0, 0.0, 4.0), 0.0)


@given(points)
def test_without_an_error_the_reference_itself_is_commanded(here: ReferencePoint[float]) -> None:
    commands, rate = path_following(state_at(here), here, GAINS)
    R, a = np.array(rotation(here.q)), np.array(here.acceleration)
    assert rate == pytest.approx(1.0)
    assert commands.n_x == pytest.approx((R.T @ (a - [0.0, 0.0, g0]))[0] / g0, abs=1e-9)
    assert (commands.n_y, commands.n_z, commands.p) == pytest.approx((here.n_y, here.n_z, here.p_Kbar), abs=1e-9)
    assert (commands.n_z_dot, commands.p_dot, commands.delta_T_dot) == pytest.approx((0.7, -0.4, 0.1))
    assert vars(errors(state_at(here), here)) == pytest.approx({"distance": 0.0, "roll": 0.0}, abs=1e-7)


@given(points, offset, offset, offset, st.floats(-0.3, 0.3), st.floats(-10.0, 10.0))
def test_mirrored_flight_is_commanded_the_mirrored_way(
    here: ReferencePoint[float], right: float, up: float, forward: float, roll: float, faster: float
) -> None:
    state = turned(moved(state_at(here), right, up, forward), roll, 0.0, 0.0)
    state = dataclasses.replace(state, V_K=state.V_K + faster)
    seen, rate = path_following(state, here, GAINS)
    odd = ("y", "v_E", "a_E", "q1", "q3", "n_y", "p_Kbar", "soft_p", "soft_p_dot")
    there = dataclasses.replace(here, **{name: -getattr(here, name) for name in odd})
    mirrored = dataclasses.replace(state, y=-state.y, q1=-state.q1, q3=-state.q3)
    expected = dataclasses.replace(seen, n_y=-seen.n_y, p=-seen.p, p_dot=-seen.p_dot)
    commands, same = path_following(mirrored, there, GAINS)
    assert same == pytest.approx(rate)
    assert commands.join() == pytest.approx(expected.join(), abs=1e-9)


@given(points, offset, offset, st.floats(-0.3, 0.3))
def test_sign_of_the_quaternion_does_not_matter(
    here: ReferencePoint[float], right: float, up: float, roll: float
) -> None:
    state = turned(moved(state_at(here), right, up), roll, 0.0, 0.0)
    other = dataclasses.replace(state, q0=-state.q0, q1=-state.q1, q2=-state.q2, q3=-state.q3)
    one, same = path_following(state, here, GAINS)[0], path_following(other, here, GAINS)[0]
    assert one.join() == pytest.approx(same.join(), abs=1e-9)


def test_aircraft_ahead_hurries_the_clock_and_one_behind_delays_it() -> None:
    state = state_at(LEVEL)
    assert path_rate(moved(state, forward=4.0), LEVEL, GAINS) == pytest.approx(1.05)
    assert path_rate(moved(state, forward=-4.0), LEVEL, GAINS) == pytest.approx(0.95)


def test_path_rate_stays_within_its_limits() -> None:
    assert path_rate(moved(state_at(LEVEL), forward=900.0), LEVEL, GAINS) == GAINS.along[1]
    assert path_rate(moved(state_at(LEVEL), forward=-900.0), LEVEL, GAINS) == GAINS.along[0]


def test_slow_aircraft_is_pulled_harder() -> None:
    slow = path_following(state_at(LEVEL, V_K=78.0), LEVEL, GAINS)[0]
    assert slow.n_x == pytest.approx(GAINS.K_V * 2.0 / g0)


def test_aircraft_above_pulls_less_and_one_below_more() -> None:
    state = state_at(PULLING)
    high, low = (path_following(moved(state, up=up), PULLING, GAINS)[0].n_z for up in (2.0, -2.0))
    assert (high, low) == pytest.approx((4.0 - 2.0 * GAINS.K_p / g0, 4.0 + 2.0 * GAINS.K_p / g0))


def test_aircraft_beside_the_path_banks_towards_it() -> None:
    state = state_at(PULLING)
    assert path_following(moved(state, right=2.0), PULLING, GAINS)[0].p < -0.1
    assert path_following(moved(state, right=-2.0), PULLING, GAINS)[0].p > 0.1


def test_pushing_aircraft_beside_the_path_banks_away_from_it() -> None:
    pushing = point(0.3, 0.1, 0.9, 80.0, (0.0, 0.0, -2.0), 0.0)
    assert path_following(moved(state_at(pushing), right=2.0), pushing, GAINS)[0].p > 0.1


def test_without_lift_side_force_leads_back_and_the_bank_is_kept() -> None:
    floating = point(0.3, 0.1, 0.9, 80.0, (0.0, 0.0, 0.0), 0.0)
    commands = path_following(moved(state_at(floating), right=0.5), floating, GAINS)[0]
    assert commands.p == pytest.approx(0.0, abs=1e-9)
    assert commands.n_y < -0.05


@given(st.floats(-0.2, 0.2))
def test_bank_error_is_rolled_out(roll: float) -> None:
    floating = point(0.3, 0.1, 0.9, 80.0, (0.0, 0.0, 0.0), 0.0)
    state = turned(state_at(floating), -roll, 0.0, 0.0)
    error = errors(state, floating).roll
    assert error == pytest.approx(2.0 * math.atan(roll / 2.0))
    assert path_following(state, floating, GAINS)[0].p == pytest.approx(GAINS.K_mu * error)


def test_symbols_and_floats_agree() -> None:
    state = turned(moved(state_at(PULLING), 1.0, -2.0, 3.0), 0.1, -0.05, 0.02)
    x, r = ca.SX.sym("x", FlightPathState.size()), ca.SX.sym("r", ReferencePoint.size())
    commands, rate = path_following(FlightPathState.split(x), ReferencePoint.split(r), GAINS)
    function = ca.Function("law", [x, r], [ca.vertcat(*commands.join(), rate)])
    values = np.asarray(function(state.join(), PULLING.join())).ravel()
    floats, same = path_following(state, PULLING, GAINS)
    assert values == pytest.approx([*floats.join(), same])
    assert len(values) == Commands.size() + 1
