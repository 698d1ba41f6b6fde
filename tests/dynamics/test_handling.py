"""What is said of aircraft that handle badly, and that nothing is said of those that do not."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import fly_state_space, level_trim, surroundings, with_pitch

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.handling import (
    corner_speed,
    faults,
    lateral_modes,
    remarks,
    sideslip_trim,
    trimmed_side_force,
)
from airrace.dynamics.inner_loop_parameters import inner_loop_parameters
from airrace.dynamics.linear_derivatives import level_lags, linear_parameters
from airrace.dynamics.linear_flight import surrounding
from airrace.dynamics.state_space import StateSpaceState
from airrace.dynamics.state_space_inverse import Commands, deflections
from airrace.environment.air import Air
from airrace.inputs import load_inputs
from airrace.quantities import Interval

ROOT = Path(__file__).parents[2]


def changed(aircraft: Aircraft, group: str, **values: Any) -> Aircraft:
    return dataclasses.replace(aircraft, **{group: dataclasses.replace(getattr(aircraft, group), **values)})


@pytest.mark.parametrize("name", ["edge540", "pc9"])
def test_nothing_is_wrong_with_the_shipped_aircraft(name: str) -> None:
    race = load_inputs(ROOT / "tracks/rovinj_2014.yaml", aircraft=ROOT / "configs" / f"{name}.yaml").race
    assert faults(race.aircraft) == ()
    assert remarks(race.aircraft) == ()


# --- remarks -----------------------------------------------------------------------------------------------------


def test_a_centre_of_gravity_behind_the_neutral_point_is_named_with_its_margin(edge540: Aircraft) -> None:
    (said,) = remarks(with_pitch(edge540, alpha=0.024))
    assert said.startswith("statically unstable in pitch: the centre of gravity lies 0.5 % of the mean chord behind")
    assert remarks(with_pitch(edge540, alpha=-0.024)) == ()


def test_the_manoeuvre_point_lies_where_the_short_period_loses_its_stiffness(edge540: Aircraft) -> None:
    V = corner_speed(edge540)

    def stiffness(alpha: float) -> float:
        return level_lags(inner_loop_parameters(with_pitch(edge540, alpha=alpha)), V).stiffness_z

    at_zero, slope = stiffness(0.0), stiffness(1.0) - stiffness(0.0)
    edge = -at_zero / slope
    assert edge > 0.0
    (before,) = remarks(with_pitch(edge540, alpha=0.99 * edge))
    (behind,) = remarks(with_pitch(edge540, alpha=1.01 * edge))
    assert "though before the manoeuvre point" in before
    assert "behind the manoeuvre point" in behind


def test_an_elevator_that_cannot_stall_the_aircraft_is_short(edge540: Aircraft) -> None:
    said = remarks(with_pitch(edge540, eta=-0.4))
    assert [one.split(" at ")[0] for one in said] == [
        "short of elevator: C_L_max",
        "short of elevator: C_L_min",
    ]
    assert "the travel ends at 25 deg" in said[0]


def test_ailerons_are_short_if_the_roll_rate_is_out_of_reach_at_the_top_speed(edge540: Aircraft) -> None:
    V, b = edge540.envelope.V.upper, edge540.airframe.b
    reached = edge540.roll.xi / edge540.roll.p * edge540.surfaces.xi.upper * 2.0 * V / b
    assert remarks(changed(edge540, "point_mass", p=0.99 * reached)) == ()
    (said,) = remarks(changed(edge540, "point_mass", p=1.01 * reached))
    assert said.startswith(f"short of ailerons: full deflection rolls at {math.degrees(reached):.0f} deg/s at 118 m/s")


def test_a_rudder_that_cannot_hold_the_sideslip_limit_is_short(edge540: Aircraft) -> None:
    needed = abs(sideslip_trim(inner_loop_parameters(edge540))[1]) * edge540.drag.beta_A_max
    assert remarks(changed(edge540, "surfaces", zeta=Interval(-1.01 * needed, 1.01 * needed))) == ()
    (said,) = remarks(changed(edge540, "surfaces", zeta=Interval(-0.99 * needed, 0.99 * needed)))
    assert said.startswith("short of rudder in sideslip: holding 12 deg of sideslip takes")


def test_a_fin_that_is_too_small_is_remarked_on(edge540: Aircraft) -> None:
    (said,) = remarks(changed(edge540, "yaw", beta=-0.05))
    assert said.startswith("unstable in yaw at 35 m/s: sideslip doubles every")
    assert said.endswith("(C_nbeta = -0.05, C_lbeta = -0.03)")


def test_a_dutch_roll_that_grows_is_remarked_on(edge540: Aircraft) -> None:
    # much dihedral, and a roll that swings the nose the wrong way
    loose = changed(edge540, "yaw", p=-1.0, p_per_C_L=0.0)
    (said,) = remarks(changed(loose, "roll", beta=-0.5))
    assert said.startswith("Dutch roll unstable at 35 m/s: it doubles every")


@pytest.mark.parametrize("V", [45.0, 90.0])
def test_lateral_modes_are_those_of_the_state_space(edge540: Aircraft, V: float) -> None:
    trim = level_trim(edge540, V)
    values = vars(trim) | {"p_s": 0.0, "r_s": 0.0, "z": 0.0, "delta_T": 0.0}
    base = StateSpaceState(**{name: values[name] for name in StateSpaceState.names()})
    names, step = ("beta_K", "p_s", "r_s"), 1e-6

    def rates(name: str, sign: float) -> list[float]:
        rate, _ = fly_state_space(edge540, Air(), dataclasses.replace(base, **{name: sign * step}))
        return [getattr(rate, one) for one in names]

    matrix = np.column_stack([(np.array(rates(one, 1.0)) - rates(one, -1.0)) / (2.0 * step) for one in names])
    # the lift of pitch rate and elevator is left out there
    expected = np.sort_complex(np.linalg.eigvals(matrix))
    assert np.sort_complex(lateral_modes(edge540, V)) == pytest.approx(expected, rel=0.02)


# --- faults ------------------------------------------------------------------------------------------------------


def test_ailerons_and_rudder_that_do_the_same_are_a_fault(edge540: Aircraft) -> None:
    same = changed(edge540, "yaw", xi=edge540.roll.xi * edge540.yaw.zeta / edge540.roll.zeta)
    ((group, key, message),) = faults(same)
    assert (group, key) == ("yaw", "C_nzeta")
    assert message.startswith("ailerons and rudder cannot be told apart")


def test_an_elevator_whose_lift_eats_the_wings_is_a_fault(edge540: Aircraft) -> None:
    ((group, key, message),) = faults(with_pitch(edge540, eta=-0.03))
    assert (group, key) == ("pitch", "C_meta")
    assert message.startswith("no elevator power")


def test_an_elevator_whose_lift_undoes_its_moment_is_a_fault(edge540: Aircraft) -> None:
    lifting = changed(edge540, "lift", C_Leta=-2.0)
    ((group, key, message),) = faults(with_pitch(lifting, alpha=0.0, eta=-0.02))
    assert (group, key) == ("pitch", "C_meta")
    assert message == "no elevator power: at 35 m/s the lift that it makes undoes what its moment does"


def test_a_rudder_that_takes_all_side_force_away_is_a_fault(edge540: Aircraft) -> None:
    gone = edge540.side_force.beta / sideslip_trim(inner_loop_parameters(edge540))[1]
    weak, strong = (changed(edge540, "side_force", zeta=-part * gone) for part in (0.99, 1.01))
    assert trimmed_side_force(inner_loop_parameters(weak)) < 0.0 < trimmed_side_force(inner_loop_parameters(strong))
    assert faults(weak) == ()
    ((group, key, _),) = faults(strong)
    assert (group, key) == ("side_force", "C_Ybeta")


@pytest.mark.parametrize("V_K", [35.0, 70.0, 118.0])
def test_commands_have_a_solution_for_an_aircraft_just_short_of_a_fault(edge540: Aircraft, V_K: float) -> None:
    weak = with_pitch(edge540, alpha=0.0, eta=-0.04)
    assert faults(weak) == ()
    number = linear_parameters(weak)
    values = vars(level_trim(edge540, V_K)) | {"p_s": 0.0, "r_s": 0.0}
    state = StateSpaceState(**{name: values[name] for name in StateSpaceState.names()})
    here = surrounding(state, aircraft=number, **surroundings(Air()))
    pull, hold = (deflections(state, Commands(n_z, 0.0, 0.0), here, number).eta for n_z in (3.0, 1.0))
    assert pull < hold
