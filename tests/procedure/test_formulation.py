"""The formulated race: conditions at passages, path constraints, attitudes and families of phases."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from races import DEGREE, EDGE_540, KNOT, RACES, SMALL, WINDOW, knife_edge, level, planned, prepared
from races import course as course_of
from races import pylon as pylon_at

from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.environment import Air
from airrace.model.frames import quaternion, rotation
from airrace.model.track.course import Course, Crowd, CrowdShape, Direction, Roll, SafetyLine
from airrace.model.track.gates import Element, Manoeuvre, Passing, Pylon
from airrace.model.track.polygons import Point
from airrace.optimal_control.constraint_check import boundary_values, outside
from airrace.optimal_control.problem import Boundary, PathConstraint, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Array
from airrace.procedure.formulation import PILOT_NAMES, path_constraints, piece_boundary
from airrace.procedure.guess import QUATERNION_ROWS, align_quaternions, first_mesh, rotate
from airrace.procedure.settings import MeshSettings
from airrace.race import Race

SPAN = EDGE_540.airframe.b
At = tuple[Problem, Boundary]


def problem_of(race: Race) -> Problem:
    return prepared(race).problem(first_mesh(planned(race), MeshSettings()))


def passing(element: Element, direction: Direction = Direction.FORWARD) -> At:
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


def broken(at: At, **flown: float) -> set[str]:
    """Names of the conditions that a passing does not keep; arguments of `state`."""
    problem, boundary = at
    return violated(boundary, problem, state(**flown))


LEVEL = passing(level("gate", 0.0, 0.0, 0.0))
"""A level gate flown northward, 13 m wide, half a metre of clearance, 15 to 25 m high."""
ROOM = 13.0 / 2 - 0.5 - SPAN / 2
"""How far the centre may leave its axis, wings level, m."""


@pytest.mark.parametrize(
    ("name", "value", "conditions"),
    [
        ("north", 1.0, {"along"}),
        ("east", ROOM + 0.01, {"right_wing"}),
        ("east", -ROOM - 0.01, {"left_wing"}),
        ("height", 14.99, {"height"}),
        ("height", 25.01, {"height"}),
        ("heading", 60.1, {"course_excess_right"}),
        ("heading", -60.1, {"course_excess_left"}),
        ("heading", 180.0, {"course_excess_right", "course_excess_left"}),
        ("bank", 10.1, {"bank_excess_right"}),
        ("bank", -10.1, {"bank_excess_left"}),
        ("bank", 180.0, {"bank_excess_right", "bank_excess_left"}),
        ("bank", 90.0, {"bank_excess_right"}),
        ("climb", 45.1, {"climb_sine"}),
        ("climb", -45.1, {"climb_sine"}),
    ],
)
def test_level_gate_refuses_what_is_not_allowed_by_name(name: str, value: float, conditions: set[str]) -> None:
    assert broken(LEVEL, **{name: value}) == conditions


def test_level_gate_lets_pass_what_is_allowed_and_turns_around_in_reverse() -> None:
    most = {"east": ROOM - 0.01, "heading": 59.0, "bank": 9.9, "climb": 44.0}
    for name, value in most.items():
        assert broken(LEVEL, **{name: value}) == broken(LEVEL, **{name: -value}) == set()
    assert broken(LEVEL, height=15.01) == broken(LEVEL, height=24.99) == broken(LEVEL, speed=50.0) == set()
    assert broken(LEVEL, climb=20.0, bank=9.0, heading=30.0) == broken(LEVEL) == set()
    reverse = passing(level("gate", 0.0, 0.0, 0.0), Direction.REVERSE)
    assert broken(reverse, heading=180.0) == set()
    assert broken(reverse, heading=180.0, east=-ROOM - 0.01) == {"right_wing"}
    assert broken(reverse) == {"course_excess_right", "course_excess_left"}


def test_gate_flown_exactly_fixes_position_and_bank_and_limits_the_path() -> None:
    gate = passing(level("gate", 0.0, 0.0, 0.0, Passing.POINT))
    assert broken(gate, heading=30.0, climb=40.0, speed=60.0) == set()
    assert broken(gate, climb=50.0) == {"climb_sine"}
    assert broken(gate, east=0.1) == {"right"}
    assert broken(gate, height=20.1) == {"height"}
    assert broken(gate, north=-0.1) == {"along"}
    assert broken(gate, bank=1.0) == {"bank_sine"}
    assert broken(gate, bank=180.0) == {"bank_cosine"}
    assert broken(gate, heading=61.0) == {"course_excess_right"}


@pytest.mark.parametrize(("tolerance", "allowed"), [(60.0, 59.9), (85.0, 84.9), (89.8, 89.7), (90.0, 89.9)])
def test_bank_tolerance_may_be_as_wide_as_a_right_angle(tolerance: float, allowed: float) -> None:
    wide = dataclasses.replace(WINDOW, bank=tolerance * DEGREE)
    gate = passing(dataclasses.replace(level("gate", 0.0, 0.0, 0.0), tolerances=wide))
    for side in (-1.0, 1.0):
        assert broken(gate, bank=side * allowed) == set()
        assert broken(gate, bank=side * (tolerance + 0.1)) != set()
    assert max(abs(value) for value in gate[1].values) < 1000.0  # a tangent of 1e16 is nothing to compute with
    # A banked wing leaves more room beside the centre.
    assert broken(gate, east=ROOM + 1.0) == {"right_wing"}
    assert broken(gate, east=ROOM + 1.0, bank=50.0) == set()


@pytest.mark.parametrize(("right", "bank"), [(True, 90.0), (False, -90.0)])
def test_knife_edge_gate_is_flown_on_its_edge_alone(right: bool, bank: float) -> None:
    gate = passing(knife_edge("edge", 0.0, 0.0, 0.0, right=right))
    assert broken(gate, bank=bank) == broken(gate, bank=bank, heading=20.0, climb=10.0) == set()
    assert broken(gate, bank=0.95 * bank) == {"bank_sine"}
    assert broken(gate, bank=-bank) == {"bank_cosine"}
    assert "bank_sine" in broken(gate)
    assert broken(gate, bank=bank, height=20.5) == {"height"}


def test_knife_edge_window_turns_its_bank_tolerance_with_it() -> None:
    edge = dataclasses.replace(knife_edge("edge", 0.0, 0.0, 0.0, right=True), passing=Passing.WINDOW)
    gate = passing(edge)
    assert broken(gate, bank=81.0) == broken(gate, bank=99.0) == broken(gate, bank=90.0, east=5.9) == set()
    assert broken(gate, bank=79.0) == {"bank_excess_left"}
    assert broken(gate, bank=101.0) == {"bank_excess_right"}
    assert broken(gate, bank=90.0, east=6.1) == {"right_wing", "left_wing"}


NEAR = 3.5 + SPAN / 2
"""How near a pylon may be passed that is 3.5 m clear, wings level, m."""


def test_pylon_is_passed_on_its_side_at_any_bank_and_mirrored_on_the_other() -> None:
    pylon = passing(pylon_at("pylon", 0.0, 0.0, 90.0))  # on its eastern side, counted up to 100 m away
    for allowed in ({"east": NEAR + 0.01}, {"east": 99.9}, {"east": 4.0, "bank": 89.0}):
        assert broken(pylon, **allowed) == set()
    assert broken(pylon, east=NEAR + 0.01, bank=180.0) == broken(pylon, east=10.0, climb=44.0, height=15.1) == set()
    assert broken(pylon, east=20.0, heading=59.0) == broken(pylon, east=20.0, heading=-59.0) == set()
    assert broken(pylon, east=NEAR - 0.01) == {"beside_left"}
    assert broken(pylon, east=-10.0) == {"right", "beside_left", "beside_right"}
    assert broken(pylon, east=-NEAR - 0.01) == {"right", "beside_left", "beside_right"}
    assert broken(pylon, east=100.1) == {"right"}
    assert broken(pylon, north=0.5, east=10.0) == {"along"}
    assert broken(pylon, east=20.0, heading=60.1) == {"course_excess_right"}
    assert broken(pylon, east=20.0, heading=-60.1) == {"course_excess_left"}
    assert broken(pylon, east=10.0, height=25.1) == {"height"}
    assert broken(pylon, east=10.0, climb=46.0) == {"climb_sine"}
    # What counts is the distance of the wing tips across the track, not along the line through the pylon.
    assert broken(pylon, east=NEAR + 0.5, heading=50.0) == {"beside_left"}
    other = passing(pylon_at("pylon", 0.0, 0.0, 270.0))
    assert broken(other, east=-NEAR - 0.01) == set()
    assert broken(other, east=-NEAR + 0.01) == {"beside_right"}
    assert broken(other, east=10.0) == {"right", "beside_left", "beside_right"}


@pytest.mark.parametrize(
    ("name", "value", "conditions"),
    [
        ("height", 80.0, set()),
        ("north", 1.0, {"x"}),
        ("east", 1.0, {"y"}),
        ("height", 81.0, {"z"}),
        ("heading", 1.0, {"course_sine"}),
        ("heading", 180.0, {"course_cosine"}),
        ("climb", 1.0, {"climb_sine"}),
        ("bank", 1.0, {"bank_sine"}),
        ("bank", 180.0, {"bank_cosine"}),
    ],
)
def test_manoeuvre_fixes_what_it_prescribes(name: str, value: float, conditions: set[str]) -> None:
    exactly = Interval.exactly
    place = {"north": exactly(0.0), "east": exactly(0.0), "height": exactly(80.0)}
    corner = passing(Manoeuvre("corner", bank=0.0, climb=0.0, heading=0.0, **place))
    assert broken(corner, **{"height": 80.0, name: value}) == conditions


def test_free_position_of_a_manoeuvre_may_be_bounded() -> None:
    high = passing(Manoeuvre("high", climb=0.0, height=Interval(100.0, 120.0), east=Interval(upper=5.0)))
    assert broken(high, height=100.5, east=-300.0) == set()
    assert broken(high, height=99.0) == broken(high, height=121.0) == {"z"}
    assert broken(high, height=110.0, east=6.0) == {"y"}


def test_inverted_line_is_flown_inverted_along_its_climb_angle() -> None:
    line = passing(Manoeuvre("line", bank=math.pi, climb=-math.pi / 4))
    assert broken(line, height=150.0, climb=-45.0, bank=180.0, heading=33.0) == set()
    assert broken(line, climb=-45.0, bank=0.0) == {"bank_cosine"}
    assert broken(line, climb=-44.0, bank=180.0) == {"climb_sine"}
    assert broken(line, climb=-45.0, bank=170.0) == {"bank_sine"}


@pytest.mark.parametrize("climb", [90.0, -90.0])
def test_vertical_line_is_vertical_the_right_way_round(climb: float) -> None:
    line = passing(Manoeuvre("line", climb=climb * DEGREE))
    for bank in (0.0, 40.0, 180.0):
        assert broken(line, height=150.0, climb=climb, bank=bank) == set()
    assert "climb_sine" in broken(line, climb=-climb)
    assert "course_cosine" in broken(line, climb=0.99 * climb)
    assert "course_sine" in broken(line, climb=0.99 * climb, heading=90.0)


def test_start_is_limited_in_speed_and_begins_with_a_unit_quaternion() -> None:
    problem = problem_of(SMALL)
    assert broken((problem, problem.start), heading=20.0) == set()
    assert broken((problem, problem.start), heading=20.0, speed=200.5 * KNOT) == {"V_K"}
    stretched = state(heading=20.0)
    stretched[4:8] *= 1.1
    assert violated(problem.start, problem, stretched) == {"attitude_norm"}


@pytest.mark.parametrize("name", RACES)
def test_every_leg_is_a_phase_that_ends_as_planned_at_its_passage_within_all_limits(name: str) -> None:
    race, problem = RACES[name], problem_of(RACES[name])
    boundaries = [problem.start, *(phase.end for phase in problem.phases)]
    names = [one.name for one in race.course.passages]
    assert [one.name for one in boundaries] == names
    assert [phase.name for phase in problem.phases] == [f"{a} -> {b}" for a, b in itertools.pairwise(names)]
    for waypoint, boundary in zip(planned(race).waypoints, boundaries, strict=True):
        north, east, height = waypoint.position or (0.0, 0.0, 150.0)
        angles = {"heading": waypoint.heading, "climb": waypoint.climb, "bank": waypoint.bank or 0.0}
        crossed = state(north, east, height, **{key: angle / DEGREE for key, angle in angles.items()})
        # Wings level and askew, the plan may come a little too near to a pylon; a banked wing needs less room.
        near = {"beside_left", "beside_right"} if isinstance(waypoint.passage.element, Pylon) else set[str]()
        # A plan has places and attitudes; what a pilot keeps to besides, it does not know.
        assert violated(boundary, problem, crossed) <= near | PILOT_NAMES, boundary.name
    system = problem.system
    declared = {one.name: one for one in (*system.states, *system.controls, *system.path)}
    allowed = race.course.rules.n_z_allowed
    assert (declared["n_z"].lower, declared["n_z"].upper) == (allowed.lower, allowed.upper)
    assert declared["z"].upper == -race.course.rules.height.lower
    assert (declared["V_K"].lower, declared["V_K"].upper) == (35.0, 130.0)
    assert declared["C_L"].upper == race.aircraft.lift.C_L_max
    assert declared["p_Kbar"].upper == race.aircraft.point_mass.p


# pieces of the homotopy


@pytest.mark.parametrize("name", RACES)
def test_piece_ends_exactly_as_planned(name: str) -> None:
    problem, stage_problem = problem_of(RACES[name]), prepared(RACES[name])
    for waypoint in stage_problem.plan.waypoints[1:]:
        piece = problem, piece_boundary(waypoint, stage_problem.observation)
        north, east, height = waypoint.position or (0.0, 0.0, 150.0)
        heading, climb, bank = waypoint.heading / DEGREE, waypoint.climb / DEGREE, (waypoint.bank or 0.0) / DEGREE
        attitude = {"heading": heading, "climb": climb, "bank": bank}
        assert broken(piece, north=north, east=east, height=height, **attitude) == set()
        if waypoint.position is not None:
            assert broken(piece, north=north + 0.1, east=east, height=height, **attitude) == {"x"}
        if abs(climb) < 80.0:
            attitude["heading"] += 180.0
            back = broken(piece, north=north, east=east, height=height, **attitude)
            assert back == {"course_excess_right", "course_excess_left"}
        else:
            attitude["climb"] = -climb
            assert "climb_sine" in broken(piece, north=north, east=east, height=height, **attitude)


@pytest.mark.parametrize(("turn", "conditions"), [(9.9, set()), (-9.9, set()), (10.1, {"course_excess_right"})])
def test_piece_may_leave_the_planned_course_a_little(turn: float, conditions: set[str]) -> None:
    problem, stage_problem = problem_of(SMALL), prepared(SMALL)
    last = stage_problem.plan.waypoints[-1]
    assert last.position is not None
    piece = piece_boundary(last, stage_problem.observation)
    assert violated(piece, problem, state(*last.position, heading=last.heading / DEGREE + turn)) == conditions
    climbed = violated(piece, problem, state(*last.position, heading=last.heading / DEGREE, climb=abs(turn)))
    assert climbed == ({"climb_sine"} if conditions else set())


STATES = PointMassState.quantities()
BEACH = SafetyLine("beach", Point(0.0, 500.0), Point(900.0, 500.0), keep_right=False, margin=20.0)
SQUARE = (Point(-900.0, -900.0), Point(-900.0, 900.0), Point(900.0, 900.0), Point(900.0, -900.0))
STAND = Crowd("stand", CrowdShape.LINE, (Point(0.0, -400.0), Point(300.0, -420.0)), 90.0)


def constraints_of(**changes: object) -> tuple[tuple[PathConstraint, ...], ...]:
    return path_constraints(dataclasses.replace(SMALL.course, **changes), STATES)


def with_passage(index: int, **changes: object) -> Course:
    passages = list(SMALL.course.passages)
    passages[index] = dataclasses.replace(passages[index], **changes)
    return dataclasses.replace(SMALL.course, passages=tuple(passages))


def seen(constraint: PathConstraint, north: float, east: float) -> float:
    x = [north, east, -20.0, 80.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    return float((constraint.exact or constraint.observation).values(x, constraint.values))


def test_safety_line_and_roll_are_watched_on_their_leg_alone() -> None:
    assert constraints_of() == ((), (), ())
    first, second, third = path_constraints(with_passage(2, safety_lines=(BEACH,)), STATES)
    assert (first, third) == ((), ())
    (line,) = second
    assert line.name == "safety line beach"
    assert line.bounds == {"beside": Interval(lower=20.0)}
    assert seen(line, 100.0, 480.0) == pytest.approx(20.0)
    assert seen(line, 100.0, 520.0) == pytest.approx(-20.0)
    allowed = Interval(1.3, 1.6)
    first, second, third = path_constraints(with_passage(1, roll=Roll(5.0, allowed)), STATES)
    assert (second, third) == ((), ())
    assert [constraint.bounds for constraint in first] == [{"climb": allowed}]


@pytest.mark.parametrize("corners", [SQUARE, SQUARE[::-1]])
def test_airspace_is_a_line_to_each_side_whichever_way_its_corners_run(corners: tuple[Point, ...]) -> None:
    for leg in constraints_of(airspace=corners):
        assert len(leg) == 4
        assert all(seen(side, 0.0, 0.0) == pytest.approx(900.0) for side in leg)
        outside = [sum(seen(side, *place) < 0.0 for side in leg) for place in ((1000.0, 0.0), (1000.0, 1000.0))]
        assert outside == [1, 2]


def test_crowds_are_watched_on_every_leg_with_their_own_distances_and_like_ones_share_equations() -> None:
    for (constraint,) in constraints_of(crowd=(STAND,)):
        assert constraint.bounds == {"distance": Interval(lower=90.0)}
        assert constraint.exact is not None
        assert seen(constraint, 0.0, -310.0) == pytest.approx((90.0**2 + 20.0**2) ** 0.5)
    other = dataclasses.replace(STAND, name="other", corners=(Point(5.0, 5.0), Point(6.0, 9.0)), distance=30.0)
    (one, two), *_ = constraints_of(crowd=(STAND, other))
    assert one.observation is two.observation
    assert one.exact is two.exact
    assert one.values != two.values


NODES = 7
angle = st.floats(-3.1, 3.1)
signs = arrays(np.float64, (NODES,), elements=st.sampled_from([-1.0, 1.0]))


def history(angles: list[tuple[float, float, float]]) -> Array:
    """A state history with these courses, climbs and banks; the other rows hold their own numbers."""
    state = np.arange(PointMassState.size(), dtype=float)[:, None] + np.arange(len(angles), dtype=float)
    state[QUATERNION_ROWS] = np.array([quaternion(*one) for one in angles]).T
    return state


histories = st.builds(history, st.lists(st.tuples(angle, angle, angle), min_size=NODES, max_size=NODES))


def matrices(state: Array) -> Array:
    """`R_OKbar` at every node, shape (3, 3, N)."""
    return np.array(rotation(list(state[QUATERNION_ROWS])))


@settings(max_examples=30)
@given(histories, signs)
def test_aligning_keeps_attitudes_and_other_rows_and_puts_neighbours_on_the_side_of_the_first(
    state: Array, sign: Array
) -> None:
    assert [PointMassState.names()[row] for row in QUATERNION_ROWS] == ["q0", "q1", "q2", "q3"]
    state[QUATERNION_ROWS] *= sign
    aligned = state.copy()
    align_quaternions(aligned)
    assert np.allclose(matrices(aligned), matrices(state), atol=1e-12)
    others = [row for row in range(len(state)) if row not in QUATERNION_ROWS]
    assert (aligned[others] == state[others]).all()
    assert (aligned[:, 0] == state[:, 0]).all()
    q = aligned[QUATERNION_ROWS]
    assert ((q[:, 1:] * q[:, :-1]).sum(axis=0) >= 0.0).all()
    again = aligned.copy()
    align_quaternions(again)
    assert (again == aligned).all()


@settings(max_examples=30)
@given(histories, histories, histories)
def test_directions_turn_with_the_reference(state: Array, before: Array, after: Array) -> None:
    """What `before` is turned by, in O, is what `state` is turned by: R_new R_old^T is the same for both."""
    assert np.allclose(rotate(state, before, before), state[QUATERNION_ROWS], atol=1e-12)
    assert np.allclose(rotate(before, before, after), after[QUATERNION_ROWS], atol=1e-12)
    there = state.copy()
    there[QUATERNION_ROWS] = rotate(state, before, after)
    assert np.allclose((there[QUATERNION_ROWS] ** 2).sum(axis=0), 1.0, atol=1e-12)
    assert np.allclose(rotate(there, after, before), state[QUATERNION_ROWS], atol=1e-12)
    for node in range(NODES):
        turn = matrices(after)[:, :, node] @ matrices(before)[:, :, node].T
        assert np.allclose(matrices(there)[:, :, node], turn @ matrices(state)[:, :, node], atol=1e-9)


@pytest.mark.parametrize("missing", ["intervals", "conditions"])
def test_a_mesh_or_conditions_of_too_few_legs_are_refused(missing: str) -> None:
    stage_problem = prepared(SMALL)
    mesh = first_mesh(stage_problem.plan, MeshSettings())
    if missing == "intervals":
        mesh = mesh[:-1]
    else:
        stage_problem = dataclasses.replace(stage_problem, path_constraints=stage_problem.path_constraints[:-1])
    with pytest.raises(ValueError, match="shorter"):
        stage_problem.problem(mesh)
