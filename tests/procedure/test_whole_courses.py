"""Whole courses on every stage, and the findings of the paper."""

import dataclasses

import numpy as np
import pytest
from matched_laps import laps, matched_laps
from races import (
    COURSES,
    DIVING_EIGHT,
    PLAN,
    RACES,
    ROOT,
    SIXTEEN,
    assert_certified,
    blown,
    one_lap,
    optimum,
    solve_stages,
)
from test_shipped_optima import plane_of

from airrace.files.inputs import load_inputs
from airrace.model.environment import Thermal
from airrace.optimal_control.quantities import Interval
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.stage import Stage
from airrace.race import Race

TRACKS = sorted(path.stem for path in (ROOT / "tracks").glob("*.yaml"))
WIND = 8.0  # m/s
BESIDE = 20.0
"""m, from a leg to a thermal, whose updraft is some 40 m wide to either side near the ground."""


@pytest.mark.slow
@pytest.mark.parametrize("name", TRACKS)
def test_every_shipped_course_is_certified_up_to_six_degrees_of_freedom(name: str) -> None:
    assert_certified(load_inputs(ROOT / "tracks" / f"{name}.yaml").race)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["chiba_2015", "rovinj_2014"])
def test_other_aircraft_is_certified_up_to_six_degrees_of_freedom(name: str) -> None:
    track, aircraft = ROOT / "tracks" / f"{name}.yaml", ROOT / "configs" / "pc9.yaml"
    assert_certified(load_inputs(track, aircraft=aircraft).race)


@pytest.mark.slow
@pytest.mark.parametrize("origin", [0.0, 120.0, 240.0])
@pytest.mark.parametrize("name", COURSES)
def test_course_in_wind_is_certified_up_to_six_degrees_of_freedom(name: str, origin: float) -> None:
    assert_certified(blown(RACES[name], origin, WIND))


@pytest.mark.slow
def test_rudder_is_not_wagged_where_the_angle_of_attack_is_at_its_limit() -> None:
    """Side force in step with the bank turns the path: in this wind it paid to wag the rudder all through the loop."""
    race = blown(RACES["sixteen_phases"], 240.0, WIND)
    result = next(one for one in solve_stages(race) if one.stage is Stage.STATE_SPACE_INVERSION)
    flown = result.trajectory
    phase = flown.phases.index("2:quad/1 -> 2:quad/2")
    within = (flown.time > flown.time[flown.first_node[phase]] + 1.5) & (
        flown.time < flown.time[flown.first_node[phase + 1]] - 1.5
    )
    assert np.ptp(flown["r_s"][within]) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("name", COURSES)
def test_course_between_thermals_is_certified_up_to_six_degrees_of_freedom(name: str) -> None:
    assert_certified(between_thermals(RACES[name]))


def test_thermals_beside_a_leg_are_felt() -> None:
    """The point mass takes another time between them, by 24 ms."""
    pair = DIVING_EIGHT, between_thermals(DIVING_EIGHT)
    still, rising = (optimum(race, PLAN).trajectory.race_time for race in pair)
    assert abs(rising - still) > 0.01


def between_thermals(race: Race) -> Race:
    """The race with a thermal on either side of its longest leg, as the point mass flies it in still air."""
    flown = optimum(race, PLAN).trajectory
    north, east = (flown[name][flown.first_node] for name in ("x", "y"))
    lengths = np.hypot(np.diff(north), np.diff(east))
    leg = int(lengths.argmax())
    along = np.array([np.diff(north)[leg], np.diff(east)[leg]]) / lengths[leg]
    across = np.array([-along[1], along[0]])  # to the right
    places = [
        np.array([north[leg], east[leg]]) + share * lengths[leg] * along + side * BESIDE * across
        for share, side in ((1.0 / 3.0, -1.0), (2.0 / 3.0, 1.0))
    ]
    thermals = tuple(Thermal(float(place[0]), float(place[1]), 2.5, 1000.0) for place in places)
    return dataclasses.replace(race, air=dataclasses.replace(race.air, thermals=thermals))


HALF_CUBAN = RACES["half_cuban_eight"]
GATES = 20.0
"""m, the height of all gates of the sixteen phases."""

# the half Cuban eight leans into the wind


@pytest.mark.slow
@pytest.mark.parametrize(("origin", "side"), [(90.0, 1.0), (270.0, -1.0)])
def test_whole_aircraft_of_every_fidelity_in_a_crosswind_tilts_the_half_cuban_eight_into_it(
    origin: float, side: float
) -> None:
    assert side * plane_of(assert_certified(blown(HALF_CUBAN, origin, 10.0))).tilt > 1.0


@pytest.mark.parametrize(("origin", "side"), [pytest.param(90.0, 1.0, marks=pytest.mark.slow), (270.0, -1.0)])
def test_whole_aircraft_tilts_the_half_cuban_eight_into_a_crosswind(origin: float, side: float) -> None:
    """Wind from the east tilts the plane to the east, wind from the west to the west."""
    windy, calm = blown(HALF_CUBAN, origin, 10.0), solve_stages(HALF_CUBAN)
    (result,) = optimize(windy, PLAN, until=Stage.SIX_DOF, threads=1, start=calm, start_name="calm", progress=Silent())
    assert (result.stage, result.remarks, result.certified) == (Stage.SIX_DOF, "", True)
    assert side * plane_of(result).tilt > 1.0


def test_whole_aircraft_flies_the_half_cuban_eight_upright_in_still_air() -> None:
    assert abs(plane_of(assert_certified(HALF_CUBAN)).tilt) < 1.0


# the turn between the two passings of the quad climbs, although all gates are at one height


def below(race: Race, ceiling: float) -> Race:
    """The race under a ceiling, m."""
    rules = dataclasses.replace(race.course.rules, height=Interval(race.course.rules.height.lower, ceiling))
    return dataclasses.replace(race, course=dataclasses.replace(race.course, rules=rules))


def climb_within_the_quad(result: StageResult, lap: int) -> float:
    """How far above its gates the aircraft gets between the two passings, m."""
    trajectory = result.trajectory
    phase = trajectory.phases.index(f"{lap}:quad/1 -> {lap}:quad/2")
    first, last = trajectory.first_node[phase], trajectory.first_node[phase + 1]
    height = -trajectory["z"][first : last + 1]
    assert height[[0, -1]] == pytest.approx([GATES, GATES], abs=0.1)
    return float(height.max() - GATES)


def test_point_mass_climbs_in_the_turn_before_the_second_passing_of_the_quad() -> None:
    assert climb_within_the_quad(optimum(one_lap(SIXTEEN), PLAN), 1) > 20.0


def test_a_flat_turn_before_the_second_passing_of_the_quad_costs_time() -> None:
    free, flat = (optimum(race, PLAN) for race in (one_lap(SIXTEEN), below(one_lap(SIXTEEN), GATES + 10.0)))
    assert flat.certified
    assert climb_within_the_quad(flat, 1) < 10.1
    assert flat.trajectory.race_time > free.trajectory.race_time + 0.1


@pytest.mark.slow
def test_whole_aircraft_climbs_in_both_turns_before_the_second_passing_of_the_quad() -> None:
    result = assert_certified(SIXTEEN)
    assert min(climb_within_the_quad(result, lap) for lap in (1, 2)) > 20.0


@pytest.mark.slow
def test_a_flat_turn_costs_the_whole_aircraft_time() -> None:
    free, flat = (assert_certified(race) for race in (one_lap(SIXTEEN), below(one_lap(SIXTEEN), GATES + 10.0)))
    assert climb_within_the_quad(free, 1) > 20.0
    assert flat.trajectory.race_time > free.trajectory.race_time + 0.1


# laps are optimised jointly


@pytest.mark.slow
def test_two_laps_flown_jointly_are_faster_than_one_lap_with_matched_ends_flown_twice() -> None:
    """A lap that ends as it begins can be flown any number of times: here as a race of four laps passes the line.

    Whoever flies two at once may pass the line otherwise between them, which gains 30 ms, and whoever races may begin
    and end otherwise, too: with speed to be spent on the turns, and in any attitude, which gains 4.7 s.
    """
    one, two = matched_laps(1).race_time, matched_laps(2).race_time
    race = optimum(laps(2), PLAN).trajectory.race_time
    assert race < two - 1.0
    assert two < 2.0 * one - 0.02
