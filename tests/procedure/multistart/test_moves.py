"""Coarse solutions, moves within windows, and the description of routes."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from races import DIVING_EIGHT, EDGE_540, SMALL, course, level, prepared, pylon
from races import planned as plan_of
from search_races import OFF, SLALOM, open_session, optimum, planned_coarse_solution, slalom
from transformations import mirrored

from airrace.model.environment import Air
from airrace.optimal_control.mesh_refinement import resample
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.interface import Ending, SolverOptions
from airrace.optimal_control.solvers.service import SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.procedure.guess import concatenate, guess, phase_piece
from airrace.procedure.multistart import coarse_solution, window
from airrace.procedure.multistart.coarse_solution import (
    ERROR_MAX,
    INTERVAL_QUANTUM,
    INTERVAL_SECONDS,
    INTERVALS_MAX,
    STAGNATION_MAX,
    CoarseSolution,
    InitialGuess,
    coarse_options,
    intervals,
    planned_guess,
    solve_coarse,
    try_solve,
)
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.rolls import tilt_turn
from airrace.procedure.multistart.search import QUICK as BUDGET
from airrace.procedure.multistart.search import Radius
from airrace.procedure.multistart.segments import (
    Segment,
    SegmentShape,
    describe_route,
    describe_segments,
    differing,
    same_route,
    segment_name,
    segments_of,
    shape_of,
)
from airrace.procedure.multistart.window import END_SPEED_TRUST, EvaluatedMove, Move, apply_moves, evaluate
from airrace.procedure.planning.plan import plan
from airrace.procedure.planning.route_decisions import RouteDecisions, candidates
from airrace.procedure.warm_start import InitialBarrier
from airrace.race import Race

ATTITUDE = slice(4, 8)


def own_window(base: CoarseSolution, first: int, last: int) -> Move:
    """A window around a flight's own route."""
    pieces = [phase_piece(base.iterate, base.problem, index) for index in range(first, last)]
    return Move(base, first, last, base.stage_problem, pieces, Segment(0, first, last), "own")


def evaluate_or_none(move: Move) -> EvaluatedMove | None:
    with open_session() as session:
        return evaluate(session.service, move)


def evaluated(move: Move) -> EvaluatedMove:
    found = evaluate_or_none(move)
    assert found is not None
    return found


@pytest.mark.parametrize(("first", "last"), [(0, 1), (1, 2), (2, 3), (0, 2), (1, 3), (0, 3)])
def test_window_around_the_own_route_saves_nothing_and_keeps_the_conditions_of_the_race(first: int, last: int) -> None:
    base = planned_coarse_solution(SMALL)
    found = evaluated(own_window(base, first, last))
    assert abs(found.saved) < 3e-3
    assert found.iterate.durations.shape == (last - first,)
    whole = base.stage_problem.problem(base.problem.mesh)
    assert (found.problem.start == whole.start) is (first == 0)
    assert (found.problem.phases[-1].end == whole.phases[-1].end) is (last == 3)


def test_window_begins_and_ends_in_the_states_of_the_flight_around_it() -> None:
    base = planned_coarse_solution(SMALL)
    found = evaluated(own_window(base, 1, 2))
    nodes = base.problem.first_node
    before, behind = base.iterate.state[:, nodes[1]], base.iterate.state[:, nodes[2]]
    assert found.iterate.state[:, 0] == pytest.approx(before, abs=1e-4)
    for row, name in enumerate(one.name for one in base.problem.system.states):
        if name == "V_K":
            assert abs(found.iterate.state[row, -1] - behind[row]) <= END_SPEED_TRUST
        elif name not in ("q0", "q1", "q2", "q3"):
            assert found.iterate.state[row, -1] == pytest.approx(behind[row], abs=1e-3), name
    # Both signs of a quaternion are the same attitude.
    assert abs(found.iterate.state[ATTITUDE, -1] @ behind[ATTITUDE]) == pytest.approx(1.0, abs=1e-4)


def test_window_whose_end_is_out_of_reach_is_given_up_early(monkeypatch: pytest.MonkeyPatch) -> None:
    base = planned_coarse_solution(SMALL)
    z = [one.name for one in base.problem.system.states].index("z")
    state = base.iterate.state.copy()
    state[z, base.problem.first_node[2] :] -= 500.0
    move = own_window(base, 1, 2)
    solutions: list[ProgramSolution] = []

    def record(*arguments: Any) -> ProgramSolution | None:
        solution = try_solve(*arguments)
        assert solution is not None
        solutions.append(solution)
        return solution

    monkeypatch.setattr(window, "try_solve", record)
    assert evaluate_or_none(dataclasses.replace(move, base=with_state(base, state))) is None
    assert [solution.ending for solution in solutions] == [Ending.INFEASIBLE]
    assert solutions[0].iterations < 2 * STAGNATION_MAX


@pytest.mark.parametrize("is_baseline", [True, False])
def test_only_a_start_that_a_run_without_a_search_has_too_is_never_given_up_early(
    is_baseline: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits: list[int] = []

    def record(_: object, problem: object, iterate: object, options: SolverOptions) -> None:
        limits.append(options.stagnation_max)

    monkeypatch.setattr(coarse_solution, "try_solve", record)
    stage_problem = prepared(SMALL)
    start = planned_guess(stage_problem, stage_problem.plan, InitialBarrier.COLD)
    with open_session() as session:
        assert solve_coarse(session.service, dataclasses.replace(start, is_baseline=is_baseline)) is None
    assert limits == [SolverOptions().stagnation_max if is_baseline else STAGNATION_MAX]


def generator(base: CoarseSolution, race: Race) -> MoveGenerator:
    return MoveGenerator(base, race.course, BUDGET.planning_radius.scale(base.stage_problem.plan.cruise))


def moves(base: CoarseSolution, race: Race) -> list[Move]:
    return list(generator(base, race).moves(set(range(len(base.problem.phases)))))


@pytest.mark.slow
def test_some_move_unwinds_a_wound_flight_and_fits_into_it() -> None:
    base = planned_coarse_solution(SLALOM)
    tried = [one for one in moves(base, SLALOM) if one.plan_penalty <= BUDGET.plan_penalty_max]
    with open_session() as session:
        found = [evaluate(session.service, one) for one in tried]
        best = max((one for one in found if one is not None), key=lambda one: one.saved)
        flight = dataclasses.replace(base.stage_problem, plan=best.move.stage_problem.plan)
        whole = apply_moves(session.service, flight, base, [best])
    assert best.saved > 5.0
    assert whole is not None
    assert whole.race_time == pytest.approx(base.race_time - best.saved, abs=0.05)
    assert whole.race_time == pytest.approx(optimum(SLALOM).trajectory.race_time, abs=0.05)


@pytest.mark.parametrize("race", [pytest.param(SMALL, id="four gates"), pytest.param(SLALOM, id="slalom")])
def test_every_move_has_a_piece_for_each_of_its_phases(race: Race) -> None:
    for move in moves(planned_coarse_solution(race), race):
        assert len(move.pieces) == move.last - move.first
        assert move.first <= move.segment.first < move.segment.last <= move.last
        for piece in move.pieces:
            assert np.isfinite(piece.state).all()
            assert np.isfinite(piece.control).all()
            assert piece.durations.min() > 0.0


def test_moves_are_those_of_the_mirrored_flight_and_none_where_nothing_has_changed() -> None:
    assert list(generator(planned_coarse_solution(SLALOM), SLALOM).moves(set())) == []
    own = [(one.segment, one.kind) for one in moves(planned_coarse_solution(SLALOM), SLALOM)]
    image = mirrored(SLALOM)
    assert [(one.segment, one.kind) for one in moves(planned_coarse_solution(image), image)] == own


def test_start_that_may_be_passed_either_way_is_tried_the_other_way() -> None:
    """Begun backwards past a pylon, the flight is a turn of 180 degrees longer; its window says so."""
    elements = (pylon("first", 0.0, 0.0, 90.0), level("second", 500.0, 0.0, 0.0), level("third", 900.0, 0.0, 0.0))
    race = Race(course("from a pylon", *elements), EDGE_540, Air())
    forward = plan_of(race)
    backwards = [one for one in candidates(race.course, 0) if math.cos(one.axis - forward.waypoints[0].axis) < 0.0]
    chosen = RouteDecisions(candidates={0: tuple(backwards)})
    stage_problem = prepared(race)
    wrong = dataclasses.replace(stage_problem, plan=plan(race.course, stage_problem.plan.cruise, chosen))
    with open_session() as session:
        base = solve_coarse(session.service, planned_guess(wrong, wrong.plan, InitialBarrier.COLD))
    assert base is not None
    gain = base.race_time - planned_coarse_solution(race).race_time
    assert gain > 2.0
    about_start = [one for one in moves(base, race) if one.kind == "other direction" and one.segment.number == 0]
    assert max(evaluated(one).saved for one in about_start) == pytest.approx(gain, abs=0.05)


def twice(race: Race) -> Race:
    """The same elements flown twice."""
    passages = race.course.passages
    again = [dataclasses.replace(one, name=f"2:{one.name}", lap=2, speed=Interval()) for one in passages]
    return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=(*passages, *again)))


def test_what_is_faster_in_one_lap_is_tried_in_the_other() -> None:
    race = twice(SLALOM)
    base = planned_coarse_solution(race)
    neighbourhood = generator(base, race)
    about = [one for one in neighbourhood.moves(set(range(len(base.problem.phases)))) if one.segment.number == 1]
    best = max((evaluate_or_none(one) for one in about), key=lambda one: 0.0 if one is None else one.saved)
    assert best is not None
    assert best.saved > 3.0
    (again,) = neighbourhood.replicate_in_other_laps(best, "unwound")
    assert (again.segment.number, again.kind) == (4, "unwound in another lap")
    assert evaluated(again).saved == pytest.approx(best.saved, rel=0.2)


def test_route_of_another_flight_saves_what_that_flight_is_faster() -> None:
    """The window is the whole race here: what it saves is the difference between both flights."""
    base, good = planned_coarse_solution(SLALOM), planned_coarse_solution(slalom(8.0))
    assert good.race_time < base.race_time - 5.0
    neighbourhood = generator(base, SLALOM)
    found = evaluated(neighbourhood.from_flight(good, neighbourhood.segments, "another"))
    fast, slow = optimum(SLALOM).trajectory.race_time, optimum(SLALOM, OFF).trajectory.race_time
    assert slow > fast + 5.0
    assert found.saved == pytest.approx(base.race_time - fast, abs=0.05)


def test_short_turn_that_leads_high_is_tried_flat() -> None:
    base = planned_coarse_solution(SLALOM)
    problem, long = base.problem, math.radians(100.0)
    short = next(one for one in segments_of(SLALOM.course) if abs(shape_of(base, one).turn) < long)
    first, last = problem.first_node[short.first], problem.first_node[short.last]
    z, state = [one.name for one in problem.system.states].index("z"), base.iterate.state.copy()
    state[z, first : last + 1] -= 90.0 * np.sin(np.linspace(0.0, math.pi, last - first + 1))

    def shapes(flown: CoarseSolution) -> list[str]:
        about = [one for one in moves(flown, SLALOM) if one.segment == short]
        return [one.kind for one in about if one.kind in ("flat", "over the top")]

    assert shapes(base) == []
    assert shapes(with_state(base, state)) == ["flat"]


each_small_race = pytest.mark.parametrize(
    "race",
    [
        pytest.param(SMALL, id="four gates"),
        pytest.param(SLALOM, id="slalom"),
        pytest.param(DIVING_EIGHT, id="half cuban eight"),
    ],
)


@each_small_race
def test_coarse_solution_is_near_the_certified_optimum_and_corrects_its_own_errors(race: Race) -> None:
    found = planned_coarse_solution(race)
    assert found.race_time == pytest.approx(optimum(race, OFF).trajectory.race_time, abs=0.03)
    counts = [len(phase) for phase in found.problem.mesh]
    for error, count in zip(found.errors.tolist(), counts, strict=True):
        assert abs(error) <= ERROR_MAX or count == INTERVALS_MAX


def coarsen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let coarse solutions have fewer intervals."""
    for name, value in (("INTERVAL_SECONDS", 0.5), ("INTERVALS_MIN", 3), ("INTERVAL_QUANTUM", 1)):
        monkeypatch.setattr(coarse_solution, name, value)


def test_errors_of_integration_on_a_coarse_mesh_become_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Corrected, a race time is nearer to that of the same mesh where intervals are integrated more finely."""
    coarsen(monkeypatch)
    monkeypatch.setattr(coarse_solution, "MESHES_MAX", 1)
    stage_problem = prepared(DIVING_EIGHT)
    with open_session() as session:
        coarse = solve_coarse(session.service, planned_guess(stage_problem, stage_problem.plan, InitialBarrier.COLD))
        assert coarse is not None
        scheme = dataclasses.replace(coarse.problem.scheme, steps=4 * coarse.problem.scheme.steps)
        finer = dataclasses.replace(coarse.problem, scheme=scheme)
        solution = try_solve(session.service, finer, coarse.iterate, coarse_options(InitialBarrier.COARSE))
    assert solution is not None
    assert solution.success
    true, raw = float(solution.iterate.durations.sum()), float(coarse.iterate.durations.sum())
    assert true - raw > 0.01  # the coarse mesh gains by its errors
    assert abs(coarse.race_time - true) < 0.5 * abs(raw - true)


@pytest.mark.parametrize("error", [-0.5, 0.5])
def test_large_errors_count_against_a_flight_whatever_their_sign(error: float) -> None:
    own = planned_coarse_solution(SMALL)
    doubtful = dataclasses.replace(own, errors=own.errors + np.eye(len(own.errors))[0] * error)
    raw = float(own.iterate.durations.sum())
    assert doubtful.race_time == pytest.approx(raw + 0.5, abs=2 * ERROR_MAX)


def test_mesh_with_large_errors_is_made_finer(monkeypatch: pytest.MonkeyPatch) -> None:
    coarsen(monkeypatch)
    stage_problem = prepared(DIVING_EIGHT)
    first = planned_guess(stage_problem, stage_problem.plan, InitialBarrier.COLD)
    with open_session() as session:
        found = solve_coarse(session.service, first)
    assert found is not None
    assert found.problem.intervals > sum(len(phase) for phase in first.mesh)
    assert abs(found.race_time - optimum(DIVING_EIGHT, OFF).trajectory.race_time) < 0.2


def test_intervals_grow_with_the_duration_in_steps_up_to_a_limit() -> None:
    seconds = np.linspace(0.1, 60.0, 200).tolist()
    counts = [intervals(one) for one in seconds]
    assert counts == sorted(counts)
    assert all(count % INTERVAL_QUANTUM == 0 for count in counts)
    assert counts[-1] == INTERVALS_MAX
    for one, count in zip(seconds, counts, strict=True):
        assert count == INTERVALS_MAX or one / count <= INTERVAL_SECONDS + 1e-12


def test_slower_plan_has_no_more_intervals_for_being_slow() -> None:
    stage_problem = prepared(SMALL)
    slow = Radius(0.5, slower=True).scale(stage_problem.plan.cruise)
    slower = planned_guess(stage_problem, plan(SMALL.course, slow), InitialBarrier.COLD)
    own = planned_guess(stage_problem, stage_problem.plan, InitialBarrier.COLD)
    assert slower.stage_problem.plan.cruise.V < stage_problem.plan.cruise.V
    assert sum(map(len, slower.mesh)) <= sum(map(len, own.mesh))


@pytest.mark.parametrize("slower", [False, True])
@pytest.mark.parametrize("factor", [0.3, 0.7, 1.0])
def test_pace_is_scaled_to_the_radius_asked_for(factor: float, slower: bool) -> None:
    pace = prepared(SMALL).plan.cruise
    other = Radius(factor, slower).scale(pace)
    assert other.radius == pytest.approx(factor * pace.radius)
    same = ("n", "p") if slower else ("V", "p")
    assert [getattr(other, name) for name in same] == [getattr(pace, name) for name in same]


class Hanging(SolverService):
    """Never comes back."""

    def __init__(self) -> None: ...

    def solve(self, *arguments: object, **named: object) -> None:  # type: ignore[override]
        raise SolverTimeout("no iteration finished within 1 s")


def test_start_on_which_the_solver_hangs_is_lost_and_nothing_else() -> None:
    stage_problem = prepared(SMALL)
    assert solve_coarse(Hanging(), planned_guess(stage_problem, stage_problem.plan, InitialBarrier.COLD)) is None


@pytest.mark.parametrize("finer", [False, True])
def test_coarse_solution_from_an_optimum_stays_there_on_a_coarse_mesh(finer: bool) -> None:
    """Moves are proposed on coarse meshes, whatever mesh their flight was begun on."""
    rough = planned_coarse_solution(SMALL)
    counts = [(2 if finer else 1) * len(phase) for phase in rough.problem.mesh]
    mesh, start = resample(rough.problem.mesh, rough.iterate, counts)
    begun = InitialGuess(rough.stage_problem, mesh, start, InitialBarrier.COARSE, is_baseline=finer)
    with open_session() as session:
        found = solve_coarse(session.service, begun)
    assert found is not None
    assert found.race_time == pytest.approx(rough.race_time, abs=1e-3)
    if finer:
        wanted = [intervals(seconds) for seconds in found.iterate.durations.tolist()]
        assert [len(phase) for phase in found.problem.mesh] == wanted
        assert sum(wanted) < sum(counts)


DEGREE = math.radians(1.0)
FLAT = SegmentShape(
    turn=180 * DEGREE,
    lateral_turn=180 * DEGREE,
    steepest=5 * DEGREE,
    height=22.0,
    rise=2.0,
    gain=0.0,
    overhead=False,
    length=500.0,
)
OVER = dataclasses.replace(FLAT, steepest=88 * DEGREE, height=163.0, rise=143.0, overhead=True)


@pytest.mark.parametrize(
    ("flown", "words"),
    [
        (FLAT, "180 degrees to the right, flat"),
        (dataclasses.replace(FLAT, turn=-180 * DEGREE), "180 degrees to the left, flat"),
        (dataclasses.replace(FLAT, turn=-3 * DEGREE), "straight, flat"),
        (dataclasses.replace(FLAT, height=83.0, rise=1.0, gain=61.0), "180 degrees to the right, climbing 60 m"),
        (dataclasses.replace(FLAT, turn=0.0, gain=-38.0), "straight, descending 40 m"),
        (dataclasses.replace(FLAT, height=83.0, rise=63.0), "180 degrees to the right, 80 m high"),
        (dataclasses.replace(FLAT, turn=3 * DEGREE, height=83.0, rise=63.0), "straight, 80 m high"),
        (OVER, "over the top to the right, 160 m high"),
        (dataclasses.replace(OVER, lateral_turn=0.1 * DEGREE), "over the top, 160 m high"),
        (dataclasses.replace(OVER, turn=-170 * DEGREE), "over the top to the left, 160 m high"),
        (dataclasses.replace(OVER, overhead=False), "180 degrees to the right, 160 m high"),
        (dataclasses.replace(OVER, steepest=40 * DEGREE), "180 degrees to the right, 160 m high"),
    ],
)
def test_shape_in_words(flown: SegmentShape, words: str) -> None:
    assert flown.describe() == words


def test_segments_lie_behind_one_another_and_are_described_by_the_passages_at_their_ends() -> None:
    segments = segments_of(SMALL.course)
    assert [one.number for one in segments] == list(range(len(segments)))
    assert (segments[0].first, segments[-1].last) == (0, len(SMALL.course.passages) - 1)
    assert [one.last for one in segments[:-1]] == [one.first for one in segments[1:]]
    assert describe_route(SMALL.course, planned_coarse_solution(SMALL), segments) == "no long turns"
    course, segments, wound = SLALOM.course, segments_of(SLALOM.course), planned_coarse_solution(SLALOM)
    assert [segment_name(course, one) for one in segments] == ["first -> left", "left -> right", "right -> last"]
    for words in (describe_segments(course, wound, segments[1:]), describe_route(course, wound, segments)):
        assert [one.split(": ")[0] for one in words.split("; ")] == ["left -> right", "right -> last"]


def test_mirrored_flight_has_the_mirrored_shapes() -> None:
    image = mirrored(SLALOM)
    for place in segments_of(SLALOM.course):
        own, seen = shape_of(planned_coarse_solution(SLALOM), place), shape_of(planned_coarse_solution(image), place)
        assert seen.turn == pytest.approx(-own.turn, abs=0.02)
        assert seen.overhead is own.overhead
        for name in ("steepest", "height", "rise", "length"):
            assert getattr(seen, name) == pytest.approx(getattr(own, name), rel=0.02, abs=0.5), name


def test_flight_differs_where_it_is_moved_or_banked_otherwise_and_not_by_the_sign_of_its_quaternions() -> None:
    found, segments = planned_coarse_solution(SMALL), segments_of(SMALL.course)
    first, last = found.problem.first_node[1], found.problem.first_node[2]
    inside = slice(first + 1, last)
    turned, higher, upside_down, slightly = (found.iterate.state.copy() for _ in range(4))
    turned[ATTITUDE] *= -1.0
    higher[2, inside] -= 30.0
    q0, q1, q2, q3 = found.iterate.state[ATTITUDE, inside]
    upside_down[ATTITUDE, inside] = np.array([-q1, q0, q3, -q2])  # rolled by half a turn
    slightly[:2, inside] += 3.0
    for state, different in ((turned, []), (higher, [1]), (upside_down, [1]), (slightly, [])):
        other = with_state(found, state)
        assert differing(found, other, segments) == [segments[index] for index in different]
    assert same_route(found, segments[1], found, segments[1])
    assert not same_route(found, segments[0], found, segments[2])


def with_state(found: CoarseSolution, state: np.ndarray) -> CoarseSolution:
    return dataclasses.replace(found, iterate=dataclasses.replace(found.iterate, state=state))


def level_turn() -> CoarseSolution:
    """The planned, level flight of the wound race, unsolved."""
    found = planned_coarse_solution(SLALOM)
    stage_problem = prepared(SLALOM)
    iterate = guess(stage_problem.plan, found.problem.mesh)
    return dataclasses.replace(found, stage_problem=stage_problem, iterate=iterate)


def test_tilted_turn_keeps_its_ends_durations_and_mesh_and_leads_the_higher_the_steeper_it_is() -> None:
    planned = level_turn()
    pieces = [phase_piece(planned.iterate, planned.problem, index) for index in (1, 2)]
    own = concatenate(pieces)
    assert concatenate(tilt_turn(pieces, 0.0)).state[:3] == pytest.approx(own.state[:3], abs=1e-9)
    tops = [-own.state[2].min()]
    for angle in (20.0, 50.0, 85.0):
        other = concatenate(tilt_turn(pieces, angle * DEGREE))
        assert (other.state.shape, other.control.shape) == (own.state.shape, own.control.shape)
        assert other.durations.tolist() == own.durations.tolist()
        assert other.state[:3, [0, -1]] == pytest.approx(own.state[:3, [0, -1]], abs=1e-9)
        assert (other.state[2] <= own.state[2] + 1e-9).all()  # nowhere lower
        assert np.linalg.norm(other.state[ATTITUDE], axis=0) == pytest.approx(1.0)
        tops.append(-other.state[2].min())
    assert tops == sorted(tops)
    assert tops[2] > tops[0] + 30.0
