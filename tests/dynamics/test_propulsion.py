"""Thrust and the power lever."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.aerodynamics import drag_coefficient
from airrace.dynamics.aircraft_parameters import AircraftParameters, aircraft_parameters
from airrace.dynamics.propulsion import lever_rate, power_ratio, thrust
from airrace.environment.atmosphere import RHO_ISA, g0

KNOT = 1852.0 / 3600.0
HORSEPOWER = 745.7


def with_power(aircraft: Aircraft, P_max: float) -> AircraftParameters[float]:
    stronger = dataclasses.replace(aircraft.propulsion, P_max=P_max)
    return aircraft_parameters(dataclasses.replace(aircraft, propulsion=stronger))


def test_thrust_at_rest_is_the_static_thrust(edge540: Aircraft) -> None:
    assert thrust(1.0, 0.0, RHO_ISA, aircraft_parameters(edge540)) == pytest.approx(6200.0, rel=1e-12)


def test_thrust_at_speed_tends_to_propulsive_power_over_speed(edge540: Aircraft) -> None:
    numbers = aircraft_parameters(edge540)
    assert thrust(1.0, 1e4, RHO_ISA, numbers) * 1e4 == pytest.approx(0.87 * 223.7e3, rel=1e-4)


@given(st.floats(0.0, 1.0), st.floats(0.0, 120.0))
def test_thrust_is_proportional_to_the_lever_and_falls_with_speed(
    edge540: Aircraft, delta_T: float, V_A: float
) -> None:
    numbers = aircraft_parameters(edge540)
    assert thrust(delta_T, V_A, 1.1, numbers) == pytest.approx(delta_T * thrust(1.0, V_A, 1.1, numbers), rel=1e-12)
    assert thrust(1.0, V_A + 1.0, 1.1, numbers) < thrust(1.0, V_A, 1.1, numbers)


def test_power_is_full_in_standard_air_and_lost_faster_than_density() -> None:
    assert power_ratio(RHO_ISA) == pytest.approx(1.0, rel=1e-12)
    assert power_ratio(0.8 * RHO_ISA) < 0.8


# thrust of a published 340 hp model of this aircraft flown in JSBSim: knots, N
@pytest.mark.parametrize(("knots", "newton"), [(147.0, 2689.0), (165.0, 2403.0), (183.0, 2361.0), (199.0, 2050.0)])
def test_thrust_agrees_with_a_published_model_of_the_aircraft(edge540: Aircraft, knots: float, newton: float) -> None:
    numbers = with_power(edge540, 340.0 * HORSEPOWER)
    assert thrust(1.0, knots * KNOT, RHO_ISA, numbers) == pytest.approx(newton, rel=0.08)


def test_published_top_speed_balances_thrust_and_drag(edge540: Aircraft) -> None:
    numbers, V = with_power(edge540, 340.0 * HORSEPOWER), 426.0 / 3.6
    qbar = 0.5 * RHO_ISA * V**2
    C_L = numbers.m * g0 / (qbar * numbers.S)
    D = qbar * numbers.S * drag_coefficient(C_L, 0.0, numbers)
    assert thrust(1.0, V, RHO_ISA, numbers) == pytest.approx(D, rel=0.02)


def test_lever_covers_two_thirds_of_a_step_in_its_time_constant(edge540: Aircraft) -> None:
    numbers = aircraft_parameters(edge540)
    flight = solve_ivp(lambda _, d: lever_rate(d, 1.0, numbers), (0.0, numbers.tau_T), [0.0], rtol=1e-10, atol=1e-12)
    assert flight.y[0, -1] == pytest.approx(0.632120559, abs=1e-7)
