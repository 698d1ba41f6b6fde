"""The pace of a plan is one the aircraft can keep."""

import dataclasses
import math

import pytest
from races import EDGE_540, RULES

from airrace.environment.atmosphere import g0
from airrace.planning.planning_model import AIR_DENSITY, cruise, top_speed
from airrace.quantities import Interval


def test_at_top_speed_thrust_power_balances_drag() -> None:
    V, S, drag, propulsion = top_speed(EDGE_540), EDGE_540.airframe.S, EDGE_540.drag, EDGE_540.propulsion
    lift = EDGE_540.airframe.m * g0 / (0.5 * AIR_DENSITY * V**2 * S)
    D = 0.5 * AIR_DENSITY * V**2 * S * (drag.C_D0 + drag.k * (lift - drag.C_L_minD) ** 2)
    power_needed = D * V
    assert power_needed == pytest.approx(propulsion.eta_p * propulsion.P_max, rel=1e-9)


def test_pace_lies_within_the_envelope_and_lift_and_limits_carry_its_turns() -> None:
    pace = cruise(EDGE_540, RULES)
    assert EDGE_540.envelope.V.lower < pace.V < top_speed(EDGE_540)
    lift = 0.5 * AIR_DENSITY * pace.V**2 * EDGE_540.airframe.S * EDGE_540.lift.C_L_max
    assert 1.0 < pace.n < min(RULES.n_z.upper, lift / (EDGE_540.airframe.m * g0))
    assert 0.0 < pace.p < EDGE_540.point_mass.p


@pytest.mark.parametrize("n_z_max", [4.5, 7.0, 10.0, 12.0])
def test_pace_never_pulls_more_than_the_rules_allow(n_z_max: float) -> None:
    pace = cruise(EDGE_540, dataclasses.replace(RULES, n_z=Interval(0.0, n_z_max)))
    assert 1.0 < pace.n < n_z_max


@pytest.mark.parametrize("n_z_max", [1.1, 1.5, 2.5])
def test_turns_stay_narrow_enough_to_plan_with_however_tight_the_limits(n_z_max: float) -> None:
    pace = cruise(EDGE_540, dataclasses.replace(RULES, n_z=Interval(0.0, n_z_max)))
    assert pace.n > 1.0
    assert pace.radius < 1500.0


def test_slow_envelope_holds_the_pace_back() -> None:
    slow = dataclasses.replace(EDGE_540, envelope=dataclasses.replace(EDGE_540.envelope, V=Interval(35.0, 60.0)))
    assert cruise(slow, RULES).V <= 60.0


def test_radius_is_that_of_a_level_turn() -> None:
    pace = cruise(EDGE_540, RULES)
    bank = math.acos(1.0 / pace.n)
    chi_dot = g0 * math.tan(bank) / pace.V
    assert pace.radius == pytest.approx(pace.V / chi_dot, rel=1e-12)
