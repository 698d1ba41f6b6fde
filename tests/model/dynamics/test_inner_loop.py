"""Inner loops: their systems, linear models, corrections of modes and inverses."""

import dataclasses
import math

import numpy as np
import pytest
from bodies import (
    KNOT,
    Array,
    as_state_space_inversion,
    as_transfer_functions,
    bodies,
    endless_wing,
    fly_six_dof,
    fly_state_space,
    fly_state_space_inversion,
    fly_transfer_functions,
    level_trim,
    surroundings,
    with_airframe,
)
from flights import windy_airs
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import root

from airrace.model.aircraft import Aircraft, LinearLoops, Mode, Propeller, inner_loop_parameters
from airrace.model.dynamics.rigid_body import body_axes, lags, level_lags, linear_parameters, stability_axes
from airrace.model.dynamics.six_dof import SixDofState
from airrace.model.dynamics.state_space import StateSpaceState, normal_load_factor, surrounding
from airrace.model.dynamics.state_space_inversion import (
    ALPHA_BANDWIDTH,
    BETA_BANDWIDTH,
    P_BANDWIDTH,
    Q_BANDWIDTH,
    R_BANDWIDTH,
    StateSpaceInversionState,
    angle_of_attack,
    deflections,
    sideslip,
)
from airrace.model.environment import RHO_ISA, Air, g0
from airrace.model.frames import quaternion, rotation

SPEEDS = (55.0, 75.0, 95.0)
LONGITUDINAL, LATERAL = ("alpha_K", "q_K"), ("beta_K", "p_s", "r_s")


def to_linear(trim: SixDofState[float]) -> StateSpaceState[float]:
    p_s, r_s = stability_axes(trim.alpha_K, trim.p_K, trim.r_K)
    values = vars(trim) | {"p_s": p_s, "r_s": r_s}
    return StateSpaceState(**{name: values[name] for name in StateSpaceState.names()})


def to_six_dof(state: StateSpaceState[float]) -> SixDofState[float]:
    p, r = body_axes(state.alpha_K, state.p_s, state.r_s)
    values = vars(state) | {"p_K": p, "r_K": r}
    return SixDofState(**{name: values[name] for name in SixDofState.names()})


def linear_answer(aircraft: Aircraft, state: StateSpaceState[float], rows: tuple[str, ...]) -> list[float]:
    rate, path = fly_state_space(aircraft, Air(), state)
    return [getattr(rate, one) for one in rows] + [path.n_z, path.n_y]


def true_answer(aircraft: Aircraft, state: StateSpaceState[float], rows: tuple[str, ...]) -> list[float]:
    """What the whole aircraft does, its rates in stability axes."""
    rate, path = fly_six_dof(aircraft, Air(), to_six_dof(state))
    p_dot, r_dot = stability_axes(state.alpha_K, rate.p_K, rate.r_K)
    found = vars(rate) | {"p_s": p_dot, "r_s": r_dot}
    return [found[one] for one in rows] + [path.n_z, path.n_y]


def difference_quotients(answer, aircraft: Aircraft, trim: StateSpaceState[float], rows, columns) -> Array:
    step = 1e-5

    def moved(name: str, sign: float) -> Array:
        state = dataclasses.replace(trim, **{name: getattr(trim, name) + sign * step})
        return np.array(answer(aircraft, state, rows))

    return np.column_stack([(moved(one, 1.0) - moved(one, -1.0)) / (2.0 * step) for one in columns])


@pytest.mark.parametrize("V_K", SPEEDS)
@pytest.mark.parametrize("I_xz", [0.0, 80.0])
@pytest.mark.parametrize(
    ("rows", "columns"), [(LONGITUDINAL, (*LONGITUDINAL, "eta")), (LATERAL, (*LATERAL, "xi", "zeta"))]
)
def test_linear_motions_are_the_linearisation_of_the_whole_aircraft_in_level_flight(
    edge540: Aircraft, V_K: float, I_xz: float, rows: tuple[str, ...], columns: tuple[str, ...]
) -> None:
    flown = with_airframe(endless_wing(edge540), I_xz=I_xz)
    trim = to_linear(level_trim(flown, V_K))
    linear, true = (difference_quotients(one, flown, trim, rows, columns) for one in (linear_answer, true_answer))
    # thrust pulls along x_B: T cos(alpha) instead of T, all that is left out; in g per rad
    thrust = trim.delta_T * 6200.0 / (698.0 * 9.8) * (1.0 - math.cos(trim.alpha_K))
    assert np.abs(linear[-2:] - true[-2:]).max() <= thrust + 1e-6
    assert linear[:-2] == pytest.approx(true[:-2], rel=2e-3, abs=2e-3)


@pytest.mark.parametrize("V_K", SPEEDS)
@pytest.mark.parametrize("rows", [LONGITUDINAL, LATERAL])
def test_modes_of_the_linear_motions_are_those_of_the_whole_aircraft(
    edge540: Aircraft, V_K: float, rows: tuple[str, ...]
) -> None:
    flown = endless_wing(edge540)
    trim = to_linear(level_trim(flown, V_K))
    linear, true = (
        np.linalg.eigvals(difference_quotients(one, flown, trim, rows, rows)[: len(rows)])
        for one in (linear_answer, true_answer)
    )
    assert np.sort_complex(linear) == pytest.approx(np.sort_complex(true), rel=1e-3)


@pytest.mark.parametrize("V_K", SPEEDS)
def test_neither_linear_motion_moves_the_other(edge540: Aircraft, V_K: float) -> None:
    trim = to_linear(level_trim(edge540, V_K))
    for rows, columns in ((LONGITUDINAL, (*LATERAL, "xi", "zeta")), (LATERAL, LONGITUDINAL)):
        motion = difference_quotients(linear_answer, edge540, trim, rows, columns)[: len(rows)]
        assert motion == pytest.approx(np.zeros_like(motion), abs=1e-9)


def test_roll_about_the_velocity_at_a_large_angle_needs_stability_axes(edge540: Aircraft) -> None:
    """The linear model's acceleration is the whole aircraft's, products of rates apart, at any angle of attack."""
    flown = endless_wing(edge540)
    trim = dataclasses.replace(to_linear(level_trim(flown, 70.0)), alpha_K=0.26)
    linear, true = (
        difference_quotients(one, flown, trim, LATERAL, (*LATERAL, "xi", "zeta"))[:3]
        for one in (linear_answer, true_answer)
    )
    # thrust along x_B and the flight path's turn, seen from the body, enter beta_K' only
    assert linear[1:] == pytest.approx(true[1:], rel=1e-9, abs=1e-7)
    assert linear[0] == pytest.approx(true[0], abs=0.02)


# --- known numbers -----------------------------------------------------------------------------------------------


def test_modes_of_the_edge_at_180_knots_are_the_known_ones(edge540: Aircraft) -> None:
    lag = lags(180.0 * KNOT, RHO_ISA, edge540.drag.C_D0, linear_parameters(edge540))
    omega_z, omega_y = math.sqrt(lag.stiffness_z), math.sqrt(lag.stiffness_y)
    assert (omega_z, omega_y) == pytest.approx((6.5, 5.0), abs=0.06)
    assert lag.damping_z / (2.0 * omega_z) == pytest.approx(0.66, abs=0.005)
    assert lag.damping_y / (2.0 * omega_y) == pytest.approx(0.16, abs=0.005)
    assert 1.0 / lag.roll == pytest.approx(0.08, abs=0.005)


def test_short_period_of_the_transfer_function_is_that_of_the_state_space(edge540: Aircraft) -> None:
    # but for the lift that pitch rate and elevator make
    flown = dataclasses.replace(edge540, lift=dataclasses.replace(edge540.lift, C_Lq=0.0, C_Leta=0.0))
    trim = to_linear(level_trim(flown, 90.0))
    modes = np.linalg.eigvals(difference_quotients(linear_answer, flown, trim, LONGITUDINAL, LONGITUDINAL)[:2])
    lag = lags(90.0, RHO_ISA, 0.0, linear_parameters(flown))
    assert abs(modes[0]) ** 2 == pytest.approx(lag.stiffness_z, rel=0.05)
    assert -2.0 * modes[0].real == pytest.approx(lag.damping_z, rel=0.05)


# --- transfer functions ------------------------------------------------------------------------------------------


@given(bodies, windy_airs)
def test_a_command_that_is_met_is_held(edge540: Aircraft, some: SixDofState[float], air) -> None:
    state = as_transfer_functions(some)
    met = dataclasses.replace(state, n_z_cmd=state.n_z, n_y_cmd=state.n_y, p_cmd=state.p_Kbar, n_z_dot=0.0, n_y_dot=0.0)
    rate, _ = fly_transfer_functions(edge540, air, met)
    assert (rate.n_z, rate.n_z_dot, rate.n_y, rate.n_y_dot, rate.p_Kbar) == (0.0, 0.0, 0.0, 0.0, 0.0)


def test_lags_grow_shorter_with_the_speed_and_longer_with_the_height(edge540: Aircraft) -> None:
    number = linear_parameters(edge540)
    slow, fast, high = lags(60.0, 1.2, 0.03, number), lags(90.0, 1.2, 0.03, number), lags(60.0, 1.0, 0.03, number)
    for name in vars(slow):
        assert getattr(high, name) < getattr(slow, name) < getattr(fast, name)


GIVEN = LinearLoops(V=90.0, short_period=Mode(8.0, 0.7), dutch_roll=Mode(4.0, 0.3), tau_p=0.12)


def test_constants_given_are_flown_at_the_speed_they_are_given_for(edge540: Aircraft) -> None:
    lag = level_lags(linear_parameters(dataclasses.replace(edge540, linear=GIVEN)), 90.0)
    assert math.sqrt(lag.stiffness_z) == pytest.approx(8.0, rel=1e-12)
    assert lag.damping_z == pytest.approx(2.0 * 0.7 * 8.0, rel=1e-12)
    assert math.sqrt(lag.stiffness_y) == pytest.approx(4.0, rel=1e-12)
    assert lag.damping_y == pytest.approx(2.0 * 0.3 * 4.0, rel=1e-12)
    assert 1.0 / lag.roll == pytest.approx(0.12, rel=1e-12)


def test_constants_equal_to_the_aircrafts_own_change_nothing(edge540: Aircraft) -> None:
    own, V = level_lags(inner_loop_parameters(edge540), 80.0), 80.0
    omega_z, omega_y = math.sqrt(own.stiffness_z), math.sqrt(own.stiffness_y)
    same = LinearLoops(
        V,
        Mode(omega_z, own.damping_z / (2.0 * omega_z)),
        Mode(omega_y, own.damping_y / (2.0 * omega_y)),
        1.0 / own.roll,
    )
    corrected = linear_parameters(dataclasses.replace(edge540, linear=same))
    assert list(corrected.join()) == pytest.approx(list(inner_loop_parameters(edge540).join()), rel=1e-10)


@pytest.mark.parametrize("part", ["short_period", "dutch_roll", "tau_p"])
def test_what_is_not_given_stays(edge540: Aircraft, part: str) -> None:
    alone = dataclasses.replace(LinearLoops(90.0), **{part: getattr(GIVEN, part)})
    before, after = (vars(linear_parameters(dataclasses.replace(edge540, linear=given))) for given in (None, alone))
    touched = {name for name in before if before[name] != after[name]}
    expected = {
        "short_period": {"C_malpha", "C_mq", "C_malphadot"},
        "dutch_roll": {"C_nbeta", "C_nr"},
        "tau_p": {"C_lp"},
    }
    assert touched == expected[part]


def test_six_degrees_of_freedom_know_no_corrections(edge540: Aircraft) -> None:
    corrected = dataclasses.replace(edge540, linear=GIVEN)
    assert inner_loop_parameters(corrected) == inner_loop_parameters(edge540)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_torque_of_the_propeller_is_the_engines_power_over_its_rate_of_turn(edge540: Aircraft, sense: float) -> None:
    Omega = sense * 2700.0 * 2.0 * math.pi / 60.0
    turning = dataclasses.replace(edge540, propeller=Propeller(5.26, Omega))
    trim = dataclasses.replace(level_trim(edge540, 80.0), z=0.0, delta_T=1.0)
    alone, driven = (fly_six_dof(flown, Air(), trim)[0] for flown in (edge540, turning))
    torque = (driven.p_K - alone.p_K) * edge540.airframe.I_x
    assert pytest.approx(1.225, rel=1e-4) == RHO_ISA
    assert torque == pytest.approx(-223.7e3 / Omega, rel=1e-9)


def test_gyroscopic_moment_couples_pitch_and_yaw_by_the_angular_momentum(edge540: Aircraft) -> None:
    h = 5.26 * 2700.0 * 2.0 * math.pi / 60.0
    turning = dataclasses.replace(edge540, propeller=Propeller(5.26, h / 5.26))
    pitching = dataclasses.replace(level_trim(edge540, 80.0), delta_T=0.0, q_K=1.0, r_K=0.5)
    alone, driven = (fly_six_dof(flown, Air(), pitching)[0] for flown in (edge540, turning))
    assert (driven.r_K - alone.r_K) * edge540.airframe.I_z == pytest.approx(h * 1.0, rel=1e-9)
    assert (driven.q_K - alone.q_K) * edge540.airframe.I_y == pytest.approx(-h * 0.5, rel=1e-9)


commands = st.fixed_dictionaries(
    {"n_z_cmd": st.floats(-4.0, 10.0), "n_y_cmd": st.floats(-0.5, 0.5), "p_cmd": st.floats(-6.0, 6.0)}
)
NAMES = ("alpha_K", "beta_K", "p_s", "q_K", "r_s")


def inverted(aircraft: Aircraft, air: Air, state: StateSpaceInversionState[float]) -> StateSpaceState[float]:
    """The state of the inner loop with the deflections that its inverse asks for."""
    number = linear_parameters(aircraft)
    here = surrounding(state, aircraft=number, **surroundings(air))
    values = vars(state) | vars(deflections(state, here, number))
    return StateSpaceState(**{name: values[name] for name in StateSpaceState.names()})


@settings(max_examples=40)
@given(bodies, windy_airs, commands)
def test_inner_loop_answers_its_inverse_with_the_accelerations_asked_for(
    edge540: Aircraft, some: SixDofState[float], air: Air, wanted: dict[str, float]
) -> None:
    flown, state = with_airframe(edge540, I_xz=80.0), dataclasses.replace(as_state_space_inversion(some), **wanted)
    plant = inverted(flown, air, state)
    rate, path = fly_state_space(flown, air, plant)
    number = linear_parameters(flown)
    here = surrounding(state, aircraft=number, **surroundings(air))
    R = rotation(state.q)
    q_Kbar, r_Kbar = g0 * (path.n_z - R[2][2]) / state.V_K, g0 * (path.n_y + R[2][1]) / state.V_K
    C_L = normal_load_factor(state, plant.eta, here, number)[1]
    beta_des = sideslip(state.n_y_cmd, state, C_L, here, number)
    alpha_error = angle_of_attack(state.n_z_cmd, state, here, number) - path.alpha_A
    q_des = q_Kbar + ALPHA_BANDWIDTH * alpha_error
    r_des = r_Kbar - BETA_BANDWIDTH * (beta_des - path.beta_A)
    assert rate.p_s == pytest.approx(P_BANDWIDTH * (state.p_cmd - state.p_s), rel=1e-9, abs=1e-7)
    assert rate.q_K == pytest.approx(Q_BANDWIDTH * (q_des - state.q_K), rel=1e-9, abs=1e-7)
    assert rate.r_s == pytest.approx(R_BANDWIDTH * (r_des - state.r_s), rel=1e-9, abs=1e-7)


@settings(max_examples=40)
@given(bodies, windy_airs)
def test_controlled_model_is_the_inner_loop_behind_its_inverse(
    edge540: Aircraft, some: SixDofState[float], air: Air
) -> None:
    state = as_state_space_inversion(some)
    plant = inverted(edge540, air, state)
    rate, path = fly_state_space_inversion(edge540, air, state)
    plant_rate, plant_path = fly_state_space(edge540, air, plant)
    assert [getattr(rate, one) for one in NAMES] == pytest.approx([getattr(plant_rate, one) for one in NAMES])
    assert (path.eta, path.xi, path.zeta) == pytest.approx((plant.eta, plant.xi, plant.zeta))
    assert (path.n_z, path.n_y, path.C_L) == pytest.approx((plant_path.n_z, plant_path.n_y, plant_path.C_L))


@pytest.mark.parametrize("mu", [0.0, -0.6, 1.3])
@pytest.mark.parametrize(("n_z", "n_y"), [(1.0, 0.0), (4.0, 0.1), (-1.5, -0.2)])
def test_load_factors_commanded_are_those_of_the_steady_flight(
    edge540: Aircraft, mu: float, n_z: float, n_y: float
) -> None:
    q0, q1, q2, q3 = quaternion(0.4, 0.1, mu)
    values = vars(level_trim(edge540, 85.0)) | {"q0": q0, "q1": q1, "q2": q2, "q3": q3, "p_s": 0.0, "r_s": 0.0}
    values |= {"n_z_cmd": n_z, "n_y_cmd": n_y, "p_cmd": 0.0}
    base = StateSpaceInversionState(**{name: values[name] for name in StateSpaceInversionState.names()})

    def residual(unknowns: Array) -> list[float]:
        rate, _ = fly_state_space_inversion(
            edge540, Air(), dataclasses.replace(base, **dict(zip(NAMES, unknowns, strict=True)))
        )
        return [getattr(rate, one) for one in NAMES]

    found = root(residual, [0.05, 0.0, 0.0, 0.0, 0.0], tol=1e-12).x
    assert residual(found) == pytest.approx([0.0] * 5, abs=1e-9)
    steady = dataclasses.replace(base, **dict(zip(NAMES, (float(one) for one in found), strict=True)))
    _, path = fly_state_space_inversion(edge540, Air(), steady)
    assert (path.n_z, path.n_y, steady.p_s) == pytest.approx((n_z, n_y, 0.0), abs=1e-9)


def test_commands_held_for_two_seconds_are_flown(edge540: Aircraft) -> None:
    trim = level_trim(edge540, 90.0)
    values = vars(trim) | {"p_s": 0.0, "r_s": 0.0, "n_z_cmd": 5.0, "n_y_cmd": 0.15, "p_cmd": 0.0, "delta_T": 1.0}
    start = StateSpaceInversionState(**{name: values[name] for name in StateSpaceInversionState.names()})

    def derivative(_: float, x: Array) -> list[float]:
        state = StateSpaceInversionState[float].split(x)
        return list(fly_state_space_inversion(edge540, Air(), state)[0].join())

    x = solve_ivp(derivative, (0.0, 2.0), list(start.join()), rtol=1e-9, atol=1e-9).y[:, -1]
    _, path = fly_state_space_inversion(edge540, Air(), StateSpaceInversionState[float].split(x))
    # what is left is the lag behind a trim that moves as the aircraft climbs and slows down
    assert path.n_z == pytest.approx(5.0, abs=0.25)
    assert path.n_y == pytest.approx(0.15, abs=0.03)


def test_a_roll_rate_commanded_in_flight_is_reached_within_a_third_of_a_second(edge540: Aircraft) -> None:
    values = vars(level_trim(edge540, 90.0)) | {"p_s": 0.0, "r_s": 0.0, "n_z_cmd": 1.0, "n_y_cmd": 0.0, "p_cmd": 4.0}
    start = StateSpaceInversionState(**{name: values[name] for name in StateSpaceInversionState.names()})

    def derivative(_: float, x: Array) -> list[float]:
        state = StateSpaceInversionState[float].split(x)
        return list(fly_state_space_inversion(edge540, Air(), state)[0].join())

    times = np.linspace(0.0, 0.33, 12)
    flown = solve_ivp(derivative, (0.0, 0.33), list(start.join()), rtol=1e-9, atol=1e-9, t_eval=times).y
    rolling = StateSpaceInversionState.split(flown).p_s
    # the first-order lag of the chain's gain, whatever else the aircraft does
    assert rolling == pytest.approx(4.0 * (1.0 - np.exp(-P_BANDWIDTH * times)), abs=1e-5)
