"""Figures of steady flight: closed forms, and the balances that they stand for."""

import dataclasses
import math
from typing import Any

import pytest
from scipy.optimize import brentq

from airrace.aircraft import Aircraft, aircraft_parameters
from airrace.dynamics.flight_manual import (
    climb_rate,
    full_thrust,
    performance,
    roll_rate,
    stall_speed,
    sustained_load_factor,
    top_speed,
    under,
)
from airrace.environment import RHO_ISA, g0


def changed(aircraft: Aircraft, group: str, **values: Any) -> Aircraft:
    return dataclasses.replace(aircraft, **{group: dataclasses.replace(getattr(aircraft, group), **values)})


def drag(aircraft: Aircraft, V: float, load_factor: float) -> float:
    qS = 0.5 * RHO_ISA * V * V * aircraft.airframe.S
    C_L = load_factor * aircraft.airframe.m * g0 / qS
    return qS * (aircraft.drag.C_D0 + aircraft.drag.k * (C_L - aircraft.drag.C_L_minD) ** 2)


def test_the_wing_carries_the_weight_at_the_stall_at_its_largest_lift(edge540: Aircraft) -> None:
    lift = 0.5 * RHO_ISA * stall_speed(edge540) ** 2 * edge540.airframe.S * edge540.lift.C_L_max
    assert lift == pytest.approx(edge540.airframe.m * g0, rel=1e-12)


def test_thrust_balances_drag_at_the_top_speed_and_no_longer_beyond(edge540: Aircraft) -> None:
    V = top_speed(edge540)
    assert full_thrust(aircraft_parameters(edge540), V) == pytest.approx(drag(edge540, V, 1.0), rel=1e-9)
    assert all(
        full_thrust(aircraft_parameters(edge540), V + dV) < drag(edge540, V + dV, 1.0) for dV in (0.1, 1.0, 10.0, 100.0)
    )


def test_top_speed_without_induced_drag_is_that_of_the_closed_form(edge540: Aircraft) -> None:
    """Without a bound of the thrust and without induced drag `V^3 = 2 P/(rho S C_D0)`."""
    plain = changed(changed(edge540, "drag", k=1e-12), "propulsion", T_static=1e12)
    P = plain.propulsion.eta_p * plain.propulsion.P_max
    V = (2.0 * P / (RHO_ISA * plain.airframe.S * plain.drag.C_D0)) ** (1.0 / 3.0)
    assert top_speed(plain) == pytest.approx(V, rel=1e-6)


def test_an_aircraft_without_power_to_carry_itself_has_neither_top_speed_nor_turn(edge540: Aircraft) -> None:
    heavy = under(edge540, 20.0 * edge540.airframe.m, None)
    assert (top_speed(heavy), sustained_load_factor(heavy)) == (0.0, 0.0)
    assert climb_rate(heavy) < 0.0


def test_forces_balance_along_the_path_at_the_best_climb(edge540: Aircraft) -> None:
    """No speed climbs faster than by `m g0 sin gamma = T - D` with a lift of `m g0 cos gamma`."""
    weight, numbers = edge540.airframe.m * g0, aircraft_parameters(edge540)

    def climb(V: float) -> float:
        def excess(sine: float) -> float:
            return full_thrust(numbers, V) - drag(edge540, V, math.sqrt(1.0 - sine * sine)) - weight * sine

        return V * brentq(excess, -1.0, 1.0)

    best = max(climb(30.0 + 0.1 * step) for step in range(400))
    assert climb_rate(edge540) == pytest.approx(best, rel=1e-6)


@pytest.mark.parametrize("mass", [600.0, 698.0, 900.0])
def test_lighter_and_stronger_aircraft_climb_and_turn_better(edge540: Aircraft, mass: float) -> None:
    one = under(edge540, mass, None)
    lighter, stronger = under(edge540, 0.95 * mass, None), under(one, None, 1.05 * one.propulsion.P_max)
    for better in (lighter, stronger):
        assert climb_rate(better) > climb_rate(one)
        assert top_speed(better) > top_speed(one)
        assert sustained_load_factor(better) > sustained_load_factor(one)


def test_the_tightest_turn_is_held_by_the_thrust_and_no_speed_holds_a_tighter_one(edge540: Aircraft) -> None:
    n = sustained_load_factor(edge540)
    excess = [
        full_thrust(aircraft_parameters(edge540), V) - drag(edge540, V, n)
        for V in (30.0 + 0.05 * step for step in range(2000))
    ]
    assert max(excess) == pytest.approx(0.0, abs=0.1)


def test_damping_balances_the_ailerons_at_the_roll_rate(edge540: Aircraft) -> None:
    V, roll = 92.6, edge540.roll
    p = roll_rate(edge540, V)
    moment = roll.C_lxi * edge540.surfaces.xi.lower + roll.C_lp * p * edge540.airframe.b / (2.0 * V)
    assert moment == pytest.approx(0.0, abs=1e-12)
    assert roll_rate(edge540, 2.0 * V) == pytest.approx(2.0 * p, rel=1e-12)


def test_the_wing_reaches_the_largest_load_factor_at_V_A(edge540: Aircraft) -> None:
    found = performance(edge540)
    assert found.speed_max > found.V_A
    assert (found.V_A / found.stall) ** 2 == pytest.approx(edge540.envelope.n_z.upper, rel=1e-12)
    assert found.roll_rate == roll_rate(edge540, found.V_A)
    assert math.isclose(performance(edge540, 50.0).roll_rate, roll_rate(edge540, 50.0))
