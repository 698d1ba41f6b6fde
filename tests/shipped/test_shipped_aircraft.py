"""What the shipped numbers of an aircraft come to, against what is published for its type."""

import math
from pathlib import Path

import pytest

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.atmosphere import RHO_ISA, g0
from airrace.inputs import load_inputs

ROOT = Path(__file__).parents[2]
KNOT = 1852.0 / 3600.0
KMH = 1.0 / 3.6


def aircraft(name: str) -> Aircraft:
    return load_inputs(ROOT / "tracks/rovinj_2014.yaml", aircraft=ROOT / "configs" / f"{name}.yaml").race.aircraft


PC9 = aircraft("pc9")
EDGE = aircraft("edge540")


def stall_speed(flown: Aircraft, m: float) -> float:
    """Least speed of level flight at sea level with the mass `m`, m/s."""
    return math.sqrt(2.0 * m * g0 / (RHO_ISA * flown.airframe.S * flown.lift.C_L_max))


def top_speed(flown: Aircraft) -> float:
    """Speed at which full thrust balances the drag of level flight at sea level, m/s."""
    slow, fast = 60.0, 200.0
    while fast - slow > 1e-6:
        V = 0.5 * (slow + fast)
        slow, fast = (V, fast) if excess_thrust(flown, V) > 0.0 else (slow, V)
    return slow


def excess_thrust(flown: Aircraft, V: float) -> float:
    engine, drag, airframe = flown.propulsion, flown.drag, flown.airframe
    power = engine.eta_p * engine.P_max
    qS = 0.5 * RHO_ISA * V**2 * airframe.S
    C_L = airframe.m * g0 / qS
    return power / math.hypot(V, power / engine.T_static) - qS * (drag.C_D0 + drag.k * (C_L - drag.C_L_minD) ** 2)


def full_aileron_roll_rate(flown: Aircraft, V: float) -> float:
    """Steady roll rate at which damping balances the ailerons, rad/s."""
    return flown.roll.xi / flown.roll.p * flown.surfaces.xi.upper * 2.0 * V / flown.airframe.b


def test_pc9_is_as_fast_at_sea_level_as_published() -> None:
    assert top_speed(PC9) == pytest.approx(496 * KMH, rel=0.02)


def test_pc9_stalls_where_the_type_does() -> None:
    assert stall_speed(PC9, 2250.0) == pytest.approx(79 * KNOT, rel=0.01)


def test_pc9_reaches_its_load_factor_limit_near_200_knots() -> None:
    V = stall_speed(PC9, PC9.airframe.m) * math.sqrt(PC9.envelope.n_z.upper)
    assert pytest.approx(200 * KNOT, rel=0.02) == V


@pytest.mark.parametrize("flown", [PC9, EDGE], ids=lambda flown: flown.name)
def test_speed_limits_lie_above_the_stall_and_the_top_speed(flown: Aircraft) -> None:
    assert flown.envelope.V.lower == pytest.approx(1.2 * stall_speed(flown, flown.airframe.m), rel=0.03)
    assert flown.envelope.V.upper > 1.05 * top_speed(flown)


@pytest.mark.parametrize("flown", [PC9, EDGE], ids=lambda flown: flown.name)
def test_the_point_mass_rolls_about_as_fast_as_full_ailerons_make_it(flown: Aircraft) -> None:
    assert flown.point_mass.p == pytest.approx(full_aileron_roll_rate(flown, 180 * KNOT), rel=0.15)


@pytest.mark.parametrize("flown", [PC9, EDGE], ids=lambda flown: flown.name)
def test_the_sideslip_limit_binds_before_the_lateral_load_factor_does(flown: Aircraft) -> None:
    """The rudder that holds the sideslip takes part of its side force away."""
    beta, V = flown.drag.beta_A_max, flown.envelope.V.upper
    zeta = -flown.yaw.beta * beta / flown.yaw.zeta
    C_Y = flown.side_force.beta * beta + flown.side_force.zeta * zeta
    n_y = 0.5 * RHO_ISA * V**2 * flown.airframe.S * abs(C_Y) / (flown.airframe.m * g0)
    assert n_y < flown.point_mass.n_y
