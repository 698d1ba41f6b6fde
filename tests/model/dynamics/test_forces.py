"""Forces, handling qualities, limits, safety lines and climb."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from bodies import fly_state_space, level_trim, surroundings, with_pitch
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.model.aircraft import Aircraft, AircraftParameters, aircraft_parameters, inner_loop_parameters
from airrace.model.dynamics.aerodynamics import (
    LoadFactorPath,
    drag_coefficient,
    lift_curve,
    power_ratio,
    throttle_rate,
    thrust,
    wind_airflow,
)
from airrace.model.dynamics.flight_model import FlightModel, assemble
from airrace.model.dynamics.handling import (
    corner_speed,
    faults,
    lateral_modes,
    remarks,
    sideslip_trim,
    trimmed_side_force,
)
from airrace.model.dynamics.limits import LEAST_ROOM, flight_limits
from airrace.model.dynamics.observations import climb_observation, line_observation, line_values
from airrace.model.dynamics.point_mass import PointMassControl, PointMassState, point_mass
from airrace.model.dynamics.rigid_body import level_lags, linear_parameters
from airrace.model.dynamics.state_space import StateSpaceState, surrounding
from airrace.model.dynamics.state_space_inversion import StateSpaceInversionState, deflections
from airrace.model.environment import RHO_ISA, Air, g0
from airrace.model.frames import quaternion, rotation
from airrace.model.track.course import Rules, SafetyLine
from airrace.model.track.polygons import Point, to_right
from airrace.optimal_control.quantities import Interval

angle = st.floats(-3.1, 3.1)
winds = st.tuples(*[st.floats(-15.0, 15.0)] * 3)


@given(angle, st.floats(-1.5, 1.5), angle, st.floats(45.0, 120.0), winds)
def test_air_velocity_and_wind_add_up_to_ground_velocity(
    chi: float, gamma: float, mu: float, V_K: float, V_W: tuple[float, float, float]
) -> None:
    R = rotation(quaternion(chi, gamma, mu))
    flow = wind_airflow(V_K, R, V_W)
    V_A_O = np.array(R) @ [flow.u, flow.v, flow.w]
    assert V_A_O + np.array(V_W) == pytest.approx(V_K * np.array(R)[:, 0], abs=1e-10)
    assert np.linalg.norm(V_A_O) == pytest.approx(flow.V_A, rel=1e-12)


@given(st.floats(-1.4, 1.4), st.floats(-0.2, 0.2))
def test_drag_is_least_at_its_lift_coefficient_and_without_sideslip(
    edge540: Aircraft, C_L: float, beta_A: float
) -> None:
    numbers = aircraft_parameters(edge540)
    assert (
        drag_coefficient(C_L, beta_A, 80.0, 1.2, numbers)
        >= drag_coefficient(numbers.C_L_minD, 0.0, 80.0, 1.2, numbers)
        == numbers.C_D0
    )
    assert drag_coefficient(C_L, beta_A, 80.0, 1.2, numbers) == drag_coefficient(C_L, -beta_A, 80.0, 1.2, numbers)


def test_drag_of_sideslip_equals_its_source_at_the_point_of_calibration(edge540: Aircraft) -> None:
    numbers = aircraft_parameters(edge540)
    added = drag_coefficient(0.0, 0.2, 80.0, 1.2, numbers) - drag_coefficient(0.0, 0.0, 80.0, 1.2, numbers)
    assert added == pytest.approx(0.17 * 0.2, rel=0.01)


@given(st.floats(-1.5, 1.5), st.floats(0.0, 0.5))
def test_lift_curve_rises_between_its_limits(edge540: Aircraft, alpha_A: float, step: float) -> None:
    lift = edge540.lift
    assert lift.C_L_min < lift_curve(alpha_A, lift) < lift.C_L_max
    assert lift_curve(0.1 * alpha_A, lift) == pytest.approx(0.48 * alpha_A, abs=2e-3)
    assert lift_curve(alpha_A + step, lift) >= lift_curve(alpha_A, lift)


def test_trimmed_side_force_includes_the_rudder_that_balances_the_yawing_moment(edge540: Aircraft) -> None:
    beta_A = 0.1
    zeta = -edge540.yaw.C_nbeta * beta_A / edge540.yaw.C_nzeta  # C_n = 0
    C_Y = edge540.side_force.C_Ybeta * beta_A + edge540.side_force.C_Yzeta * zeta
    assert aircraft_parameters(edge540).C_Y_trim * beta_A == pytest.approx(C_Y, rel=1e-12)


KNOT = 1852.0 / 3600.0
HORSEPOWER = 745.7


def with_power(aircraft: Aircraft, P_max: float) -> AircraftParameters[float]:
    stronger = dataclasses.replace(aircraft.propulsion, P_max=P_max)
    return aircraft_parameters(dataclasses.replace(aircraft, propulsion=stronger))


def test_thrust_is_static_at_rest_and_propulsive_power_over_speed_when_fast(edge540: Aircraft) -> None:
    numbers = aircraft_parameters(edge540)
    assert thrust(1.0, 0.0, RHO_ISA, numbers) == pytest.approx(6200.0, rel=1e-12)
    assert thrust(1.0, 1e4, RHO_ISA, numbers) * 1e4 == pytest.approx(0.87 * 223.7e3, rel=1e-4)
    assert power_ratio(RHO_ISA) == pytest.approx(1.0, rel=1e-12)
    assert power_ratio(0.8 * RHO_ISA) < 0.8


@given(st.floats(0.0, 1.0), st.floats(0.0, 120.0))
def test_thrust_is_proportional_to_the_lever_and_falls_with_speed(
    edge540: Aircraft, delta_T: float, V_A: float
) -> None:
    numbers = aircraft_parameters(edge540)
    assert thrust(delta_T, V_A, 1.1, numbers) == pytest.approx(delta_T * thrust(1.0, V_A, 1.1, numbers), rel=1e-12)
    assert thrust(1.0, V_A + 1.0, 1.1, numbers) < thrust(1.0, V_A, 1.1, numbers)


# thrust of a published 340 hp model of this aircraft flown in JSBSim: knots, N
@pytest.mark.parametrize(("knots", "newton"), [(147.0, 2689.0), (165.0, 2403.0), (183.0, 2361.0), (199.0, 2050.0)])
def test_thrust_agrees_with_a_published_model_of_the_aircraft(edge540: Aircraft, knots: float, newton: float) -> None:
    numbers = with_power(edge540, 340.0 * HORSEPOWER)
    assert thrust(1.0, knots * KNOT, RHO_ISA, numbers) == pytest.approx(newton, rel=0.08)


def test_published_top_speed_balances_thrust_and_drag(edge540: Aircraft) -> None:
    numbers, V = with_power(edge540, 340.0 * HORSEPOWER), 426.0 / 3.6
    qbar = 0.5 * RHO_ISA * V**2
    C_L = numbers.m * g0 / (qbar * numbers.S)
    D = qbar * numbers.S * drag_coefficient(C_L, 0.0, V, RHO_ISA, numbers)
    assert thrust(1.0, V, RHO_ISA, numbers) == pytest.approx(D, rel=0.02)


def test_lever_covers_two_thirds_of_a_step_in_its_time_constant(edge540: Aircraft) -> None:
    numbers = aircraft_parameters(edge540)
    flight = solve_ivp(lambda _, d: throttle_rate(d, 1.0, numbers), (0.0, numbers.tau_T), [0.0], rtol=1e-10, atol=1e-12)
    assert flight.y[0, -1] == pytest.approx(0.632120559, abs=1e-7)


ROOT = Path(__file__).parents[3]


def changed(aircraft: Aircraft, group: str, **values: Any) -> Aircraft:
    return dataclasses.replace(aircraft, **{group: dataclasses.replace(getattr(aircraft, group), **values)})


@pytest.mark.parametrize("name", ["edge540", "pc9"])
def test_nothing_is_wrong_with_the_shipped_aircraft(name: str) -> None:
    race = load_inputs(ROOT / "tracks/rovinj_2014.yaml", aircraft=ROOT / "configs" / f"{name}.yaml").race
    assert faults(race.aircraft) == ()
    assert remarks(race.aircraft) == ()


# --- remarks -----------------------------------------------------------------------------------------------------


def test_a_centre_of_gravity_behind_the_neutral_point_is_named_with_its_margin(edge540: Aircraft) -> None:
    (said,) = remarks(with_pitch(edge540, C_malpha=0.024))
    assert said.startswith("statically unstable in pitch: the centre of gravity lies 0.5 % of the mean chord behind")
    assert remarks(with_pitch(edge540, C_malpha=-0.024)) == ()


def test_the_manoeuvre_point_lies_where_the_short_period_loses_its_stiffness(edge540: Aircraft) -> None:
    V = corner_speed(edge540)

    def stiffness(alpha: float) -> float:
        return level_lags(inner_loop_parameters(with_pitch(edge540, C_malpha=alpha)), V).stiffness_z

    at_zero, slope = stiffness(0.0), stiffness(1.0) - stiffness(0.0)
    edge = -at_zero / slope
    assert edge > 0.0
    (before,) = remarks(with_pitch(edge540, C_malpha=0.99 * edge))
    (behind,) = remarks(with_pitch(edge540, C_malpha=1.01 * edge))
    assert "though before the manoeuvre point" in before
    assert "behind the manoeuvre point" in behind


def test_an_elevator_that_cannot_stall_the_aircraft_is_short(edge540: Aircraft) -> None:
    said = remarks(with_pitch(edge540, C_meta=-0.4))
    assert [one.split(" at ")[0] for one in said] == [
        "short of elevator: C_L_max",
        "short of elevator: C_L_min",
    ]
    assert "the travel ends at 25 deg" in said[0]


def test_ailerons_are_short_if_the_roll_rate_is_out_of_reach_at_the_top_speed(edge540: Aircraft) -> None:
    V, b = edge540.envelope.V.upper, edge540.airframe.b
    reached = edge540.roll.C_lxi / edge540.roll.C_lp * edge540.surfaces.xi.upper * 2.0 * V / b
    assert remarks(changed(edge540, "point_mass", p=0.99 * reached)) == ()
    (said,) = remarks(changed(edge540, "point_mass", p=1.01 * reached))
    assert said.startswith(f"short of ailerons: full deflection rolls at {math.degrees(reached):.0f} deg/s at 118 m/s")


def test_a_rudder_that_cannot_hold_the_sideslip_limit_is_short(edge540: Aircraft) -> None:
    needed = abs(sideslip_trim(inner_loop_parameters(edge540))[1]) * edge540.drag.beta_A_max
    assert remarks(changed(edge540, "surfaces", zeta=Interval(-1.01 * needed, 1.01 * needed))) == ()
    (said,) = remarks(changed(edge540, "surfaces", zeta=Interval(-0.99 * needed, 0.99 * needed)))
    assert said.startswith("short of rudder in sideslip: holding 12 deg of sideslip takes")


def test_a_fin_that_is_too_small_is_remarked_on(edge540: Aircraft) -> None:
    (said,) = remarks(changed(edge540, "yaw", C_nbeta=-0.05))
    assert said.startswith("unstable in yaw at 35 m/s: sideslip doubles every")
    assert said.endswith("(C_nbeta = -0.05, C_lbeta = -0.03)")


def test_a_dutch_roll_that_grows_is_remarked_on(edge540: Aircraft) -> None:
    # much dihedral, and a roll that swings the nose the wrong way
    loose = changed(edge540, "yaw", C_np=-1.0, C_np_per_C_L=0.0)
    (said,) = remarks(changed(loose, "roll", C_lbeta=-0.5))
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
    same = changed(edge540, "yaw", C_nxi=edge540.roll.C_lxi * edge540.yaw.C_nzeta / edge540.roll.C_lzeta)
    ((group, key, message),) = faults(same)
    assert (group, key) == ("yaw", "C_nzeta")
    assert message.startswith("ailerons and rudder cannot be distinguished")


def test_an_elevator_whose_lift_eats_the_wings_is_a_fault(edge540: Aircraft) -> None:
    ((group, key, message),) = faults(with_pitch(edge540, C_meta=-0.03))
    assert (group, key) == ("pitch", "C_meta")
    assert message.startswith("no elevator power")


def test_an_elevator_whose_lift_undoes_its_moment_is_a_fault(edge540: Aircraft) -> None:
    lifting = changed(edge540, "lift", C_Leta=-2.0)
    ((group, key, message),) = faults(with_pitch(lifting, C_malpha=0.0, C_meta=-0.02))
    assert (group, key) == ("pitch", "C_meta")
    assert message == "no elevator power: at 35 m/s the lift that it makes undoes what its moment does"


def test_a_rudder_that_takes_all_side_force_away_is_a_fault(edge540: Aircraft) -> None:
    gone = edge540.side_force.C_Ybeta / sideslip_trim(inner_loop_parameters(edge540))[1]
    weak, strong = (changed(edge540, "side_force", C_Yzeta=-part * gone) for part in (0.99, 1.01))
    assert trimmed_side_force(inner_loop_parameters(weak)) < 0.0 < trimmed_side_force(inner_loop_parameters(strong))
    assert faults(weak) == ()
    ((group, key, _),) = faults(strong)
    assert (group, key) == ("side_force", "C_Ybeta")


@pytest.mark.parametrize("V_K", [35.0, 70.0, 118.0])
def test_commands_have_a_solution_for_an_aircraft_just_short_of_a_fault(edge540: Aircraft, V_K: float) -> None:
    weak = with_pitch(edge540, C_malpha=0.0, C_meta=-0.04)
    assert faults(weak) == ()
    number = linear_parameters(weak)
    values = vars(level_trim(edge540, V_K)) | {"p_s": 0.0, "r_s": 0.0, "n_z_cmd": 1.0, "n_y_cmd": 0.0, "p_cmd": 0.0}
    state = StateSpaceInversionState(**{name: values[name] for name in StateSpaceInversionState.names()})
    here = surrounding(state, aircraft=number, **surroundings(Air()))
    pull, hold = (deflections(dataclasses.replace(state, n_z_cmd=n_z), here, number).eta for n_z in (3.0, 1.0))
    assert pull < hold


def test_the_narrower_limit_counts(edge540: Aircraft) -> None:
    strict = Rules(n_z=Interval(-2.0, 10.0), C_L=Interval(-5.0, 1.1), p=3.0, beta_A=0.1)
    limits = flight_limits(edge540, strict)
    assert limits.n_z == Interval(-2.0, 10.0)
    assert (limits.C_L.lower, limits.C_L.upper) == (-1.4, 1.1)
    assert limits.p_Kbar == Interval(-3.0, 3.0)
    assert limits.beta_A == Interval(-0.1, 0.1)


def test_without_rules_the_aircraft_sets_the_limits(edge540: Aircraft) -> None:
    limits = flight_limits(edge540, Rules(n_z=Interval()))
    assert limits.n_z == edge540.envelope.n_z
    assert limits.V_K == edge540.envelope.V
    assert limits.p_Kbar.upper == edge540.point_mass.p
    assert (limits.C_L.lower, limits.C_L.upper) == (-1.4, 1.4)
    assert limits.beta_A.upper == edge540.drag.beta_A_max


def test_floor_and_ceiling_bound_the_down_axis_from_the_other_side(edge540: Aircraft) -> None:
    assert flight_limits(edge540, Rules(n_z=Interval(), height=Interval(5.0, 300.0))).z == Interval(-300.0, -5.0)
    assert flight_limits(edge540, Rules(n_z=Interval(), height=Interval(lower=5.0))).z == Interval(-math.inf, -5.0)


@pytest.mark.parametrize("room", [0.0, 0.1 * LEAST_ROOM, LEAST_ROOM, 2.0 * LEAST_ROOM])
def test_the_least_room_is_left_between_floor_and_ceiling(edge540: Aircraft, room: float) -> None:
    z = flight_limits(edge540, Rules(n_z=Interval(), height=Interval(20.0, 20.0 + room))).z
    assert z.upper - z.lower == pytest.approx(max(room, LEAST_ROOM))
    assert 0.5 * (z.lower + z.upper) == pytest.approx(-20.0 - 0.5 * room)


def test_angle_of_attack_bounds_lift_through_the_lift_curve(edge540: Aircraft) -> None:
    rules = Rules(n_z=Interval(), alpha_A=Interval(-0.05, math.radians(12.0)))
    limits = flight_limits(edge540, rules)
    assert limits.C_L.upper == lift_curve(math.radians(12.0), edge540.lift) == pytest.approx(1.0, abs=0.01)
    assert limits.C_L.lower == pytest.approx(-0.24, abs=0.01)


@pytest.mark.parametrize(
    ("name", "asked"),
    [("z", {"height": Interval(20.0, 19.999)}), ("n_z", {"n_z": Interval(13.0, 15.0)})],
    ids=["a ceiling below the floor", "more than the aircraft takes"],
)
def test_contradicting_limits_are_named(edge540: Aircraft, name: str, asked: dict[str, Interval]) -> None:
    with pytest.raises(InputError, match=f"Edge 540: {name}: no value"):
        flight_limits(edge540, Rules(**{"n_z": Interval(), **asked}))


def test_bounds_replace_only_what_they_name_and_name_only_what_there_is(edge540: Aircraft) -> None:
    def assembled(bounds: dict[str, Interval]) -> FlightModel:
        vectors = (PointMassState[Any], PointMassControl[Any], LoadFactorPath[Any])
        numbers, parts = aircraft_parameters(edge540), {"roll_rate": lambda x, _: x.p_Kbar, "at_rest": ()}
        return assemble("m", point_mass, vectors, bounds, aircraft=numbers, air=Air(), counting=False, **parts)

    (bounded,) = (
        one for one in assembled({"V_K": Interval(1.0, 2.0)}).system.states if (one.lower, one.upper) == (1, 2)
    )
    assert bounded.name == "V_K"
    with pytest.raises(KeyError, match="c"):
        assembled({"c": Interval()})


STATES = PointMassState.quantities()
coordinates = st.floats(-900.0, 900.0)
places = st.builds(Point, coordinates, coordinates)
angles = st.floats(-3.1, 3.1)


ORIGIN = Point(0.0, 0.0)


def state(place: Point = ORIGIN, heading: float = 0.0, climb: float = 0.0, bank: float = 0.0) -> np.ndarray:
    q = quaternion(heading, climb, bank)
    return np.array([place.north, place.east, -20.0, 80.0, *q, 1.0, 1.0, 0.0, 0.0])


@given(places, places, places)
def test_line_measures_the_distance_to_its_right(start: Point, end: Point, place: Point) -> None:
    if math.hypot(end.north - start.north, end.east - start.east) > 1.0:
        seen = float(line_observation(STATES).values(state(place), line_values(start, end, right=True)))
        assert seen == pytest.approx(to_right(start, end, place), abs=1e-8)


@given(places, st.booleans())
def test_allowed_side_of_a_safety_line_is_positive(place: Point, keep_right: bool) -> None:
    line = SafetyLine("beach", Point(10.0, -20.0), Point(110.0, 60.0), keep_right)
    seen = float(
        line_observation(STATES).values(state(place), line_values(line.start, line.end, right=line.keep_right))
    )
    side = to_right(line.start, line.end, place)
    assert seen == pytest.approx(side if keep_right else -side, abs=1e-9)


@given(angles, st.floats(-math.pi / 2, math.pi / 2), angles)
def test_exact_climb_is_the_climb_angle_of_the_attitude(heading: float, climb: float, bank: float) -> None:
    seen = climb_observation(STATES, exact=True).values(state(heading=heading, climb=climb, bank=bank), [])
    assert float(seen) == pytest.approx(climb, abs=1e-7)


@given(angles, st.floats(-math.pi / 2, math.pi / 2), angles)
def test_rounded_climb_stays_below_the_exact_one_by_less_than_a_milliradian(
    heading: float, climb: float, bank: float
) -> None:
    attitude = state(heading=heading, climb=climb, bank=bank)
    rounded, exact = (float(climb_observation(STATES, exact=one).values(attitude, [])) for one in (False, True))
    assert abs(rounded) <= abs(exact) + 1e-12
    assert abs(exact - rounded) < 1.1e-3


def test_rounded_climb_has_slopes_on_the_vertical() -> None:
    observation = climb_observation(STATES, exact=False)
    x = ca.SX.sym("x", len(STATES))
    slopes = ca.Function("slopes", [x], [ca.hessian(observation.values(x, []), x)[0]])
    assert np.isfinite(np.asarray(slopes(state(climb=math.pi / 2)))).all()
