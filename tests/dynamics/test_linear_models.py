"""The linear models: the linearisation of the whole aircraft, with the modes of motion known of the type."""

import dataclasses
import math

import numpy as np
import pytest
from bodies import (
    KNOT,
    Array,
    as_state_space,
    as_transfer_functions,
    bodies,
    endless_wing,
    fly_six_dof,
    fly_state_space,
    fly_transfer_functions,
    level_trim,
    mirrored,
    with_airframe,
)
from flights import mirrored_air, windy_airs
from hypothesis import given

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.attitude import body_axes, stability_axes
from airrace.dynamics.linear_derivatives import lags, linear_parameters
from airrace.dynamics.six_dof import SixDofState
from airrace.dynamics.state_space import StateSpaceState
from airrace.environment.air import Air
from airrace.environment.atmosphere import RHO_ISA

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


def jacobian(answer, aircraft: Aircraft, trim: StateSpaceState[float], rows, columns) -> Array:
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
    linear, true = (jacobian(one, flown, trim, rows, columns) for one in (linear_answer, true_answer))
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
        np.linalg.eigvals(jacobian(one, flown, trim, rows, rows)[: len(rows)]) for one in (linear_answer, true_answer)
    )
    assert np.sort_complex(linear) == pytest.approx(np.sort_complex(true), rel=1e-3)


@pytest.mark.parametrize("V_K", SPEEDS)
def test_neither_linear_motion_moves_the_other(edge540: Aircraft, V_K: float) -> None:
    trim = to_linear(level_trim(edge540, V_K))
    for rows, columns in ((LONGITUDINAL, (*LATERAL, "xi", "zeta")), (LATERAL, LONGITUDINAL)):
        motion = jacobian(linear_answer, edge540, trim, rows, columns)[: len(rows)]
        assert motion == pytest.approx(np.zeros_like(motion), abs=1e-9)


def test_roll_about_the_velocity_at_a_large_angle_needs_stability_axes(edge540: Aircraft) -> None:
    """The linear model's acceleration is the whole aircraft's, products of rates apart, at any angle of attack."""
    flown = endless_wing(edge540)
    trim = dataclasses.replace(to_linear(level_trim(flown, 70.0)), alpha_K=0.26)
    linear, true = (
        jacobian(one, flown, trim, LATERAL, (*LATERAL, "xi", "zeta"))[:3] for one in (linear_answer, true_answer)
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
    modes = np.linalg.eigvals(jacobian(linear_answer, flown, trim, LONGITUDINAL, LONGITUDINAL)[:2])
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


@given(bodies, windy_airs)
def test_a_mirrored_aircraft_answers_mirrored(edge540: Aircraft, some: SixDofState[float], air: Air) -> None:
    for fly, state in (
        (fly_transfer_functions, as_transfer_functions(some)),
        (fly_state_space, as_state_space(some)),
    ):
        rate, path = fly(edge540, air, state)
        other_rate, other_path = fly(edge540, mirrored_air(air), mirrored(state))
        assert list(other_rate.join()) == pytest.approx(list(mirrored(rate).join()), rel=1e-9, abs=1e-8)
        assert list(other_path.join()) == pytest.approx(list(mirrored(path).join()), rel=1e-9, abs=1e-8)


def test_lags_grow_shorter_with_the_speed_and_longer_with_the_height(edge540: Aircraft) -> None:
    number = linear_parameters(edge540)
    slow, fast, high = lags(60.0, 1.2, 0.03, number), lags(90.0, 1.2, 0.03, number), lags(60.0, 1.0, 0.03, number)
    for name in vars(slow):
        assert getattr(high, name) < getattr(slow, name) < getattr(fast, name)
