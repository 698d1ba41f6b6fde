"""The formulated race: conditions at passages, path constraints, attitudes and families of phases."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from races import COURSES, DEGREE, EDGE_540, KNOT, RACES, SHIPPED, SMALL, WINDOW, knife_edge, level, planned, prepared
from races import course as course_of
from races import pylon as pylon_at

from airrace.dynamics.point_mass import PointMassState
from airrace.environment.air import Air
from airrace.frames import quaternion, rotation
from airrace.optimal_control.constraint_check import boundary_values, outside
from airrace.optimal_control.problem import Boundary, PathConstraint, Problem
from airrace.planning.race import Race
from airrace.procedure.attitudes import ROWS, align_quaternions, turned
from airrace.procedure.formulation import piece_boundary
from airrace.procedure.guess import first_mesh
from airrace.procedure.path_constraints import leg_watches
from airrace.procedure.settings import MeshSettings
from airrace.quantities import Interval
from airrace.track.course import Course, Crowd, CrowdShape, Direction, Roll, SafetyLine
from airrace.track.gates import Element, Manoeuvre, Passing, Pylon
from airrace.track.polygons import Point
from airrace.trajectory import Array

SPAN = EDGE_540.airframe.b


def problem_of(race: Race) -> Problem:
    return prepared(race).problem(first_mesh(planned(race), MeshSettings()))


def passing(element: Element, direction: Direction = Direction.FORWARD) -> tuple[Problem, Boundary]:
    """The boundary at an element in the middle of a course that leads through it."""
    start, finish = level("start", -500.0, 0.0, 0.0), level("finish", 500.0, 0.0, 0.0)
    course = course_of("one element", start, element, finish)
    a, b, c = course.passages
    course = dataclasses.replace(course, passages=(a, dataclasses.replace(b, direction=direction), c))
    problem = problem_of(Race(course, EDGE_540, Air()))
    return problem, problem.phases[0].end


def state(
    north: float = 0.0,
    east: float = 0.0,
    height: float = 20.0,
    *,
    heading: float = 0.0,
    climb: float = 0.0,
    bank: float = 0.0,
    speed: float = 90.0,
) -> np.ndarray:
    """A point-mass state; angles in degrees."""
    q0, q1, q2, q3 = quaternion(heading * DEGREE, climb * DEGREE, bank * DEGREE)
    made = PointMassState[float](
        x=north, y=east, z=-height, V_K=speed, q0=q0, q1=q1, q2=q2, q3=q3, delta_T=1.0, n_z=1.0, n_y=0.0, p_Kbar=0.0
    )
    return np.array(made.join())


def violated(boundary: Boundary, problem: Problem, at: np.ndarray) -> set[str]:
    """Names of the conditions that a state does not keep."""
    return {
        quantity.name
        for quantity, bounds, value in boundary_values(problem, boundary, at)
        if float(outside(np.asarray(value), bounds.lower, bounds.upper)) > 1e-9
    }


# a level gate at the origin, flown northward, 13 m wide, half a metre of clearance, 15 to 25 m high

LEVEL = passing(level("gate", 0.0, 0.0, 0.0))
ROOM = 13.0 / 2 - 0.5 - SPAN / 2  # how far the centre may leave the axis, wings level


@pytest.mark.parametrize(
    "allowed",
    [
        state(),
        state(east=ROOM - 0.01),
        state(east=-ROOM + 0.01),
        state(height=15.01),
        state(height=24.99),
        state(heading=59.0),
        state(heading=-59.0),
        state(bank=9.9),
        state(bank=-9.9),
        state(climb=44.0),
        state(climb=-44.0),
        state(climb=20.0, bank=9.0, heading=30.0),
        state(speed=50.0),
    ],
)
def test_level_gate_lets_pass_what_is_allowed(allowed: np.ndarray) -> None:
    problem, gate = LEVEL
    assert violated(gate, problem, allowed) == set()


@pytest.mark.parametrize(
    ("wrong", "conditions"),
    [
        (state(north=1.0), {"along"}),
        (state(east=ROOM + 0.01), {"right_wing"}),
        (state(east=-ROOM - 0.01), {"left_wing"}),
        (state(height=14.99), {"height"}),
        (state(height=25.01), {"height"}),
        (state(heading=60.1), {"course_excess_right"}),
        (state(heading=-60.1), {"course_excess_left"}),
        (state(heading=180.0), {"course_excess_right", "course_excess_left"}),
        (state(bank=10.1), {"bank_excess_right"}),
        (state(bank=-10.1), {"bank_excess_left"}),
        (state(bank=180.0), {"bank_excess_right", "bank_excess_left"}),
        (state(bank=90.0), {"bank_excess_right"}),
        (state(climb=45.1), {"climb_sine"}),
        (state(climb=-45.1), {"climb_sine"}),
    ],
)
def test_level_gate_refuses_what_is_not_allowed_by_name(wrong: np.ndarray, conditions: set[str]) -> None:
    problem, gate = LEVEL
    assert violated(gate, problem, wrong) == conditions


def test_gate_flown_in_reverse_is_the_gate_turned_around() -> None:
    problem, gate = passing(level("gate", 0.0, 0.0, 0.0), Direction.REVERSE)
    assert violated(gate, problem, state(heading=180.0)) == set()
    assert violated(gate, problem, state(heading=180.0, east=-ROOM - 0.01)) == {"right_wing"}
    assert violated(gate, problem, state()) == {"course_excess_right", "course_excess_left"}


def test_banked_wing_leaves_more_room_beside_the_centre() -> None:
    wide = dataclasses.replace(level("gate", 0.0, 0.0, 0.0), tolerances=dataclasses.replace(WINDOW, bank=60 * DEGREE))
    problem, gate = passing(wide)
    assert violated(gate, problem, state(east=ROOM + 1.0)) == {"right_wing"}
    assert violated(gate, problem, state(east=ROOM + 1.0, bank=50.0)) == set()


def test_gate_flown_exactly_fixes_position_and_bank_and_limits_the_path() -> None:
    problem, gate = passing(level("gate", 0.0, 0.0, 0.0, Passing.POINT))
    assert violated(gate, problem, state(heading=30.0, climb=40.0, speed=60.0)) == set()
    assert violated(gate, problem, state(climb=50.0)) == {"climb_sine"}
    assert violated(gate, problem, state(east=0.1)) == {"right"}
    assert violated(gate, problem, state(height=20.1)) == {"height"}
    assert violated(gate, problem, state(north=-0.1)) == {"along"}
    assert violated(gate, problem, state(bank=1.0)) == {"bank_sine"}
    assert violated(gate, problem, state(bank=180.0)) == {"bank_cosine"}
    assert violated(gate, problem, state(heading=61.0)) == {"course_excess_right"}


@pytest.mark.parametrize(("tolerance", "allowed"), [(85.0, 84.9), (89.8, 89.7), (90.0, 89.9)])
def test_bank_tolerance_may_be_as_wide_as_a_right_angle(tolerance: float, allowed: float) -> None:
    wide = dataclasses.replace(WINDOW, bank=tolerance * DEGREE)
    problem, gate = passing(dataclasses.replace(level("gate", 0.0, 0.0, 0.0), tolerances=wide))
    for side in (-1.0, 1.0):
        assert violated(gate, problem, state(bank=side * allowed)) == set()
        assert violated(gate, problem, state(bank=side * (tolerance + 0.1))) != set()
    assert max(abs(value) for value in gate.values) < 1000.0  # a tangent of 1e16 is nothing to compute with


# knife-edge gates


@pytest.mark.parametrize(("right", "bank"), [(True, 90.0), (False, -90.0)])
def test_knife_edge_gate_is_flown_on_its_edge_alone(right: bool, bank: float) -> None:
    problem, gate = passing(knife_edge("edge", 0.0, 0.0, 0.0, right=right))
    assert violated(gate, problem, state(bank=bank)) == set()
    assert violated(gate, problem, state(bank=bank, heading=20.0, climb=10.0)) == set()
    assert violated(gate, problem, state(bank=0.95 * bank)) == {"bank_sine"}
    assert violated(gate, problem, state(bank=-bank)) == {"bank_cosine"}
    assert "bank_sine" in violated(gate, problem, state(bank=0.0))
    assert violated(gate, problem, state(bank=bank, height=20.5)) == {"height"}


def test_knife_edge_window_turns_its_bank_tolerance_with_it() -> None:
    edge = dataclasses.replace(knife_edge("edge", 0.0, 0.0, 0.0, right=True), passing=Passing.WINDOW)
    problem, gate = passing(edge)
    assert violated(gate, problem, state(bank=81.0)) == set()
    assert violated(gate, problem, state(bank=99.0)) == set()
    assert violated(gate, problem, state(bank=79.0)) == {"bank_excess_left"}
    assert violated(gate, problem, state(bank=101.0)) == {"bank_excess_right"}
    assert violated(gate, problem, state(bank=90.0, east=5.9)) == set()
    assert violated(gate, problem, state(bank=90.0, east=6.1)) == {"right_wing", "left_wing"}


# a pylon at the origin to be passed on its eastern side, 3.5 m clear, counted up to 100 m away

PYLON = passing(pylon_at("pylon", 0.0, 0.0, 90.0))
NEAR = 3.5 + SPAN / 2


@pytest.mark.parametrize(
    "allowed",
    [
        state(east=NEAR + 0.01),
        state(east=99.9),
        state(east=4.0, bank=89.0),
        state(east=NEAR + 0.01, bank=180.0),
        state(east=20.0, heading=59.0),
        state(east=20.0, heading=-59.0),
        state(east=10.0, climb=44.0, height=15.1),
    ],
)
def test_pylon_lets_pass_what_is_on_its_side_at_any_bank(allowed: np.ndarray) -> None:
    problem, pylon = PYLON
    assert violated(pylon, problem, allowed) == set()


@pytest.mark.parametrize(
    ("wrong", "conditions"),
    [
        (state(east=NEAR - 0.01), {"beside_left"}),
        (state(east=-10.0), {"right", "beside_left", "beside_right"}),
        (state(east=-NEAR - 0.01), {"right", "beside_left", "beside_right"}),
        (state(east=100.1), {"right"}),
        (state(north=0.5, east=10.0), {"along"}),
        (state(east=20.0, heading=60.1), {"course_excess_right"}),
        (state(east=20.0, heading=-60.1), {"course_excess_left"}),
        (state(east=10.0, height=25.1), {"height"}),
        (state(east=10.0, climb=46.0), {"climb_sine"}),
        # What counts is the distance of the wing tips across the track, not along the line through the pylon.
        (state(east=NEAR + 0.5, heading=50.0), {"beside_left"}),
    ],
)
def test_pylon_refuses_what_is_not_allowed_by_name(wrong: np.ndarray, conditions: set[str]) -> None:
    problem, pylon = PYLON
    assert violated(pylon, problem, wrong) == conditions


def test_pylon_with_the_other_side_is_the_mirror_image() -> None:
    problem, pylon = passing(pylon_at("pylon", 0.0, 0.0, 270.0))
    assert violated(pylon, problem, state(east=-NEAR - 0.01)) == set()
    assert violated(pylon, problem, state(east=-NEAR + 0.01)) == {"beside_right"}
    assert violated(pylon, problem, state(east=10.0)) == {"right", "beside_left", "beside_right"}


# manoeuvres

FIXED = Manoeuvre(
    "corner",
    bank=0.0,
    climb=0.0,
    heading=0.0,
    north=Interval.exactly(0.0),
    east=Interval.exactly(0.0),
    height=Interval.exactly(80.0),
)


def test_manoeuvre_fixes_what_it_prescribes() -> None:
    problem, corner = passing(FIXED)
    assert violated(corner, problem, state(height=80.0)) == set()
    assert violated(corner, problem, state(north=1.0, height=80.0)) == {"x"}
    assert violated(corner, problem, state(east=1.0, height=80.0)) == {"y"}
    assert violated(corner, problem, state(height=81.0)) == {"z"}
    assert violated(corner, problem, state(height=80.0, heading=1.0)) == {"course_sine"}
    assert violated(corner, problem, state(height=80.0, heading=180.0)) == {"course_cosine"}
    assert violated(corner, problem, state(height=80.0, climb=1.0)) == {"climb_sine"}
    assert violated(corner, problem, state(height=80.0, bank=1.0)) == {"bank_sine"}
    assert violated(corner, problem, state(height=80.0, bank=180.0)) == {"bank_cosine"}


def test_inverted_line_is_flown_inverted_along_its_climb_angle() -> None:
    problem, line = passing(Manoeuvre("line", bank=math.pi, climb=-math.pi / 4))
    assert violated(line, problem, state(height=150.0, climb=-45.0, bank=180.0, heading=33.0)) == set()
    assert violated(line, problem, state(climb=-45.0, bank=0.0)) == {"bank_cosine"}
    assert violated(line, problem, state(climb=-44.0, bank=180.0)) == {"climb_sine"}
    assert violated(line, problem, state(climb=-45.0, bank=170.0)) == {"bank_sine"}


@pytest.mark.parametrize("up", [True, False])
def test_vertical_line_is_vertical_the_right_way_round(up: bool) -> None:
    climb = 90.0 if up else -90.0
    problem, line = passing(Manoeuvre("line", climb=climb * DEGREE))
    for bank in (0.0, 40.0, 180.0):
        assert violated(line, problem, state(height=150.0, climb=climb, bank=bank)) == set()
    assert "climb_sine" in violated(line, problem, state(climb=-climb))
    assert "course_cosine" in violated(line, problem, state(climb=0.99 * climb))
    assert "course_sine" in violated(line, problem, state(climb=0.99 * climb, heading=90.0))


def test_free_position_may_be_bounded() -> None:
    problem, high = passing(Manoeuvre("high", climb=0.0, height=Interval(100.0, 120.0), east=Interval(upper=5.0)))
    assert violated(high, problem, state(height=100.5, east=-300.0)) == set()
    assert violated(high, problem, state(height=99.0)) == {"z"}
    assert violated(high, problem, state(height=121.0)) == {"z"}
    assert violated(high, problem, state(height=110.0, east=6.0)) == {"y"}


# whole races


def test_start_is_limited_in_speed_and_begins_with_a_unit_quaternion() -> None:
    problem = problem_of(SMALL)
    assert violated(problem.start, problem, state(heading=20.0)) == set()
    assert violated(problem.start, problem, state(heading=20.0, speed=200.5 * KNOT)) == {"V_K"}
    stretched = state(heading=20.0)
    stretched[4:8] *= 1.1
    assert violated(problem.start, problem, stretched) == {"attitude_norm"}


@pytest.mark.parametrize("name", RACES)
def test_every_leg_is_a_phase_that_ends_at_its_passage(name: str) -> None:
    problem, passages = problem_of(RACES[name]), RACES[name].course.passages
    assert [problem.start.name, *(phase.end.name for phase in problem.phases)] == [one.name for one in passages]
    assert [phase.name for phase in problem.phases] == [
        f"{a.name} -> {b.name}" for a, b in itertools.pairwise(passages)
    ]


@pytest.mark.parametrize("name", RACES)
def test_planned_crossings_keep_all_conditions(name: str) -> None:
    problem = problem_of(RACES[name])
    boundaries = [problem.start, *(phase.end for phase in problem.phases)]
    for waypoint, boundary in zip(planned(RACES[name]).waypoints, boundaries, strict=True):
        north, east, height = waypoint.position or (0.0, 0.0, 150.0)
        angles = {"heading": waypoint.heading, "climb": waypoint.climb, "bank": waypoint.bank or 0.0}
        crossed = state(north, east, height, **{key: angle / DEGREE for key, angle in angles.items()})
        # Wings level and askew, the plan may come a little too near to a pylon; a banked wing needs less room.
        assert violated(boundary, problem, crossed) <= {"beside_left", "beside_right"}, boundary.name
        if not isinstance(waypoint.passage.element, Pylon):
            assert violated(boundary, problem, crossed) == set(), boundary.name


@pytest.mark.parametrize("name", COURSES)
def test_limits_of_aircraft_and_rules_hold_along_the_path(name: str) -> None:
    race, system = SHIPPED[name], problem_of(SHIPPED[name]).system
    declared = {one.name: one for one in (*system.states, *system.controls, *system.path)}
    assert (declared["n_z"].lower, declared["n_z"].upper) == (race.course.rules.n_z.lower, race.course.rules.n_z.upper)
    assert declared["z"].upper == -race.course.rules.height.lower
    assert (declared["V_K"].lower, declared["V_K"].upper) == (35.0, 130.0)
    assert declared["C_L"].upper == race.aircraft.lift.C_L_max
    assert declared["p_Kbar"].upper == race.aircraft.point_mass.p


# pieces of the homotopy


@pytest.mark.parametrize("name", RACES)
def test_piece_ends_exactly_as_planned(name: str) -> None:
    problem, flight = problem_of(RACES[name]), prepared(RACES[name])
    for waypoint in flight.plan.waypoints[1:]:
        piece = piece_boundary(waypoint, flight.observation)
        north, east, height = waypoint.position or (0.0, 0.0, 150.0)
        heading, climb, bank = waypoint.heading / DEGREE, waypoint.climb / DEGREE, (waypoint.bank or 0.0) / DEGREE
        assert violated(piece, problem, state(north, east, height, heading=heading, climb=climb, bank=bank)) == set()
        if waypoint.position is not None:
            beside = state(north + 0.1, east, height, heading=heading, climb=climb, bank=bank)
            assert violated(piece, problem, beside) == {"x"}
        back = state(north, east, height, heading=heading + 180.0, climb=climb, bank=bank)
        if abs(climb) < 80.0:
            assert violated(piece, problem, back) == {"course_excess_right", "course_excess_left"}
        else:
            fallen = state(north, east, height, heading=heading, climb=-climb, bank=bank)
            assert "climb_sine" in violated(piece, problem, fallen)


@pytest.mark.parametrize(("turn", "broken"), [(9.9, set()), (-9.9, set()), (10.1, {"course_excess_right"})])
def test_piece_may_leave_the_planned_course_a_little(turn: float, broken: set[str]) -> None:
    problem, flight = problem_of(SMALL), prepared(SMALL)
    last = flight.plan.waypoints[-1]
    assert last.position is not None
    piece = piece_boundary(last, flight.observation)
    assert violated(piece, problem, state(*last.position, heading=last.heading / DEGREE + turn)) == broken
    climbed = violated(piece, problem, state(*last.position, heading=last.heading / DEGREE, climb=abs(turn)))
    assert climbed == ({"climb_sine"} if broken else set())


STATES = PointMassState.quantities()
BEACH = SafetyLine("beach", Point(0.0, 500.0), Point(900.0, 500.0), keep_right=False, margin=20.0)
SQUARE = (Point(-900.0, -900.0), Point(-900.0, 900.0), Point(900.0, 900.0), Point(900.0, -900.0))
STAND = Crowd("stand", CrowdShape.LINE, (Point(0.0, -400.0), Point(300.0, -420.0)), 90.0)


def watches(**changes: object) -> tuple[tuple[PathConstraint, ...], ...]:
    return leg_watches(dataclasses.replace(SMALL.course, **changes), STATES)


def with_passage(index: int, **changes: object) -> Course:
    passages = list(SMALL.course.passages)
    passages[index] = dataclasses.replace(passages[index], **changes)
    return dataclasses.replace(SMALL.course, passages=tuple(passages))


def seen(watch: PathConstraint, north: float, east: float) -> float:
    x = [north, east, -20.0, 80.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    return float((watch.exact or watch.observation).values(x, watch.values))


def test_course_without_surroundings_watches_nothing() -> None:
    assert watches() == ((), (), ())


def test_safety_line_is_watched_on_its_leg_alone() -> None:
    first, second, third = leg_watches(with_passage(2, safety_lines=(BEACH,)), STATES)
    assert (first, third) == ((), ())
    (line,) = second
    assert line.name == "safety line beach"
    assert line.bounds == {"beside": Interval(lower=20.0)}
    assert seen(line, 100.0, 480.0) == pytest.approx(20.0)
    assert seen(line, 100.0, 520.0) == pytest.approx(-20.0)


@pytest.mark.parametrize("corners", [SQUARE, SQUARE[::-1]])
def test_airspace_is_a_line_to_each_side_whichever_way_its_corners_run(corners: tuple[Point, ...]) -> None:
    for leg in watches(airspace=corners):
        assert len(leg) == 4
        assert all(seen(side, 0.0, 0.0) == pytest.approx(900.0) for side in leg)
        outside = [sum(seen(side, *place) < 0.0 for side in leg) for place in ((1000.0, 0.0), (1000.0, 1000.0))]
        assert outside == [1, 2]


def test_crowd_is_watched_on_every_leg_with_its_own_distance() -> None:
    for (watch,) in watches(crowd=(STAND,)):
        assert watch.bounds == {"distance": Interval(lower=90.0)}
        assert watch.exact is not None
        assert seen(watch, 0.0, -310.0) == pytest.approx((90.0**2 + 20.0**2) ** 0.5)


def test_like_crowds_share_their_equations() -> None:
    other = dataclasses.replace(STAND, name="other", corners=(Point(5.0, 5.0), Point(6.0, 9.0)), distance=30.0)
    (one, two), *_ = watches(crowd=(STAND, other))
    assert one.observation is two.observation
    assert one.exact is two.exact
    assert one.values != two.values


def test_climb_angle_is_watched_during_a_roll() -> None:
    allowed = Interval(1.3, 1.6)
    first, second, third = leg_watches(with_passage(1, roll=Roll(5.0, allowed)), STATES)
    assert (second, third) == ((), ())
    assert [watch.bounds for watch in first] == [{"climb": allowed}]


NODES = 7
angle = st.floats(-3.1, 3.1)
signs = arrays(np.float64, (NODES,), elements=st.sampled_from([-1.0, 1.0]))


def history(angles: list[tuple[float, float, float]]) -> Array:
    """A state history with these courses, climbs and banks; the other rows hold their own numbers."""
    state = np.arange(PointMassState.size(), dtype=float)[:, None] + np.arange(len(angles), dtype=float)
    state[ROWS] = np.array([quaternion(*one) for one in angles]).T
    return state


histories = st.builds(history, st.lists(st.tuples(angle, angle, angle), min_size=NODES, max_size=NODES))


def matrices(state: Array) -> Array:
    """`R_OKbar` at every node, shape (3, 3, N)."""
    return np.array(rotation(list(state[ROWS])))


def test_rows_are_those_of_the_quaternion() -> None:
    assert [PointMassState.names()[row] for row in ROWS] == ["q0", "q1", "q2", "q3"]


@settings(max_examples=30)
@given(histories, signs)
def test_aligning_changes_no_attitude_and_no_other_row(state: Array, sign: Array) -> None:
    state[ROWS] *= sign
    aligned = state.copy()
    align_quaternions(aligned)
    assert np.allclose(matrices(aligned), matrices(state), atol=1e-12)
    others = [row for row in range(len(state)) if row not in ROWS]
    assert (aligned[others] == state[others]).all()


@settings(max_examples=30)
@given(histories, signs)
def test_neighbours_lie_on_the_same_side_after_aligning(state: Array, sign: Array) -> None:
    state[ROWS] *= sign
    align_quaternions(state)
    q = state[ROWS]
    assert ((q[:, 1:] * q[:, :-1]).sum(axis=0) >= 0.0).all()


@settings(max_examples=30)
@given(histories, signs)
def test_aligning_keeps_the_first_node_and_a_second_time_changes_nothing(state: Array, sign: Array) -> None:
    state[ROWS] *= sign
    aligned = state.copy()
    align_quaternions(aligned)
    assert (aligned[:, 0] == state[:, 0]).all()
    again = aligned.copy()
    align_quaternions(again)
    assert (again == aligned).all()


@settings(max_examples=30)
@given(histories, histories)
def test_turning_from_an_attitude_to_itself_changes_nothing(state: Array, reference: Array) -> None:
    assert np.allclose(turned(state, reference, reference), state[ROWS], atol=1e-12)


@settings(max_examples=30)
@given(histories, histories)
def test_turning_the_reference_itself_leads_to_where_the_reference_goes(before: Array, after: Array) -> None:
    assert np.allclose(turned(before, before, after), after[ROWS], atol=1e-12)


@settings(max_examples=30)
@given(histories, histories, histories)
def test_turning_there_and_back_is_a_round_trip(state: Array, before: Array, after: Array) -> None:
    there = state.copy()
    there[ROWS] = turned(state, before, after)
    assert np.allclose((there[ROWS] ** 2).sum(axis=0), 1.0, atol=1e-12)
    assert np.allclose(turned(there, after, before), state[ROWS], atol=1e-12)


@settings(max_examples=30)
@given(histories, histories, histories)
def test_directions_turn_with_the_reference(state: Array, before: Array, after: Array) -> None:
    """What `before` is turned by, in O, is what `state` is turned by: R_new R_old^T is the same for both."""
    new = state.copy()
    new[ROWS] = turned(state, before, after)
    for node in range(NODES):
        turn = matrices(after)[:, :, node] @ matrices(before)[:, :, node].T
        assert np.allclose(matrices(new)[:, :, node], turn @ matrices(state)[:, :, node], atol=1e-9)
