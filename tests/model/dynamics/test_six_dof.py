"""The whole aircraft against the equations in body axes, in a moving frame, in a mirror, and in trim."""

import dataclasses
import math

import numpy as np
import pytest
from bodies import (
    STICK_FREE,
    Array,
    bodies,
    body_attitude,
    fly_six_dof,
    level_trim,
    wind_at,
    with_airframe,
    with_pitch,
)
from flights import windy_airs
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from airrace.model.aircraft import Aircraft, InnerLoopParameters, inner_loop_parameters
from airrace.model.dynamics.six_dof import SixDofState
from airrace.model.environment import RHO_ISA, Air, StaticWind, atmosphere_parameters, density, g0
from airrace.model.frames import angles, quaternion, rotation

PROPELLER = {"h_P": 1500.0, "Q_P": 700.0}


def stepped(state: SixDofState[float], rate: SixDofState[float], step: float) -> SixDofState[float]:
    return SixDofState[float].split([one + step * dot for one, dot in zip(state.join(), rate.join(), strict=True)])


def ground_velocity(state: SixDofState[float]) -> Array:
    return state.V_K * body_attitude(state) @ heading_in_body(state.alpha_K, state.beta_K)


def heading_in_body(alpha: float, beta: float) -> Array:
    return np.array([math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)])


def in_body_axes(
    number: InnerLoopParameters[float], air: Air, state: SixDofState[float]
) -> tuple[Array, Array, float, float]:
    """Acceleration in O and angular acceleration in B by the textbook, with `C_L` and airspeed.

    Forces and moments come from the components (u, v, w) of velocities in the body; no flight-path frame occurs.
    """
    R_OB, omega = body_attitude(state), np.array([state.p_K, state.q_K, state.r_K])
    V_B = R_OB.T @ ground_velocity(state)
    u, v, w = R_OB.T @ (ground_velocity(state) - wind_at(air, (state.x, state.y, state.z)))
    V_A = math.sqrt(u * u + v * v + w * w)
    alpha, beta, rho = math.atan2(w, u), math.asin(v / V_A), density(state.z, atmosphere_parameters(air))
    qS = 0.5 * rho * V_A**2 * number.S
    span, chord = number.b / (2 * V_A), number.cbar / (2 * V_A)
    p, q, r = state.p_K * span, state.q_K * chord, state.r_K * span
    line, wide = number.C_L0 + number.C_Lalpha * alpha, 0.05
    high, low = line - number.C_L_min, line - number.C_L_max
    wing = 0.5 * (number.C_L_min + number.C_L_max + math.hypot(high, wide) - math.hypot(low, wide))
    C_L = wing + number.C_Lq * q + number.C_Leta * state.eta
    C_D = number.C_D0 + number.k * (C_L - number.C_L_minD) ** 2 + number.C_Dbeta2 * beta**2
    C_Y = number.C_Ybeta * beta + number.C_Yp * p + number.C_Yr * r
    C_Y += number.C_Yxi * state.xi + number.C_Yzeta * state.zeta
    wind_along = np.array([u, v, w]) / V_A
    lift_along = np.array([math.sin(alpha), 0.0, -math.cos(alpha)])
    side_along = np.cross(wind_along, lift_along)
    T = state.delta_T * number.P * (1.132 * rho / RHO_ISA - 0.132) / math.hypot(V_A, number.V_s)
    F = qS * (-C_D * wind_along + C_Y * side_along + C_L * lift_along) + np.array([T, 0.0, 0.0])
    acceleration = R_OB @ F / number.m + np.array([0.0, 0.0, g0])
    u_dot, _, w_dot = R_OB.T @ acceleration - np.cross(omega, V_B)
    alpha_dot = (V_B[0] * w_dot - V_B[2] * u_dot) / (V_B[0] ** 2 + V_B[2] ** 2)
    C_l = number.C_lbeta * beta + number.C_lp * p + (number.C_lr + number.C_lr_per_C_L * C_L) * r
    C_l += number.C_lxi * state.xi + number.C_lzeta * state.zeta
    C_m = number.C_m0 + number.C_malpha * alpha + number.C_mq * q + number.C_meta * state.eta
    C_m += number.C_malphadot * alpha_dot * chord
    C_n = number.C_nbeta * beta + (number.C_np + number.C_np_per_C_L * C_L) * p + number.C_nr * r
    C_n += number.C_nxi * state.xi + number.C_nzeta * state.zeta
    M = qS * np.array([number.b * C_l, number.cbar * C_m, number.b * C_n])
    M[0] -= state.delta_T * (1.132 * rho / RHO_ISA - 0.132) * number.Q_P
    I = np.array([[number.I_x, 0, -number.I_xz], [0, number.I_y, 0], [-number.I_xz, 0, number.I_z]])  # noqa: E741
    H = I @ omega + np.array([number.h_P, 0.0, 0.0])
    return acceleration, np.linalg.solve(I, M - np.cross(omega, H)), C_L, V_A


# --- the equations in body axes ----------------------------------------------------------------------------------


@settings(max_examples=40)
@given(bodies, windy_airs)
def test_rates_and_path_quantities_are_those_of_the_equations_in_body_axes(
    edge540: Aircraft, state: SixDofState[float], air: Air
) -> None:
    number = dataclasses.replace(inner_loop_parameters(with_airframe(edge540, I_xz=80.0)), **PROPELLER)
    rate, path = fly_six_dof(number, air, state)
    acceleration, turning, C_L, _ = in_body_axes(number, air, state)
    step = 1e-6
    ahead, behind = (ground_velocity(stepped(state, rate, sign * step)) for sign in (1.0, -1.0))
    assert (ahead - behind) / (2.0 * step) == pytest.approx(acceleration, rel=1e-6, abs=1e-5)
    assert np.array([rate.p_K, rate.q_K, rate.r_K]) == pytest.approx(turning, rel=1e-9, abs=1e-8)
    assert pytest.approx(C_L, rel=1e-12, abs=1e-12) == path.C_L
    # the body turns with its own rates
    ahead, behind = (body_attitude(stepped(state, rate, sign * step)) for sign in (1.0, -1.0))
    p, q, r = state.p_K, state.q_K, state.r_K
    spin = np.array([[0.0, -r, q], [r, 0.0, -p], [-q, p, 0.0]])
    assert (ahead - behind) / (2.0 * step) == pytest.approx(body_attitude(state) @ spin, abs=1e-7)
    # load factors are all forces but the weight
    R = np.array(rotation(state.q))
    specific = R.T @ (acceleration - np.array([0.0, 0.0, g0])) / g0
    expected = np.array([rate.V_K / g0 - R[2, 0], path.n_y, -path.n_z])
    assert specific == pytest.approx(expected, rel=1e-9, abs=1e-9)
    # the aerodynamic angles are those of the air in body axes
    seen = body_attitude(state).T @ (ground_velocity(state) - wind_at(air, (state.x, state.y, state.z)))
    along = heading_in_body(path.alpha_A, path.beta_A)
    assert seen == pytest.approx(float(np.linalg.norm(seen)) * along, rel=1e-9, abs=1e-9)


# --- laws --------------------------------------------------------------------------------------------------------


def flight(number: InnerLoopParameters[float], air: Air, start: SixDofState[float], t: float) -> SixDofState[float]:
    def derivative(_: float, x: Array) -> list[float]:
        return list(fly_six_dof(number, air, SixDofState[float].split(x))[0].join())

    end = solve_ivp(derivative, (0.0, t), list(start.join()), method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    return SixDofState[float].split([float(one) for one in end])


def seen_from_the_air(state: SixDofState[float], wind: Array, t: float) -> SixDofState[float]:
    """The same flight in the frame that drifts with a uniform wind since t seconds, where the air is still."""
    R_OB = body_attitude(state)
    velocity = ground_velocity(state) - wind
    V = float(np.linalg.norm(velocity))
    u, v, w = R_OB.T @ velocity / V
    alpha, beta = math.atan2(w, u), math.asin(v)
    q1, q2, q3, q0 = (Rotation.from_matrix(R_OB) * Rotation.from_euler("YZ", [-alpha, beta])).as_quat()
    drifted = dict(zip("xyz", np.array([state.x, state.y, state.z]) - wind * t, strict=True))
    return dataclasses.replace(state, V_K=V, alpha_K=alpha, beta_K=beta, q0=q0, q1=q1, q2=q2, q3=q3, **drifted)


@settings(max_examples=3, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(3.0, 15.0), st.floats(-0.02, 0.02))
def test_flight_in_uniform_wind_is_flight_in_still_air_seen_from_a_moving_frame(
    edge540: Aircraft, origin: float, speed: float, xi: float
) -> None:
    # the moment due to the rate of the kinematic angle of attack, not the aerodynamic one, tells the frames apart
    number = dataclasses.replace(inner_loop_parameters(with_pitch(edge540, C_malphadot=0.0)), **PROPELLER)
    air = Air(wind=StaticWind(origin, speed))
    trim = level_trim(edge540, 80.0)
    start = dataclasses.replace(trim, z=-400.0, xi=xi, eta=trim.eta - 0.03, zeta=0.02, beta_K=0.03)
    wind = wind_at(air, (0.0, 0.0, -400.0))
    blown = seen_from_the_air(flight(number, air, start, 5.0), wind, 5.0)
    still = flight(number, Air(), seen_from_the_air(start, wind, 0.0), 5.0)
    assert [blown.x, blown.y, blown.z] == pytest.approx([still.x, still.y, still.z], abs=1e-5)
    assert body_attitude(blown) == pytest.approx(body_attitude(still), abs=1e-6)
    names = ("V_K", "alpha_K", "beta_K", "p_K", "q_K", "r_K")
    assert [getattr(blown, one) for one in names] == pytest.approx([getattr(still, one) for one in names], abs=1e-6)


# --- trims -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("V_K", [45.0, 60.0, 80.0, 100.0])
def test_straight_and_level_flight_exists_within_the_travels(edge540: Aircraft, V_K: float) -> None:
    trim = level_trim(edge540, V_K)
    rate, path = fly_six_dof(edge540, Air(), trim, dataclasses.replace(STICK_FREE, delta_T_cmd=trim.delta_T))
    rest = [getattr(rate, name) for name in SixDofState.names() if name != "x"]
    assert rest == pytest.approx([0.0] * len(rest), abs=1e-9)
    assert path.n_z == pytest.approx(1.0, abs=1e-9)
    assert 0.0 < trim.delta_T < 1.0
    assert edge540.surfaces.eta.lower < trim.eta < edge540.surfaces.eta.upper
    assert 0.0 < trim.alpha_K < 0.25


@pytest.mark.parametrize("mu", [-0.9, 0.5, 1.1])
def test_steady_level_turns_obey_the_turn_law(edge540: Aircraft, mu: float) -> None:
    V_K, turn = 85.0, g0 * math.tan(mu) / 85.0
    q0, q1, q2, q3 = quaternion(0.0, 0.0, mu)
    base = dataclasses.replace(level_trim(edge540, V_K), q0=q0, q1=q1, q2=q2, q3=q3)
    names = ("delta_T", "alpha_K", "beta_K", "p_K", "q_K", "r_K", "eta", "xi", "zeta")

    def residual(unknowns: Array) -> list[float]:
        state = dataclasses.replace(base, **dict(zip(names, unknowns, strict=True)))
        rate, path = fly_six_dof(edge540, Air(), state)
        still = [rate.V_K, rate.alpha_K, rate.beta_K, rate.p_K, rate.q_K, rate.r_K]
        return [*still, path.p_Kbar, path.n_y, path.n_z - 1.0 / math.cos(mu)]

    found = root(residual, [getattr(base, name) for name in names], tol=1e-12).x
    state = dataclasses.replace(base, **dict(zip(names, found, strict=True)))
    assert residual(found) == pytest.approx([0.0] * 9, abs=1e-8)
    step, rate = 1e-5, fly_six_dof(edge540, Air(), state)[0]
    ahead, behind = (angles(rotation(stepped(state, rate, sign * step).q)) for sign in (1.0, -1.0))
    changes = [(one - other) / (2.0 * step) for one, other in zip(ahead, behind, strict=True)]
    assert changes == pytest.approx([turn, 0.0, 0.0], abs=1e-6)
    assert math.hypot(state.q_K, state.p_K, state.r_K) == pytest.approx(abs(turn), rel=1e-6)
