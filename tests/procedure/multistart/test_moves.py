"""Coarse solutions, moves within windows, and routes in words."""

import dataclasses
import math

import numpy as np
import pytest
from races import EDGE_540, SHIPPED, SMALL, course, level, prepared, pylon
from races import planned as plan_of
from search_races import OFF, QUICK, SLALOM, open_session, optimum, planned_coarse_solution, slalom
from transformations import mirrored

from airrace.environment.air import Air
from airrace.optimal_control.refinement import resample
from airrace.optimal_control.solvers.process.service import SolverService, SolverTimeout
from airrace.planning.plan import plan
from airrace.planning.race import Race
from airrace.planning.route_decisions import RouteDecisions
from airrace.planning.waypoints import candidates
from airrace.procedure.guess import guess
from airrace.procedure.multistart import coarse_solution
from airrace.procedure.multistart.budget import QUICK as QUICK_EFFORT
from airrace.procedure.multistart.budget import Radius, scaled
from airrace.procedure.multistart.coarse_solution import (
    INTERVAL,
    MOST,
    STEP,
    CoarseSolution,
    InitialGuess,
    intervals,
    planned_guess,
    solve_coarse,
    try_solve,
)
from airrace.procedure.multistart.description import describe_route, named, shape_in_words, way_in_words
from airrace.procedure.multistart.moves import Move, MoveGenerator
from airrace.procedure.multistart.search import EvaluatedWindow
from airrace.procedure.multistart.segments import Segment, Shape, differing, same_way, shape, stretches
from airrace.procedure.multistart.tilted_turns import tilt_turn
from airrace.procedure.multistart.window import END_SPEED_TRUST, EvaluatedMove, Window, apply_moves, priced
from airrace.procedure.phase_segments import joined, phase_piece
from airrace.procedure.start import InitialBarrier
from airrace.quantities import Interval

ATTITUDE = slice(4, 8)


def own_window(base: CoarseSolution, first: int, last: int) -> Window:
    """A window around a flight's own way."""
    pieces = [phase_piece(base.iterate, base.problem, index) for index in range(first, last)]
    return Window(base, first, last, base.flight, pieces)


def solved_or_none(window: Window) -> EvaluatedMove | None:
    with open_session() as session:
        return priced(session.service, window)


def solved(window: Window) -> EvaluatedMove:
    found = solved_or_none(window)
    assert found is not None
    return found


@pytest.mark.parametrize(("first", "last"), [(0, 1), (1, 2), (2, 3), (0, 2), (1, 3), (0, 3)])
def test_own_way_saves_nothing(first: int, last: int) -> None:
    found = solved(own_window(planned_coarse_solution(SMALL), first, last))
    assert abs(found.saved) < 3e-3
    assert found.iterate.durations.shape == (last - first,)


def test_window_begins_and_ends_in_the_states_of_the_flight_around_it() -> None:
    base = planned_coarse_solution(SMALL)
    found = solved(own_window(base, 1, 2))
    nodes = base.problem.first_node
    before, behind = base.iterate.state[:, nodes[1]], base.iterate.state[:, nodes[2]]
    names = [one.name for one in base.problem.system.states]
    assert found.iterate.state[:, 0] == pytest.approx(before, abs=1e-4)
    for row, name in enumerate(names):
        if name == "V_K":
            assert abs(found.iterate.state[row, -1] - behind[row]) <= END_SPEED_TRUST
        elif name not in ("q0", "q1", "q2", "q3"):
            assert found.iterate.state[row, -1] == pytest.approx(behind[row], abs=1e-3), name
    # Both signs of a quaternion are the same attitude.
    assert abs(found.iterate.state[ATTITUDE, -1] @ behind[ATTITUDE]) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("first", [0, 1, 2])
def test_window_at_an_end_of_the_race_keeps_its_conditions(first: int) -> None:
    base = planned_coarse_solution(SMALL)
    found = solved(own_window(base, first, 3))
    whole = base.flight.problem(base.problem.mesh)
    assert found.problem.phases[-1].end == whole.phases[-1].end
    assert (found.problem.start == whole.start) is (first == 0)


def moves(base: CoarseSolution, race: Race, changed: set[int] | None = None) -> list[Move]:
    move_generator = MoveGenerator(base, race.course, scaled(base.flight.plan.cruise, QUICK_EFFORT.thinking))
    phases = set(range(len(base.problem.phases))) if changed is None else changed
    return list(move_generator.moves(phases))


def test_some_way_through_a_window_unwinds_a_wound_flight_and_fits_into_it() -> None:
    base = planned_coarse_solution(SLALOM)
    tried = [one for one in moves(base, SLALOM) if one.plan_penalty <= QUICK_EFFORT.max_plan_penalty]
    with open_session() as session:
        found = [priced(session.service, one.window) for one in tried]
        best = max((one for one in found if one is not None), key=lambda one: one.saved)
        whole = apply_moves(
            session.service, dataclasses.replace(base.flight, plan=best.window.flight.plan), base, [best]
        )
    assert best.saved > 5.0
    assert whole is not None
    assert whole.race_time == pytest.approx(base.race_time - best.saved, abs=0.05)
    assert whole.race_time == pytest.approx(optimum(SLALOM).trajectory.race_time, abs=0.05)


@pytest.mark.parametrize("race", [pytest.param(SMALL, id="four gates"), pytest.param(SLALOM, id="slalom")])
def test_every_thought_has_a_piece_for_each_of_its_phases(race: Race) -> None:
    for move in moves(planned_coarse_solution(race), race):
        window = move.window
        assert len(window.pieces) == window.last - window.first
        assert window.first <= move.stretch.first < move.stretch.last <= window.last
        for piece in window.pieces:
            assert np.isfinite(piece.state).all()
            assert np.isfinite(piece.control).all()
            assert piece.durations.min() > 0.0


def test_nothing_is_thought_of_where_nothing_has_changed() -> None:
    assert moves(planned_coarse_solution(SLALOM), SLALOM, changed=set()) == []


def test_mirrored_flight_is_thought_of_likewise() -> None:
    own = [(one.stretch, one.kind) for one in moves(planned_coarse_solution(SLALOM), SLALOM)]
    image = mirrored(SLALOM)
    assert [(one.stretch, one.kind) for one in moves(planned_coarse_solution(image), image)] == own


def test_start_that_may_be_passed_either_way_is_thought_of_the_other_way() -> None:
    """Begun backwards past a pylon, the flight is a turn of 180 degrees longer; its window says so."""
    elements = (pylon("first", 0.0, 0.0, 90.0), level("second", 500.0, 0.0, 0.0), level("third", 900.0, 0.0, 0.0))
    race = Race(course("from a pylon", *elements), EDGE_540, Air())
    forward = plan_of(race)
    backwards = [one for one in candidates(race.course, 0) if math.cos(one.axis - forward.waypoints[0].axis) < 0.0]
    chosen = RouteDecisions(ways={0: tuple(backwards)})
    flight = prepared(race)
    wrong = dataclasses.replace(flight, plan=plan(race.course, flight.plan.cruise, chosen))
    with open_session() as session:
        base = solve_coarse(session.service, planned_guess(wrong, wrong.plan, InitialBarrier.COLD))
    assert base is not None
    assert base.race_time > planned_coarse_solution(race).race_time + 2.0
    about_start = [one for one in moves(base, race) if one.kind == "other direction" and one.stretch.number == 0]
    saved = [solved(one.window).saved for one in about_start]
    assert max(saved) == pytest.approx(base.race_time - planned_coarse_solution(race).race_time, abs=0.05)


def test_ways_are_told_apart_whatever_they_hold() -> None:
    """Two ways through the same window differ in nothing but the numbers of their flights."""
    base = planned_coarse_solution(SLALOM)
    window = own_window(base, 0, 3)
    one, other = (
        EvaluatedWindow(
            Move(Segment(1, 1, 2), again, 0.0, "a way"), EvaluatedMove(again, base.iterate, base.problem, 0.1)
        )
        for again in (window, dataclasses.replace(window))
    )
    assert one in [one]
    assert other not in [one]


def twice(race: Race) -> Race:
    """The same elements flown twice."""
    passages = race.course.passages
    again = [dataclasses.replace(one, name=f"2:{one.name}", lap=2, speed=Interval()) for one in passages]
    return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=(*passages, *again)))


def test_what_wins_in_one_lap_is_thought_of_in_the_other() -> None:
    race = twice(SLALOM)
    base = planned_coarse_solution(race)
    move_generator = MoveGenerator(base, race.course, scaled(base.flight.plan.cruise, QUICK_EFFORT.thinking))
    about = [one for one in move_generator.moves(set(range(len(base.problem.phases)))) if one.stretch.number == 1]
    best = max((solved_or_none(one.window) for one in about), key=lambda one: 0.0 if one is None else one.saved)
    assert best is not None
    assert best.saved > 3.0
    (again,) = move_generator.replicate_in_other_laps(best, "unwound")
    assert (again.stretch.number, again.kind) == (4, "unwound in another lap")
    assert solved(again.window).saved == pytest.approx(best.saved, rel=0.2)


def test_way_of_another_flight_is_worth_what_that_flight_is_faster() -> None:
    """The window is the whole race here: what it saves is the difference between both flights."""
    base, good = planned_coarse_solution(SLALOM), planned_coarse_solution(slalom(8.0))
    move_generator = MoveGenerator(base, SLALOM.course, scaled(base.flight.plan.cruise, QUICK_EFFORT.thinking))
    found = solved(move_generator.from_flight(good, move_generator.stretches).window)
    assert found.saved == pytest.approx(base.race_time - optimum(SLALOM).trajectory.race_time, abs=0.05)


def test_races_of_these_tests_are_what_they_are_said_to_be() -> None:
    assert optimum(SLALOM, OFF).trajectory.race_time > optimum(SLALOM, QUICK).trajectory.race_time + 5.0
    assert planned_coarse_solution(slalom(8.0)).race_time < planned_coarse_solution(SLALOM).race_time - 5.0


def test_short_turn_that_leads_high_is_thought_of_flat() -> None:
    base = planned_coarse_solution(SLALOM)
    problem, long = base.problem, math.radians(100.0)
    short = next(one for one in stretches(SLALOM.course) if abs(shape(base, one).turn) < long)
    first, last = problem.first_node[short.first], problem.first_node[short.last]
    z, state = [one.name for one in problem.system.states].index("z"), base.iterate.state.copy()
    state[z, first : last + 1] -= 90.0 * np.sin(np.linspace(0.0, math.pi, last - first + 1))
    high = dataclasses.replace(base, iterate=dataclasses.replace(base.iterate, state=state))

    def shapes(flown: CoarseSolution) -> list[str]:
        about = [one for one in moves(flown, SLALOM) if one.stretch == short]
        return [one.kind for one in about if one.kind == "flat" or one.kind.startswith("slanted")]

    assert shapes(base) == []
    assert shapes(high) == ["flat"]


HALF_CUBAN = SHIPPED["half_cuban_eight"]
each_small_race = pytest.mark.parametrize(
    "race",
    [
        pytest.param(SMALL, id="four gates"),
        pytest.param(SLALOM, id="slalom"),
        pytest.param(HALF_CUBAN, id="half cuban eight"),
    ],
)


@each_small_race
def test_sketch_is_near_the_certified_optimum_of_the_same_way(race: Race) -> None:
    assert planned_coarse_solution(race).race_time == pytest.approx(optimum(race, OFF).trajectory.race_time, abs=0.03)


@each_small_race
def test_sketch_is_never_deceived_by_its_own_errors(race: Race) -> None:
    found = planned_coarse_solution(race)
    counts = [len(phase) for phase in found.problem.mesh]
    for error, count in zip(found.errors.tolist(), counts, strict=True):
        assert abs(error) <= coarse_solution.ERROR_TOLERANCE or count == MOST


def test_errors_of_integration_on_a_coarse_mesh_are_told_in_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Corrected, a race time is nearer to that of the same mesh where intervals are integrated more finely."""
    monkeypatch.setattr(coarse_solution, "INTERVAL", 0.5)
    monkeypatch.setattr(coarse_solution, "FEWEST", 3)
    monkeypatch.setattr(coarse_solution, "STEP", 1)
    monkeypatch.setattr(coarse_solution, "COARSE_SOLVES_MAX", 1)
    flight = prepared(HALF_CUBAN)
    with open_session() as session:
        coarse = solve_coarse(session.service, planned_guess(flight, flight.plan, InitialBarrier.COLD))
        assert coarse is not None
        scheme = dataclasses.replace(coarse.problem.scheme, steps=4 * coarse.problem.scheme.steps)
        finer = dataclasses.replace(coarse.problem, scheme=scheme)
        solution = try_solve(session.service, finer, coarse.iterate, InitialBarrier.COARSE)
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
    assert doubtful.race_time == pytest.approx(raw + 0.5, abs=2 * coarse_solution.ERROR_TOLERANCE)


def test_mesh_that_deceives_is_made_finer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coarse_solution, "INTERVAL", 0.5)
    monkeypatch.setattr(coarse_solution, "FEWEST", 3)
    monkeypatch.setattr(coarse_solution, "STEP", 1)
    flight = prepared(HALF_CUBAN)
    first = planned_guess(flight, flight.plan, InitialBarrier.COLD)
    with open_session() as session:
        found = solve_coarse(session.service, first)
    assert found is not None
    assert found.problem.intervals > sum(len(phase) for phase in first.mesh)
    assert abs(found.race_time - optimum(HALF_CUBAN, OFF).trajectory.race_time) < 0.2


def test_intervals_grow_with_the_duration_in_steps_up_to_a_limit() -> None:
    seconds = np.linspace(0.1, 60.0, 200)
    counts = [intervals(float(one)) for one in seconds]
    assert counts == sorted(counts)
    assert all(count % STEP == 0 for count in counts)
    assert counts[-1] == MOST
    for one, count in zip(seconds, counts, strict=True):
        assert count == MOST or one / count <= INTERVAL + 1e-12


def test_slower_plan_has_no_more_intervals_for_being_slow() -> None:
    flight = prepared(SMALL)
    slow = scaled(flight.plan.cruise, Radius(0.5, slower=True))
    slower = planned_guess(flight, plan(SMALL.course, slow), InitialBarrier.COLD)
    own = planned_guess(flight, flight.plan, InitialBarrier.COLD)
    assert slower.flight.plan.cruise.V < flight.plan.cruise.V
    assert sum(map(len, slower.mesh)) <= sum(map(len, own.mesh))


@pytest.mark.parametrize("slower", [False, True])
@pytest.mark.parametrize("factor", [0.3, 0.7, 1.0])
def test_pace_is_scaled_to_the_radius_asked_for(factor: float, slower: bool) -> None:
    pace = prepared(SMALL).plan.cruise
    other = scaled(pace, Radius(factor, slower))
    assert other.radius == pytest.approx(factor * pace.radius)
    kept = ("n", "p") if slower else ("V", "p")
    assert [getattr(other, name) for name in kept] == [getattr(pace, name) for name in kept]


class Hanging(SolverService):
    """Never comes back."""

    def __init__(self) -> None: ...

    def solve(self, *arguments: object, **named: object) -> None:  # type: ignore[override]
        raise SolverTimeout("no iteration finished within 1 s")


def test_start_on_which_the_solver_hangs_is_lost_and_nothing_else() -> None:
    flight = prepared(SMALL)
    assert solve_coarse(Hanging(), planned_guess(flight, flight.plan, InitialBarrier.COLD)) is None


def test_sketch_of_an_optimum_stays_there() -> None:
    found = planned_coarse_solution(SMALL)
    with open_session() as session:
        again = solve_coarse(
            session.service,
            InitialGuess(found.flight, found.problem.mesh, found.iterate, InitialBarrier.COARSE),
        )
    assert again is not None
    assert again.race_time == pytest.approx(found.race_time, abs=1e-3)


def test_start_on_a_fine_mesh_is_sketched_like_all_others() -> None:
    """Other ways are proposed on the meshes of sketches, whatever mesh their flight was begun on."""
    rough = planned_coarse_solution(SMALL)
    counts = [2 * len(phase) for phase in rough.problem.mesh]
    mesh, guess = resample(rough.problem.mesh, rough.iterate, counts)
    begun = InitialGuess(rough.flight, mesh, guess, InitialBarrier.COARSE, is_baseline=True)
    with open_session() as session:
        found = solve_coarse(session.service, begun)
    assert found is not None
    wanted = [intervals(seconds) for seconds in found.iterate.durations.tolist()]
    assert [len(phase) for phase in found.problem.mesh] == wanted
    assert sum(wanted) < sum(counts)
    assert found.race_time == pytest.approx(rough.race_time, abs=1e-3)


DEGREE = math.radians(1.0)
FLAT = Shape(
    turn=180 * DEGREE,
    aside=180 * DEGREE,
    steepest=5 * DEGREE,
    height=22.0,
    rise=2.0,
    gain=0.0,
    overhead=False,
    seconds=6.0,
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
        (dataclasses.replace(OVER, aside=0.1 * DEGREE), "over the top, 160 m high"),
        (dataclasses.replace(OVER, turn=-170 * DEGREE), "over the top to the left, 160 m high"),
        (dataclasses.replace(OVER, overhead=False), "180 degrees to the right, 160 m high"),
        (dataclasses.replace(OVER, steepest=40 * DEGREE), "180 degrees to the right, 160 m high"),
    ],
)
def test_shape_is_told_in_words(flown: Shape, words: str) -> None:
    assert shape_in_words(flown) == words


def test_way_names_the_passages_at_both_ends() -> None:
    course, places = SLALOM.course, stretches(SLALOM.course)
    assert [named(course, one) for one in places] == ["first -> left", "left -> right", "right -> last"]
    told = way_in_words(course, planned_coarse_solution(SLALOM), places[1:]).split("; ")
    assert [one.split(": ")[0] for one in told] == ["left -> right", "right -> last"]


def test_flight_is_told_by_its_long_turns() -> None:
    assert describe_route(SMALL.course, planned_coarse_solution(SMALL), stretches(SMALL.course)) == "no long turns"
    told = describe_route(SLALOM.course, planned_coarse_solution(SLALOM), stretches(SLALOM.course))
    assert [one.split(": ")[0] for one in told.split("; ")] == ["left -> right", "right -> last"]


def test_mirrored_flight_has_the_mirrored_shapes() -> None:
    image = mirrored(SLALOM)
    for place in stretches(SLALOM.course):
        own, seen = shape(planned_coarse_solution(SLALOM), place), shape(planned_coarse_solution(image), place)
        assert seen.turn == pytest.approx(-own.turn, abs=0.02)
        assert seen.overhead is own.overhead
        for name in ("steepest", "height", "rise", "seconds", "length"):
            assert getattr(seen, name) == pytest.approx(getattr(own, name), rel=0.02, abs=0.5), name


def test_stretches_lie_one_behind_the_other_over_the_whole_course() -> None:
    places = stretches(SMALL.course)
    assert [one.number for one in places] == list(range(len(places)))
    assert (places[0].first, places[-1].last) == (0, len(SMALL.course.passages) - 1)
    assert [one.last for one in places[:-1]] == [one.first for one in places[1:]]


def test_flight_differs_nowhere_from_itself_and_not_by_the_sign_of_its_quaternions() -> None:
    found, places = planned_coarse_solution(SMALL), stretches(SMALL.course)
    state = found.iterate.state.copy()
    state[4:8] *= -1.0
    turned = with_state(found, state)
    assert differing(found, found, places) == []
    assert differing(found, turned, places) == []


def test_flight_differs_where_it_is_moved_or_banked_otherwise() -> None:
    found, places = planned_coarse_solution(SMALL), stretches(SMALL.course)
    first, last = found.problem.first_node[1], found.problem.first_node[2]
    inside = slice(first + 1, last)
    higher = found.iterate.state.copy()
    higher[2, inside] -= 30.0
    assert differing(found, with_state(found, higher), places) == [places[1]]
    upside_down = found.iterate.state.copy()
    q0, q1, q2, q3 = found.iterate.state[4:8, inside]
    upside_down[4:8, inside] = np.array([-q1, q0, q3, -q2])  # rolled by half a turn
    assert differing(found, with_state(found, upside_down), places) == [places[1]]
    slightly = found.iterate.state.copy()
    slightly[:2, inside] += 3.0
    assert differing(found, with_state(found, slightly), places) == []


def test_stretches_of_the_same_flight_are_the_same_way_only_where_they_are_flown_in_one_place() -> None:
    found, places = planned_coarse_solution(SMALL), stretches(SMALL.course)
    assert same_way(found, places[1], found, places[1])
    assert not same_way(found, places[0], found, places[2])


def with_state(found: CoarseSolution, state: np.ndarray) -> CoarseSolution:
    return dataclasses.replace(found, iterate=dataclasses.replace(found.iterate, state=state))


# slanted turns


def level_turn() -> CoarseSolution:
    """The planned, level flight of the wound race, unsolved."""
    found = planned_coarse_solution(SLALOM)
    flight = prepared(SLALOM)
    return dataclasses.replace(found, flight=flight, iterate=guess(flight.plan, found.problem.mesh))


@pytest.mark.parametrize("angle", [50.0, 85.0])
def test_slanted_turn_keeps_its_ends_durations_and_mesh_and_leads_higher(angle: float) -> None:
    planned = level_turn()
    pieces = [phase_piece(planned.iterate, planned.problem, index) for index in (1, 2)]
    raised = tilt_turn(pieces, angle * DEGREE)
    own, other = joined(pieces), joined(raised)
    assert other.state.shape == own.state.shape
    assert other.control.shape == own.control.shape
    assert other.durations.tolist() == own.durations.tolist()
    assert other.state[:3, [0, -1]] == pytest.approx(own.state[:3, [0, -1]], abs=1e-9)
    assert -other.state[2].min() > -own.state[2].min() + 30.0
    assert (other.state[2] <= own.state[2] + 1e-9).all()  # nowhere lower
    assert np.linalg.norm(other.state[4:8], axis=0) == pytest.approx(1.0)


def test_turn_that_is_not_slanted_stays_where_it_is() -> None:
    planned = level_turn()
    pieces = [phase_piece(planned.iterate, planned.problem, index) for index in (1, 2)]
    assert joined(tilt_turn(pieces, 0.0)).state[:3] == pytest.approx(joined(pieces).state[:3], abs=1e-9)


def test_steeper_slant_leads_higher() -> None:
    planned = level_turn()
    pieces = [phase_piece(planned.iterate, planned.problem, index) for index in (1, 2)]
    tops = [-joined(tilt_turn(pieces, angle * DEGREE)).state[2].min() for angle in (0.0, 20.0, 50.0, 85.0)]
    assert tops == sorted(tops)
