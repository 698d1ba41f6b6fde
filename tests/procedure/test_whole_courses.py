"""Every course is flown by the whole aircraft, certified on every stage: in any air, and by either aircraft."""

import dataclasses

import numpy as np
import pytest
from races import COURSES, PLAN, RACES, ROOT, assert_certified, blown, optimum, solve_stages

from airrace.environment.air import Thermal
from airrace.inputs import load_inputs
from airrace.planning.race import Race
from airrace.procedure.result import Stage

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
    assert np.ptp(flown.of("r_s")[within]) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("name", COURSES)
def test_course_between_thermals_is_certified_up_to_six_degrees_of_freedom(name: str) -> None:
    assert_certified(between_thermals(RACES[name]))


def test_thermals_beside_a_leg_are_felt() -> None:
    """The point mass takes another time between them, by 24 ms."""
    race = RACES["half_cuban_eight"]
    still, rising = (optimum(one, PLAN).trajectory.race_time for one in (race, between_thermals(race)))
    assert abs(rising - still) > 0.01


def between_thermals(race: Race) -> Race:
    """The race with a thermal on either side of its longest leg, as the point mass flies it in still air."""
    flown = optimum(race, PLAN).trajectory
    north, east = (flown.of(name)[flown.first_node] for name in ("x", "y"))
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
