"""The inverse of the linear inner loop against the inner loop itself."""

import dataclasses

import numpy as np
import pytest
from bodies import (
    Array,
    as_state_space_inversion,
    bodies,
    fly_state_space,
    fly_state_space_inversion,
    level_trim,
    mirrored,
    surroundings,
    with_airframe,
)
from flights import mirrored_air, windy_airs
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import root

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.linear_derivatives import linear_parameters
from airrace.dynamics.linear_flight import normal_load_factor, surrounding
from airrace.dynamics.six_dof import SixDofState
from airrace.dynamics.state_space import StateSpaceState
from airrace.dynamics.state_space_inverse import GAINS, Commands, Gains, angle_of_attack, deflections, sideslip
from airrace.dynamics.state_space_inversion import StateSpaceInversionState
from airrace.environment.air import Air
from airrace.environment.atmosphere import g0
from airrace.frames import quaternion, rotation

commands = st.builds(Commands, n_z=st.floats(-4.0, 10.0), n_y=st.floats(-0.5, 0.5), p=st.floats(-6.0, 6.0))
NAMES = ("alpha_K", "beta_K", "p_s", "q_K", "r_s")


def inverted(
    aircraft: Aircraft, air: Air, state: StateSpaceInversionState[float], wanted: Commands, gains: Gains = GAINS
) -> StateSpaceState[float]:
    """The state of the inner loop with the deflections that its inverse asks for."""
    number = linear_parameters(aircraft)
    here = surrounding(state, aircraft=number, **surroundings(air))
    values = vars(state) | vars(deflections(state, wanted, here, number, gains))
    return StateSpaceState(**{name: values[name] for name in StateSpaceState.names()})


@settings(max_examples=40)
@given(bodies, windy_airs, commands)
def test_inner_loop_answers_its_inverse_with_the_accelerations_asked_for(
    edge540: Aircraft, some: SixDofState[float], air: Air, wanted: Commands
) -> None:
    flown, state = with_airframe(edge540, I_xz=80.0), as_state_space_inversion(some)
    plant = inverted(flown, air, state, wanted)
    rate, path = fly_state_space(flown, air, plant)
    number = linear_parameters(flown)
    here = surrounding(state, aircraft=number, **surroundings(air))
    R = rotation(state.q)
    q_Kbar, r_Kbar = g0 * (path.n_z - R[2][2]) / state.V_K, g0 * (path.n_y + R[2][1]) / state.V_K
    C_L = normal_load_factor(state, plant.eta, here, number)[1]
    beta_des = sideslip(wanted.n_y, state, C_L, here, number)
    alpha_error = angle_of_attack(wanted.n_z, state, here, number) - path.alpha_A
    q_des = q_Kbar + GAINS.alpha * alpha_error
    r_des = r_Kbar - GAINS.beta * (beta_des - path.beta_A)
    assert rate.p_s == pytest.approx(GAINS.p * (wanted.p - state.p_s), rel=1e-9, abs=1e-7)
    assert rate.q_K == pytest.approx(GAINS.q * (q_des - state.q_K), rel=1e-9, abs=1e-7)
    assert rate.r_s == pytest.approx(GAINS.r * (r_des - state.r_s), rel=1e-9, abs=1e-7)


@settings(max_examples=40)
@given(bodies, windy_airs)
def test_controlled_model_is_the_inner_loop_behind_its_inverse(
    edge540: Aircraft, some: SixDofState[float], air: Air
) -> None:
    state = as_state_space_inversion(some)
    wanted = Commands(state.n_z_cmd, state.n_y_cmd, state.p_cmd)
    plant = inverted(edge540, air, state, wanted)
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
    assert rolling == pytest.approx(4.0 * (1.0 - np.exp(-GAINS.p * times)), abs=1e-5)


@settings(max_examples=40)
@given(bodies, windy_airs)
def test_a_mirrored_command_moves_the_surfaces_mirrored(edge540: Aircraft, some: SixDofState[float], air: Air) -> None:
    state = as_state_space_inversion(some)
    rate, path = fly_state_space_inversion(edge540, air, state)
    other_rate, other_path = fly_state_space_inversion(edge540, mirrored_air(air), mirrored(state))
    assert list(other_rate.join()) == pytest.approx(list(mirrored(rate).join()), rel=1e-8, abs=1e-8)
    assert list(other_path.join()) == pytest.approx(list(mirrored(path).join()), rel=1e-8, abs=1e-8)
