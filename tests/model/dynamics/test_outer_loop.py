"""The outer loop and its inverse."""

import math

import numpy as np
import pytest
from flights import controls, states, windy_airs
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from airrace.model.aircraft import Aircraft
from airrace.model.dynamics.outer_loop import (
    FlightPathState,
    LoadFactors,
    flight_path_rates,
    load_factors,
    load_factors_of_motion,
)
from airrace.model.dynamics.point_mass import PointMassControl, PointMassState, build_point_mass
from airrace.model.dynamics.six_dof import build_six_dof
from airrace.model.environment import Air, g0
from airrace.model.frames import angles, quaternion, rotation
from airrace.model.track.course import Rules

angle = st.floats(-3.1, 3.1)
climb = st.floats(-1.4, 1.4)
speed = st.floats(40.0, 120.0)
load = st.floats(-10.0, 10.0)


def flight_path(chi: float, gamma: float, mu: float, V_K: float) -> FlightPathState[float]:
    q0, q1, q2, q3 = quaternion(chi, gamma, mu)
    return FlightPathState(x=0.0, y=0.0, z=-100.0, V_K=V_K, q0=q0, q1=q1, q2=q2, q3=q3)


def rates(state: FlightPathState[float], n: tuple[float, float, float], p_Kbar: float = 0.0) -> FlightPathState[float]:
    return flight_path_rates(state, rotation(state.q), n_x=n[0], n_y=n[1], n_z=n[2], p_Kbar=p_Kbar)


def angle_rates(state: FlightPathState[float], rate: FlightPathState[float]) -> tuple[float, float, float]:
    """`(chi_dot, gamma_dot, mu_dot)` by central differences."""
    step = 1e-6
    ahead = angles(rotation([q + step * dot for q, dot in zip(state.q, rate.q, strict=True)]))
    behind = angles(rotation([q - step * dot for q, dot in zip(state.q, rate.q, strict=True)]))
    return tuple(math.remainder(a - b, 2.0 * math.pi) / (2.0 * step) for a, b in zip(ahead, behind, strict=True))


def fly(state: FlightPathState[float], n: tuple[float, float, float], duration: float) -> FlightPathState[float]:
    def derivative(_: float, x: NDArray[np.float64]) -> list[float]:
        return list(rates(FlightPathState[float].split(x), n).join())

    solution = solve_ivp(derivative, (0.0, duration), list(state.join()), rtol=1e-10, atol=1e-10)
    return FlightPathState[float].split(solution.y[:, -1])


@given(angle, st.floats(-1.4, 1.4), speed)
def test_level_turn_follows_the_coordinated_turn_law(chi: float, mu: float, V_K: float) -> None:
    state = flight_path(chi, 0.0, mu, V_K)
    chi_dot, gamma_dot, mu_dot = angle_rates(state, rates(state, (0.0, 0.0, 1.0 / math.cos(mu))))
    assert chi_dot == pytest.approx(g0 * math.tan(mu) / V_K, abs=1e-7)
    assert (gamma_dot, mu_dot) == (pytest.approx(0.0, abs=1e-7), pytest.approx(0.0, abs=1e-7))


def test_level_circle_closes_after_one_turn() -> None:
    mu, V_K = math.radians(75.0), 85.0
    start = flight_path(0.3, 0.0, mu, V_K)
    end = fly(start, (0.0, 0.0, 1.0 / math.cos(mu)), 2.0 * math.pi * V_K / (g0 * math.tan(mu)))
    assert (end.x, end.y, end.z, end.V_K) == pytest.approx((0.0, 0.0, -100.0, V_K), abs=1e-5)
    assert np.array(rotation(end.q)) == pytest.approx(np.array(rotation(start.q)), abs=1e-7)


@given(angle, climb, angle, speed, load, load, load, st.floats(-7.0, 7.0))
def test_acceleration_is_specific_force_plus_gravity(
    chi: float, gamma: float, mu: float, V_K: float, n_x: float, n_y: float, n_z: float, p_Kbar: float
) -> None:
    state = flight_path(chi, gamma, mu, V_K)
    rate = rates(state, (n_x, n_y, n_z), p_Kbar)
    step = 1e-6

    def velocity(s: float) -> NDArray[np.float64]:
        R = np.array(rotation([q + s * dot for q, dot in zip(state.q, rate.q, strict=True)]))
        return (state.V_K + s * rate.V_K) * R[:, 0]

    acceleration = (velocity(step) - velocity(-step)) / (2.0 * step)
    specific_force = g0 * np.array(rotation(state.q)) @ np.array([n_x, n_y, -n_z])
    assert acceleration == pytest.approx(specific_force + np.array([0.0, 0.0, g0]), abs=1e-5)


@given(angle, climb, angle, speed, st.floats(-7.0, 7.0))
def test_roll_rate_turns_about_the_velocity_alone(
    chi: float, gamma: float, mu: float, V_K: float, p_Kbar: float
) -> None:
    state = flight_path(chi, gamma, mu, V_K)
    R = rotation(state.q)
    # load factors that carry the weight: the path stays straight
    rate = rates(state, (0.0, -R[2][1], R[2][2]), p_Kbar)
    chi_dot, gamma_dot, mu_dot = angle_rates(state, rate)
    assert (chi_dot, gamma_dot) == (pytest.approx(0.0, abs=1e-5), pytest.approx(0.0, abs=1e-5))
    assert mu_dot == pytest.approx(p_Kbar, abs=1e-5)


def test_without_forces_the_path_is_the_throw_parabola() -> None:
    gamma, V_K, t = math.radians(60.0), 70.0, 8.0
    end = fly(flight_path(0.4, gamma, 0.0, V_K), (0.0, 0.0, 0.0), t)
    reach = V_K * math.cos(gamma) * t
    assert (end.x, end.y) == pytest.approx((reach * math.cos(0.4), reach * math.sin(0.4)), abs=1e-6)
    assert end.z == pytest.approx(-100.0 - V_K * math.sin(gamma) * t + 0.5 * g0 * t**2, abs=1e-6)


def test_loop_passes_the_vertical_and_comes_back_upright() -> None:
    # forces that carry the weight and add a constant turn upward: a perfect circle in the vertical plane
    V_K, turn = 80.0, 5.0 * g0

    def derivative(_: float, x: NDArray[np.float64]) -> list[float]:
        state = FlightPathState[float].split(x)
        R = rotation(state.q)
        return list(rates(state, (-R[2][0], -R[2][1], R[2][2] + turn / g0)).join())

    start = flight_path(0.9, 0.0, 0.0, V_K)
    period = 2.0 * math.pi * V_K / turn
    half = solve_ivp(derivative, (0.0, period / 2.0), list(start.join()), rtol=1e-10, atol=1e-10).y[:, -1]
    full = solve_ivp(derivative, (0.0, period), list(start.join()), rtol=1e-10, atol=1e-10).y[:, -1]
    top, end = FlightPathState[float].split(half), FlightPathState[float].split(full)
    assert top.z == pytest.approx(-100.0 - 2.0 * V_K**2 / turn, abs=1e-5)
    assert rotation(top.q)[2][2] == pytest.approx(-1.0, abs=1e-8)
    assert (end.x, end.y, end.z) == pytest.approx((0.0, 0.0, -100.0), abs=1e-5)
    assert np.array(rotation(end.q)) == pytest.approx(np.array(rotation(start.q)), abs=1e-7)


g = st.floats(-10.0, 10.0)


@given(states, g, g, g, st.floats(-7.0, 7.0))
def test_inverse_of_the_outer_loop_is_its_inverse(
    state: PointMassState[float], n_x: float, n_y: float, n_z: float, p_Kbar: float
) -> None:
    given_factors = {"n_x": n_x, "n_y": n_y, "n_z": n_z, "p_Kbar": p_Kbar}
    rates = flight_path_rates(state, rotation(state.q), **given_factors)
    assert vars(load_factors_of_motion(state, rates)) == pytest.approx(given_factors, abs=1e-9)


@given(states, st.floats(0.5, 2.0), g, g)
def test_length_of_the_quaternion_does_not_matter(
    state: PointMassState[float], length: float, n_y: float, n_z: float
) -> None:
    q0, q1, q2, q3 = (length * one for one in state.q)
    longer = FlightPathState(x=0.0, y=0.0, z=-9.0, V_K=state.V_K, q0=q0, q1=q1, q2=q2, q3=q3)
    rates = flight_path_rates(longer, rotation(longer.q), n_x=0.0, n_y=n_y, n_z=n_z, p_Kbar=1.0)
    read = load_factors_of_motion(longer, rates)
    assert (read.n_y, read.n_z, read.p_Kbar) == pytest.approx((n_y, n_z, 1.0), abs=1e-9)


@given(states, controls, windy_airs)
def test_load_factors_of_the_point_mass_are_its_states(
    edge540: Aircraft, rules: Rules, state: PointMassState[float], control: PointMassControl[float], air: Air
) -> None:
    model = build_point_mass(edge540, rules, air)
    read = load_factors(model.system)(state.join(), control.join(), model.parameter_values)
    n = LoadFactors[float].split(np.asarray(read).ravel())
    assert (n.n_y, n.n_z, n.p_Kbar) == pytest.approx((state.n_y, state.n_z, state.p_Kbar), abs=1e-9)


@given(st.floats(-0.2, 0.25), st.floats(-0.2, 0.2), st.floats(-4.0, 4.0), st.floats(-0.4, 0.4))
def test_load_factors_of_six_degrees_of_freedom_are_its_path_quantities(
    edge540: Aircraft, rules: Rules, alpha: float, beta: float, p: float, zeta: float
) -> None:
    model = build_six_dof(edge540, rules, Air())
    flight = [0.0, 0.0, -50.0, 80.0, math.cos(0.4), math.sin(0.4), 0.0, 0.0, 0.7]
    x, u = [*flight, alpha, beta, p, 0.3, 0.2, -0.1, 0.1, zeta], [0.0, 0.0, 0.0, 1.0]
    arguments = (x, u, model.parameter_values)
    read = LoadFactors[float].split(np.asarray(load_factors(model.system)(*arguments)).ravel())
    assert model.system.path_values is not None
    seen = np.asarray(model.system.path_values(*arguments)).ravel()
    path = dict(zip([one.name for one in model.system.path], seen, strict=True))
    assert (read.n_z, read.n_y, read.p_Kbar) == pytest.approx([path[name] for name in ("n_z", "n_y", "p_Kbar")])
