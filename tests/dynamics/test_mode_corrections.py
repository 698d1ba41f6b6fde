"""Constants of the linear loops, and the propeller, as an aircraft file gives them."""

import dataclasses
import math

import pytest
from bodies import fly_six_dof, level_trim

from airrace.aircraft.aircraft import Aircraft, LinearLoops, Mode, Propeller
from airrace.dynamics.inner_loop_parameters import inner_loop_parameters
from airrace.dynamics.linear_derivatives import level_lags, linear_parameters
from airrace.environment.air import Air
from airrace.environment.atmosphere import RHO_ISA

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
