"""A plan keeps the choices it is given, and the plan of a flight makes those of the flight."""

import dataclasses
import math

import numpy as np
import pytest
from races import (
    EDGE_540,
    RACES,
    ROOT,
    SHIPPED,
    SMALL,
    course,
    knife_edge,
    level,
    prepared,
    pylon,
    settings,
    solve_point_mass,
)
from races import planned as plan_of

from airrace.files.inputs import load_inputs
from airrace.model.environment import Air
from airrace.model.frames import angle_between, quaternion
from airrace.model.track.gates import Gate, Manoeuvre
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Trajectory
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.planning.plan import Plan, plan, plan_from_solution, stops_of, track_turn, waypoint_from_solution
from airrace.procedure.planning.planning_model import cruise
from airrace.procedure.planning.route_decisions import ANY, MIRRORED_TIES, RouteDecisions, candidates
from airrace.procedure.result import StageResult
from airrace.procedure.settings import GuessKind, MeshSettings, SearchEffort, Settings
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import StageProblem, formulate, mesh_of, trajectory_of
from airrace.race import Race

every_race = pytest.mark.parametrize("name", RACES)
OFF = dataclasses.replace(settings(GuessKind.PLAN), search=SearchEffort.OFF)


def race_of(*elements: object) -> Race:
    return Race(course("built", *elements), EDGE_540, Air())  # type: ignore[arg-type]


def planned(race: Race, choices: RouteDecisions) -> Plan:
    return plan(race.course, cruise(race.aircraft, race.course.rules), choices)


def choices_of(made: Plan, race: Race) -> RouteDecisions:
    """All choices that a plan has made, but for the sides of its turns."""
    passages = race.course.passages
    return RouteDecisions(
        candidates={stop: (made.waypoints[stop],) for stop in stops_of(race.course)},
        rolls={
            index: 1 if made.waypoints[index].rolled > 0.0 else -1
            for index, one in enumerate(passages)
            if one.roll is not None
        },
        edges={
            index: 1 if (made.waypoints[index].bank or 0.0) > 0.0 else -1
            for index, one in enumerate(passages)
            if isinstance(one.element, Gate) and one.element.either_bank
        },
    )


# choices given


@every_race
def test_plan_keeps_its_own_choices_and_any_way_that_is_left_of_a_passage(name: str) -> None:
    race, own = RACES[name], plan_of(RACES[name])
    assert planned(race, ANY) == planned(race, choices_of(own, race)) == own
    for index in stops_of(race.course):
        for way in candidates(race.course, index)[::13]:
            made = planned(race, RouteDecisions(candidates={index: (way,)}))
            assert made.waypoints[index].axis == way.axis
            assert made.waypoints[index].heading == way.heading
            assert made.seconds >= own.seconds - 1e-9


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", ["four_gates", "rovinj_2014"])
def test_plan_turns_to_the_side_that_is_asked_for(name: str, side: int) -> None:
    race = RACES[name]
    for index in range(1, len(race.course.passages)):
        made = planned(race, RouteDecisions(turns={index: side}))
        path = made.legs[index - 1].path
        assert path is not None
        net = sum(length * bend for length, bend in zip(path.lengths, path.curvatures, strict=True))
        assert side * net > 0.0
        assert made.seconds >= plan_of(race).seconds - 1e-9


@pytest.mark.parametrize("side", [1, -1])
def test_plan_flies_a_knife_edge_on_the_wing_and_rolls_to_the_side_that_is_asked_for(side: int) -> None:
    edge = knife_edge("edge", 350, 160, 70, right=True, either=True)
    race = race_of(level("a", 0, 0, 0), edge, level("c", 200, 500, 160))
    made = planned(race, RouteDecisions(edges={1: side}))
    assert made.waypoints[1].bank == side * math.pi / 2
    assert made.seconds == plan_of(race).seconds
    race = load_inputs(ROOT / "tracks" / "air_race_x_2024.yaml").race
    (index,) = [number for number, passage in enumerate(race.course.passages) if passage.roll is not None]
    assert side * planned(race, RouteDecisions(rolls={index: side})).waypoints[index].rolled > 0.0


def test_choices_without_some_ways_are_free_there_and_kept_elsewhere() -> None:
    race = SHIPPED["rovinj_2014"]
    whole = choices_of(plan_of(race), race)
    freed = whole.without_candidates(3)
    assert freed.candidates_at(race.course, 3) == candidates(race.course, 3)
    assert freed.candidates_at(race.course, 4) == [plan_of(race).waypoints[4]]
    assert len(whole.candidates_at(race.course, 3)) == 1


# choices as flown


def guessed(race: Race) -> tuple[StageProblem, Trajectory]:
    """The guess from a race's plan."""
    stage_problem = prepared(race)
    mesh = first_mesh(stage_problem.plan, MeshSettings())
    return stage_problem, trajectory_of(stage_problem.problem(mesh), guess(stage_problem.plan, mesh))


def assert_same_choices(race: Race, one: Plan, other: Plan) -> None:
    for index, passage in enumerate(race.course.passages):
        a, b = one.waypoints[index], other.waypoints[index]
        if index not in stops_of(race.course):
            continue
        if isinstance(passage.element, Manoeuvre):
            # Where the line is vertical, half a turn of heading is half a turn of bank: attitudes are compared.
            assert abs(float(np.dot(a.q, b.q))) > math.cos(math.radians(50.0) / 2), passage.name
        else:
            assert abs(angle_between(a.axis, b.axis)) < 1e-9, passage.name
        if isinstance(passage.element, Gate):
            assert a.bank == b.bank, passage.name
        assert np.sign(a.rolled) == np.sign(b.rolled), passage.name


@every_race
def test_plan_of_a_guess_makes_the_choices_of_the_plan_that_it_is_made_from_and_takes_as_long(name: str) -> None:
    race = RACES[name]
    flight, flown = guessed(race)
    again = plan_from_solution(race.course, flight.plan.cruise, flown)
    assert_same_choices(race, flight.plan, again)
    assert again.seconds == pytest.approx(flight.plan.seconds, rel=0.02)


def optimum_of(race: Race) -> StageResult:
    (found,) = solve_point_mass(race, OFF)
    assert found.certified
    return found


@pytest.mark.parametrize("name", ["four_gates", "half_cuban_eight"])
def test_plan_of_an_optimum_makes_the_choices_that_it_was_planned_with(name: str) -> None:
    race = RACES[name]
    again = plan_from_solution(race.course, prepared(race).plan.cruise, optimum_of(race).trajectory)
    assert_same_choices(race, plan_of(race), again)


@pytest.mark.parametrize("stage", [Stage.POINT_MASS, Stage.TRANSFER_FUNCTION])
def test_model_planned_as_flown_has_a_problem_of_the_same_size_that_the_flight_solves(stage: Stage) -> None:
    flown = optimum_of(SMALL).trajectory
    mesh = mesh_of(flown)
    own = formulate(stage, SMALL, Settings()).problem(mesh)
    again = formulate(stage, SMALL, Settings(), flown).problem(mesh)
    assert [phase.name for phase in again.phases] == [phase.name for phase in own.phases]
    for a, b in zip(
        (own.start, *(one.end for one in own.phases)), (again.start, *(one.end for one in again.phases)), strict=True
    ):
        assert a is not None
        assert b is not None
        assert {name: (one.lower, one.upper) for name, one in a.bounds.items()} == {
            name: (one.lower, one.upper) for name, one in b.bounds.items()
        }
        assert a.values == pytest.approx(b.values)
    for phase, seconds in zip(again.phases, flown.durations.tolist(), strict=True):
        assert phase.duration.lower <= seconds <= phase.duration.upper


STRAIGHT = race_of(level("a", 0, 0, 0), level("b", 400, 0, 0), level("c", 800, 0, 0))
SLALOM = race_of(level("a", 0, 0, 0), pylon("p", 300, 0, 90), pylon("q", 600, 20, 270), level("d", 900, 40, 0))


@pytest.mark.parametrize("race", [pytest.param(STRAIGHT, id="straight"), pytest.param(SLALOM, id="slalom")])
def test_plan_of_a_flight_that_hardly_turns_has_no_loops(race: Race) -> None:
    again = plan_from_solution(race.course, cruise(race.aircraft, race.course.rules), optimum_of(race).trajectory)
    assert again.seconds == pytest.approx(plan_of(race).seconds, rel=0.05)
    for leg in again.legs:
        assert leg.path is not None
        assert leg.path.turning < math.pi


# read off a flight


def noisy(track: np.ndarray, size: float) -> np.ndarray:
    return track + np.random.default_rng(1).normal(0.0, size, track.shape)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-5])
@pytest.mark.parametrize("course_of_it", [0.0, 53.0, 200.0])
def test_half_a_loop_turns_the_track_by_half_a_circle_and_to_no_side(course_of_it: float, size: float) -> None:
    angle = np.linspace(0.0, math.pi, 60)
    ahead, chi = 100.0 * np.sin(angle), math.radians(course_of_it)
    loop = np.stack([ahead * math.cos(chi), ahead * math.sin(chi), -100.0 * (1.0 - np.cos(angle))])
    found = track_turn(noisy(loop, size))
    assert abs(found.angle) == pytest.approx(math.pi, abs=1e-3)
    assert found.lateral == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("size", [1e-9, 1e-5])
def test_vertical_line_turns_to_no_side(size: float) -> None:
    """Level, straight up for 200 m, and on with another course: what turns is the difference of both courses."""
    before = np.stack([np.linspace(0.0, 100.0, 20), np.zeros(20), np.zeros(20)])
    up = np.stack([np.full(40, 100.0), np.zeros(40), -np.linspace(0.0, 200.0, 40)])
    after = np.stack([100.0 + np.linspace(0.0, 50.0, 20), np.linspace(0.0, 50.0, 20), np.full(20, -200.0)])
    found = track_turn(noisy(np.hstack([before, up[:, 1:], after[:, 1:]]), size))
    assert found.angle == pytest.approx(math.radians(45.0), abs=1e-3)


@pytest.mark.parametrize("turns", [-540.0, -100.0, 30.0, 300.0])
def test_level_turn_is_reported_with_its_side(turns: float) -> None:
    chi = np.radians(np.linspace(0.0, turns, 200))
    found = track_turn(np.stack([np.cumsum(np.cos(chi)), np.cumsum(np.sin(chi)), np.zeros(200)]))
    assert found.angle == pytest.approx(math.radians(turns), rel=0.01)
    assert found.lateral == found.angle


@pytest.mark.parametrize("bank", [0.0, 90.0, 175.0, -120.0])
def test_course_of_a_manoeuvre_is_read_off_whatever_the_bank(bank: float) -> None:
    top = Manoeuvre("top", climb=math.radians(45.0), height=Interval(lower=100.0))
    race = race_of(level("first", 0.0, 0.0, 0.0), top, level("last", 500.0, 0.0, 0.0))
    q = np.array(quaternion(math.radians(40.0), math.radians(45.0), math.radians(bank)))
    assert waypoint_from_solution(race.course, 1, q).heading == pytest.approx(math.radians(40.0))


def test_decisions_of_another_flight_are_taken_at_its_stops_and_all_others_stay() -> None:
    own = RouteDecisions(
        turns={1: 1, 2: 1},
        rolls={1: 1, 2: 1},
        lengths={1: 10.0, 2: 20.0},
        prefer_last_on_ties=MIRRORED_TIES.prefer_last_on_ties,
    )
    other = RouteDecisions(turns={1: -1, 2: -1}, rolls={1: -1, 2: -1}, lengths={2: 30.0})
    mixed = own.with_those_of(other, {2})
    assert (mixed.turns, mixed.rolls, mixed.lengths) == ({1: 1, 2: -1}, {1: 1, 2: -1}, {1: 10.0, 2: 30.0})
    assert mixed.prefer_last_on_ties
